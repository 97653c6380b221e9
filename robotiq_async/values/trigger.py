"""Trigger: the events of the state machine."""

from __future__ import annotations

from enum import Enum


class Trigger(Enum):
    """An event that can change the state of a hand.

    ``ASK_`` marks a call of the user, ``SEEN_`` a condition that a status shows; the others concern the link
    and the delivery of a request.
    """

    __hash__ = object.__hash__  # see State

    ASK_START = "start()"
    ASK_ACTIVATE = "activate()"
    ASK_COMMAND = "a command"
    ASK_HOLD = "hold()"
    ASK_HALT = "halt()"
    ASK_RELEASE = "atr()"
    ASK_RESET = "reset()"
    ASK_STOP = "stop()"
    ACTIVATES = "gripper is reset, and is to be activated"
    DELIVERED = "request acknowledged"
    SEEN_READY = "gripper is active"
    SEEN_BUSY = "gripper is activating"
    SEEN_RESET = "gripper is reset"
    SEEN_FAULT = "gripper reports a fault"
    SEEN_RELEASED = "automatic release completed"
    LINK_LOST = "link lost"
    STOPPED = "shutdown finished"

    @property
    def is_seen(self) -> bool:
        """Whether a status shows this."""
        return self.name.startswith("SEEN_")
