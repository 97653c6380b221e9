"""Transition and SentRequest: a change of a hand's state, and an image that was written."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from .enums import State, Trigger
from .request import Request


@dataclass(frozen=True, slots=True)
class Transition:
    """A change of state.

    Attributes:
        source: the state before.
        target: the state after.
        trigger: its cause.
        timestamp: monotonic seconds, on the clock of the statuses.
    """

    source: State
    target: State
    trigger: Trigger
    timestamp: float

    def as_dict(self) -> dict[str, Any]:
        """The transition in types that JSON and pandas accept; states and trigger by name."""
        return {
            "timestamp": self.timestamp,
            "source": self.source.name,
            "target": self.target.name,
            "trigger": self.trigger.name,
        }


@dataclass(frozen=True, slots=True)
class SentRequest:
    """A request image that was written.

    Attributes:
        request: the image.
        timestamp: monotonic seconds at which it was sent, on the clock of the statuses.
        acknowledged: whether the gripper acknowledged it; if not, it may still have arrived.
    """

    request: Request
    timestamp: float
    acknowledged: bool

    def as_dict(self) -> dict[str, Any]:
        """The image in types that JSON and pandas accept, with the attributes of the request.

        The key of each axis holds its ``position``, ``speed`` and ``force``.
        """
        request = self.request
        return {
            "timestamp": self.timestamp,
            "acknowledged": self.acknowledged,
            "registers": list(request.registers),
            "activate": request.activate,
            "go": request.go,
            "release": request.release,
            "mode": request.mode.name,
            "individual_fingers": request.individual_fingers,
            "individual_scissor": request.individual_scissor,
            **{str(axis.name): asdict(asked) for axis, asked in request.by_axis},
        }
