"""Transition and SentRequest: a change of a hand's state, and an image that was written."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, Self

from .enums import State, Trigger
from .model import model_of
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

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any]) -> Self:
        """The transition with this :meth:`as_dict`; KeyError or TypeError for other fields."""
        source, target, trigger = fields["source"], fields["target"], fields["trigger"]
        return cls(State[source], State[target], Trigger[trigger], fields["timestamp"])


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
            **{str(axis.name): asdict(wanted) for axis, wanted in request.by_axis},
        }

    def as_raw(self) -> dict[str, Any]:
        """The fewest figures that :meth:`from_raw` needs, in types that JSON accepts."""
        return {
            "registers": self.request.registers,
            "model": self.request.model.name,
            "timestamp": self.timestamp,
            "acknowledged": self.acknowledged,
        }

    @classmethod
    def from_raw(cls, fields: Mapping[str, Any]) -> Self:
        """The image with this :meth:`as_raw`; KeyError, TypeError or ValueError for other fields."""
        request = Request.from_registers(fields["registers"], model_of(fields.get("model")))
        return cls(request, fields["timestamp"], bool(fields["acknowledged"]))
