"""Asyncio-native client for the Robotiq 3-Finger gripper (S-Model) and its siblings 2F-85, 2F-140 and Hand-E.

Programs import from here. The packages below it::

    values      words of the wire: status, request, results, errors
    calibration  units, scales: between counts and millimetres, newtons, seconds
    hands       the parts of any hand: its calls, options, streams
    local       RobotiqHand, and the task that polls, from start() to stop()
    control     the next write: state machine, moves, adoption
    link        addresses, transports, Modbus: the bytes
    sync        blocking hands, for scripts and notebooks
    fleet       hands on other hosts: agents that serve them, remote hands
    tools       recordings, viewer, web page, measurements, diagnosis of a hand
    dropins     the interfaces that labs copy: robotiq_gripper.py, DROID's server, LeRobot's robot
    ros2        a lifecycle node of ROS 2 around a hand
    simulator   a simulated gripper with its servers
    cli         the command line
    runtime     below all of it: clocks, event loops, logging, optional packages

None of this has run on real hardware yet.
"""

from .calibration import Units
from .calibration.conventions import Convention
from .hands.options import ReconnectPolicy
from .hands.statistics import Statistics
from .hands.streams import Stream
from .link.tunnel.protocol import Tunnel, TunnelPlace
from .local.robotiq_hand import RobotiqHand
from .runtime.version import __version__ as __version__
from .values.enums import (
    CLOSED,
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
    Trigger,
)
from .values.errors import (
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
from .values.events import SentRequest, Transition
from .values.grip import GraspResult, GripChange, GripEvent
from .values.inhibit import Inhibit
from .values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, Model
from .values.move_result import MoveResult
from .values.status import Part, RobotiqStatus

__all__ = [
    "CLOSED",
    "FORCE_MAX",
    "FORCE_MIN",
    "HAND_E",
    "JAW",
    "OPEN",
    "SPEED_MAX",
    "SPEED_MIN",
    "THREE_FINGER",
    "TWO_FINGER_85",
    "TWO_FINGER_140",
    "WIDTH_NORMAL",
    "WIDTH_PINCH",
    "WIDTH_WIDE",
    "ActivationTimeoutError",
    "ConnectFailedError",
    "ConnectionLostError",
    "Convention",
    "Fault",
    "Finger",
    "GraspResult",
    "GripChange",
    "GripEvent",
    "GripperFaultError",
    "Inhibit",
    "Initialization",
    "InvalidStateError",
    "Mode",
    "Model",
    "MotionInhibitedError",
    "MoveResult",
    "MoveSupersededError",
    "MoveTimeoutError",
    "NotActivatedError",
    "NotStartedError",
    "ObjectStatus",
    "Part",
    "ProtocolError",
    "ReconnectPolicy",
    "ResponseTimeoutError",
    "RobotiqConnectionError",
    "RobotiqError",
    "RobotiqHand",
    "RobotiqStateError",
    "RobotiqStatus",
    "SentRequest",
    "Severity",
    "State",
    "StateTimeoutError",
    "Statistics",
    "Stream",
    "Transition",
    "Trigger",
    "Tunnel",
    "TunnelPlace",
    "Units",
    "WrongModelError",
]


def __dir__() -> list[str]:
    return sorted([*__all__, "__version__"])
