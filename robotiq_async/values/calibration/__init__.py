"""What the values 0..255 mean: speeds, forces and closing times, of the thesis or of one's own gripper."""

from .scales import (
    NOMINAL_FORCES_N,
    NOMINAL_SPEEDS_MM_S,
    STROKE_MM,
    ForceCalibration,
    SpeedCalibration,
    opening_mm,
    position_of_opening,
)
from .units import Units

__all__ = [
    "NOMINAL_FORCES_N",
    "NOMINAL_SPEEDS_MM_S",
    "STROKE_MM",
    "ForceCalibration",
    "SpeedCalibration",
    "Units",
    "opening_mm",
    "position_of_opening",
]
