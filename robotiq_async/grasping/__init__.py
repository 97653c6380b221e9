"""Who holds a part, and what becomes of the grip."""

from .grasp_result import GraspResult, check_at_least
from .grip_event import GripChange, GripEvent
from .grip_watch import SLIP_COUNTS, GripWatch

__all__ = ["SLIP_COUNTS", "GraspResult", "GripChange", "GripEvent", "GripWatch", "check_at_least"]
