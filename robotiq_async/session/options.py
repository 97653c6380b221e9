"""The options of a hand, checked, and the transport they describe."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Final, NamedTuple

from ..calibration import ForceCalibration, SpeedCalibration, Units
from ..link.address import Address, parse_address
from ..link.canonical import canonical_address
from ..link.guard import GuardedTransport
from ..link.modbus import ModbusTransport
from ..link.sim_transport import SimulatedTransport, new_gripper
from ..link.transport import Transport
from ..log import Log, log
from ..wire.checks import check_byte, check_flag, check_int, check_seconds
from ..wire.registers import REGISTER_COUNT, RTU_REGISTERS, TCP_REGISTERS, RegisterMap
from .claims import Gripper
from .reconnecting import ReconnectPolicy

POLL_INTERVAL_S: Final = 0.005
"""200 Hz, as the thesis polled; the manual names 200 Hz for RTU and 100 Hz for TCP."""
CONNECT_TIMEOUT_S: Final = 2.0
RESPONSE_TIMEOUT_S: Final = 0.4
"""Two of these, a read in flight and a write, still end within the second that a write may take."""
ACTIVATION_TIMEOUT_S: Final = 20.0
"""What drivers that ran on hardware wait for."""
LONGEST_NAME: Final = 64
"""Characters of a hand's name: it begins every line of the log."""
HINTS: Final = {
    "tcp": " (two grippers behind one gateway: give each of the hands its device_id)",
    "rtu": " (a serial port has one owner, whatever the device_id: two would read each other's replies)",
}
"""For people who meant two grippers. A gateway takes several connections; on a serial line replies carry no
number, and whoever has it open gets part of what arrives."""

# Read when this is imported: a hand may be made in a running loop, and that waits for no disk.
_THESIS: Final = SpeedCalibration.thesis()
_NOMINAL: Final = ForceCalibration.nominal()


@dataclass(frozen=True, slots=True)
class Options:
    """Everything a hand is constructed with, checked."""

    make_transport: Callable[[], Transport]
    """A transport for one start of the hand."""
    address: str
    gripper: Callable[[], Gripper]
    """Which one it is, at this moment: a serial port may have been plugged in meanwhile."""
    poll_interval: float
    activation_timeout: float
    policy: ReconnectPolicy | None
    speed: int
    force: int
    units: Units
    """What positions, speeds and forces mean to people; default timeouts of moves come from its speeds."""
    keep_grip: bool = False
    """What a stop does about it unless told."""
    given_name: str = ""
    """What the hand is to be called; empty if nothing was said."""
    log: Log = log
    """For what happens to it."""

    @property
    def name(self) -> str:
        """What the hand is called: by its address, unless something else was said."""
        return self.given_name or self.address


def check_options(
    address: object,
    *,
    device_id: object,
    poll_interval: object,
    connect_timeout: object,
    response_timeout: object,
    activation_timeout: object,
    reconnect: object,
    speed: object,
    force: object,
    request_address: object,
    status_address: object,
    calibration: object,
    force_calibration: object,
    keep_grip: object,
    name: object = None,
) -> Options:
    """Check every option and make the transport; opens nothing and needs no running loop.

    Raises:
        TypeError: an option of the wrong type; named with value and range.
        ValueError: an option outside its range, or a malformed address.
    """
    given_name = _check_name(name)
    connect_s = check_seconds("connect_timeout", connect_timeout, 0.01, 5.0)
    response_s = check_seconds("response_timeout", response_timeout, 0.005, 0.5)
    way = _way_to(address, device_id, request_address, status_address, given_name)
    return Options(
        make_transport=partial(way.make, connect_timeout=connect_s, response_timeout=response_s),
        address=way.address,
        gripper=way.gripper,
        poll_interval=check_seconds("poll_interval", poll_interval, 0.001, 0.1),
        activation_timeout=check_seconds("activation_timeout", activation_timeout, 0.01, 120.0),
        policy=_check_reconnect(reconnect),
        speed=check_byte("speed", speed),
        force=check_byte("force", force),
        units=check_units(calibration, force_calibration),
        keep_grip=check_flag("keep_grip", keep_grip),
        given_name=given_name,
        log=Log(given_name or way.address),
    )


class _Way(NamedTuple):
    """How a gripper is reached: the address that is shown, which one it is, and what makes its transport."""

    address: str
    gripper: Callable[[], Gripper]
    make: Callable[..., Transport]


def _way_to(address: object, device_id: object, request: object, status: object, name: str) -> _Way:
    if isinstance(address, str):
        parsed = parse_address(address)
        return _over_modbus(
            parsed, _check_registers(parsed, device_id, request, status), device_id is not None
        )
    if isinstance(address, Transport):
        shown = f"<{type(address).__name__} at {id(address):#x}>"
        guarded = partial(GuardedTransport, address, shown, log=Log(name or shown))
        return _Way(shown, partial(Gripper, shown), guarded)
    raise TypeError(f"address must be a string or a Transport, got {address!r}")


def _check_registers(address: Address, device_id: object, request: object, status: object) -> RegisterMap:
    registers = RTU_REGISTERS if address.kind == "rtu" else TCP_REGISTERS
    if device_id is not None:
        registers = replace(registers, device_id=check_int("device_id", device_id, 1, 247))
    last = 0x10000 - REGISTER_COUNT
    if request is not None:
        registers = replace(registers, request=check_int("request_address", request, 0, last))
    if status is not None:
        registers = replace(registers, status=check_int("status_address", status, 0, last))
    return registers


def _over_modbus(address: Address, registers: RegisterMap, names_unit: bool) -> _Way:
    if address.kind == "sim":
        simulated = new_gripper(address.simulation)
        shown = f"{address}#{id(simulated):x}"  # every sim:// is a gripper of its own
        return _Way(shown, partial(Gripper, shown), partial(SimulatedTransport, simulated, registers))
    unit = registers.device_id if names_unit and address.kind == "tcp" else None
    return _Way(
        str(address),
        lambda: Gripper(canonical_address(address), unit, HINTS[address.kind]),
        partial(ModbusTransport, address, registers),
    )


def _check_name(name: object) -> str:
    if name is None:
        return ""
    form = f"a text of 1..{LONGEST_NAME} printable characters without blanks around it"
    if not isinstance(name, str):
        raise TypeError(f"name must be None or {form}, got {name!r}")
    if not 1 <= len(name) <= LONGEST_NAME or not name.isprintable() or name != name.strip():
        raise ValueError(f"name must be None or {form}, got {name!r:.100}")
    return name


def check_units(calibration: object, force_calibration: object) -> Units:
    """What the values of a hand mean; None for the thesis's speeds, and for the manual's forces.

    Raises:
        TypeError: not a calibration of its kind.
        ValueError: speeds that do not reach over 0..255.
    """
    speeds = _THESIS if calibration is None else calibration
    forces = _NOMINAL if force_calibration is None else force_calibration
    if not isinstance(speeds, SpeedCalibration):
        raise TypeError(f"calibration must be None or a SpeedCalibration, got {calibration!r}")
    if not isinstance(forces, ForceCalibration):
        raise TypeError(f"force_calibration must be None or a ForceCalibration, got {force_calibration!r}")
    first, last = speeds.points[0][0], speeds.points[-1][0]
    if (first, last) != (0, 255):
        raise ValueError(f"calibration must reach over the speed values 0..255, got {first}..{last}")
    return Units(speeds, forces)


def _check_reconnect(reconnect: object) -> ReconnectPolicy | None:
    if isinstance(reconnect, ReconnectPolicy):
        return reconnect
    if reconnect is True:
        return ReconnectPolicy()
    if reconnect is False:
        return None
    raise TypeError(f"reconnect must be True, False or a ReconnectPolicy, got {reconnect!r}")
