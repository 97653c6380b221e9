"""A gripper, its server and a hand in one virtual loop, with an eye on every message and motion."""

from __future__ import annotations

import asyncio
import os
from bisect import bisect_left, bisect_right
from collections import deque
from collections.abc import AsyncIterator, Callable, Iterable, Sequence
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import pytest

from robotiq_async import JAW, Finger, RobotiqConnectionError, RobotiqHand, RobotiqStatus, State, Tunnel
from robotiq_async.link.address import parse_address
from robotiq_async.link.urcap import lines
from robotiq_async.simulator import (
    RtuOverTcpSimulatorServer,
    SerialSimulatorServer,
    SimulatedGripper,
    SimulatorServer,
    UrcapSimulatorServer,
    parse_troubles,
)
from robotiq_async.simulator.server.framing import Frame
from robotiq_async.simulator.server.responder import Responder, TcpResponder
from robotiq_async.simulator.server.serial_server import RtuResponder
from robotiq_async.simulator.server.urcap_server import UNREADABLE, UrcapResponder
from robotiq_async.simulator.troubles.fault_injector import FaultInjector
from robotiq_async.values import registers as reg
from robotiq_async.values.model import Model, model_of
from robotiq_async.values.registers import Field, Registers, gFLT, gIMC, gPO
from robotiq_async.values.request import Request
from tests.arms import Arm, DoosanController, ToolLine, tunnel_of
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop
from tests.virtual_line import VirtualLine

LONGEST_HOLD_S = 0.020
HABITS = parse_troubles(os.environ.get("HABITS", ""))
"""Troubles that every gripper here has besides, by the environment. The promises stay the same."""
MODEL = model_of(os.environ.get("MODEL"))
"""The gripper of every world that names no other, by the environment. Some scenes need three fingers."""
MOST_SAID = 20_000
"""Requests and replies that are kept: those of a cycle of the soak."""
MOST_TOLD = 16
"""Those that are told where a status is wrong."""
SPEEDUP = 5.0
"""Of the gripper only: the link and the hand keep to their own times."""


class HeldLoopError(AssertionError):
    """Callbacks kept the loop for too long, in real time: the code did, or the machine."""


WAITS = (5, 6, 7, 11)
"""Faults with which a gripper waits for an activation, or to release."""


class Written(NamedTuple):
    """An image that was written.

    Attributes:
        time: when.
        registers: it.
        positions: where the axes were.
        shown: where the last status before it showed them.
    """

    time: float
    registers: Registers
    positions: tuple[int, ...]
    shown: tuple[int, ...]


class StampedGripper(SimulatedGripper):
    """Writes a number into each status, so that no two in a row are alike.

    Its place is the current of the scissor, or on a jaw, of which only three registers are read, the fault of
    a controller. A current that changes is progress: where there is none, the number stays.

    The current has seven bits: with the eighth, one status in ten that has lost its highest bits (seven-bits)
    would keep a right checksum and a number of before. The checksum does not see four wrong bits that are as
    far apart as the terms of its polynomial, or eight times as far: those of gSTA, of the scissor's gDT and
    current, and of the checksum itself are.

    Attributes:
        stamps: when each status was given out, and its number.
        images: every image that was written; of a SET that is taken one by one that of its GTO alone.
    """

    def __init__(self, *arguments: Any, **options: Any) -> None:
        super().__init__(*arguments, **options)
        self.stamps: list[tuple[float, int]] = []
        self.images: list[Written] = []
        self._number = 0
        self._shown = self._positions()

    def status_registers(self) -> Registers:
        registers = super().status_registers()
        has_modes = self.model.has_modes
        if not (has_modes and (gIMC.read(registers) == 0 or gFLT.read(registers) in WAITS)):
            self._number = (self._number + 1) % (128 if has_modes else 16)
        self.stamps.append((self._clock(), self._number))
        self._shown = tuple(place.read(registers) for place, _ in zip(gPO, self.model.axes, strict=False))
        if has_modes:
            return (*registers[:7], self._number << 8)
        return (registers[0], registers[1] & 0x0FFF | self._number << 12, *registers[2:])

    def write(self, address_offset: int, registers: Sequence[int]) -> None:
        super().write(address_offset, registers)
        written = Written(self._clock(), self.request_registers, self._positions(), self._shown)
        self.images.append(written)

    def _positions(self) -> tuple[int, ...]:
        return tuple(map(self.position, self.model.axes))


def stamp_of(status: RobotiqStatus) -> int:
    """The number that the gripper wrote into a status."""
    registers = status.registers
    return registers[7] >> 8 if status.model.has_modes else registers[1] >> 12


class Heard:
    """Has the habits that are asked for, and tells what its responder has noted."""

    _responder: Any

    async def start(self) -> None:
        await super().start()  # type: ignore[misc]
        injector: FaultInjector = self.fault_injector  # type: ignore[attr-defined]
        for habit in HABITS:
            await injector.begin(habit)

    @property
    def heard(self) -> list[float]:
        """When each request for this gripper came in."""
        times: list[float] = self._responder.heard
        return times

    @property
    def asked(self) -> asyncio.Event:
        """Set as soon as the first has come, before it is answered."""
        event: asyncio.Event = self._responder.asked
        return event

    def told(self, until: float) -> str:
        """The last requests and replies before a time, as bytes."""
        said = [each for each in self._responder.said if each.time <= until]
        return "\n".join(map(str, said[-MOST_TOLD:]))


def readable(frame: bytes) -> str:
    """The words of a text port, or the bytes of Modbus."""
    words = frame.decode("latin-1").strip()
    return words if words.isascii() and words.isprintable() else frame.hex(" ")


class Said(NamedTuple):
    """A request that came in, or a reply and the parts of it that were sent; None if the line was cut."""

    time: float
    frame: bytes
    parts: tuple[tuple[float, bytes], ...] | None = ()
    is_reply: bool = False

    def __str__(self) -> str:
        text = f"{self.time:.4f} {'reply' if self.is_reply else 'asked'} {readable(self.frame)}"
        if not self.is_reply or self.parts == ((0.0, self.frame),):
            return text
        parts = [f"{readable(part)} after {delay:g} s" for delay, part in self.parts or ()]
        return f"{text}, sent as {', '.join(parts) or 'nothing'}"


class Hears(Responder):
    """Notes when each request for this gripper came in, and what was said."""

    def __init__(self, *arguments: Any) -> None:
        super().__init__(*arguments)
        self.heard: list[float] = []
        self.asked = asyncio.Event()
        self.said: deque[Said] = deque(maxlen=MOST_SAID)

    def take(self, inbox: bytearray) -> Frame | None:
        frame = super().take(inbox)  # type: ignore[safe-super]
        if frame is not None and self._is_meant(frame.unit):
            now = asyncio.get_running_loop().time()
            self.heard.append(now)
            self.said.append(Said(now, frame.pdu))
            self.asked.set()
        return frame

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        delivered = super().deliver(reply)
        parts = None if delivered is None else tuple(delivered)
        self.said.append(Said(asyncio.get_running_loop().time(), reply, parts, is_reply=True))
        return parts


class TcpServer(Heard, SimulatorServer):
    class _responds(Hears, TcpResponder):  # noqa: N801  # as the server names it
        pass


class RtuServer(Heard, SerialSimulatorServer):
    class _responds(Hears, RtuResponder):  # noqa: N801
        pass


class ToolServer(Heard, RtuOverTcpSimulatorServer):
    """The other end of the line at an arm's tool."""

    class _responds(Hears, RtuResponder):  # noqa: N801
        pass


class UrcapServer(Heard, UrcapSimulatorServer):
    class _responds(Hears, UrcapResponder):  # noqa: N801
        """Keeps what it has answered, for there is no room for a number in the variables."""

        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments)
            self.given: list[tuple[float, str, int]] = []
            self.motions: list[bytes] = []
            self.was_spaced = False

        def answer(self, frame: Frame) -> bytes:
            said = super().answer(frame)
            self.was_spaced |= self.troubles.set_spacing > 0
            if frame.pdu.startswith(b"GET "):
                name, value = said.decode().split()
                if value != UNREADABLE:
                    self.given.append((asyncio.get_running_loop().time(), name, int(value)))
            elif frame.pdu.endswith(b" GTO 1"):
                self.motions.append(frame.pdu)
            return said

        def _take(self, asked: Iterable[tuple[Field, int]]) -> None:
            """Half a SET asks for nothing: GTO is the last variable of a motion, and the first of a stop."""
            pairs = [*asked]
            super()._take(pairs)
            if isinstance(self.gripper, StampedGripper) and reg.rGTO not in dict(pairs):
                self.gripper.images.pop()

    @property
    def given(self) -> list[tuple[float, str, int]]:
        """When a variable was read, its name and its value."""
        values: list[tuple[float, str, int]] = self._responder.given
        return values

    @property
    def motions(self) -> list[bytes]:
        """The lines that set a motion going; the gripper sees each variable alone if they are taken so."""
        lines: list[bytes] = self._responder.motions
        return lines

    @property
    def was_spaced(self) -> bool:
        """Whether variables of a SET were taken one by one."""
        spaced: bool = self._responder.was_spaced
        return spaced


Server = TcpServer | RtuServer | ToolServer | UrcapServer


@dataclass
class World:
    """All there is in one test."""

    gripper: StampedGripper
    server: Server
    line: VirtualLine | None
    hand: RobotiqHand
    statuses: list[RobotiqStatus] = field(default_factory=list)
    states: list[State] = field(default_factory=list)

    @property
    def loop(self) -> VirtualLoop:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, VirtualLoop)
        return loop

    async def activate_beforehand(self) -> None:
        """Leave the gripper active and open, as another client would."""
        await activate_beforehand(self.gripper)

    async def until(self, condition: Callable[[], bool]) -> None:
        """Wait until something is true; half a minute at most, and in this loop that takes no time."""
        async with asyncio.timeout(30):
            while not condition():  # noqa: ASYNC110  # there is no event to wait for
                await asyncio.sleep(0.001)

    async def until_moving(self) -> None:
        await self.until(lambda: self.gripper.is_moving)

    async def until_state(self, state: State) -> None:
        await self.hand.wait_for_state(state, timeout=30)

    @property
    def holds(self) -> Finger:
        """The axes that hold the part while the rest moves: two fingers beside A, or the one jaw."""
        return self.gripper.model.all_axes & (Finger.B | Finger.C) or JAW

    def travels(self) -> dict[Finger, float]:
        return {axis: self.gripper.travel(axis) for axis in self.gripper.model.axes}

    async def nothing_moves_for(self, seconds: float, tolerance: float = 0.0) -> None:
        before = self.travels()
        await asyncio.sleep(seconds)
        after = self.travels()
        assert all(after[axis] - before[axis] <= tolerance for axis in after), (before, after)

    def motions(self, since: int = 0) -> list[tuple[int, ...]]:
        """The positions in each write that set the axes going, from a number of writes on."""
        model = self.gripper.model
        images = [Request.from_registers(write.registers, model) for write in self.gripper.writes[since:]]
        return [tuple(axis.position for axis in image.axes) for image in images if image.go]

    def check_no_stale_status(self) -> None:
        """Every status is the answer to the last request before it, and none came twice."""
        numbers = [status.sequence for status in self.statuses]
        assert numbers == sorted(set(numbers))
        if isinstance(self.server, UrcapServer):
            self._check_variables(self.server)
        else:
            self._check_stamps()

    def _check_variables(self, server: UrcapServer) -> None:
        """Each variable of a status has the value that was given out last before it.

        While a SET is taken half, the echo is that of the status before.
        """
        given, next_one = server.given, 0
        values: dict[str, int] = {}
        before: RobotiqStatus | None = None
        for status in self.statuses:
            while next_one < len(given) and given[next_one][0] <= status.timestamp:
                _, name, value = given[next_one]
                values[name] = value
                next_one += 1
            read = lines.status_registers(values)
            if read != status.registers and server.was_spaced and before is not None:
                activation, go, position = before.echo
                read = lines.status_registers(values | {"ACT": activation, "GTO": go, "PRE": position})
            assert status.registers == read, f"{status!r} is not {values}\n{server.told(status.timestamp)}"
            before = status

    def _check_stamps(self) -> None:
        given_at = [at for at, _ in self.gripper.stamps]
        for status in self.statuses:
            index = bisect_right(given_at, status.timestamp) - 1
            while index >= 0 and self.gripper.stamps[index][1] != stamp_of(status):
                index -= 1
            assert index >= 0, f"never sent: {status!r}\n{self.server.told(status.timestamp)}"
            newer = bisect_right(self.server.heard, given_at[index])
            asked_again = self.server.heard[newer : bisect_left(self.server.heard, status.timestamp)]
            assert not asked_again, (
                f"{status!r}, given at {given_at[index]:.4f}, answers an older request: asked again "
                f"{len(asked_again)} times since\n{self.server.told(status.timestamp)}"
            )

    def check_loop(self) -> None:
        if self.loop.longest_hold >= LONGEST_HOLD_S:
            raise HeldLoopError(f"the loop was held for {self.loop.longest_hold} s")

    async def watch(self) -> None:
        """Collect what the hand reports, over starts and stops, until cancelled."""
        while True:
            with suppress(RobotiqConnectionError):
                async for status in self.hand.statuses(buffer=1_000_000):
                    self.statuses.append(status)
            await asyncio.sleep(0.001)

    async def watch_states(self) -> None:
        while True:
            with suppress(RobotiqConnectionError):
                async for transition in self.hand.transitions():
                    self.states.append(transition.target)
            await asyncio.sleep(0.001)


@asynccontextmanager
async def tunnel_through_an_arm(server: Server) -> AsyncIterator[tuple[Arm, Tunnel]]:
    """An arm with a gripper at its tool, and the tunnel that carries the bytes as they are."""
    async with DoosanController(ToolLine(parse_address(server.address).port)) as arm:
        yield arm, tunnel_of("Doosan", "127.0.0.1", arm.port)


@asynccontextmanager
async def world(
    link: str = "tcp",
    *,
    monkeypatch: pytest.MonkeyPatch | None = None,
    speedup: float = SPEEDUP,
    model: Model = MODEL,
    **options: object,
) -> AsyncIterator[World]:
    """A world whose gripper was just switched on, and a hand that is not started.

    Args:
        link: tcp, rtu, tunnel, or urcap for a jaw.
        monkeypatch: for rtu, where the fake serial ports are put in place.
        speedup: of the gripper.
        model: of the gripper, and of the hand.
        options: for the hand.
    """
    loop = asyncio.get_running_loop()
    gripper = StampedGripper(loop.time, speedup=speedup, device_cycle=0.005 * speedup, model=model)
    line: VirtualLine | None = None
    server: Server
    address: str | Tunnel
    if link == "rtu":
        assert monkeypatch is not None
        line = VirtualLine(monkeypatch)
        server, address = RtuServer(line.FAR, gripper), f"rtu://{line.near}"
    elif link == "urcap":
        server, address = UrcapServer(gripper), ""
    else:
        server, address = ToolServer(gripper) if link == "tunnel" else TcpServer(gripper), ""
    async with AsyncExitStack() as stack:
        await stack.enter_async_context(server)
        if link == "tunnel":
            _, address = await stack.enter_async_context(tunnel_through_an_arm(server))
        # Every phase and every trouble lasts for many polls; more of them reveal no more and take longer.
        options = {"poll_interval": 0.03, "model": model} | options
        if any(habit.kind == "function-3-only" for habit in HABITS):
            options = {"read_function": 3} | options
        for habit in HABITS:
            if habit.kind == "write-spacing":  # a jaw may need more than is usual for it
                options = {"write_spacing": habit.amount} | options
        hand = RobotiqHand(address or server.address, **options)  # type: ignore[arg-type]
        here = World(gripper, server, line, hand)
        watching = [asyncio.create_task(here.watch()), asyncio.create_task(here.watch_states())]
        try:
            yield here
        finally:
            for task in watching:
                task.cancel()
            await asyncio.gather(*watching, return_exceptions=True)
            await hand.stop()


@asynccontextmanager
async def started(link: str = "tcp", **options: Any) -> AsyncIterator[World]:
    """A world whose gripper is active and open, and whose hand is started."""
    async with world(link, **options) as here:
        await here.activate_beforehand()
        await here.hand.start()
        yield here
