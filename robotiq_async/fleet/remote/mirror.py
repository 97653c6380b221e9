"""Mirror: what a client knows of a hand on another host, from what it has heard."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import Final

from ...control.triggers import Trigger
from ...enums import State
from ...errors import ProtocolError
from ...log import log
from ...session.streams import Channels, Transition
from ...wire.status import RobotiqStatus
from ..control.lease import WINDOW_S
from ..wire.status_message import StatusMessage
from ..wire.values import Fields, read_request, read_transition

_RUNS: Final = 16
"""So many runs of an agent are told apart."""
DRIFT: Final = 200e-6
"""How far two clocks may part: seconds a second."""
_SEEN: Final = {
    State.RUNNING_IDLE: Trigger.SEEN_READY,
    State.RUNNING_CC: Trigger.SEEN_READY,
    State.FAULT: Trigger.SEEN_FAULT,
    State.ATR_DONE: Trigger.SEEN_RELEASED,
    State.RESET: Trigger.SEEN_RESET,
}


class AgentClock:
    """Makes times of this process of times of the agent.

    A message takes at least no time. So the smallest difference of arrival and stamp is the best guess of how
    far the clocks are apart; it may grow slowly, for clocks drift. What an answer says was said after its
    question: a smaller difference cannot be (the agent's host was suspended, and its clock with it).
    """

    def __init__(self) -> None:
        """Know nothing yet."""
        self._offset: float | None = None
        self._at = 0.0

    def hear(self, stamp: float, arrival: float, asked: float | None = None) -> None:
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
        """The time of this process at a time of the agent."""
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
    """

    def __init__(self, mark: int, channels: Channels, entered: Callable[[State], None]) -> None:
        """Mirror the gripper with this mark; ``entered`` is told of each state."""
        self.clock = AgentClock()
        self.newest: StatusMessage | None = None
        self.status: RobotiqStatus | None = None
        self.state = State.DISCONNECTED
        self.is_silent = True
        self.events = 0
        self.misrouted = 0
        self._mark = mark
        self._channels = channels
        self._entered = entered
        self._pushed = -1
        """Sequence of the last status that was handed on."""
        self._clocks: dict[int, AgentClock] = {}
        """Of each run of the agent that was heard, the present one last."""
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

    def is_about_another(self, mark: object) -> bool:
        """Whether a message is about another gripper: it came under a wrong key, and is dropped."""
        if mark == self._mark:
            return False
        self.misrouted += 1
        log.warning("a message about another gripper was dropped (%d so far)", self.misrouted)
        return True

    def is_superseded(self, message: StatusMessage, arrival: float, window: float = WINDOW_S) -> bool:
        """Whether a message is of a run of the agent that another one has followed.

        Either it was late; or two agents serve the gripper, and that other one is heard.
        """
        clock = self._clocks.get(message.epoch)
        if message.epoch == self.epoch or clock is None:
            return False
        return not self.is_silent or arrival - clock(message.stamp) > window

    def hear(
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
            message: about this gripper, and not superseded.
            arrival: our time.
            in_turn: whether it came among the news, where every status has its turn. One that came with an
                answer has overtaken others: readers get theirs first.
            window: seconds for which it is current.
            asked: our time at which it was asked for; None if it was not.
        """
        if message.epoch != self.epoch:
            self._begin_anew(message)
        self.clock.hear(message.stamp, arrival, asked)
        is_current = arrival - self.clock(message.stamp) <= window
        status = self._status(message)
        if message.stamp >= self.stamp:
            self.newest = message
            self.status = status or self.status
            if is_current:
                self._enter(message.state, arrival)
        if in_turn and status is not None and status.sequence > self._pushed:
            self._pushed = status.sequence
            self._channels.statuses.push(status)
        return is_current

    def hear_events(self, events: Iterable[Fields]) -> bool:
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

    def fall_silent(self, at: float) -> None:
        """Nothing is heard of the agent any more."""
        if not self.is_silent:
            self.is_silent = True
            source, self.state = self.state, State.DISCONNECTED
            if source is not State.DISCONNECTED:
                self._tell(Transition(source, State.DISCONNECTED, Trigger.LINK_LOST, at))
            self._entered(State.DISCONNECTED)

    def _begin_anew(self, message: StatusMessage) -> None:
        """Another run of the agent: its clock, its events and its polls are others."""
        # What is late from a run that was heard before is told by the clock of that run.
        self.clock = self._clocks.pop(message.epoch) if message.epoch in self._clocks else AgentClock()
        self._clocks[message.epoch] = self.clock
        while len(self._clocks) > _RUNS:
            del self._clocks[next(iter(self._clocks))]
        self.newest = None
        self.events = message.events
        if self.status is not None:
            self._base = self.status.sequence + 1

    def _enter(self, state: State, arrival: float) -> None:
        source, self.state = self.state, state
        if self.is_silent:
            self.is_silent = False
            if state is not State.DISCONNECTED:
                self._tell(Transition(source, state, _SEEN.get(state, Trigger.SEEN_BUSY), arrival))
        if source is not state:
            self._entered(state)

    def _status(self, message: StatusMessage) -> RobotiqStatus | None:
        """The status that a message carries, as the reader gets it."""
        if message.registers is None:
            return None
        before, sequence = self.status, self._base + message.sequence
        if before is not None and before.sequence == sequence:
            return before
        at = self.clock(message.stamp - message.age)
        if before is not None and before.sequence < sequence:
            at = max(at, before.timestamp)  # the guess of the clocks' difference may have become smaller
        return RobotiqStatus(message.registers, at, sequence)

    def _hand_on(self, event: Fields) -> None:
        try:
            if event["kind"] == "transition":
                self._tell(read_transition(event, self.clock))
            elif event["kind"] == "request":
                self._channels.requests.push(read_request(event, self.clock))
        except (KeyError, TypeError, ValueError) as error:
            raise ProtocolError(f"the agent sent an event that cannot be read: {event!r:.200}") from error

    def _tell(self, transition: Transition) -> None:
        self._channels.transitions.push(transition)
        # Also a state that lasted too short for any message.
        self._entered(transition.target)
