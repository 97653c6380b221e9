"""The calls that every hand has, with arguments."""

from __future__ import annotations

import inspect
from typing import Any

from robotiq_async import Finger, State

A = Finger.A
CALLS: dict[str, dict[str, Any]] = {
    "move": {"fingers": A, "position": 3, "speed": 3, "force": 3, "timeout": 1.0},
    "open": {"fingers": A, "speed": 3, "force": 3, "timeout": 1.0},
    "close": {"fingers": A, "speed": 3, "force": 3, "timeout": 1.0},
    "grasp": {"fingers": A, "at_least": 1, "speed": 3, "force": 3, "timeout": 1.0},
    "set_position": {"fingers": A, "value": 3},
    "set_speed": {"fingers": A, "value": 3},
    "set_force": {"fingers": A, "value": 3},
    "command": {"fingers": A, "position": 3, "speed": 3, "force": 3},
    "hold": {"fingers": A},
    "halt": {},
    "reset": {},
    "activate": {},
    "atr": {},
    "recover": {"timeout": 1.0},
    "wait_for_state": {"states": (State.FAULT,), "timeout": 1.0},
    "stop": {},
    "statuses": {"buffer": 3, "lost_after": 1.0},
    "transitions": {},
    "requests": {"buffer": 3},
    "grip_events": {"fingers": A, "slip": 3},
}
"""The calls of a hand, with valid arguments in the order in which they are checked."""
STREAMS = ("statuses", "transitions", "requests", "grip_events")
COMMANDS = [name for name in CALLS if name not in (*STREAMS, "wait_for_state", "stop")]


async def called(hand: Any, name: str, **changed: Any) -> None:
    """Make a call of the table, with other arguments where they are given."""
    arguments = CALLS.get(name, {}) | changed
    outcome = getattr(hand, name)(*arguments.pop("states", ()), **arguments)
    if inspect.isawaitable(outcome):
        await outcome
