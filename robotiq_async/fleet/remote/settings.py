"""Speed and force as this client has asked for them, for an agent that does not know them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from ...enums import AXES, Finger

KEPT: Final = ("speed", "force")
"""What a gripper keeps of a request, and does not show."""
Lease = tuple[int, int]
"""Epoch of the agent, and number of the lease."""


class Settings:
    """What each axis was asked for last, and under which lease the agent knows it.

    Speed and force have no echo. An agent that was started anew has its own, and a client that held the lease
    meanwhile may have set others: the next motion would be faster and stronger than its program asked for.
    """

    def __init__(self) -> None:
        """Whatever the agent has will do until something is asked for."""
        self._asked: dict[Finger, dict[str, int]] = {}
        self._known_under: Lease | None = None

    def note(self, axes: Finger, changes: Mapping[str, int | None], lease: Lease) -> None:
        """Axes were asked for something, and it was not refused."""
        if not self._asked:
            self._known_under = lease
        for name in KEPT:
            value = changes.get(name)
            if value is not None:
                for axis in AXES:
                    if axis in axes:
                        self._asked.setdefault(axis, {})[name] = value

    def to_give(self, lease: Lease) -> Mapping[Finger, Mapping[str, int]]:
        """What to ask for before anything moves under a lease: nothing if the agent knows it."""
        return {} if self._known_under == lease else self._asked

    def given(self, lease: Lease) -> None:
        """The agent has taken it in."""
        self._known_under = lease
