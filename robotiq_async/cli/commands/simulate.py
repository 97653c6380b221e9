"""``robotiq-async simulate``."""

from __future__ import annotations

import asyncio
import errno
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from cyclopts import Parameter

from ...link import why_no_port
from ...runtime import is_loopback
from ...values import RTU_REGISTERS, Finger, Model, RobotiqError, model_of
from ..arguments import Byte, Flag, Host, Port, UnitIds
from ..failures import normal_end, usage
from ..output.messages import tell

if TYPE_CHECKING:
    from ...simulator import (
        Likeness,
        Physics,
        SerialSimulatorServer,
        SimulatedGripper,
        SimulatorServer,
        Trouble,
    )


_EXHAUSTED: Final = (errno.EMFILE, errno.ENFILE, errno.ENOBUFS, errno.ENOMEM)


async def simulate(
    *,
    port: Port = 5020,
    host: Host = "127.0.0.1",
    model: Annotated[
        list[Literal["3f", "2f85", "2f140", "hand-e"]] | None, Parameter(negative=(), show_default=False)
    ] = None,
    speedup: Annotated[float, Parameter(metavar="FACTOR")] = 1.0,
    like_hardware: Annotated[bool, Parameter(negative="--plain", show_default=False)] = True,
    exact: Flag = False,
    object_: Annotated[Byte | None, Parameter(name="--object")] = None,
    fixed: Flag = False,
    physics: Annotated[str | None, Parameter(metavar="SCENE")] = None,
    serial: Annotated[str | None, Parameter(metavar="DEVICE")] = None,
    rtu_over_tcp: Flag = False,
    urcap: Flag = False,
    unpaced: Flag = False,
    device_id: UnitIds | None = None,
    like: Annotated[Path | None, Parameter(metavar="report.json")] = None,
    trouble: Annotated[list[str] | None, Parameter(metavar="WORDS", negative=())] = None,
    troubles: Flag = False,
) -> None:
    """Run a simulated gripper until Ctrl-C or SIGTERM.

    Its address is the only line on standard output, printed once it listens:
    other programs connect to it as to a real gripper.

    It has the habits that several sources report of real grippers; none has been
    measured by us. A 3-Finger takes 12 s for an activation, its gDT and gSTA trail
    the echo by 0.05 s (status-lag), and a write within 10 ms of the one before is
    acknowledged and forgotten (write-spacing); a jaw has none of these. The first
    status after a second without a message has fault 0x09 (silence-fault).
    With --plain it follows the manual, and activates in 4.2 s. Other habits
    are troubles: see --troubles.

    A trouble is

        KIND [VALUE] [on read|write] [at S] [for S|for ever|once] [every S]

    in seconds of the clock, counted from the start. A line on standard error reports each
    as it begins. --troubles lists the kinds.

    For example:

        robotiq-async simulate
        robotiq-async simulate --port 5021 --speedup 10 --object 150
        robotiq-async simulate --plain
        robotiq-async simulate --model 2f85 --rtu-over-tcp
        robotiq-async simulate --model 2f85 --physics box:40x60x60,0.3
        robotiq-async simulate --serial /dev/pts/3
        robotiq-async simulate --serial /dev/pts/3 --device-id 12
        robotiq-async simulate --rtu-over-tcp --port 54321
        robotiq-async simulate --rtu-over-tcp --device-id 9 --device-id 12
        robotiq-async simulate --like report/report.json
        robotiq-async simulate --urcap --model 2f85 --port 63352
        robotiq-async simulate --trouble "drop at 5 every 10" --trouble "delay 0.02"
        robotiq-async simulate --trouble "power-cut at 20 for 2; foreign 0 at 30"

    Args:
        port: TCP port; 0 takes a free one.
        host: Interface to listen on. Modbus has no password: all who reach the port can command.
        model: The gripper: a 3-Finger (the default), 2F-85, 2F-140 or Hand-E; again for the next --device-id.
        speedup: Factor by which simulated time is faster than the clock.
        like_hardware: Have the habits of real grippers (the default), or with --plain no habits.
        exact: Stop exactly at the requested position, which no real gripper does.
        object_: Count at which the fingers A, B and C meet something when they close.
        fixed: The object stays there in an activation, which then fails with fault 0x0D.
        physics: Move bodies (extra physics): "table", a part as "box:40x60x60,0.3" (mm, kg), or an MJCF file.
        serial: Serve Modbus RTU on this serial device instead of TCP (extra serial).
        rtu_over_tcp: Serve Modbus RTU through a TCP socket, as serial servers and tool ports do.
        urcap: Serve the text port of Robotiq's URCap, as a UR controller does; for a 2F or a Hand-E.
        unpaced: Do not simulate the transmission time of bytes; for a real serial port, which takes it.
        device_id: The only unit id answered (default: 9, on TCP any); again for another gripper on a line.
        like: A report of verify, whose gripper and link this one is like; the model is the report's.
        trouble: A trouble, as above; may be given again.
        troubles: List the kinds of trouble, and end.
    """
    from ...simulator import Likeness, parse_troubles

    if troubles:
        _list_troubles()
        return
    link = _ServedLink(port, host, serial, rtu_over_tcp=rtu_over_tcp, urcap=urcap, unpaced=unpaced)
    with usage():
        likeness = None if like is None else Likeness.from_file(like)
        if likeness is not None:
            _check_alone(likeness, model, object_, physics, exact)
        kinds = [model_of(each) for each in model or ["3f"]] if likeness is None else [likeness.model]
        units: Sequence[int | None] = device_id or [getattr(likeness, "device_id", None)]
        _check_line(kinds, units, is_line=link.is_line)
        link.check(kinds[0])
        plan = parse_troubles("\n".join(trouble or ()))
        grippers = [
            likeness.gripper(time.monotonic, speedup=speedup)
            if likeness is not None
            else _gripper(each, speedup, like_hardware, exact, _physics(physics, object_))
            for each in _of_each(kinds, units)
        ]
        for each in grippers:
            _place(each, object_, fixed=fixed)
        server = link.server(grippers, units)
        server.fault_injector.check(plan)
    if link.is_open_to_others:
        tell(f"anyone who reaches {host} can command this gripper")
    asyncio.get_running_loop().set_exception_handler(_without_tracebacks())
    with link.named_errors(), normal_end():
        async with server:
            # A URCap reads its gripper all the time, so there is no silence to simulate.
            await _begin(server, likeness, has_habits=like_hardware and not urcap)
            print(server.address, flush=True)
            await _play(server, plan)


def _gripper(
    model: Model, speedup: float, like_hardware: bool, exact: bool, physics: Physics | None
) -> SimulatedGripper:
    from ...simulator import SimulatedGripper, own_habits

    habits = own_habits(model) if like_hardware else None
    return SimulatedGripper(speedup=speedup, spread=not exact, habits=habits, model=model, physics=physics)


async def _play(server: SimulatorServer | SerialSimulatorServer, plan: Sequence[Trouble]) -> None:
    """Carry out a plan, and continue until the physics of the gripper fails."""
    playing = asyncio.ensure_future(
        server.fault_injector.run(plan, lambda trouble: tell(f"trouble: {trouble}"))
    )
    failing = asyncio.ensure_future(server.failed.wait())
    try:
        await asyncio.wait({playing, failing}, return_when=asyncio.FIRST_COMPLETED)
        if playing.done():
            await playing
            await failing
        raise RobotiqError(str(server.failure))
    finally:
        playing.cancel()
        failing.cancel()
        await asyncio.gather(playing, failing, return_exceptions=True)


@dataclass(frozen=True, slots=True)
class _ServedLink:
    """The kind of link, and its place."""

    port: int
    host: str
    serial: str | None
    rtu_over_tcp: bool
    urcap: bool
    unpaced: bool

    @property
    def is_line(self) -> bool:
        return self.serial is not None or self.rtu_over_tcp

    @property
    def is_open_to_others(self) -> bool:
        return self.serial is None and not is_loopback(self.host)

    def check(self, model: Model) -> None:
        """Refuse options that do not go together."""
        if (self.serial is not None) + self.rtu_over_tcp + self.urcap > 1:
            raise ValueError("--serial, --rtu-over-tcp and --urcap cannot be combined")
        if self.urcap and len(model.axes) > 1:
            raise ValueError("a URCap has a 2F or a Hand-E: --model 2f85, 2f140 or hand-e")
        if self.unpaced and not self.is_line:
            raise ValueError("--unpaced is for a serial line: --serial or --rtu-over-tcp")

    @contextmanager
    def named_errors(self) -> Iterator[None]:
        """Errors of the place and of the physics, in a sentence for the user."""
        from ...simulator import PhysicsError

        try:
            yield
        except (ImportError, PhysicsError) as error:
            raise RobotiqError(str(error)) from error
        except BrokenPipeError:
            raise  # the reader of the address has gone
        except OSError as error:
            if self.serial is not None:
                raise RobotiqError(f"cannot listen on {self.serial}: {why_no_port(error)}") from error
            where = f"{self.host}:{self.port}"
            raise RobotiqError(f"cannot listen on {where}: {error.strerror or error}") from error

    def server(
        self, grippers: Sequence[SimulatedGripper], units: Sequence[int | None]
    ) -> SimulatorServer | SerialSimulatorServer:
        from ...simulator import (
            RtuOverTcpSimulatorServer,
            SerialSimulatorServer,
            SimulatorServer,
            UrcapSimulatorServer,
        )

        first = grippers[0]
        unit = RTU_REGISTERS.device_id if units[0] is None else units[0]
        others = {each: gripper for each, gripper in zip(units[1:], grippers[1:], strict=True) if each}
        if self.serial is not None:
            return SerialSimulatorServer(
                self.serial, first, device_id=unit, paced=not self.unpaced, others=others
            )
        if self.rtu_over_tcp:
            return RtuOverTcpSimulatorServer(
                first, port=self.port, host=self.host, device_id=unit, paced=not self.unpaced, others=others
            )
        if self.urcap:
            return UrcapSimulatorServer(first, port=self.port, host=self.host, device_id=unit)
        return SimulatorServer(first, port=self.port, host=self.host, device_id=units[0])


async def _begin(
    server: SimulatorServer | SerialSimulatorServer, likeness: Likeness | None, *, has_habits: bool
) -> None:
    """Begin what lasts from the start on: the troubles of a report, or the habits of each gripper."""
    from ...simulator import like_hardware

    if likeness is not None:
        if likeness.unknown:
            tell(f"not simulated, though it differs in the report: {', '.join(likeness.unknown)}")
        await likeness.begin(server)
    elif has_habits:
        for each in (server, *getattr(server, "others", {}).values()):
            for habit in like_hardware(each.gripper.model):
                await each.fault_injector.begin(habit)


def _check_alone(likeness: Likeness, *others: object) -> None:
    """Refuse options that a report sets itself."""
    if any(others):
        raise ValueError(
            f"--like takes all from the report, the model {likeness.model.name} too: no "
            "--model, --object, --physics and --exact beside it"
        )


def _check_line(kinds: Sequence[Model], units: Sequence[int | None], *, is_line: bool) -> None:
    if len(units) > 1 and not is_line:
        raise ValueError("several --device-id need a line: --serial or --rtu-over-tcp")
    if len(set(units)) < len(units):
        raise ValueError("each gripper at a line needs a different --device-id")
    if len(kinds) not in (1, len(units)):
        raise ValueError(
            f"--model is for all, or once for each --device-id: got {len(kinds)} and {len(units)}"
        )


def _of_each(kinds: Sequence[Model], units: Sequence[int | None]) -> Sequence[Model]:
    return kinds if len(kinds) == len(units) else [*kinds] * len(units)


def _without_tracebacks() -> Callable[[asyncio.AbstractEventLoop, dict[str, Any]], None]:
    """Make a handler of the loop's complaints: one sentence when no connection can be accepted any more."""
    told = False

    def handle(loop: asyncio.AbstractEventLoop, context: dict[str, Any]) -> None:
        nonlocal told
        error = context.get("exception")
        if not (isinstance(error, OSError) and error.errno in _EXHAUSTED):
            loop.default_exception_handler(context)
        elif not told:
            told = True
            tell(f"no further connection can be accepted: {error.strerror} (ulimit -n shows the limit)")

    return handle


def _physics(scene: str | None, position: int | None) -> Physics | None:
    from ...simulator import Physics

    if scene is not None and position is not None:
        raise ValueError("--physics and --object cannot be combined: physics has its own part")
    return None if scene is None else Physics(scene, threaded=True)


def _place(gripper: SimulatedGripper, position: int | None, *, fixed: bool) -> None:
    if position is not None:
        gripper.place_object(Finger.ABC, position, fixed=fixed)
    elif fixed:
        raise ValueError("--fixed is about an object: give it with --object")


def _list_troubles() -> None:
    from ...simulator import KINDS

    for name, kind in KINDS.items():
        usual = "" if kind.value is None else f" (VALUE: {kind.value:g} unless given)"
        lasts = "" if kind.lasts == 0 else "; lasts for ever unless a duration is given"
        links = "" if kind.link is None and not kind.is_modbus else f"; over {', '.join(kind.links)}"
        print(f"{name:19} {kind.meaning}{usual}{lasts}{links}")
