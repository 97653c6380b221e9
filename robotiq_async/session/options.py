"""The options of a hand, checked, and the transport they describe."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Final, NamedTuple

from ..link.address import Address, parse_address
from ..link.canonical import canonical_address
from ..link.guard import GuardedTransport
from ..link.modbus import ModbusTransport
from ..link.sim_transport import SimulatedTransport, new_gripper
from ..link.transport import Link, Transport
from ..runtime.log import Log, log
from ..values.calibration import ForceCalibration, SpeedCalibration, Units
from ..values.checks import check_byte, check_flag, check_int, check_seconds
from ..values.registers import REGISTER_COUNT, RTU_REGISTERS, TCP_REGISTERS, RegisterMap
from .claims import Gripper
from .reconnecting import ReconnectPolicy


class Usual(float):
    """A default that stands for the network; on a serial line it is another.

    The same figure given on purpose is a plain float, and is kept on any link.
    """

    __slots__ = ()


POLL_INTERVAL_S: Final = Usual(0.005)
"""200 Hz, as the thesis polled; the manual names 200 Hz for RTU and 100 Hz for TCP."""
SERIAL_POLL_INTERVAL_S: Final = 0.015
"""The bytes of a read and a write take 5.38 ms at 115200 baud, and the silences that the standard wants
after each of the four frames 7 ms: 12.4 ms. In 15 ms they fit, with what an adapter needs to pass on two
replies, so that a stream of commands misses no polls."""
WRITE_SPACING_S: Final = 0.01
"""The manual of 2014 (chapters on TCP and RTU): registers are renewed at 100 Hz; leave 10 ms, or some writes
are lost. Users of two-finger grippers on two arms saw that."""
LONGEST_SPACING_S: Final = 0.1
CONNECT_TIMEOUT_S: Final = 2.0
RESPONSE_TIMEOUT_S: Final = 0.4
"""Two of these, a read in flight and a write, still end within the second that a write may take; on a serial
line also with the time in which the read may be asked once more."""
LONGEST_RESPONSE_S: Final = 5.0
"""For gateways that are slow; a write may take more than a second then."""
LONGEST_WAIT_S: Final = 86400.0
"""For which a start may wait for its gripper: a day."""
ACTIVATION_TIMEOUT_S: Final = 40.0
"""Drivers that ran on hardware saw about 15 s, and wait for 25 to 30 s; the notes of one list time-outs of
the activation. What ends one early leaves a hand that does not know where its fingers are."""
LONGEST_NAME: Final = 64
"""Characters of a hand's name: it begins every line of the log."""
_GATEWAY: Final = " (two grippers behind one gateway: give each of the hands its device_id)"
_LINE: Final = " (a serial port has one owner, whatever the device_id: two would read each other's replies)"

# Read when this is imported: a hand may be made in a running loop, and that waits for no disk.
_THESIS: Final = SpeedCalibration.thesis()
_NOMINAL: Final = ForceCalibration.nominal()


@dataclass(frozen=True, slots=True)
class Options:
    """Everything a hand is constructed with, checked."""

    make_transport: Callable[[], Link]
    """A transport for one start of the hand."""
    address: str
    gripper: Callable[[], Gripper]
    """Which one it is, at this moment: a serial port may have been plugged in meanwhile."""
    poll_interval: float
    write_spacing: float
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
    read_function: object = None,
    poll_interval: object,
    write_spacing: object,
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
    response_s = check_seconds("response_timeout", response_timeout, 0.005, LONGEST_RESPONSE_S)
    interval = check_seconds("poll_interval", poll_interval, 0.001, 0.1)
    registers = {
        "device_id": device_id,
        "read_function": read_function,
        "request_address": request_address,
        "status_address": status_address,
    }
    way = _way_to(address, registers, given_name)
    if way.is_rtu:
        interval = SERIAL_POLL_INTERVAL_S if isinstance(poll_interval, Usual) else interval
    return Options(
        make_transport=partial(way.make, connect_timeout=connect_s, response_timeout=response_s),
        address=way.address,
        gripper=way.gripper,
        poll_interval=interval,
        write_spacing=check_seconds("write_spacing", write_spacing, 0.0, LONGEST_SPACING_S),
        activation_timeout=check_seconds("activation_timeout", activation_timeout, 0.01, 120.0),
        policy=_check_reconnect(reconnect),
        speed=check_byte("speed", speed),
        force=check_byte("force", force),
        units=check_units(calibration, force_calibration),
        keep_grip=check_flag("keep_grip", keep_grip),
        given_name=given_name,
        log=Log(given_name or way.address),
    )


def registers_of(
    address: Address,
    *,
    device_id: object = None,
    read_function: object = None,
    request_address: object = None,
    status_address: object = None,
) -> RegisterMap:
    """How the registers of a gripper are asked for; None for what is usual on its kind of link.

    Raises:
        TypeError: an option is no int.
        ValueError: an option is outside its range.
    """
    usual = RTU_REGISTERS if address.is_rtu else TCP_REGISTERS
    last = 0x10000 - REGISTER_COUNT
    # On a line 0 is everybody, who do not answer, and more than 247 are reserved. Over TCP units in the
    # field answer to any, and drivers have used 0 and 255.
    units = (1, 247) if address.is_rtu else (0, 255)
    return RegisterMap(
        request=_int_or("request_address", request_address, 0, last, usual.request),
        status=_int_or("status_address", status_address, 0, last, usual.status),
        read_function=_int_or("read_function", read_function, 3, 4, usual.read_function),
        device_id=_int_or("device_id", device_id, *units, usual.device_id),
    )


def _int_or(name: str, value: object, low: int, high: int, usual: int) -> int:
    return usual if value is None else check_int(name, value, low, high)


class _Way(NamedTuple):
    """How a gripper is reached: the address that is shown, which one it is, and what makes its transport."""

    address: str
    gripper: Callable[[], Gripper]
    make: Callable[..., Link]
    is_rtu: bool = False


def _way_to(address: object, registers: Mapping[str, object], name: str) -> _Way:
    if isinstance(address, str):
        parsed = parse_address(address)
        names_unit = registers["device_id"] is not None
        return _over_modbus(parsed, registers_of(parsed, **registers), names_unit, name)
    if isinstance(address, Transport):
        shown = f"<{type(address).__name__} at {id(address):#x}>"
        guarded = partial(GuardedTransport, address, shown, log=Log(name or shown))
        return _Way(shown, partial(Gripper, shown), guarded)
    raise TypeError(f"address must be a string or a Transport, got {address!r}")


def _over_modbus(address: Address, registers: RegisterMap, names_unit: bool, name: str) -> _Way:
    if address.kind == "sim":
        simulated = new_gripper(address.simulation)
        shown = f"{address}#{id(simulated):x}"  # every sim:// is a gripper of its own
        return _Way(shown, partial(Gripper, shown), partial(SimulatedTransport, simulated, registers))
    # A gateway takes several connections; on a serial line replies carry no number, and whoever has it open
    # gets part of what arrives.
    unit = registers.device_id if names_unit and not address.is_rtu else None
    hint = _LINE if address.is_rtu else _GATEWAY  # for people who meant two grippers
    return _Way(
        str(address),
        lambda: Gripper(canonical_address(address), unit, hint),
        partial(ModbusTransport, address, registers, log=Log(name or str(address))),
        address.is_rtu,
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
