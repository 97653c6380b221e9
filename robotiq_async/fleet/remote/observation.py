"""What a hand on another host shows: its state, its statuses, its statistics, and streams of all of it."""

from __future__ import annotations

import asyncio
from typing import TypeVar

from ...control.grip_watch import SLIP_COUNTS, GripWatch
from ...runtime.event_loop import check_loop
from ...session.counters import Counters
from ...session.state_waiters import check_states
from ...session.streams import Channel, Channels, Stream
from ...values.calibration import Units
from ...values.checks import check_int, check_timeout
from ...values.enums import Finger, State
from ...values.errors import ConnectionLostError, NotStartedError, StateTimeoutError
from ...values.events import SentRequest, Transition
from ...values.grip_event import GripEvent
from ...values.statistics import Statistics
from ...values.status import RobotiqStatus
from ..wire.names import GripperName
from .outbox import Outbox
from .session import RemoteSession

T = TypeVar("T")


class RemoteObservation:
    """A hand on another host that is looked at."""

    _name: GripperName
    _units: Units
    _channels: Channels
    _session: RemoteSession | None
    """The run under way, or the last one."""
    _outbox: Outbox | None

    @property
    def name(self) -> str:
        """What the hand is called: its address."""
        return self.address

    @property
    def address(self) -> str:
        """The gripper's address, without how to get there."""
        return str(self._name)

    @property
    def units(self) -> Units:
        """Converts mm, mm/s, seconds and newton labels to what commands take, and back.

        By the calibrations that this hand was made with: the agent tells of none.
        """
        return self._units

    @property
    def state(self) -> State:
        """Where the hand is, as far as it is known: DISCONNECTED also while the agent is silent."""
        return State.DISCONNECTED if self._session is None else self._session.mirror.state

    @property
    def status(self) -> RobotiqStatus:
        """The newest status that was heard; its timestamp tells how old it is.

        Raises:
            NotStartedError: there is none yet.
        """
        status = None if self._session is None else self._session.mirror.status
        if status is None:
            raise NotStartedError("no status has been heard yet: start the hand first")
        return status

    @property
    def is_activated(self) -> bool:
        """Whether the gripper is active.

        Raises:
            RobotiqError: not known: not started, or nothing is heard.
        """
        return self._current_status().is_activated

    @property
    def is_reset(self) -> bool:
        """Whether the gripper is reset.

        Raises:
            RobotiqError: not known: not started, or nothing is heard.
        """
        status = self._current_status()
        return status.is_reset and not status.activation_echo

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will because of a command that does not act yet.

        Raises:
            RobotiqError: not known: not started, or nothing is heard.
        """
        self._current_status()
        assert self._session is not None
        assert self._outbox is not None
        newest = self._session.mirror.newest
        return self._outbox.is_moving or (newest is not None and newest.is_moving)

    @property
    def statistics(self) -> Statistics:
        """How the agent's polling goes, as of its last summary: at most a second old."""
        return Counters().snapshot(0) if self._session is None else self._session.statistics

    def statuses(self, buffer: int = 1) -> Stream[RobotiqStatus]:
        """Every status that is heard from now on, for one reader; see :meth:`RobotiqHand.statuses`."""
        return self._open_stream(self._channels.statuses, check_int("buffer", buffer, 1, 1_000_000))

    def transitions(self) -> Stream[Transition]:
        """Every change of state from now on, none lost that the agent still knows of.

        Losing the agent, and hearing it again, are changes too.
        """
        return self._open_stream(self._channels.transitions, None)

    def requests(self, buffer: int | None = None) -> Stream[SentRequest]:
        """Every request the agent's hand writes from now on, by whomever it was asked for."""
        kept = None if buffer is None else check_int("buffer", buffer, 1, 1_000_000)
        return self._open_stream(self._channels.requests, kept)

    def grip_events(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> Stream[GripEvent]:
        """What becomes of the grips, by the statuses that are heard; see :meth:`RobotiqHand.grip_events`.

        Of what happened in statuses that were lost on the way, it tells what is left of it.

        Args:
            fingers: mask of the axes that are watched.
            since: the status to begin with, ``result.status`` of a grasp or a move; None for the newest one.
            slip: counts that an axis in contact may move without being told, 1..255.

        Raises:
            TypeError, ValueError: an argument of the wrong type or outside its range.
        """
        watch = GripWatch(fingers, since=since, slip=slip)
        self._check_owner()
        newest = None if self._session is None else self._session.mirror.status
        if since is None and newest is not None:
            watch.see(newest)
        return self._channels.statuses.derive(watch.see)

    async def wait_for_state(self, *states: State, timeout: float | None = None) -> State:
        """Wait until the hand is, if only for a moment, in one of these states, and return it.

        Raises:
            TypeError: not a State.
            ValueError: no state, or a malformed timeout.
            StateTimeoutError: not reached in time.
            NotStartedError: the hand is not started, or was stopped meanwhile.
        """
        check_states(states)
        limit = check_timeout("timeout", timeout)
        if self.state in states:
            return self.state
        with self._asked().waiters.watching(set(states), {}) as reached:
            try:
                async with asyncio.timeout(limit):
                    return await reached
            except TimeoutError:
                names = " or ".join(state.name for state in states)
                raise StateTimeoutError(
                    f"{names} was not reached within {limit:g} s (now {self.state.name})"
                ) from None

    # -- inside ----------------------------------------------------------------------------------------

    def _started(self) -> RemoteSession:
        if self._session is None:
            raise NotStartedError("the hand is not started: use 'async with' or start()")
        self._session.check_running()
        return self._session

    def _asked(self) -> RemoteSession:
        session = self._started()
        session.check_loop()
        return session

    def _current_status(self) -> RobotiqStatus:
        self._started()
        status = self.status
        if self.state is State.DISCONNECTED:
            raise ConnectionLostError(
                "the agent or its gripper is not heard: what the gripper does is not known"
            )
        return status

    def _open_stream(self, channel: Channel[T], buffer: int | None) -> Stream[T]:
        self._check_owner()
        return channel.open(buffer)

    def _check_owner(self) -> None:
        """Refuse another thread while the hand runs: the streams are not locked."""
        session = self._session
        if session is not None and not session.is_over and not session.lost_its_loop:
            check_loop(session.loop, "a stream of the hand")
