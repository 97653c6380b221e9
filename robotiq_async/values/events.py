"""What happens to a hand: changes of its state, and requests that were written."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any

from .enums import AXES, State
from .request import Request
from .trigger import Trigger


@dataclass(frozen=True, slots=True)
class Transition:
    """One change of state.

    Attributes:
        source: the state before.
        target: the state after.
        trigger: what made it happen.
        timestamp: monotonic seconds, by the clock of the statuses.
    """

    source: State
    target: State
    trigger: Trigger
    timestamp: float

    def as_dict(self) -> dict[str, Any]:
        """All of it in types that JSON and pandas take; states and trigger by name."""
        return {
            "timestamp": self.timestamp,
            "source": self.source.name,
            "target": self.target.name,
            "trigger": self.trigger.name,
        }


@dataclass(frozen=True, slots=True)
class SentRequest:
    """One image that was written.

    Attributes:
        request: the image.
        timestamp: monotonic seconds, by the clock of the statuses, at which it was sent.
        acknowledged: whether the gripper has acknowledged it; if not, it may have arrived or not.
    """

    request: Request
    timestamp: float
    acknowledged: bool

    def as_dict(self) -> dict[str, Any]:
        """All of it in types that JSON and pandas take, the request's attributes beside its own.

        What is asked of one axis stands below its name: ``position``, ``speed`` and ``force``.
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
            **{str(axis.name): asdict(asked) for axis, asked in zip(AXES, request.axes, strict=True)},
        }
