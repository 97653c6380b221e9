"""MoveResult: the result of a move."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

from .enums import JAW, Finger, ObjectStatus, names_of
from .frozen_mapping import FrozenMapping
from .status import RobotiqStatus, milliampere


@dataclass(frozen=True, slots=True, repr=False)
class MoveResult:
    """The result of a move. A contact is a result, not an error.

    Immutable; can be compared, hashed, copied and pickled.

    Attributes:
        outcomes: the outcome of each addressed axis.
        positions: final position of each addressed axis, in counts.
        contacts: the addressed axes that a contact stopped.
        reached: the addressed axes that end within 2 counts of the target, or at the end of the stroke for a
            target beyond it. An axis whose fingertips end elsewhere is at position, and not in here.
        duration: seconds from the call to the status that ended the move.
        peak_current_ma: highest motor current seen of each addressed axis, in milliamperes; None where the
            link does not carry it.
        status: the status that ended the move.
    """

    outcomes: Mapping[Finger, ObjectStatus]
    positions: Mapping[Finger, int]
    contacts: Finger
    reached: Finger
    duration: float
    peak_current_ma: Mapping[Finger, int | None]
    status: RobotiqStatus

    def __post_init__(self) -> None:
        for name in ("outcomes", "positions", "peak_current_ma"):
            object.__setattr__(self, name, FrozenMapping(getattr(self, name)))

    def opening_mm(self, finger: Finger | int) -> float:
        """The opening at a finger when the move ended, in millimetres; as ``status.opening_mm(finger)``.

        Of a jaw it is the width between its fingertips: ``result.opening_mm(JAW)``.

        Raises:
            TypeError, ValueError: as :meth:`RobotiqStatus.opening_mm`.
        """
        return self.status.opening_mm(finger)

    @property
    def object_detected(self) -> bool:
        """Whether a contact stopped at least one addressed axis."""
        return bool(self.contacts)

    def as_dict(self) -> dict[str, Any]:
        """The result in types that JSON and pandas accept; enumerations and masks as in a status.

        The key of each axis holds its ``outcome``, ``position``, of a finger ``opening_mm``, ``reached`` and
        ``peak_current_ma``, which is left out where the link does not carry it.
        """
        return {
            "duration": self.duration,
            "object_detected": self.object_detected,
            "contacts": names_of(self.contacts),
            **{
                str(axis.name): {
                    "outcome": self.outcomes[axis].name,
                    "position": self.positions[axis],
                    **({} if axis is Finger.SCISSOR else {"opening_mm": self.opening_mm(axis)}),
                    "reached": axis in self.reached,
                    **({} if (peak := self.peak_current_ma[axis]) is None else {"peak_current_ma": peak}),
                }
                for axis in self.outcomes
            },
            "status": self.status.as_dict(),
        }

    @classmethod
    def from_dict(cls, fields: Mapping[str, Any], status: RobotiqStatus) -> Self:
        """The result with this :meth:`as_dict`, and the status in it.

        Raises:
            KeyError, TypeError, ValueError: the fields are of no result.
        """
        axes = {axis: fields[str(axis.name)] for axis in Finger.ALL if axis.name in fields}
        return cls(
            outcomes={axis: ObjectStatus[end["outcome"]] for axis, end in axes.items()},
            positions={axis: int(end["position"]) for axis, end in axes.items()},
            contacts=Finger(sum(Finger[name] for name in fields["contacts"])),
            reached=Finger(sum(axis for axis, end in axes.items() if end["reached"])),
            duration=float(fields["duration"]),
            peak_current_ma={
                axis: int(end["peak_current_ma"]) if "peak_current_ma" in end else None
                for axis, end in axes.items()
            },
            status=status,
        )

    def __repr__(self) -> str:
        axes = ", ".join(
            f"{axis}={self.positions.get(axis)} {how.name}{milliampere(self.peak_current_ma.get(axis))}"
            for axis, how in self.outcomes.items()
        )
        opening = f", {self.opening_mm(JAW):.1f} mm open" if len(self.status.model.axes) == 1 else ""
        return f"<MoveResult {axes} in {self.duration:.3f} s{opening}>"
