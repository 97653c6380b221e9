"""Asyncio-native client for the Robotiq 3-Finger gripper (S-Model).

The map; each module imports only what stands above it::

    version      the version
    enums        the names of the field                        no I/O, no clock,
    errors       everything that is raised                     no event loop
    checks       argument checks
    frozen       a mapping that stays as it is made
    registers    the bit fields, as data
    status       RobotiqStatus, decoded from eight registers
    request      Request, encoded into eight registers
    log          the logger, which never fails
    closing_time the thesis's closing times
    machine      states, triggers and the table of both
    procedures   activation, reset, release, shutdown as generators
    echo         what was written and what the gripper shows of it
    adoption     what an axis was asked to do by somebody else
    ledger       what the gripper has been asked, as far as is known
    desk         what callers have asked for
    compose      the next image, from what callers have asked
    kinematics   joint angles from the positions of the axes
    motion       moves and their results
    core         decides what to write, learns from what is read
    ------------------------------------------------------------
    clock        the time of what happens                      asyncio from here on
    address      which gripper
    places       what all ways to write an address have in common
    claims       who owns which gripper in this process
    reply        every byte of a reply, checked
    messages     what is asked and answered, as pymodbus knows it
    ending       work that ends well
    names        what the name of a host stands for
    link         transports; the only module, messages aside, that uses pymodbus
    worker       calls of somebody else's code, bounded in time
    guard        transports of somebody else's, held to what a hand relies on
    simulated    the transport of sim://
    statistics   figures about the polling
    event_loop   the loop a hand belongs to
    streams      async iterators
    timerfd      Linux's timer that is watched like a socket
    tick         the beat of the polling
    owner        the one task that owns the link
    runs         tables of measured runs, in CSV files
    calibration  what the values 0..255 mean
    options      checked options of a hand
    waiting      callers that wait for a state
    hand         RobotiqHand
    actions      what a person asks of a hand
    payloads     what is told of a hand in JSON
    jointstate   joint states as ROS 2 encodes them
    feed         everything about a hand as messages
    recorder     everything about a hand in an MCAP file; needs mcap
    recording    what such a file holds
    services     commands by name, with arguments in JSON
    viewer       a hand for Foxglove; needs foxglove-sdk
    metrics      figures for Prometheus; needs prometheus-client
    doctor       what is wrong with a connection
    measuring    closing times, force and current of a grasp
    plots        pictures of measurements; needs matplotlib
    ------------------------------------------------------------
    simulator    a simulated gripper and its Modbus servers (shares enums, registers, status, request)
    cli          the command line

Nothing of this has run on real hardware yet.
"""

from .control.motion import MoveResult
from .control.triggers import Trigger
from .enums import (
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
from .errors import (
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
from .hand import RobotiqHand
from .link.transport import Transport
from .session.reconnecting import ReconnectPolicy
from .session.statistics import Statistics
from .session.streams import SentRequest, Stream, Transition
from .version import __version__ as __version__
from .wire.status import RobotiqStatus

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
]
