"""The legal life of the hand, as one table, and the one function that changes its state.

Theory of operation
-------------------
Three kinds of events move the hand from state to state:

* what its user asks for (``ASK_``): refused, with a list of the states that would do, where the table
  has no entry. A refusal changes nothing.
* what a status shows (``SEEN_``): every status is one of five sights, see :func:`look`. The gripper does
  what it does, so a sight is never refused; where the table has no entry it says nothing new.
* what became of the link and of a request (``DELIVERED``, ``LINK_LOST``, ``STOPPED``).

A state that is only passed through is still a state: DO_ states and RUNNING_CC last from the decision to
send until the gripper has acknowledged, so that a lost link finds the hand in the state that tells what
was under way. How the hand gets from one state to another is in procedures.py; this module does not know
registers that are sent, clocks or tasks. The diagram in docs/ is drawn from the table below.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from enum import Enum
from functools import cache
from typing import Final

from ..enums import Fault, Initialization, State
from ..errors import InvalidStateError
from ..log import log
from ..wire.status import RobotiqStatus


class Trigger(Enum):
    """What can happen to the hand."""

    __hash__ = object.__hash__  # see State

    ASK_START = "start()"
    ASK_ACTIVATE = "activate()"
    ASK_COMMAND = "a command"
    ASK_HALT = "halt()"
    ASK_RELEASE = "atr()"
    ASK_RESET = "reset()"
    ASK_STOP = "stop()"
    DELIVERED = "request acknowledged"
    SEEN_READY = "gripper is active"
    SEEN_BUSY = "gripper is activating"
    SEEN_RESET = "gripper is reset"
    SEEN_FAULT = "gripper reports a fault"
    SEEN_RELEASED = "automatic release completed"
    LINK_LOST = "link lost"
    STOPPED = "shutdown finished"

    @property
    def is_sight(self) -> bool:
        """Whether this is something a status shows."""
        return self.name.startswith("SEEN_")


def look(status: RobotiqStatus) -> Trigger:
    """What a status shows of the gripper's state.

    A serious fault comes first, because gIMC = 0 with a fault is an automatic release and not a reset.
    """
    # gACT, gIMC and gFLT decide; they rarely change, and this runs at every poll.
    first, second = status.registers[:2]
    return _look(first >> 8, second >> 8 & 0x0F)


@cache
def _look(activation: int, fault: int) -> Trigger:
    """The same, from the byte that holds gACT and gIMC, and from gFLT."""
    status = RobotiqStatus((activation << 8, fault << 8, 0, 0, 0, 0, 0, 0))
    if status.fault is Fault.AUTOMATIC_RELEASE_DONE:
        return Trigger.SEEN_RELEASED
    if status.fault.is_serious:
        return Trigger.SEEN_FAULT
    if not status.activation_echo and status.initialization is Initialization.RESET:
        return Trigger.SEEN_RESET
    if status.activation_echo and status.is_activated:
        return Trigger.SEEN_READY
    return Trigger.SEEN_BUSY


# Rows shared by states. A connected hand can always be stopped and can always lose its link.
_CONNECTED: Final = {
    Trigger.ASK_STOP: State.DO_SHUTDOWN,
    Trigger.LINK_LOST: State.DISCONNECTED,
}
# An emergency is heard in every sequence; rACT = 0 is the only request that ends one.
_EMERGENCY: Final = {
    Trigger.ASK_HALT: State.DO_RESET,
    Trigger.ASK_RESET: State.DO_RESET,
}
_SIGHTS: Final = {
    Trigger.SEEN_READY: State.RUNNING_IDLE,
    Trigger.SEEN_BUSY: State.WF_ACTIVATION,
    Trigger.SEEN_RESET: State.RESET,
    Trigger.SEEN_FAULT: State.FAULT,
    Trigger.SEEN_RELEASED: State.ATR_DONE,
}

TRANSITIONS: Final[dict[State, dict[Trigger, State]]] = {
    State.DISCONNECTED: {
        **_SIGHTS,
        Trigger.ASK_START: State.DISCONNECTED,
        # start() and the reconnect policy activate straight from here: RESET is never shown on the way.
        Trigger.ASK_ACTIVATE: State.DO_ACTIVATION,
        Trigger.ASK_STOP: State.DO_SHUTDOWN,
        Trigger.LINK_LOST: State.DISCONNECTED,
    },
    State.DO_ACTIVATION: {**_CONNECTED, **_EMERGENCY, Trigger.DELIVERED: State.WF_ACTIVATION},
    State.WF_ACTIVATION: {**_CONNECTED, **_EMERGENCY, **_SIGHTS},
    State.RUNNING_IDLE: {
        **_CONNECTED,
        **_SIGHTS,
        Trigger.ASK_COMMAND: State.RUNNING_CC,
        Trigger.ASK_HALT: State.RUNNING_CC,
        Trigger.ASK_RESET: State.DO_RESET,
    },
    State.RUNNING_CC: {
        **_CONNECTED,
        **_SIGHTS,
        Trigger.SEEN_READY: State.RUNNING_CC,
        Trigger.ASK_COMMAND: State.RUNNING_CC,
        Trigger.ASK_HALT: State.RUNNING_CC,
        Trigger.DELIVERED: State.RUNNING_IDLE,
        Trigger.ASK_RESET: State.DO_RESET,
    },
    State.FAULT: {
        **_CONNECTED,
        **_SIGHTS,
        Trigger.ASK_HALT: State.FAULT,
        Trigger.ASK_RELEASE: State.DO_ATR,
        Trigger.ASK_RESET: State.DO_RESET,
    },
    State.DO_ATR: {**_CONNECTED, **_EMERGENCY, Trigger.DELIVERED: State.WF_ATR},
    State.WF_ATR: {
        **_CONNECTED,
        **_EMERGENCY,
        Trigger.SEEN_RELEASED: State.ATR_DONE,
        Trigger.SEEN_RESET: State.RESET,
    },
    State.ATR_DONE: {
        **_CONNECTED,
        **_SIGHTS,
        Trigger.ASK_HALT: State.ATR_DONE,
        Trigger.ASK_RESET: State.DO_RESET,
    },
    State.DO_RESET: {**_CONNECTED, **_EMERGENCY, Trigger.DELIVERED: State.WF_RESET},
    # A fault may outlast the request that clears it by a device cycle: only the reset itself counts.
    State.WF_RESET: {**_CONNECTED, **_EMERGENCY, Trigger.SEEN_RESET: State.RESET},
    State.RESET: {
        **_CONNECTED,
        **_SIGHTS,
        Trigger.ASK_ACTIVATE: State.DO_ACTIVATION,
        Trigger.ASK_HALT: State.RESET,
        Trigger.ASK_RESET: State.DO_RESET,
    },
    State.DO_SHUTDOWN: {Trigger.LINK_LOST: State.DO_SHUTDOWN, Trigger.STOPPED: State.SHUTDOWN},
    State.SHUTDOWN: {Trigger.ASK_START: State.DISCONNECTED},
}

RUNNING: Final = frozenset({State.RUNNING_IDLE, State.RUNNING_CC})
"""The states in which the gripper is active and takes commands."""


SEQUENCES: Final = frozenset(
    {State.DO_ACTIVATION, State.WF_ACTIVATION, State.DO_ATR, State.WF_ATR, State.DO_RESET, State.WF_RESET}
)
"""Activation, release and reset: they lead somewhere by themselves, and clearing rGTO ends none of them."""


def states_allowing(trigger: Trigger) -> frozenset[State]:
    """The states in which the table has an entry for a trigger."""
    return frozenset(state for state, row in TRANSITIONS.items() if trigger in row)


class Machine:
    """The state of one hand. :meth:`happen` is the one place that changes it."""

    def __init__(self, changed: Callable[[State, State, Trigger], None] = lambda *_: None) -> None:
        """Start in DISCONNECTED.

        Args:
            changed: called with source, target and trigger after each change of state.
        """
        self._state = State.DISCONNECTED
        self._changed = changed

    @property
    def state(self) -> State:
        """The present state."""
        return self._state

    def happen(self, trigger: Trigger) -> State:
        """Let something happen and return the state that follows.

        Raises:
            InvalidStateError: the table has no entry, and the trigger is not a sight; the state stays.
        """
        target = TRANSITIONS[self._state].get(trigger)
        if target is None:
            if trigger.is_sight:
                return self._state
            raise refusal(trigger, self._state)
        if target is not self._state:
            source, self._state = self._state, target
            # A control loop goes to RUNNING_CC and back with every command: that is for the curious.
            level = logging.DEBUG if {source, target} <= RUNNING else logging.INFO
            log.log(level, "%s -> %s (%s)", source.name, target.name, trigger.value)
            self._changed(source, target, trigger)
        return target


def refusal(trigger: Trigger, state: State) -> InvalidStateError:
    """The error for something that the table does not allow."""
    allowed = states_allowing(trigger)
    names = ", ".join(sorted(each.name for each in allowed))
    return InvalidStateError(
        f"{trigger.value} is not possible in state {state.name}; possible in: {names or 'none'}",
        state,
        allowed,
    )
