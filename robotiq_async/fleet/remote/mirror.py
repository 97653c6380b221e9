"""Mirror: what a client knows of a hand on another host, from what it has heard."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Final

from ...runtime.log import Log, log
from ...session.streams import Channels
from ...values.enums import State
from ...values.events import Transition
from ...values.status import RobotiqStatus
from ...values.trigger import Trigger
from ..control.lease import WINDOW_S
from ..wire.status_message import StatusMessage
from ..wire.values import Fields, read_request, read_transition, reading

_RUNS: Final = 16
"""At most this many runs of an agent are told apart."""
DRIFT: Final = 200e-6
"""How far two clocks may part: seconds a second."""
_SEEN: Final = {
    State.RUNNING_IDLE: Trigger.SEEN_READY,
    State.RUNNING_CC: Trigger.SEEN_READY,
    State.FAULT: Trigger.SEEN_FAULT,
    State.ATR_DONE: Trigger.SEEN_RELEASED,
    State.RESET: Trigger.SEEN_RESET,
}
_OFF: Final = (State.DO_SHUTDOWN, State.SHUTDOWN)


def as_seen_from_here(state: State) -> State:
    """The state of a remote hand whose agent's hand is in a state: that one's end is not the end of ours."""
    return State.DISCONNECTED if state in _OFF else state


class AgentClock:
    """Makes times of this process of times of the agent.

    A message takes at least no time. So the smallest difference of arrival and stamp is the best guess of how
    far the clocks are apart; it may grow slowly, for clocks drift. What an answer says was said after its
    question: a smaller difference cannot be (the agent's host was suspended, and its clock with it).
    """

    def __init__(self) -> None:
        self._offset: float | None = None
        self._at = 0.0

    def receive(self, stamp: float, arrival: float, asked: float | None = None) -> None:
        """A message with this stamp of the agent has arrived; it was asked for at ``asked``, if it was."""
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
    """What has been heard of one hand.

    Attributes:
        clock: from the agent's times to ours.
        newest: the newest of all messages; None before the first.
        status: the newest status; None before the first.
        state: where the hand is, as far as it is known: DISCONNECTED before the first message, and while the
            agent is silent.
        is_silent: whether nothing is heard of the agent.
        events: number of the newest event that was handed on.
        misrouted: messages that were about another gripper, and dropped.
        received_at: when the last one arrived that was current.
    """

    def __init__(
        self,
        mark: int,
        channels: Channels,
        entered: Callable[[State], None],
        before: Mirror | None = None,
        log: Log = log,
    ) -> None:
        """Mirror the gripper with this mark.

        Args:
            mark: see :attr:`~robotiq_async.fleet.wire.names.GripperName.mark`.
            channels: what happens is handed on there.
            entered: is told of each state.
            before: of the run before this one, if there was one: states and sequences go on from there.
            log: of the hand.
        """
        self.log = log
        self.clock = AgentClock()
        self.newest: StatusMessage | None = None
        self.status: RobotiqStatus | None = None
        self.state = State.DISCONNECTED
        self.is_silent = True
        self.events = 0
        self.misrouted = 0
        self.received_at = 0.0
        self._mark = mark
        self._channels = channels
        self._entered = entered
        self._is_over = False
        self._reported = State.DISCONNECTED if before is None else before.state
        """The state that the last transition led to: the next one begins there."""
        self._reported_at = 0.0
        self._events_state = State.DISCONNECTED
        """Where the events so far have led; statuses may be ahead of them."""
        self._pushed: RobotiqStatus | None = None
        """The last status that was handed on."""
        self._clocks: dict[int, AgentClock] = {}
        """Of each run of the agent that was heard, the present one last."""
        self._first = 0 if before is None else before.next_sequence
        self._base = 0
        """Added to the agent's sequences: they begin anew with each run of the agent, ours do not."""

    @property
    def stamp(self) -> float:
        """The newest stamp of the agent that was heard."""
        return 0.0 if self.newest is None else self.newest.stamp

    @property
    def epoch(self) -> int:
        """The run of the agent; 0 before its first message."""
        return 0 if self.newest is None else self.newest.epoch

    @property
    def next_sequence(self) -> int:
        """What no status has been numbered with, and none before it."""
        return self._first if self.status is None else self.status.sequence + 1

    def is_about_another(self, mark: object) -> bool:
        """Whether a message is about another gripper: it came under a wrong key, and is dropped."""
        if mark == self._mark:
            return False
        self.misrouted += 1
        return True

    def is_of_another_run(self, message: StatusMessage, arrival: float, window: float = WINDOW_S) -> bool:
        """Whether a message is of another run of the agent than the one that is followed.

        Either it is late; or two agents serve the gripper, and whoever has begun with one stays with it while
        it is heard: the other may serve another gripper under the same name. After one that has said that it
        ends comes the next.
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
        window: float = WINDOW_S,
        asked: float | None = None,
    ) -> bool:
        """A message has arrived. Returns whether it is current: one that was on its way for long is not.

        Args:
            message: about this gripper, and of the run that is followed, or is to be from now on.
            arrival: our time.
            in_turn: whether it came among the news, where every status has its turn. One that came with an
                answer has overtaken others: readers get theirs first.
            window: seconds for which it is current.
            asked: our time at which it was asked for; None if it was not.
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
        """Events have arrived. Returns whether some before them are missing: they wait for those."""
        for event in events:
            index = event["index"]
            if index > self.events + 1:
                return True
            if index == self.events + 1:
                self.events = index
                self._hand_on(event)
        return False

    def skip_events(self, index: int) -> None:
        """The agent has forgotten those up to this one."""
        self.events = max(self.events, index)

    def has_missed(self) -> bool:
        """Whether the agent has told of more events than have arrived."""
        return self.newest is not None and self.newest.events > self.events

    def renumbered(self, status: RobotiqStatus) -> RobotiqStatus:
        """A status that came within an answer, numbered as ours are."""
        return RobotiqStatus(status.registers, status.timestamp, self._base + status.sequence, status.model)

    def begin(self, at: float) -> None:
        """The run begins: nothing is heard yet."""
        self._report(State.DISCONNECTED, Trigger.ASK_START, at)

    def fall_silent(self, at: float) -> None:
        """Nothing is heard of the agent any more."""
        if not (self.is_silent or self._is_over):
            self.is_silent = True
            self.state = State.DISCONNECTED
            self._report(State.DISCONNECTED, Trigger.LINK_LOST, at)
            self._entered(State.DISCONNECTED)

    def shut_down(self, state: State, trigger: Trigger, at: float) -> None:
        """The run ends: what is still heard changes the state no more."""
        self._is_over = True
        self.state = state
        self._report(state, trigger, at)

    def _begin_run(self, message: StatusMessage, arrival: float) -> None:
        """Another run of the agent: its clock, its events and its polls are others."""
        self.fall_silent(arrival)
        # What is late from a run that was heard before is told by the clock of that run.
        self.clock = self._clocks.pop(message.epoch) if message.epoch in self._clocks else AgentClock()
        self._clocks[message.epoch] = self.clock
        while len(self._clocks) > _RUNS:
            del self._clocks[next(iter(self._clocks))]
        self.newest = None
        self.events = message.events
        self._events_state = as_seen_from_here(message.state)
        self._base = self.next_sequence if message.sequence < self.next_sequence else 0

    def _set_state(self, state: State, arrival: float) -> None:
        if self._is_over:
            return
        source, self.state = self.state, state
        if self.is_silent:
            self.is_silent = False
            # What came meanwhile, the events tell: they may be late.
            self._report(self._events_state, _SEEN.get(self._events_state, Trigger.SEEN_BUSY), arrival)
        if source is not state:
            self._entered(state)

    def _status(self, message: StatusMessage) -> RobotiqStatus | None:
        """The status that a message carries, as the reader gets it."""
        if message.registers is None:
            return None
        newest, sequence = self.status, self._base + message.sequence
        if newest is not None and newest.sequence == sequence:
            return newest
        # The guess of the clocks' difference becomes smaller and larger; the times that are told only rise.
        at = self.clock(message.stamp - message.age)
        for other in (self._pushed, newest):
            if other is not None:
                at = max(at, other.timestamp) if other.sequence < sequence else min(at, other.timestamp)
        return RobotiqStatus(message.registers, at, sequence, message.model)

    def _hand_on(self, event: Fields) -> None:
        with reading("an event"):
            if event["kind"] == "transition":
                self._apply(read_transition(event, self.clock))
            elif event["kind"] == "request":
                sent = read_request(event, self.clock)
                self._channels.requests.push(replace(sent, timestamp=self._in_order(sent.timestamp)))

    def _apply(self, transition: Transition) -> None:
        source, target = as_seen_from_here(transition.source), as_seen_from_here(transition.target)
        self._events_state = target
        if not (self.is_silent or self._is_over):
            # Those between, if any, the agent has forgotten.
            self._report(source, _SEEN.get(source, Trigger.SEEN_BUSY), transition.timestamp)
            self._report(target, transition.trigger, transition.timestamp)

    def _report(self, state: State, trigger: Trigger, at: float) -> None:
        """Hand on a change of state, if it is one."""
        source, self._reported = self._reported, state
        if source is not state:
            self._channels.transitions.push(Transition(source, state, trigger, self._in_order(at)))
            # Also a state that lasted too short for any message.
            self._entered(state)

    def _in_order(self, at: float) -> float:
        self._reported_at = max(self._reported_at, at)
        return self._reported_at
