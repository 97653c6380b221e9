"""The legal life of a hand: one table of state and trigger, and the one object that follows it.

Theory of operation
-------------------
Every state has an entry for every trigger: the state that follows, IGNORED where there is nothing to do or
nothing new, or the error that a caller gets. A refusal changes nothing.

What a status shows is never refused: the gripper does what it does. DO_ states and RUNNING_CC last from the
decision to send until the gripper has acknowledged, so that a lost link finds the hand in the state that
tells what was under way. How an activation, a release, a reset or a shutdown goes on is a generator (see
sequences.py) that :class:`StateMachine` runs; no register, clock or task is known here. The diagram and the
tables in docs/ are made from the table below.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from enum import Enum
from typing import Final

from ..runtime.log import Log, log
from ..values.enums import Fault, State
from ..values.errors import (
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
)
from ..values.request import Request
from ..values.status import RobotiqStatus
from ..values.trigger import Trigger
from .sequences import Sequence
from .triggers import classify


class Verdict(Enum):
    """What a trigger comes to where it leads to no state."""

    IGNORED = "nothing to do"
    LINK_DOWN = "ConnectionLostError"
    NOT_STARTED = "NotStartedError"
    NOT_ACTIVATED = "NotActivatedError"
    IN_FAULT = "GripperFaultError"
    NOT_NOW = "InvalidStateError"


Row = dict[Trigger, State | Verdict]
"""The entries of one state."""


def _all(triggers: tuple[Trigger, ...], entry: State | Verdict) -> Row:
    return dict.fromkeys(triggers, entry)


_STOPS: Final = (Trigger.ASK_HOLD, Trigger.ASK_HALT)
_MOTIONS: Final = (Trigger.ASK_ACTIVATE, Trigger.ASK_COMMAND)
_USER: Final = (*_MOTIONS, *_STOPS, Trigger.ASK_RELEASE, Trigger.ASK_RESET)
_SEEN: Final[Row] = {
    Trigger.SEEN_READY: State.RUNNING_IDLE,
    Trigger.SEEN_BUSY: State.WF_ACTIVATION,
    Trigger.SEEN_RESET: State.RESET,
    Trigger.SEEN_FAULT: State.FAULT,
    Trigger.SEEN_RELEASED: State.ATR_DONE,
}
_RUNNING: Final[Row] = _SEEN | {
    Trigger.ASK_ACTIVATE: Verdict.IGNORED,
    **_all((Trigger.ASK_COMMAND, *_STOPS), State.RUNNING_CC),
}
_FAULTY: Final[Row] = _SEEN | _all(_MOTIONS, Verdict.IN_FAULT)


def _row(entries: Row) -> Row:
    """What is usual in a sequence, and wherever the hand has its link, with entries of its own."""
    return {
        **{trigger: Verdict.IGNORED if trigger.is_seen else Verdict.NOT_NOW for trigger in Trigger},
        # No motion of a command is under way; and rACT = 0 is the only request that ends a sequence.
        Trigger.ASK_HOLD: Verdict.IGNORED,
        Trigger.ASK_HALT: State.DO_RESET,
        Trigger.ASK_RESET: State.DO_RESET,
        Trigger.ASK_STOP: State.DO_SHUTDOWN,
        Trigger.LINK_LOST: State.DISCONNECTED,
        **entries,
    }


_OFF: Final[Row] = _row(
    _all(_USER, Verdict.NOT_STARTED) | _all((Trigger.ASK_STOP, Trigger.LINK_LOST), Verdict.IGNORED)
)

TABLE: Final[dict[State, Row]] = {
    State.DISCONNECTED: _row(
        _SEEN
        | _all(_USER, Verdict.LINK_DOWN)
        | {Trigger.ASK_START: State.DISCONNECTED, Trigger.ACTIVATES: State.DO_ACTIVATION}
    ),
    State.DO_ACTIVATION: _row(
        {Trigger.ASK_ACTIVATE: Verdict.IGNORED, Trigger.DELIVERED: State.WF_ACTIVATION}
    ),
    State.WF_ACTIVATION: _row(_SEEN | {Trigger.ASK_ACTIVATE: Verdict.IGNORED}),
    State.RUNNING_IDLE: _row(_RUNNING),
    State.RUNNING_CC: _row(
        _RUNNING | {Trigger.SEEN_READY: State.RUNNING_CC, Trigger.DELIVERED: State.RUNNING_IDLE}
    ),
    State.FAULT: _row(_FAULTY | _all(_STOPS, State.FAULT) | {Trigger.ASK_RELEASE: State.DO_ATR}),
    State.DO_ATR: _row({Trigger.DELIVERED: State.WF_ATR}),
    State.WF_ATR: _row(_SEEN),
    State.ATR_DONE: _row(_FAULTY | {Trigger.ASK_HALT: Verdict.IGNORED}),
    State.DO_RESET: _row(
        _all((Trigger.ASK_HALT, Trigger.ASK_RESET), Verdict.IGNORED) | {Trigger.DELIVERED: State.WF_RESET}
    ),
    # A fault may outlast the request that clears it by a device cycle: only the reset itself counts.
    State.WF_RESET: _row({Trigger.SEEN_RESET: State.RESET}),
    State.RESET: _row(
        _SEEN
        | {
            Trigger.ASK_ACTIVATE: State.DO_ACTIVATION,
            Trigger.ASK_COMMAND: Verdict.NOT_ACTIVATED,
            Trigger.ASK_HALT: Verdict.IGNORED,
        }
    ),
    State.DO_SHUTDOWN: _OFF | {Trigger.STOPPED: State.SHUTDOWN},
    State.SHUTDOWN: _OFF | {Trigger.ASK_START: State.DISCONNECTED, Trigger.STOPPED: Verdict.IGNORED},
}
"""For every state and trigger the state that follows, IGNORED, or the error."""

RUNNING: Final = frozenset({State.RUNNING_IDLE, State.RUNNING_CC})
"""The states in which the gripper is active and takes commands."""
SEQUENCES: Final = frozenset(
    {State.DO_ACTIVATION, State.WF_ACTIVATION, State.DO_ATR, State.WF_ATR, State.DO_RESET, State.WF_RESET}
)
"""Activation, release and reset: they lead somewhere by themselves, and clearing rGTO ends none of them."""


def states_allowing(trigger: Trigger) -> frozenset[State]:
    """The states in which a trigger is not refused."""
    return frozenset(
        state
        for state, row in TABLE.items()
        if isinstance(row[trigger], State) or row[trigger] is Verdict.IGNORED
    )


class StateMachine:
    """The state of one hand, and the sequence under way. :meth:`fire` alone changes the state."""

    def __init__(
        self, changed: Callable[[State, State, Trigger], None] = lambda *_: None, *, log: Log = log
    ) -> None:
        """Start in DISCONNECTED; ``log`` is that of the hand."""
        self.log = log
        self.changed = changed
        """Called with source, target and trigger after each change of state."""
        self._state = State.DISCONNECTED
        self.sequence: Sequence | None = None
        """The one under way, for :meth:`begin`, :meth:`advance` and :meth:`drop_sequence` to change."""
        self.why_down: object = None
        """Why the link is down, for the error of what is refused then."""

    @property
    def state(self) -> State:
        """The present state."""
        return self._state

    def fire(self, trigger: Trigger, status: RobotiqStatus | None = None) -> bool:
        """Let something happen.

        Args:
            trigger: what happens.
            status: the newest one, for the error of what a fault refuses.

        Returns:
            Whether there is anything to do: False where the table says IGNORED.

        Raises:
            RobotiqError: the table refuses it; the state stays.
        """
        source = self._state
        target = TABLE[source][trigger]
        if target is source:
            return True  # quickly: most statuses show nothing new
        if target is Verdict.IGNORED:
            return False
        if isinstance(target, Verdict):
            raise refusal(trigger, source, status, self.why_down)
        self._state = target
        # A control loop goes to RUNNING_CC and back with every command: that is for the curious.
        level = logging.DEBUG if {source, target} <= RUNNING else logging.INFO
        self.log.log(level, "%s -> %s (%s)", source.name, target.name, trigger.value)
        self.changed(source, target, trigger)
        return True

    def delivered(self) -> None:
        """What was about to be sent has been acknowledged, or is not sent after all."""
        if isinstance(TABLE[self._state][Trigger.DELIVERED], State):
            self.fire(Trigger.DELIVERED)

    # -- the sequence under way ------------------------------------------------------------------------

    def begin(self, sequence: Sequence) -> None:
        """Run a sequence, in place of the one under way."""
        self.sequence = sequence
        next(sequence)

    def advance(self, status: RobotiqStatus) -> Request | None:
        """Hand a status to the sequence under way, and return what it wants written now.

        When that was its end, the state follows what the status shows.
        """
        assert self.sequence is not None, "a sequence is under way"
        try:
            return self.sequence.send(status)
        except StopIteration:
            pass
        except RobotiqError as error:
            self.log.warning("%s", error)
        self.sequence = None
        self.delivered()
        self.fire(classify(status))
        return None

    def drop_sequence(self) -> None:
        """Nothing more comes of the sequence under way."""
        self.sequence = None


def refusal(
    trigger: Trigger, state: State, status: RobotiqStatus | None = None, why_down: object = None
) -> RobotiqError:
    """The error for what the table refuses; ``why_down`` is why the link is, if that is known."""
    match TABLE[state][trigger]:
        case Verdict.LINK_DOWN:
            why = "" if why_down is None else f": {why_down}"
            return ConnectionLostError(f"the link is down and being opened again{why}")
        case Verdict.NOT_STARTED:
            return NotStartedError("the hand is not started")
        case Verdict.NOT_ACTIVATED:
            return NotActivatedError("the gripper is not activated: call activate() or recover()")
        case Verdict.IN_FAULT:
            return GripperFaultError(Fault.NONE if status is None else status.fault)
    allowed = states_allowing(trigger)
    names = ", ".join(sorted(each.name for each in allowed))
    return InvalidStateError(
        f"{trigger.value} is not possible in state {state.name}; possible in: {names or 'none'}",
        state,
        allowed,
    )
