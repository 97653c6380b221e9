"""Diagnoses a connection: one finding per check, each with advice.

Nothing moves. The doctor examines a gripper that this host reaches, or one that an agent serves.
"""

from .findings import Finding, Level, ReportFinding
from .fleet import examine_remote
from .gripper import examine

__all__ = ["Finding", "Level", "ReportFinding", "examine", "examine_remote"]
