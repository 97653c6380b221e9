"""A simulated gripper, and servers that put it on a wire.

=====================  ====================================================================
module                 what it holds
=====================  ====================================================================
``gripper``            :class:`SimulatedGripper`: clock, registers, objects, faults, power
``controller``         the firmware: activation, modes, release, faults, who drives which axis
``control``            what a request asks of the axes, and the fixed sequences, as data
``axis``               one axis: motion, stops, contacts
``motor``              what its motor draws
``spread``             what is not exact about it
``faults``             the faults that are present, and when they end
``report``             the status registers
``server``             :class:`SimulatorServer`: Modbus TCP
``serial_server``      :class:`SerialSimulatorServer`: Modbus RTU on a serial line
``serial_connection``  where a frame ends on it
``endpoint``           what both servers have in common
``bank``               which register is found at which address
``connection``         one client; ``framing`` cuts its bytes into requests
``replies``            lost, late and mangled replies, switched by hand
``trouble``            what can go wrong, as data and as words: :class:`Trouble`, :func:`parse_troubles`
``adversary``          makes troubles happen, one at a time or by a plan
``damage``             what troubles do to the bytes of a reply
=====================  ====================================================================

The physics (the first eight) import neither pymodbus nor asyncio.
"""

from .physics.gripper import SimulatedGripper
from .server.serial_server import SerialSimulatorServer
from .server.tcp_server import SimulatorServer
from .troubles.trouble import Trouble, parse_troubles

__all__ = ["SerialSimulatorServer", "SimulatedGripper", "SimulatorServer", "Trouble", "parse_troubles"]
