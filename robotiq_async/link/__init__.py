"""Transports: eight registers in, eight registers out, every byte checked. pymodbus stops here."""

from .address import URCAP_PORT, Address, Simulation, is_remote, malformed, parse_address
from .modbus import ModbusTransport
from .registers import registers_of
from .serial.ports import MISSING, USB_SERIAL, latency_file, latency_timer, names_of_adapters, why_no_port
from .sim_transport import SimulatedTransport, new_gripper, simulated
from .transport import CyclicLink, Link
from .tunnel.protocol import Tunnel, TunnelPlace
from .urcap.transport import UrcapTransport

__all__ = ["URCAP_PORT", "Address", "Simulation", "is_remote", "malformed", "parse_address"]
__all__ += ["ModbusTransport"]
__all__ += ["registers_of"]
__all__ += ["MISSING", "USB_SERIAL", "latency_file", "latency_timer", "names_of_adapters"]
__all__ += ["why_no_port"]
__all__ += ["SimulatedTransport", "new_gripper", "simulated"]
__all__ += ["CyclicLink", "Link"]
__all__ += ["Tunnel", "TunnelPlace"]
__all__ += ["UrcapTransport"]
