"""A simulated gripper, and servers that put it on a wire.

==============  ===========================================================================
room            contents
==============  ===========================================================================
``physics``     :class:`SimulatedGripper`: axes, contacts, faults, power, and the words it reports;
                :class:`Habits`: choices that the manual leaves open
``mechanics``   :class:`Physics`: bodies and contacts that move the axes in its place (extra ``physics``)
``server``      :class:`SimulatorServer` (Modbus TCP), :class:`SerialSimulatorServer` (Modbus RTU),
                :class:`RtuOverTcpSimulatorServer` (Modbus RTU behind a serial server),
                :class:`UrcapSimulatorServer` (the text port of a UR's URCap)
``troubles``    failures, as data and as text: :class:`Trouble`, :func:`parse_troubles`;
                :class:`FaultInjector`, ``server.fault_injector``, makes it happen;
                :func:`own_habits` and :func:`like_hardware`: habits of real grippers
``functions``   the Modbus functions that are served
==============  ===========================================================================

The physics imports neither pymodbus nor asyncio.
"""

from .mechanics.physics import Physics
from .physics.bodies import Bodies, Body
from .physics.driven_axis import PhysicsError
from .physics.gripper import SimulatedGripper
from .physics.habits import Habits
from .physics.scale import SimulatedScale
from .server.serial_server import RtuOverTcpSimulatorServer, SerialSimulatorServer
from .server.tcp_server import SimulatorServer
from .server.urcap_server import UrcapSimulatorServer
from .troubles.fault_injector import FaultInjector
from .troubles.like_hardware import like_hardware, own_habits
from .troubles.likeness import Likeness
from .troubles.trouble import KINDS, Trouble, parse_troubles

__all__ = [
    "KINDS",
    "Bodies",
    "Body",
    "FaultInjector",
    "Habits",
    "Likeness",
    "Physics",
    "PhysicsError",
    "RtuOverTcpSimulatorServer",
    "SerialSimulatorServer",
    "SimulatedGripper",
    "SimulatedScale",
    "SimulatorServer",
    "Trouble",
    "UrcapSimulatorServer",
    "like_hardware",
    "own_habits",
    "parse_troubles",
]
