"""Conversion between counts and other units: speeds, forces, times, conventions; nominal or measured."""

from .motion_profile import MotionProfile
from .scales import ForceCalibration, SpeedCalibration
from .units import Units

__all__ = ["ForceCalibration", "MotionProfile", "SpeedCalibration", "Units"]
