"""Mirror: the state of a hand on another host, from the messages that have arrived."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace
from typing import Any, Final

from ...hands import Channels
from ...runtime import Log
from ...values import Inhibit, RobotiqStatus, SentRequest, State, Transition, Trigger, check_points
from ..control.lease import LEASE_WINDOW_S
from ..limited_log import LimitedLog
from ..wire.status_message import StatusMessage
from ..wire.values import Fields, reading

_CLOCKS_KEPT: Final = 16  # runs of an agent whose clocks are kept
DRIFT: Final = 200e-6  # drift between two clocks at most, in seconds per second
_TRIGGER_OF: Final = {
    State.RUNNING_IDLE: Trigger.SEEN_READY,
    State.RUNNING_CC: Trigger.SEEN_READY,
    State.FAULT: Trigger.SEEN_FAULT,
    State.ATR_DONE: Trigger.SEEN_RELEASED,
    State.RESET: Trigger.SEEN_RESET,
}
_OFF: Final = (State.DO_SHUTDOWN, State.SHUTDOWN)


def as_seen_from_here(state: State) -> State:
    """The state of a remote hand. If the agent's hand shuts down, ours is only disconnected."""
    return State.DISCONNECTED if state in _OFF else state


class AgentClock:
    """Converts times of the agent to times of this process.

    The transit time of a message is never negative. So the smallest difference of arrival and stamp is the
    best estimate of the clock difference; it may grow by DRIFT, because clocks drift. An answer is sent after
    its question. So the difference cannot be smaller than the time of the question minus the stamp of the
    answer; if it is, the agent's host was suspended, and its clock with it.
    """

    def __init__(self) -> None:
        self._offset: float | None = None
        self._at = 0.0

    def receive(self, stamp: float, arrival: float, asked: float | None = None) -> None:
        """Learn from a message; ``asked`` is our time of the question if the message is an answer."""
        difference = arrival - stamp
        if self._offset is None:
            self._offset = difference
        else:
            self._offset = min(difference, self._offset + DRIFT * (arrival - self._at))
        if asked is not None and self._offset < asked - stamp:
            self._offset = difference
        self._at = arrival

    def __call__(self, stamp: float) -> float:
        return stamp + (self._offset or 0.0)


class Mirror:
    """The state of one hand, as far as messages show it.

    Attributes:
        clock: converts the agent's times to ours.
        newest: the newest message; None before the first.
        status: the newest status; None before the first.
        state: of the hand: DISCONNECTED before the first message, and while the agent is silent.
        is_silent: whether no current message arrives.
        events: number of the newest event that readers got.
        misrouted: messages about another gripper, which were dropped.
        received_at: arrival of the last current message.
        points: of the agent's stroke, measured on the gripper; empty for nominal openings.
        inhibited: why the agent refuses motion; None while it does not.
    """

    def __init__(
        self,
        mark: int,
        channels: Channels | None = None,
        entered: Callable[[State], None] = lambda _: None,
        before: Mirror | None = None,
        log: Log | None = None,
    ) -> None:
        """Call ``entered`` with each state. State and sequences continue from the mirror ``before``."""
        self.log = log or Log()
        self.clock: AgentClock = AgentClock()
        self.newest: StatusMessage | None = None
        self.status: RobotiqStatus | None = None
        self.state: State = State.DISCONNECTED
        self.is_silent: bool = True
        self.events: int = 0
        self.misrouted: int = 0
        self._misrouted = LimitedLog(self.log)
        self.received_at: float = 0.0
        self.points: tuple[tuple[int, float], ...] = ()
        self.inhibited: Inhibit | None = None
        self._inhibit_stamp = -math.inf
        """The agent's time of the newest word about it: a summary may be older than an answer."""
        self._mark = mark
        self._channels = channels or Channels()
        self._entered = entered
        self._is_over = False
        self._reported = State.DISCONNECTED if before is None else before.state
        """Target of the last transition that readers got: the source of the next one."""
        self._reported_at = 0.0
        self._events_state = State.DISCONNECTED
        """State after the events so far; statuses may be ahead of them."""
        self._pushed: RobotiqStatus | None = None  # the last status that readers got
        self._clocks: dict[int, AgentClock] = {}  # by run of the agent, the present one last
        self._first = 0 if before is None else before.next_sequence
        self._base = 0
        """Added to the sequences of the agent, which restart with each of its runs; ours never do."""

    @property
    def stamp(self) -> float:
        return 0.0 if self.newest is None else self.newest.stamp

    @property
    def epoch(self) -> int:
        """The run of the agent; 0 before its first message."""
        return 0 if self.newest is None else self.newest.epoch

    @property
    def next_sequence(self) -> int:
        """The first sequence that no status has had."""
        return self._first if self.status is None else self.status.sequence + 1

    def is_about_another(self, mark: object) -> bool:
        # zenoh may deliver a sample under the wrong key.
        if mark == self._mark:
            return False
        self.misrouted += 1
        self._misrouted.warn("a message about another gripper was dropped")
        return True

    def is_of_another_run(
        self, message: StatusMessage, arrival: float, window: float = LEASE_WINDOW_S
    ) -> bool:
        """Whether a message is of another run of the agent than the present one, and to be dropped.

        Either it is late, or two agents serve the gripper. The second may serve another gripper under the
        same name, so the client stays with the first as long as its messages arrive. A run that has announced
        its end is followed by the next.
        """
        newest = self.newest
        if newest is None or message.epoch == newest.epoch:
            return False
        is_current = not self.is_silent and arrival - self.received_at <= window
        if is_current and newest.state not in _OFF:
            return True
        clock = self._clocks.get(message.epoch)
        return clock is not None and arrival - clock(message.stamp) > window

    def receive(
        self,
        message: StatusMessage,
        arrival: float,
        *,
        in_turn: bool,
        window: float = LEASE_WINDOW_S,
        asked: float | None = None,
    ) -> bool:
        """Take over a message; returns whether it is current, that is, at most ``window`` seconds old.

        With ``in_turn`` it was published, and readers get its status. An answer may overtake published
        statuses, so readers do not get its status. ``asked`` is our time of the question that it answers.
        """
        if message.epoch != self.epoch:
            self._begin_run(message, arrival)
        self.clock.receive(message.stamp, arrival, asked)
        is_current = arrival - self.clock(message.stamp) <= window
        if is_current:
            self.received_at = arrival
        status = self._status(message)
        if message.stamp >= self.stamp:
            self.newest = message
            self.status = status or self.status
            if is_current:
                self._set_state(as_seen_from_here(message.state), arrival)
        if (
            in_turn
            and status is not None
            and (self._pushed is None or status.sequence > self._pushed.sequence)
        ):
            self._pushed = status
            self._channels.statuses.push(status)
        return is_current

    def receive_events(self, events: Iterable[Fields]) -> bool:
        """Hand on events. True if some before them are missing: then the later ones wait for these."""
        for event in events:
            index = event["index"]
            if index > self.events + 1:
                return True
            if index == self.events + 1:
                self.events = index
                self._hand_on(event)
        return False

    def skip_events(self, index: int) -> None:
        # The agent no longer has the events up to this one.
        self.events = max(self.events, index)

    def has_missed(self) -> bool:
        return self.newest is not None and self.newest.events > self.events

    def read_status(self, fields: Mapping[str, Any]) -> RobotiqStatus:
        """The status in an answer, with our time and sequence."""
        status = RobotiqStatus.from_raw(fields)
        return self._as_ours(status, self.clock(status.timestamp))

    def receive_points(self, summary: Mapping[str, Any]) -> None:
        """Take over the points that were measured on the gripper; an older agent sends none."""
        self.points = check_points("stroke", summary["stroke"]) if summary.get("stroke") else ()

    def receive_inhibit(self, told: Mapping[str, Any]) -> None:
        """Take over whether motion is inhibited; an older agent does not say."""
        if "inhibited" in told and (stamp := float(told["stamp"])) >= self._inhibit_stamp:
            inhibit = told["inhibited"]
            self.inhibited = None if inhibit is None else Inhibit.from_dict(inhibit)
            self._inhibit_stamp = stamp

    def begin(self, at: float) -> None:
        self._report(State.DISCONNECTED, Trigger.ASK_START, at)

    def fall_silent(self, at: float) -> None:
        if not (self.is_silent or self._is_over):
            self.is_silent = True
            self.state = State.DISCONNECTED
            self._report(State.DISCONNECTED, Trigger.LINK_LOST, at)
            self._entered(State.DISCONNECTED)

    def shut_down(self, state: State, trigger: Trigger, at: float) -> None:
        # From now on messages do not change the state.
        self._is_over = True
        self.state = state
        self._report(state, trigger, at)

    def _begin_run(self, message: StatusMessage, arrival: float) -> None:
        self.fall_silent(arrival)
        # With the clock of an earlier run, late messages of that run are recognized as late.
        self.clock = self._clocks.pop(message.epoch) if message.epoch in self._clocks else AgentClock()
        self._clocks[message.epoch] = self.clock
        while len(self._clocks) > _CLOCKS_KEPT:
            del self._clocks[next(iter(self._clocks))]
        self.newest = None
        self._inhibit_stamp = -math.inf
        self.events = message.events
        self._events_state = as_seen_from_here(message.state)
        first = 0 if message.status is None else message.status.sequence
        self._base = self.next_sequence if first < self.next_sequence else 0

    def _set_state(self, state: State, arrival: float) -> None:
        if self._is_over:
            return
        source, self.state = self.state, state
        if self.is_silent:
            self.is_silent = False
            # The state after the events, not of this status: the events up to it may still arrive.
            self._report(self._events_state, _TRIGGER_OF.get(self._events_state, Trigger.SEEN_BUSY), arrival)
        if source is not state:
            self._entered(state)

    def _status(self, message: StatusMessage) -> RobotiqStatus | None:
        theirs, newest = message.status, self.status
        if theirs is None:
            return None
        sequence = self._base + theirs.sequence
        if newest is not None and newest.sequence == sequence:
            return newest
        # The estimated clock difference falls and rises, but timestamps must rise with the sequence.
        at = self.clock(theirs.timestamp)
        for other in (self._pushed, newest):
            if other is not None:
                at = max(at, other.timestamp) if other.sequence < sequence else min(at, other.timestamp)
        return self._as_ours(theirs, at)

    def _as_ours(self, status: RobotiqStatus, at: float) -> RobotiqStatus:
        model = status.model
        stroke = model.stroke.measured(self.points)
        return RobotiqStatus(
            status.registers, at, self._base + status.sequence, model, stroke, status.has_current
        )

    def _hand_on(self, event: Fields) -> None:
        with reading("an event"):
            if event["kind"] == "transition":
                self._apply(Transition.from_dict(event))
            elif event["kind"] == "inhibit":
                self.receive_inhibit(event)
            elif event["kind"] == "request":
                sent = SentRequest.from_raw(event)
                at = self._in_order(self.clock(sent.timestamp))
                self._channels.requests.push(replace(sent, timestamp=at))

    def _apply(self, transition: Transition) -> None:
        source, target = as_seen_from_here(transition.source), as_seen_from_here(transition.target)
        at = self.clock(transition.timestamp)
        self._events_state = target
        if not (self.is_silent or self._is_over):
            # Transitions in between, if any, are lost: the agent keeps only the newest events.
            self._report(source, _TRIGGER_OF.get(source, Trigger.SEEN_BUSY), at)
            self._report(target, transition.trigger, at)

    def _report(self, state: State, trigger: Trigger, at: float) -> None:
        source, self._reported = self._reported, state
        if source is not state:
            self._channels.transitions.push(Transition(source, state, trigger, self._in_order(at)))
            # Also a state too short to appear in any status.
            self._entered(state)

    def _in_order(self, at: float) -> float:
        self._reported_at = max(self._reported_at, at)
        return self._reported_at
