"""What a hand shows: its state, its statuses, its statistics, and streams of all of it.

Made from robotiq_async.hand.observation by docs/make_sync.py.
"""

from __future__ import annotations

from collections.abc import Callable

from ..control.grip_watch import SLIP_COUNTS
from ..values.calibration import Units
from ..values.enums import Finger, State
from ..values.events import SentRequest, Transition
from ..values.grip_event import GripEvent
from ..values.statistics import Statistics
from ..values.status import RobotiqStatus
from .blocking import BlockingHand
from .streams import Stream


class Observation(BlockingHand):
    """A hand that is looked at."""

    @property
    def name(self) -> str:
        """What the hand is called: what its constructor was given, or else its address."""
        return self._inner.name

    @property
    def address(self) -> str:
        """The gripper's address in its full form; for a transport object, what messages call it."""
        return self._inner.address

    @property
    def units(self) -> Units:
        """Converts mm, mm/s, seconds and newton labels to what commands take, and back.

        By the calibrations that the hand was made with; there before the start.
        """
        return self._inner.units

    @property
    def state(self) -> State:
        """Where the hand is."""
        return self._inner.state

    @property
    def status(self) -> RobotiqStatus:
        """The most recent status; its timestamp tells how old it is.

        Raises:
            NotStartedError: there is none yet.
        """
        return self._inner.status

    @property
    def is_activated(self) -> bool:
        """Whether the gripper is active (gIMC = 3).

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        return self._inner.is_activated

    @property
    def is_reset(self) -> bool:
        """Whether the gripper is reset (gACT = 0 and gIMC = 0).

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        return self._inner.is_reset

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will because of a command that does not act yet.

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        return self._inner.is_moving

    @property
    def statistics(self) -> Statistics:
        """How the polling went since the last start."""
        return self._inner.statistics

    def statuses(self, buffer: int = 1) -> Stream[RobotiqStatus]:
        """Every status from now on, for one reader; newest wins.

        A slow reader costs only itself: it keeps the newest ``buffer`` statuses and ``.missed`` counts
        the others. Opened before the start it waits, and it waits out a lost link. Ends after
        :meth:`stop`; raises RobotiqConnectionError when the hand gives up.

        Args:
            buffer: statuses kept for the reader, 1..1000000.

        Raises:
            TypeError: buffer is not an int.
            ValueError: buffer is outside its range.
        """
        return Stream(self._caller.tell(lambda: self._inner.statuses(buffer)), self._caller)

    def transitions(self) -> Stream[Transition]:
        """Every change of state from now on, for one reader, none lost. Ends after :meth:`stop`."""
        return Stream(self._caller.tell(lambda: self._inner.transitions()), self._caller)

    def requests(self, buffer: int | None = None) -> Stream[SentRequest]:
        """Every request written from now on, for one reader. Ends after :meth:`stop`.

        Args:
            buffer: requests kept for the reader, the newest ones, 1..1000000; None loses none.

        Raises:
            TypeError: buffer is not an int.
            ValueError: buffer is outside its range.
        """
        return Stream(self._caller.tell(lambda: self._inner.requests(buffer)), self._caller)

    def grip_events(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> Stream[GripEvent]:
        """What becomes of the grips from now on: contacts gained and lost, parts that slip.

        For one reader, none lost. It waits out a lost link, tells nothing meanwhile, and when the link is
        back what has become of the grips. Ends after :meth:`stop`, as :meth:`statuses` does.

        It tells what the gripper reports. A contact latches: a part that is pulled out is noticed when its
        finger closes on, which it does when more force is asked for, and by the manual not before.

        Args:
            fingers: mask of the axes that are watched.
            since: the status to begin with, ``result.status`` of a grasp or a move: what has changed between
                that and the next status is told, too. None for the newest one.
            slip: counts that an axis in contact may move without being told, 1..255.

        Raises:
            TypeError: an argument of the wrong type.
            ValueError: an argument outside its range.
        """
        return Stream(
            self._caller.tell(lambda: self._inner.grip_events(fingers, since=since, slip=slip)), self._caller
        )

    def add_listener(
        self, callback: Callable[[RobotiqStatus | Transition | SentRequest], None]
    ) -> Callable[[], None]:
        """Call a plain function with every status, change of state and request written, as it happens.

        It is called in the hand's event loop, in the turn in which it happens: before any reader of a stream
        and any caller that waits goes on. So it must be quick, and it must not block: every poll waits for
        it. What happens is told in its order; a change of state comes before the status or the request that
        leads to it, and what a callback brings about itself after what it is called with.

        A callback that raises is logged with its traceback and not called again; the hand goes on. Added
        before the start it waits, and it outlasts :meth:`stop`, until it is removed.

        Args:
            callback: takes a RobotiqStatus, a Transition or a SentRequest.

        Returns:
            What removes it again; calling that twice does no harm.

        Raises:
            TypeError: callback cannot be called, or is a coroutine function.
        """
        return self._caller.tell(lambda: self._inner.add_listener(callback))

    def wait_for_state(self, *states: State, timeout: float | None = None) -> State:
        """Wait until the hand is, if only for a moment, in one of these states, and return it.

        Args:
            states: at least one.
            timeout: seconds; None waits for as long as the hand runs.

        Raises:
            TypeError: not a State.
            ValueError: no state, or a malformed timeout.
            StateTimeoutError: not reached in time.
            NotStartedError: the hand is not started, or was stopped meanwhile.
            RobotiqConnectionError: the hand gave up on its link.
        """
        return self._caller.wait(lambda: self._inner.wait_for_state(*states, timeout=timeout))
