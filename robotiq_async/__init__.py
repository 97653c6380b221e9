"""Asyncio-native client for the Robotiq 3-Finger gripper (S-Model).

What a program needs is imported from here. Where it comes from, and what stands around it::

    hand, protocol           RobotiqHand, and what every hand can do
    session                  the task that polls, from start() to stop()
    grasping                 who holds a part, and what becomes of the grip
    control                  what to write next: state machine, moves, adoption
    link                     addresses, transports, Modbus: the bytes
    wire                     status and request, decoded and encoded
    calibration, kinematics  what the values mean: mm/s, N, joint angles
    description              the hand in three dimensions: its URDF, the poses of its links
    actions, telemetry       operating a hand; recordings, viewers and metrics of one
    web                      a page in the browser
    measure, doctor          measurements of a gripper; what is wrong with a connection
    sync                     blocking hands, for scripts and notebooks
    fleet                    hands on other hosts: agents that serve them, remote hands
    ros2                     a lifecycle node of ROS 2 around a hand
    simulator, cli           a simulated gripper with its servers; the command line

Nothing of this has run on real hardware yet.
"""

from .control.motion import MoveResult
from .control.triggers import Trigger
from .hand import RobotiqHand
from .link.transport import Transport
from .session.reconnecting import ReconnectPolicy
from .session.statistics import Statistics
from .session.streams import SentRequest, Stream, Transition
from .values.calibration import Units
from .values.enums import (
    CLOSED,
    FORCE_MAX,
    FORCE_MIN,
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
)
from .values.errors import (
    ActivationTimeoutError,
    ConnectFailedError,
    ConnectionLostError,
    GripperFaultError,
    InvalidStateError,
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
)
from .values.grasp_result import GraspResult
from .values.grip_event import GripChange, GripEvent
from .values.status import RobotiqStatus
from .version import __version__ as __version__

__all__ = [
    "CLOSED",
    "FORCE_MAX",
    "FORCE_MIN",
    "OPEN",
    "SPEED_MAX",
    "SPEED_MIN",
    "WIDTH_NORMAL",
    "WIDTH_PINCH",
    "WIDTH_WIDE",
    "ActivationTimeoutError",
    "ConnectFailedError",
    "ConnectionLostError",
    "Fault",
    "Finger",
    "GraspResult",
    "GripChange",
    "GripEvent",
    "GripperFaultError",
    "Initialization",
    "InvalidStateError",
    "Mode",
    "MoveResult",
    "MoveSupersededError",
    "MoveTimeoutError",
    "NotActivatedError",
    "NotStartedError",
    "ObjectStatus",
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
    "Transport",
    "Trigger",
    "Units",
]


def __dir__() -> list[str]:
    """The public names, without the modules that they come from."""
    return sorted([*__all__, "__version__"])
