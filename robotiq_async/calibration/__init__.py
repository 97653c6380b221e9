"""Conversion between counts and other units: speeds, forces, times, conventions; nominal or measured."""

from .amounts import UNITS, force_of, position_of, speed_of
from .conventions import CONVENTIONS, Convention
from .csv_tables import (
    FORCE,
    SPEED_LAYOUT,
    Layout,
    RunsTable,
    TableError,
    integer,
    read_measured,
    read_rows,
    read_stroke,
    read_table,
    write_rows,
    write_stroke,
    write_table,
)
from .motion_profile import MotionProfile, profile_of
from .scales import ForceCalibration, SpeedCalibration, closing_time, mean, newton
from .units import Units

__all__ = ["UNITS", "force_of", "position_of", "speed_of"]
__all__ += ["CONVENTIONS", "Convention"]
__all__ += ["FORCE", "SPEED_LAYOUT", "Layout", "RunsTable", "TableError", "integer", "read_measured"]
__all__ += ["read_rows", "read_stroke", "read_table", "write_rows", "write_stroke", "write_table"]
__all__ += ["MotionProfile", "profile_of"]
__all__ += ["ForceCalibration", "SpeedCalibration", "closing_time", "mean", "newton"]
__all__ += ["Units"]
