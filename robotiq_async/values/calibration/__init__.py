"""What the values 0..255 mean: speeds, forces, closing times; from the thesis or your own measurements."""

from .scales import ForceCalibration, SpeedCalibration
from .units import Units

__all__ = ["ForceCalibration", "SpeedCalibration", "Units"]
