"""Kind: the parts that each kind of hand supplies, and the parts that all kinds share."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from typing import Literal, TypeVar

from ..calibration import ForceCalibration, SpeedCalibration, Units
from ..runtime.concurrency import check_loop
from ..runtime.logger import Log
from ..values.checks import check_flag
from ..values.enums import Finger, State, StopLevel, Trigger
from ..values.errors import ConnectionLostError, InvalidStateError, NotStartedError
from ..values.inhibit import Inhibit
from ..values.model import THREE_FINGER, Model
from ..values.move_result import MoveResult
from ..values.states import check
from ..values.status import RobotiqStatus
from ..values.stroke import Points
from .options import UnitsByModel
from .present_run import NamesErrors, PresentRun, refuse_copy
from .streams import Channel, Channels, Stream

T = TypeVar("T")


class HandKind(ABC):
    """The inside of a hand; :class:`~robotiq_async.hands.Hand` has its calls, and the steps to a new kind."""

    _session: PresentRun | None = None
    """The present run, or the last one; None before the first start."""

    def __init__(
        self,
        address: str,
        *,
        units: Callable[[Model], Units] | None = None,
        name: str = "",
        keep_grip: bool = False,
        model: Model | None = None,
        calibration: SpeedCalibration | None = None,
        force_calibration: ForceCalibration | None = None,
    ) -> None:
        self._address = address
        self._given_name = name
        if units is None:
            by_model = UnitsByModel(calibration, force_calibration)
            units, model = lambda model: by_model(model, self._points), model or by_model.model
        self._units = units
        self._keep_grip = check_flag("keep_grip", keep_grip)
        self._model = model or THREE_FINGER
        self._channels = Channels(Log(name or address))
        self._naming = NamesErrors(name)

    def __repr__(self) -> str:
        name = f"{self._given_name} " if self._given_name else ""
        return f"<{type(self).__name__} {name}{self._address} {self.state.name}>"

    __reduce__ = refuse_copy

    # -- supplied by each kind of hand, with checked arguments ---------------------------------------------

    @property
    @abstractmethod
    def state(self) -> State:
        """The state of the hand."""

    @property
    @abstractmethod
    def inhibited(self) -> Inhibit | None:
        """The reason that motion is refused, since when, and by whom; None while it is permitted."""

    @property
    @abstractmethod
    def _newest_status(self) -> RobotiqStatus | None:
        """The newest status; None before the first."""

    @abstractmethod
    def _is_moving(self) -> bool:
        """Whether an axis moves or will move; only called while that is known."""

    @abstractmethod
    async def _start(self, activate: bool, wait: float) -> None: ...

    @abstractmethod
    async def _stop(self, halt: bool, keep_grip: bool) -> None: ...

    @abstractmethod
    async def _set(self, what: Literal["position", "speed", "force"], value: int, axes: Finger) -> None: ...

    @abstractmethod
    def _command(self, axes: Finger, position: int | None, speed: int | None, force: int | None) -> None: ...

    @abstractmethod
    async def _move(
        self, axes: Finger, target: int, speed: int | None, force: int | None, timeout: float | None
    ) -> MoveResult: ...

    @abstractmethod
    async def _hold(self, axes: Finger) -> None: ...

    @abstractmethod
    async def _halt(self) -> None: ...

    @abstractmethod
    async def _inhibit(self, inhibit: Inhibit) -> None: ...

    @abstractmethod
    async def _permit(self, who: str, seen: Inhibit | None) -> None: ...

    @abstractmethod
    async def _activate(self) -> None: ...

    @abstractmethod
    async def _reset(self) -> None: ...

    @abstractmethod
    async def _atr(self) -> None: ...

    @abstractmethod
    async def _recover(self, timeout: float | None) -> None: ...

    @abstractmethod
    async def _wait_for_state(self, states: Collection[State], timeout: float | None) -> State: ...

    @property
    def _points(self) -> Points:
        """Of the stroke that was measured on the gripper; none for nominal openings."""
        return ()

    # -- shared by the calls above -------------------------------------------------------------------------

    def _keeps_grip(self, keep_grip: bool | None) -> bool:
        return self._keep_grip if keep_grip is None else check_flag("keep_grip", keep_grip)

    def _stop_level(self, halt: bool, keep_grip: bool | None) -> StopLevel:
        """The level for the arguments of a stop."""
        check_flag("halt", halt)
        return StopLevel.of(halt=halt, keep_grip=self._keeps_grip(keep_grip))

    def _check_running(self) -> None:
        if self._session is None:
            raise NotStartedError("the hand is not started", advice="use 'async with' or start()")
        self._session.check_running()

    @property
    def _is_started(self) -> bool:
        """Whether a run has begun, and neither ended nor begun to end."""
        return self._session is not None and not self._session.is_over

    def _check_may_start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Refuse a second start, and a start in another event loop than the loop of a run or of readers."""
        self._check_loop("hand.start()")
        self._channels.check_loop(loop)
        if self._is_started:
            allowed = {State.DISCONNECTED, State.SHUTDOWN}
            why = f"this hand runs on {self._address} already: stop() it first"
            raise InvalidStateError(why, self.state, allowed)

    def _check_allowed(self, trigger: Trigger, *, presses: bool = True) -> None:
        """Refuse a call that the state does not allow, or, if it may move or ``presses``, an inhibit."""
        check(trigger, self.state, self._newest_status, self.inhibited if presses else None)

    def _current_status(self) -> RobotiqStatus:
        with self._naming:
            self._check_running()
            if (status := self._newest_status) is None:
                raise NotStartedError("no status has been read yet: start the hand first")
            if self._is_link_down:
                raise ConnectionLostError("the link is down: the present status of the gripper is not known")
            return status

    @property
    def _is_link_down(self) -> bool:
        return self.state is State.DISCONNECTED

    def _check_may_listen(self) -> None:
        """Refuse another thread or loop while the hand runs: neither streams nor listeners are locked."""
        self._check_loop("a stream or a listener of the hand")

    def _check_loop(self, what: str) -> None:
        if self._session is not None and not self._session.is_over:
            self._check_called_in_loop(what)

    def _check_called_in_loop(self, what: str = "the hand") -> None:
        """Raise RuntimeError if called outside the event loop of the run, or after that loop was closed."""
        assert self._session is not None, "the hand was started"
        check_loop(self._session.loop, what)

    def _opened(self, channel: Channel[T], buffer: int | None, limit: float | None = None) -> Stream[T]:
        self._check_may_listen()
        return channel.open(buffer, limit, self._no_status_for)

    def _no_status_for(self, seconds: float) -> ConnectionLostError:
        why = f"no status for {seconds:g} s (the hand is in {self.state.name})"
        return ConnectionLostError(why).of_hand(self._given_name)
