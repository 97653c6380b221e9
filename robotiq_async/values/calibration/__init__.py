"""Speeds, forces and closing times of the values 0..255, from the thesis or your own measurements."""

from .motion_profile import MotionProfile
from .scales import ForceCalibration, SpeedCalibration
from .units import Units

__all__ = ["ForceCalibration", "MotionProfile", "SpeedCalibration", "Units"]
