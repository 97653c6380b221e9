"""Speeds, forces and closing times of the values 0..255, from the thesis or your own measurements."""

from .scales import ForceCalibration, SpeedCalibration
from .units import Units

__all__ = ["ForceCalibration", "SpeedCalibration", "Units"]
