"""Words of the wire: names, models, requests, status, results, errors. Pure: no file, no clock."""

from .checks import (
    as_float,
    check_byte,
    check_flag,
    check_int,
    check_mask,
    check_number,
    check_seconds,
    check_timeout,
    parse_fingers,
    repr_of,
    single,
)
from .contradictions import contradiction, names_that_fit, why_stranger
from .enums import (
    CLOSED,
    DEFAULT_FORCE,
    DEFAULT_SPEED,
    FORCE_MAX,
    FORCE_MIN,
    JAW,
    OPEN,
    SPEED_MAX,
    SPEED_MIN,
    WIDTH_NORMAL,
    WIDTH_PINCH,
    WIDTH_WIDE,
    Fault,
    Finger,
    Initialization,
    Mode,
    ObjectStatus,
    Severity,
    State,
    StopLevel,
    Trigger,
    names_of,
)
from .errors import (
    ActivationTimeoutError,
    ConnectFailedError,
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
    MotionInhibitedError,
    MoveSupersededError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
    RobotiqError,
    RobotiqStateError,
    StateTimeoutError,
    WrongModelError,
)
from .events import SentRequest, Transition
from .grip import GraspResult, GripChange, GripEvent
from .inhibit import LONGEST_REASON, Inhibit
from .model import (
    HAND_E,
    MODELS,
    THREE_FINGER,
    TWO_FINGER_85,
    TWO_FINGER_140,
    Model,
    model_of,
)
from .move_result import MoveResult
from .registers import RTU_REGISTERS, TCP_REGISTERS, Echo, RegisterMap, Registers
from .request import AxisRequest, Request
from .states import MOVES, RUNNING, TABLE, Verdict, refusal
from .status import NO_REQUEST, Part, RobotiqStatus
from .stroke import Point, Points, Stroke, check_points, why_not_after

__all__ = ["as_float", "check_byte", "check_flag", "check_int", "check_mask", "check_number"]
__all__ += ["check_seconds", "check_timeout", "parse_fingers", "repr_of", "single"]
__all__ += ["CLOSED", "DEFAULT_FORCE", "DEFAULT_SPEED", "FORCE_MAX", "FORCE_MIN", "JAW", "OPEN"]
__all__ += ["SPEED_MAX", "SPEED_MIN", "WIDTH_NORMAL", "WIDTH_PINCH", "WIDTH_WIDE", "Fault", "Finger"]
__all__ += ["Initialization", "Mode", "ObjectStatus", "Severity", "State", "StopLevel", "Trigger"]
__all__ += ["names_of"]
__all__ += ["ActivationTimeoutError", "ConnectFailedError", "ConnectionLostError", "GripperFaultError"]
__all__ += ["InvalidStateError", "MotionInhibitedError", "MoveSupersededError", "MoveTimeoutError"]
__all__ += ["NotActivatedError", "NotStartedError", "ProtocolError", "ResponseTimeoutError"]
__all__ += ["RobotiqConnectionError", "RobotiqError", "RobotiqStateError", "StateTimeoutError"]
__all__ += ["WrongModelError"]
__all__ += ["SentRequest", "Transition"]
__all__ += ["GraspResult", "GripChange", "GripEvent"]
__all__ += ["LONGEST_REASON", "Inhibit"]
__all__ += ["HAND_E", "MODELS", "THREE_FINGER", "TWO_FINGER_85", "TWO_FINGER_140", "Model", "model_of"]
__all__ += ["contradiction", "names_that_fit", "why_stranger"]
__all__ += ["MoveResult"]
__all__ += ["RTU_REGISTERS", "TCP_REGISTERS", "Echo", "RegisterMap", "Registers"]
__all__ += ["AxisRequest", "Request"]
__all__ += ["MOVES", "RUNNING", "TABLE", "Verdict", "refusal"]
__all__ += ["NO_REQUEST", "Part", "RobotiqStatus"]
__all__ += ["Point", "Points", "Stroke", "check_points", "why_not_after"]
