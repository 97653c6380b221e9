"""What a hand shows: its state, its statuses, its statistics, and streams of all of it."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from typing import TypeVar

from ..control.grip_watch import SLIP_COUNTS, GripWatch
from ..control.state_machine import StateMachine
from ..session.counters import Counters
from ..session.options import Options
from ..session.session import Session
from ..session.state_waiters import check_states
from ..session.streams import Channel, Channels, Stream
from ..values.calibration import Units
from ..values.checks import check_int, check_timeout
from ..values.enums import Finger, State
from ..values.errors import ConnectionLostError, NotStartedError
from ..values.events import SentRequest, Transition
from ..values.grip_event import GripEvent
from ..values.statistics import Statistics
from ..values.status import RobotiqStatus
from .naming import tells_its_hand

T = TypeVar("T")


class Observation:
    """A hand that is looked at: from any thread, but for its streams, which belong to its event loop."""

    _options: Options
    _machine: StateMachine
    _channels: Channels
    _session: Session | None
    """The run under way, or the last one."""

    @property
    def name(self) -> str:
        """What the hand is called: what its constructor was given, or else its address."""
        return self._options.name

    @property
    def address(self) -> str:
        """The gripper's address in its full form; for a transport object, what messages call it."""
        return self._options.address

    @property
    def units(self) -> Units:
        """Converts mm, mm/s, seconds and newton labels to what commands take, and back.

        By the calibrations that the hand was made with; there before the start.
        """
        return self._options.units

    @property
    def state(self) -> State:
        """Where the hand is."""
        return self._machine.state

    @property
    @tells_its_hand
    def status(self) -> RobotiqStatus:
        """The most recent status; its timestamp tells how old it is.

        Raises:
            NotStartedError: there is none yet.
        """
        status = None if self._session is None else self._session.controller.status
        if status is None:
            raise NotStartedError("no status has been read yet: start the hand first")
        return status

    @property
    def is_activated(self) -> bool:
        """Whether the gripper is active (gIMC = 3).

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        return self._current_status().is_activated

    @property
    def is_reset(self) -> bool:
        """Whether the gripper is reset (gACT = 0 and gIMC = 0).

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        status = self._current_status()
        return status.is_reset and not status.activation_echo

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will because of a command that does not act yet.

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """
        self._current_status()
        return self._started().controller.is_moving

    @property
    def statistics(self) -> Statistics:
        """How the polling went since the last start."""
        if self._session is None:
            return Counters().snapshot(0)
        controller = self._session.controller
        return self._session.counters.snapshot(controller.foreign_commands, controller.passing_faults)

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
        return self._open(self._channels.statuses, check_int("buffer", buffer, 1, 1_000_000))

    def transitions(self) -> Stream[Transition]:
        """Every change of state from now on, for one reader, none lost. Ends after :meth:`stop`."""
        return self._open(self._channels.transitions, None)

    def requests(self, buffer: int | None = None) -> Stream[SentRequest]:
        """Every request written from now on, for one reader. Ends after :meth:`stop`.

        Args:
            buffer: requests kept for the reader, the newest ones, 1..1000000; None loses none.

        Raises:
            TypeError: buffer is not an int.
            ValueError: buffer is outside its range.
        """
        kept = None if buffer is None else check_int("buffer", buffer, 1, 1_000_000)
        return self._open(self._channels.requests, kept)

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
        watch = GripWatch(fingers, since=since, slip=slip)
        self._check_owner()
        newest = None if self._session is None else self._session.controller.status
        if since is None and newest is not None:
            watch.see(newest)
        return self._channels.statuses.derive(watch.see)

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
            RuntimeError: called from another thread or event loop while the hand runs.
        """
        if inspect.iscoroutinefunction(callback) or not callable(callback):
            raise TypeError(f"callback must be a plain function, got {callback!r}")
        self._check_owner()
        return self._channels.listeners.add(callback)

    @tells_its_hand
    async def wait_for_state(self, *states: State, timeout: float | None = None) -> State:
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
        check_states(states)
        limit = check_timeout("timeout", timeout)
        if self.state in states:
            return self.state
        names = " or ".join(state.name for state in states)
        session = self._started()
        session.check_loop("the hand")
        return await session.reach(set(states), limit, what=f"{names} was not reached")

    @property
    def _has_commanded(self) -> bool:
        """Whether a request was written since the last start, or waits for that.

        One that was refused leaves no trace.
        """
        session = self._session
        return session is not None and (session.counters.has_begun_to_write or session.controller.has_request)

    # -- inside ----------------------------------------------------------------------------------------

    def _started(self) -> Session:
        """The run under way, for whoever only reads: that may be done from anywhere.

        Raises:
            NotStartedError: not started, or stopped.
            ConnectionLostError: the hand gave up on its link.
        """
        if self._session is None:
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        self._session.check_running()
        return self._session

    def _asked(self) -> Session:
        """The run under way, for whoever asks for something.

        Raises:
            NotStartedError, ConnectionLostError: as :meth:`_started`; or stop() was called.
            RuntimeError: called from another thread or event loop.
        """
        session = self._started()
        session.check_loop("the hand")
        session.check_takes_requests()
        return session

    @tells_its_hand
    def _current_status(self) -> RobotiqStatus:
        self._started()
        status = self.status
        if self.state is State.DISCONNECTED:
            raise ConnectionLostError("the link is down: what the gripper does is not known")
        return status

    def _open(self, channel: Channel[T], buffer: int | None) -> Stream[T]:
        self._check_owner()
        return channel.open(buffer)

    def _check_owner(self) -> None:
        """Refuse another thread while the hand runs: neither streams nor listeners are locked."""
        session = self._session
        if session is not None and not session.is_over and not session.lost_its_loop:
            session.check_loop("a stream or a listener of the hand")
