"""Backend: the part of a hand that reaches its gripper; each kind of hand has its own."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection
from typing import Final, Literal, TypeVar

from ..calibration import ForceCalibration, SpeedCalibration, Units
from ..runtime.concurrency import check_loop, wait_shielded
from ..runtime.logger import Log
from ..values.checks import check_flag
from ..values.enums import Finger, State, StopLevel, Trigger
from ..values.errors import ConnectionLostError, InvalidStateError, NotStartedError, of_hand
from ..values.inhibit import Inhibit
from ..values.model import THREE_FINGER, Model
from ..values.move_result import MoveResult
from ..values.states import check
from ..values.status import RobotiqStatus
from ..values.stroke import Points
from .options import UnitsByModel
from .present_run import PresentRun
from .statistics import Statistics
from .streams import Channel, Channels, Stream

T = TypeVar("T")


class Backend(ABC):
    """Carries out the calls of a :class:`~robotiq_async.hands.Hand`, whose arguments are checked by then.

    For another kind of hand, supply the abstract methods, give ``channels`` each status and transition, and
    set ``session`` to the present run, or override :meth:`check_running`.

    Args:
        address: of the gripper, in its full form; no two hands of a process have the same one.
        name: of the hand in the log, errors and metrics; empty for its address.
        units: converts positions, speeds and forces of the model; by default by these calibrations.
        keep_grip: whether a stop keeps a grip by default.
        model: of the gripper; None for the model of a calibration, else a 3-Finger.
        calibration: the speeds of the gripper; None for the thesis's gripper.
        force_calibration: the forces of the gripper; None for the manual's figures.

    Attributes:
        channels: the streams and listeners of the hand.
        session: the present run, or the last one; None before the first start.
    """

    session: PresentRun | None = None

    def __init__(
        self,
        address: str,
        *,
        name: str = "",
        units: Callable[[Model], Units] | None = None,
        keep_grip: bool = False,
        model: Model | None = None,
        calibration: SpeedCalibration | None = None,
        force_calibration: ForceCalibration | None = None,
    ) -> None:
        self.address: Final = address
        self.name: Final = name
        self.keep_grip: Final = check_flag("keep_grip", keep_grip)
        self.channels: Final = Channels(Log(name or address))
        if units is None:
            by_model = UnitsByModel(calibration, force_calibration)
            units, model = lambda model: by_model(model, self.points), model or by_model.model
        self._units = units
        self._model = model or THREE_FINGER

    # -- supplied by each kind of hand -----------------------------------------------------------------------

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
    def newest_status(self) -> RobotiqStatus | None:
        """The newest status; None until there are some."""

    @property
    @abstractmethod
    def statistics(self) -> Statistics | None:
        """Figures of the polling since the last start; None until there are some."""

    @property
    def points(self) -> Points:
        """Of the stroke that was measured on the gripper; none for nominal openings."""
        return ()

    @abstractmethod
    def is_moving(self) -> bool:
        """Whether an axis moves or will move; only called while that is known."""

    @abstractmethod
    async def start(self, activate: bool, wait: float) -> None: ...

    @abstractmethod
    async def stop(self, halt: bool, keep_grip: bool) -> None: ...

    @abstractmethod
    async def set(self, what: Literal["position", "speed", "force"], value: int, axes: Finger) -> None: ...

    @abstractmethod
    def command(self, axes: Finger, position: int | None, speed: int | None, force: int | None) -> None: ...

    @abstractmethod
    async def move(
        self, axes: Finger, target: int, speed: int | None, force: int | None, timeout: float | None
    ) -> MoveResult: ...

    @abstractmethod
    async def hold(self, axes: Finger) -> None: ...

    @abstractmethod
    async def halt(self) -> None: ...

    @abstractmethod
    async def inhibit(self, inhibit: Inhibit) -> None: ...

    @abstractmethod
    async def permit(self, who: str, seen: Inhibit | None) -> None: ...

    @abstractmethod
    async def activate(self) -> None: ...

    @abstractmethod
    async def reset(self) -> None: ...

    @abstractmethod
    async def atr(self) -> None: ...

    @abstractmethod
    async def recover(self, timeout: float | None) -> None: ...

    @abstractmethod
    async def wait_for_state(self, states: Collection[State], timeout: float | None) -> State: ...

    # -- the same for all ------------------------------------------------------------------------------------

    @property
    def model(self) -> Model:
        """The model of the gripper, which a status may tell."""
        newest = self.newest_status
        return self._model if newest is None else newest.model

    @property
    def units(self) -> Units:
        return self._units(self.model)

    def check_running(self) -> None:
        """Raise NotStartedError, or the error that ended the link, unless a run is under way."""
        if self.session is None:
            raise NotStartedError("the hand is not started", advice="use 'async with' or start()")
        self.session.check_running()

    @property
    def is_started(self) -> bool:
        """Whether a run has begun, and neither ended nor begun to end."""
        return self.session is not None and not self.session.is_over

    async def wait_for_end(self, ending: asyncio.Future[None]) -> None:
        """Wait until a run has ended, also when cancelled; then raise its error or the cancellation."""
        await wait_shielded(ending)
        ending.result()

    def keeps_grip(self, keep_grip: bool | None) -> bool:
        """The argument of a stop, checked; None is the default of the hand."""
        return self.keep_grip if keep_grip is None else check_flag("keep_grip", keep_grip)

    def stop_level(self, halt: bool, keep_grip: bool | None) -> StopLevel:
        """The level for the arguments of a stop."""
        check_flag("halt", halt)
        return StopLevel.of(halt=halt, keep_grip=self.keeps_grip(keep_grip))

    def check_may_start(self, loop: asyncio.AbstractEventLoop) -> None:
        """Refuse a second start, and a start in another event loop than the loop of a run or of readers."""
        self.check_loop("hand.start()")
        self.channels.check_loop(loop)
        if self.is_started:
            allowed = {State.DISCONNECTED, State.SHUTDOWN}
            why = f"this hand runs on {self.address} already: stop() it first"
            raise InvalidStateError(why, self.state, allowed)

    def check_loop(self, what: str) -> None:
        """Refuse another thread or event loop while the hand runs."""
        if self.session is not None and not self.session.is_over:
            self.check_called_in_loop(what)

    def check_called_in_loop(self, what: str = "the hand") -> None:
        """Raise RuntimeError if called outside the event loop of the run, or after that loop was closed."""
        assert self.session is not None, "the hand was started"
        check_loop(self.session.loop, what)

    def check_may_listen(self) -> None:
        """Refuse another thread or loop while the hand runs: neither streams nor listeners are locked."""
        self.check_loop("a stream or a listener of the hand")

    def check_allowed(self, trigger: Trigger, *, presses: bool = True) -> None:
        """Refuse a call that the state does not allow, or, if it may move or ``presses``, an inhibit."""
        check(trigger, self.state, self.newest_status, self.inhibited if presses else None)

    @property
    def status(self) -> RobotiqStatus:
        """The newest status; NotStartedError before the first."""
        if (status := self.newest_status) is None:
            raise NotStartedError("no status has been read yet: start the hand first")
        return status

    def current_status(self) -> RobotiqStatus:
        """The newest status, unless the link went down after it."""
        self.check_running()
        status = self.status
        if self.is_link_down:
            raise ConnectionLostError("the link is down: the present status of the gripper is not known")
        return status

    @property
    def is_link_down(self) -> bool:
        """Whether the newest status is from before a loss of the link."""
        return self.state is State.DISCONNECTED

    def open_stream(self, channel: Channel[T], buffer: int | None, limit: float | None = None) -> Stream[T]:
        """A stream of a channel, for one reader; with a limit it fails when no status comes for that time."""
        self.check_may_listen()
        return channel.open(buffer, limit, self.no_status_for)

    def no_status_for(self, seconds: float) -> ConnectionLostError:
        """The error of a stream whose limit of time is over."""
        why = f"no status for {seconds:g} s (the hand is in {self.state.name})"
        return of_hand(ConnectionLostError(why), self.name)
