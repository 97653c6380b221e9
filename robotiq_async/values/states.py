"""The states of a hand: their order, and the answer of each state to a call.

Every state has an entry for every trigger: the next state, IGNORED where there is nothing to do, or the
error that the caller gets. A refusal changes nothing. A status is never refused. The table comes
from three rules and 18 entries for the exceptions.

DO_ states and RUNNING_CC last from the call until the acknowledgement, so the last state before DISCONNECTED
names the write that may be lost; DO_SHUTDOWN lasts until the hand has stopped. The diagram and the tables in
docs/ are made from the table below.
"""

from __future__ import annotations

from enum import Enum
from typing import Final

from .enums import Fault, State, Trigger
from .errors import (
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
    MotionInhibitedError,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
)
from .inhibit import Inhibit
from .status import RobotiqStatus


class Verdict(Enum):
    """The result of a trigger that leads to no state."""

    IGNORED = "nothing to do"
    LINK_DOWN = "ConnectionLostError"
    NOT_STARTED = "NotStartedError"
    NOT_ACTIVATED = "NotActivatedError"
    IN_FAULT = "GripperFaultError"
    NOT_NOW = "InvalidStateError"


_REFUSALS: Final = frozenset(Verdict) - {Verdict.IGNORED}
Row = dict[Trigger, State | Verdict]  # the entries of one state


def _all(triggers: tuple[Trigger, ...], entry: State | Verdict) -> Row:
    return dict.fromkeys(triggers, entry)


# First rule: the outcome of a call wherever the link is up, in _row(). Second: the condition that a status
# shows leads to its state, wherever no procedure runs, in SEEN. Third: a hand that is off refuses, in _OFF.
_STOPS: Final = (Trigger.ASK_HOLD, Trigger.ASK_HALT)
_STARTING: Final = (Trigger.ASK_ACTIVATE, Trigger.ASK_COMMAND)
_USER: Final = (*_STARTING, *_STOPS, Trigger.ASK_RELEASE, Trigger.ASK_RESET, Trigger.HALT_RESETS)
SEEN: Final = {
    Trigger.SEEN_READY: State.RUNNING_IDLE,
    Trigger.SEEN_BUSY: State.WF_ACTIVATION,
    Trigger.SEEN_RESET: State.RESET,
    Trigger.SEEN_STRANDED: State.RESET,  # an activation resets it first
    Trigger.SEEN_FAULT: State.FAULT,
    Trigger.SEEN_RELEASED: State.ATR_DONE,
}
_AS_SEEN: Final[Row] = {**SEEN}  # the same as a Row: the types of a dictionary are its own
_WHILE_RUNNING: Final[Row] = _AS_SEEN | {
    Trigger.ASK_ACTIVATE: Verdict.IGNORED,
    **_all((Trigger.ASK_COMMAND, *_STOPS), State.RUNNING_CC),
}
_FAULTY: Final[Row] = _AS_SEEN | _all(_STARTING, Verdict.IN_FAULT)


def _row(entries: Row) -> Row:
    """The usual entries while the link is up, with ``entries`` instead of some."""
    return {
        **{trigger: Verdict.IGNORED if trigger.is_seen else Verdict.NOT_NOW for trigger in Trigger},
        # In a sequence no axis moves by a command, and only rACT = 0 ends it.
        Trigger.ASK_HOLD: Verdict.IGNORED,
        **_all((Trigger.ASK_HALT, Trigger.HALT_RESETS, Trigger.ASK_RESET), State.DO_RESET),
        Trigger.ASK_STOP: State.DO_SHUTDOWN,
        Trigger.LINK_LOST: State.DISCONNECTED,
        **entries,
    }


_OFF: Final[Row] = _row(
    _all(_USER, Verdict.NOT_STARTED) | _all((Trigger.ASK_STOP, Trigger.LINK_LOST), Verdict.IGNORED)
)

TABLE: Final[dict[State, Row]] = {
    State.DISCONNECTED: _row(
        _AS_SEEN
        | _all(_USER, Verdict.LINK_DOWN)
        | {Trigger.ASK_START: State.DISCONNECTED, Trigger.ACTIVATES: State.DO_ACTIVATION}
    ),
    # While a procedure sends or waits, it judges each status itself (see procedures.py). WF_ states that
    # another client has begun follow each status, as this client then waits for nothing.
    State.DO_ACTIVATION: _row(
        {Trigger.ASK_ACTIVATE: Verdict.IGNORED, Trigger.DELIVERED: State.WF_ACTIVATION}
    ),
    State.WF_ACTIVATION: _row(_AS_SEEN | {Trigger.ASK_ACTIVATE: Verdict.IGNORED}),
    State.RUNNING_IDLE: _row(_WHILE_RUNNING),
    State.RUNNING_CC: _row(
        _WHILE_RUNNING | {Trigger.SEEN_READY: State.RUNNING_CC, Trigger.DELIVERED: State.RUNNING_IDLE}
    ),
    # Holds and halts are sent in a fault: no motion may resume when a minor one clears [manual 2012, 4.7].
    State.FAULT: _row(_FAULTY | _all(_STOPS, State.FAULT) | {Trigger.ASK_RELEASE: State.DO_ATR}),
    State.DO_ATR: _row({Trigger.DELIVERED: State.WF_ATR}),
    State.WF_ATR: _row(_AS_SEEN),
    State.ATR_DONE: _row(_FAULTY | {Trigger.ASK_HALT: Verdict.IGNORED}),
    State.DO_RESET: _row(
        _all((Trigger.ASK_HALT, Trigger.HALT_RESETS, Trigger.ASK_RESET), Verdict.IGNORED)
        | {Trigger.DELIVERED: State.WF_RESET}
    ),
    # A fault may show for a device cycle after the reset was written: only the reset itself counts.
    State.WF_RESET: _row({Trigger.SEEN_RESET: State.RESET}),
    State.RESET: _row(
        _AS_SEEN
        | {
            Trigger.ASK_ACTIVATE: State.DO_ACTIVATION,
            Trigger.ASK_COMMAND: Verdict.NOT_ACTIVATED,
            Trigger.ASK_HALT: Verdict.IGNORED,
        }
    ),
    State.DO_SHUTDOWN: _OFF | {Trigger.STOPPED: State.SHUTDOWN},
    State.SHUTDOWN: _OFF | {Trigger.ASK_START: State.DISCONNECTED, Trigger.STOPPED: Verdict.IGNORED},
}
"""The next state, IGNORED or the error, for every state and trigger."""

RUNNING: Final = frozenset({State.RUNNING_IDLE, State.RUNNING_CC})
"""The states in which the gripper is active and takes commands."""
SEQUENCES: Final = frozenset(
    {State.DO_ACTIVATION, State.WF_ACTIVATION, State.DO_ATR, State.WF_ATR, State.DO_RESET, State.WF_RESET}
)
"""The states of an activation, a release and a reset. Clearing rGTO ends none of these."""

MOVES: Final = frozenset({Trigger.ASK_COMMAND, Trigger.ASK_ACTIVATE, Trigger.ASK_RELEASE})
"""Triggers that an inhibit refuses. A command of speed alone passes; HALT, HOLD, RESET and STOP always do."""


def states_allowing(trigger: Trigger) -> frozenset[State]:
    return frozenset(state for state, row in TABLE.items() if row[trigger] not in _REFUSALS)


def check(
    trigger: Trigger,
    state: State,
    status: RobotiqStatus | None = None,
    inhibited: Inhibit | None = None,
    why_down: object = None,
) -> bool:
    """Whether there is anything to do for a trigger. Raises the error if the table or an inhibit refuses it.

    ``inhibited`` counts for triggers that may move or press.
    """
    if inhibited is not None and trigger in MOVES:
        raise MotionInhibitedError(inhibited)
    answer = TABLE[state][trigger]
    if answer in _REFUSALS:
        raise refusal(trigger, state, status, why_down)
    return answer is not Verdict.IGNORED


def refusal(
    trigger: Trigger, state: State, status: RobotiqStatus | None = None, why_down: object = None
) -> RobotiqError:
    """Make the error for a trigger that the table refuses."""
    match TABLE[state][trigger]:
        case Verdict.LINK_DOWN:
            why = "" if why_down is None else f": {why_down}"
            return ConnectionLostError(f"the link is down and being opened again{why}")
        case Verdict.NOT_STARTED:
            return NotStartedError("the hand is not started")
        case Verdict.NOT_ACTIVATED:
            return NotActivatedError("the gripper is not activated", advice="call activate() or recover()")
        case Verdict.IN_FAULT:
            return GripperFaultError(Fault.NONE if status is None else status.fault)
    allowed = states_allowing(trigger)
    names = ", ".join(sorted(each.name for each in allowed))
    waits = "activate() waits for it, and recover() also resets a gripper that is stuck"
    is_activating = state in (State.DO_ACTIVATION, State.WF_ACTIVATION)
    return InvalidStateError(
        f"{trigger.value} is not possible in state {state.name}; possible in: {names or 'none'}",
        state,
        allowed,
        advice=waits if is_activating and trigger is Trigger.ASK_COMMAND else "",
    )
