"""The blocking RobotiqHand and its streams: each call is made in the event loop of the async one."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Generic, Self, TypeVar

from ..calibration import ForceCalibration, SpeedCalibration, Units
from ..hands.arguments import with_arguments_of
from ..hands.grip_watch import SLIP_COUNTS
from ..hands.options import (
    ACTIVATION_TIMEOUT_S,
    CONNECT_TIMEOUT_S,
    NO_ADDRESS,
    POLL_INTERVAL_S,
    RESPONSE_TIMEOUT_S,
    WRITE_SPACING_S,
    HandOptions,
    ReconnectPolicy,
)
from ..hands.present_run import refuse_copy
from ..hands.statistics import Statistics
from ..hands.streams import Stream as AsyncStream
from ..link.tunnel.protocol import Tunnel
from ..local.robotiq_hand import RobotiqHand as AsyncRobotiqHand
from ..values.enums import DEFAULT_FORCE, DEFAULT_SPEED, Finger, State
from ..values.events import SentRequest, Transition
from ..values.grip import GraspResult, GripEvent
from ..values.inhibit import Inhibit
from ..values.model import Model
from ..values.move_result import MoveResult
from ..values.status import Part, RobotiqStatus
from .caller import Caller

T = TypeVar("T")
K = TypeVar("K", bound=type)


class Stream(Generic[T]):
    """An iterator with one reader; dropping it ends it. Made by a hand."""

    def __init__(self, stream: AsyncStream[T], caller: Caller) -> None:
        self._stream = stream
        self._caller = caller

    def __iter__(self) -> Self:
        return self

    def __next__(self) -> T:
        """The next item; waits for it. An interrupted wait loses nothing.

        Raises:
            StopIteration: the hand was stopped, or the stream was closed.
            RobotiqConnectionError: the hand gave up on its link.
            RuntimeError: another thread is waiting on the same stream.
        """
        items = self._caller.wait(self._next)
        if not items:
            raise StopIteration
        return items[0]

    async def _next(self) -> tuple[T, ...]:
        try:
            return (await anext(self._stream),)
        except StopAsyncIteration:
            return ()

    @property
    def missed(self) -> int:
        """Items that were dropped, the oldest first, because the reader was slow."""
        return self._stream.missed

    def take_nowait(self) -> T | None:
        """The next item if there is one now, or None."""
        return self._caller.tell(self._stream.take_nowait)

    def drain(self) -> Iterator[T]:
        """Iterate over the items that are there now."""
        return iter(self._caller.tell(lambda: list(self._stream.drain())))

    def close(self) -> None:
        """End the stream; a waiting reader ends too. Idempotent."""
        self._caller.wait(self._stream.aclose)


def _documented_as(original: type) -> Callable[[K], K]:
    """Copy the docstrings of public methods and properties of the same name, and the options'."""

    def copy(kind: K) -> K:
        if kind.__doc__ and original.__doc__:  # python -OO has none
            kind.__doc__ = with_arguments_of(kind.__doc__, original.__doc__)
        for name, member in vars(kind).items():
            if not name.startswith("_"):
                member.__doc__ = getattr(original, name).__doc__
        return kind

    return copy


@_documented_as(AsyncRobotiqHand)
class RobotiqHand:
    """A Robotiq gripper behind Modbus TCP, a serial line, or simulated, that blocks.

    Use it as ``with RobotiqHand(address) as hand:``, or call :meth:`start` and :meth:`stop`. The options, the
    calls, their arguments, results and errors are as of :class:`robotiq_async.RobotiqHand`, and each call
    returns when the async one has ended. All blocking hands share one event loop in a separate thread,
    which polls while your code runs. Calls may come from any thread, also from one in which another event
    loop runs: that loop waits for them.

    Ctrl-C cancels a call as if it were the async one, and then holds every axis that moves. A hand
    that was not stopped is stopped when the program ends. After a fork it stays with the parent. Listeners
    are called in the hand's thread, where a call that waits raises RuntimeError.

    None of this has run on real hardware yet.
    """

    def __init__(
        self,
        address: str | Tunnel = NO_ADDRESS,
        *,
        name: str | None = None,
        device_id: int | None = None,
        read_function: int | None = None,
        write_function: int | None = None,
        poll_interval: float = POLL_INTERVAL_S,
        write_spacing: float = WRITE_SPACING_S,
        connect_timeout: float = CONNECT_TIMEOUT_S,
        response_timeout: float = RESPONSE_TIMEOUT_S,
        activation_timeout: float = ACTIVATION_TIMEOUT_S,
        reconnect: bool | ReconnectPolicy = True,
        speed: int = DEFAULT_SPEED,
        force: int = DEFAULT_FORCE,
        request_address: int | None = None,
        status_address: int | None = None,
        calibration: SpeedCalibration | None = None,
        force_calibration: ForceCalibration | None = None,
        stroke: str | Path | Sequence[tuple[int, float]] | None = None,
        keep_grip: bool = False,
        model: Model | str | None = None,
    ) -> None:
        self._hand = AsyncRobotiqHand(
            address,
            name=name,
            device_id=device_id,
            read_function=read_function,
            write_function=write_function,
            poll_interval=poll_interval,
            write_spacing=write_spacing,
            connect_timeout=connect_timeout,
            response_timeout=response_timeout,
            activation_timeout=activation_timeout,
            reconnect=reconnect,
            speed=speed,
            force=force,
            request_address=request_address,
            status_address=status_address,
            calibration=calibration,
            force_calibration=force_calibration,
            stroke=stroke,
            keep_grip=keep_grip,
            model=model,
        )
        self._caller = Caller(self._hand)

    @property
    def _inner(self) -> AsyncRobotiqHand:
        self._caller.check_process()
        return self._hand

    __reduce__ = refuse_copy

    def __repr__(self) -> str:
        return repr(self._hand)

    # -- lifetime --------------------------------------------------------------------------------------

    def __enter__(self) -> Self:
        try:
            self.start()
        except Exception:
            raise
        except BaseException:  # Ctrl-C, perhaps after it had started: Python does not call __exit__ then
            self.stop()
            raise
        return self

    def __exit__(self, *_: object) -> None:
        self.stop()

    def start(self, activate: bool = True, *, wait: float = 0.0) -> None:
        self._caller.start(lambda: self._inner.start(activate, wait=wait))

    def stop(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        self._caller.stop(lambda: self._inner.stop(halt=halt, keep_grip=keep_grip))

    # -- commands --------------------------------------------------------------------------------------

    def set_position(
        self,
        value: int | None = None,
        fingers: Finger | int = Finger.ABC,
        *,
        mm: float | None = None,
        open_fraction: float | None = None,
    ) -> None:
        self._caller.wait(
            lambda: self._inner.set_position(value, fingers, mm=mm, open_fraction=open_fraction)
        )

    def set_speed(
        self,
        value: int | None = None,
        fingers: Finger | int = Finger.ALL,
        *,
        mm_per_s: float | None = None,
    ) -> None:
        self._caller.wait(lambda: self._inner.set_speed(value, fingers, mm_per_s=mm_per_s))

    def set_force(
        self,
        value: int | None = None,
        fingers: Finger | int = Finger.ALL,
        *,
        label_n: float | None = None,
    ) -> None:
        self._caller.wait(lambda: self._inner.set_force(value, fingers, label_n=label_n))

    def command(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        position: int | None = None,
        speed: int | None = None,
        force: int | None = None,
        mm: float | None = None,
        open_fraction: float | None = None,
        mm_per_s: float | None = None,
        label_n: float | None = None,
    ) -> None:
        self._caller.tell(
            lambda: self._inner.command(
                fingers,
                position=position,
                speed=speed,
                force=force,
                mm=mm,
                open_fraction=open_fraction,
                mm_per_s=mm_per_s,
                label_n=label_n,
            )
        )

    def move(
        self,
        position: int | None = None,
        fingers: Finger | int = Finger.ABC,
        *,
        mm: float | None = None,
        open_fraction: float | None = None,
        speed: int | None = None,
        mm_per_s: float | None = None,
        force: int | None = None,
        label_n: float | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        return self._caller.wait(
            lambda: self._inner.move(
                position,
                fingers,
                mm=mm,
                open_fraction=open_fraction,
                speed=speed,
                mm_per_s=mm_per_s,
                force=force,
                label_n=label_n,
                timeout=timeout,
            )
        )

    def open(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        mm_per_s: float | None = None,
        force: int | None = None,
        label_n: float | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        return self._caller.wait(
            lambda: self._inner.open(
                fingers,
                speed=speed,
                mm_per_s=mm_per_s,
                force=force,
                label_n=label_n,
                timeout=timeout,
            )
        )

    def close(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        mm_per_s: float | None = None,
        force: int | None = None,
        label_n: float | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        return self._caller.wait(
            lambda: self._inner.close(
                fingers,
                speed=speed,
                mm_per_s=mm_per_s,
                force=force,
                label_n=label_n,
                timeout=timeout,
            )
        )

    def grasp(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        at_least: int | None = None,
        speed: int | None = None,
        mm_per_s: float | None = None,
        force: int | None = None,
        label_n: float | None = None,
        timeout: float | None = None,
    ) -> GraspResult:
        return self._caller.wait(
            lambda: self._inner.grasp(
                fingers,
                at_least=at_least,
                speed=speed,
                mm_per_s=mm_per_s,
                force=force,
                label_n=label_n,
                timeout=timeout,
            )
        )

    def hold(self, fingers: Finger | int = Finger.ALL) -> None:
        self._caller.wait(lambda: self._inner.hold(fingers))

    def halt(self) -> None:
        self._caller.wait(lambda: self._inner.halt())

    def inhibit(self, reason: str, *, who: str = "") -> None:
        self._caller.wait(lambda: self._inner.inhibit(reason, who=who))

    def permit(self, *, who: str = "", seen: Inhibit | None = None) -> None:
        self._caller.wait(lambda: self._inner.permit(who=who, seen=seen))

    # -- activation, faults ----------------------------------------------------------------------------

    def activate(self) -> None:
        self._caller.wait(lambda: self._inner.activate())

    def reset(self) -> None:
        self._caller.wait(lambda: self._inner.reset())

    def atr(self) -> None:
        self._caller.wait(lambda: self._inner.atr())

    def recover(self, timeout: float | None = None) -> None:
        self._caller.wait(lambda: self._inner.recover(timeout))

    # -- reading ---------------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        return self._inner.name

    @property
    def address(self) -> str:
        return self._inner.address

    @property
    def model(self) -> Model:
        return self._inner.model

    @property
    def units(self) -> Units:
        return self._inner.units

    @property
    def state(self) -> State:
        return self._inner.state

    @property
    def status(self) -> RobotiqStatus:
        return self._inner.status

    @property
    def part(self) -> Part | None:
        return self._inner.part

    @property
    def is_activated(self) -> bool:
        return self._inner.is_activated

    @property
    def is_reset(self) -> bool:
        return self._inner.is_reset

    @property
    def is_moving(self) -> bool:
        return self._inner.is_moving

    @property
    def inhibited(self) -> Inhibit | None:
        return self._inner.inhibited

    def resume_inhibit(self, inhibit: Inhibit) -> None:
        self._inner.resume_inhibit(inhibit)

    def halt_inhibited(self) -> None:
        self._caller.wait(lambda: self._inner.halt_inhibited())

    @property
    def statistics(self) -> Statistics:
        return self._inner.statistics

    def statuses(self, buffer: int = 1, *, lost_after: float | None = None) -> Stream[RobotiqStatus]:
        return self._opened(lambda: self._inner.statuses(buffer, lost_after=lost_after))

    def transitions(self) -> Stream[Transition]:
        return self._opened(lambda: self._inner.transitions())

    def requests(self, buffer: int | None = None) -> Stream[SentRequest]:
        return self._opened(lambda: self._inner.requests(buffer))

    def grip_events(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> Stream[GripEvent]:
        return self._opened(lambda: self._inner.grip_events(fingers, since=since, slip=slip))

    @property
    def options(self) -> HandOptions:
        return self._inner.options

    def assume(self, settings: Mapping[tuple[Finger, str], int]) -> None:
        self._caller.tell(lambda: self._inner.assume(settings))

    def drop_requests(self, why: str) -> None:
        self._caller.tell(lambda: self._inner.drop_requests(why))

    def add_listener(
        self, callback: Callable[[RobotiqStatus | Transition | SentRequest], None]
    ) -> Callable[[], None]:
        return self._caller.tell(lambda: self._inner.add_listener(callback))

    def wait_for_state(self, *states: State, timeout: float | None = None) -> State:
        return self._caller.wait(lambda: self._inner.wait_for_state(*states, timeout=timeout))

    def _opened(self, open_stream: Callable[[], AsyncStream[T]]) -> Stream[T]:
        return Stream(self._caller.tell(open_stream), self._caller)


def caller_of(hand: RobotiqHand) -> Caller:
    """The caller of a blocking hand, for tools that run in its event loop."""
    return hand._caller  # noqa: SLF001  # both are the hand
