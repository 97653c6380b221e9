"""What the values 0..255 mean: speeds, forces, closing times; from the thesis or your own measurements."""

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
