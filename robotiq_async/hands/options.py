"""The options of a hand, in one table.

:class:`HandOptions` checks the arguments of a hand. Each of its fields carries an :class:`Option`: range,
unit, help, default, and the places that offer it. FLEET.toml, the parameters of ROS, the command line and the
tables in docs/ are made from :data:`OPTIONS`. A new option is a field here, and an argument of
:class:`~robotiq_async.RobotiqHand`, whose signature is written out for editors and type checkers.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from enum import Flag, auto
from functools import cache, partial
from pathlib import Path
from typing import Annotated, Final, get_type_hints

from ..calibration import ForceCalibration, SpeedCalibration, Units
from ..calibration.csv_tables import TableError, read_stroke
from ..link.gripper_link import GripperLink, gripper_link
from ..link.registers import LAST_BLOCK, check_write_function
from ..link.transport import Link
from ..link.tunnel.protocol import Tunnel
from ..runtime.logger import Log
from ..values.checks import check_byte, check_flag, check_int, check_seconds, repr_of
from ..values.enums import DEFAULT_FORCE, DEFAULT_SPEED
from ..values.model import MODELS, THREE_FINGER, Model, model_of
from ..values.registers import RTU_REGISTERS, TCP_REGISTERS
from ..values.stroke import Points, check_points


class Usual(float):
    """A default that stands for the 3-Finger; a jaw has another.

    The same figure given on purpose is a plain float, and is kept for any model. With None, the signature,
    ``help()`` and the command line would show no figure.
    """

    __slots__ = ()


class NoAddress(str):
    """The address of a hand without one. The same text given on purpose is a plain str, without a warning."""

    __slots__ = ()


NO_ADDRESS: Final = NoAddress("sim://")
"""A program runs without hardware: its first start warns that nothing real moves."""
POLL_INTERVAL_S: Final = 0.005
"""200 Hz, as the thesis polled; the manual of 2014 has 100 Hz (pp. 58, 75), with function 23 200 Hz (p. 64).
On a serial line, where a read and a write take longer, the next cycle begins later, and that is no miss."""
WRITE_SPACING_S: Final = Usual(0.01)
"""3-Finger manual of 2014 (pp. 58, 75): registers are renewed at 100 Hz; leave 10 ms between commands."""
JAW_WRITE_SPACING_S: Final = 0.005
"""Manual of the 2F-85 and 2F-140: commands may come every 5 ms, at 200 Hz (function 23)."""


def usual_write_spacing(model: Model) -> float:
    """The seconds between two writes to a model, unless given."""
    return JAW_WRITE_SPACING_S if len(model.axes) == 1 else float(WRITE_SPACING_S)


LATE_POLLS: Final = "polling was late"  # how the warning about late polls begins
LONGEST_SPACING_S: Final = 0.1  # a command waits that long at most before it is written
CONNECT_TIMEOUT_S: Final = 2.0
"""A lost first packet is sent again after 1 s; a device that answers neither is not there."""
RESPONSE_TIMEOUT_S: Final = 0.4
"""Two of these, a read in flight and a write, still end within the second that a write may take; on a serial
line also with the time in which the read may be repeated."""
LONGEST_RESPONSE_S: Final = 5.0  # for gateways that are slow; a write may take more than a second then
LONGEST_WAIT_S: Final = 86400.0  # how long a start may wait for its gripper: a day
ACTIVATION_TIMEOUT_S: Final = 40.0
"""Drivers that ran on hardware saw about 15 s, and wait for 25 to 30 s; the notes of one list time-outs of
the activation. An early end leaves a hand that does not know where its fingers are."""
LONGEST_NAME: Final = 64  # characters of a hand's name: it begins every line of the log


class Place(Flag):
    """The places that offer an option, besides :class:`~robotiq_async.RobotiqHand`."""

    NONE = 0
    FILE = auto()
    """A key of a gripper's table in FLEET.toml."""
    ROS = auto()
    """A parameter of the ROS node."""
    COMMAND_LINE = auto()
    """An argument of the commands that reach a gripper."""


@dataclass(frozen=True, slots=True)
class Option:
    """A row of the table: one option.

    Attributes:
        help: its meaning, with its unit, as a sentence without its full stop.
        check: takes name and value, and returns the value that is kept.
        places: where it is offered.
        low: the lowest number, of all links.
        high: the highest number, of all links.
        tcp: the value that None stands for over TCP.
        rtu: the value that None stands for on a serial line.
        default: the value that counts unless another is given; None where it depends on the link.
        choices: the allowed names, if the value is a name.
        is_file: whether it can be the path of a file.
    """

    help: str
    check: Callable[[str, object], object]
    places: Place = Place.NONE
    low: float = 0
    high: float = 0
    tcp: int | None = None
    rtu: int | None = None
    default: object = None
    choices: tuple[str, ...] = ()
    is_file: bool = False


def _seconds(help: str, low: float, high: float, places: Place = Place.FILE) -> Option:
    return Option(help, partial(check_seconds, low=low, high=high), places, low, high)


def _byte(help: str) -> Option:
    return Option(help, check_byte, Place.FILE | Place.ROS, 0, 255)


def _by_link(help: str, register: str, low: int, high: int, places: Place = Place.NONE) -> Option:
    """One that depends on the link unless it is given; ``register`` is its field of a RegisterMap."""

    def check(name: str, value: object) -> object:
        return None if value is None else check_int(name, value, low, high)

    tcp, rtu = getattr(TCP_REGISTERS, register), getattr(RTU_REGISTERS, register)
    return Option(help, check, places | Place.FILE | Place.COMMAND_LINE, low, high, tcp, rtu)


def _check_address(_: str, value: object) -> object:
    return value  # gripper_link() has parsed it


def _check_write_function(_: str, value: object) -> object:
    return None if value is None else check_write_function(value)


def _check_model(name: str, model: object) -> Model:
    return model_of(model, name)


def _check_name(_: str, name: object) -> str | None:
    form = f"None or a text of 1..{LONGEST_NAME} printable characters without blanks around it"
    if name is None:
        return None
    if not isinstance(name, str):
        raise TypeError(f"name must be {form}, got {repr_of(name)}")
    if not 1 <= len(name) <= LONGEST_NAME or not name.isprintable() or name != name.strip():
        raise ValueError(f"name must be {form}, got {name!r:.100}")
    return name


def _check_reconnect(_: str, reconnect: object) -> object:
    if not isinstance(reconnect, bool | ReconnectPolicy):
        raise TypeError(f"reconnect must be True, False or a ReconnectPolicy, got {repr_of(reconnect)}")
    return reconnect


def _check_speeds(_: str, speeds: object) -> SpeedCalibration | None:
    if not isinstance(speeds, SpeedCalibration | None):
        raise TypeError(f"calibration must be None or a SpeedCalibration, got {repr_of(speeds)}")
    if speeds is not None and (ends := (speeds.points[0][0], speeds.points[-1][0])) != (0, 255):
        raise ValueError(f"calibration must reach over the speed values 0..255, got {ends[0]}..{ends[1]}")
    return speeds


def _check_forces(_: str, forces: object) -> ForceCalibration | None:
    if not isinstance(forces, ForceCalibration | None):
        raise TypeError(f"force_calibration must be None or a ForceCalibration, got {repr_of(forces)}")
    return forces


def check_stroke(name: str, stroke: object, model: Model | None = None) -> Points | None:
    """Points that were measured on a gripper, or the points in a file; None for nominal openings.

    Raises:
        TypeError: not points, and not a path.
        ValueError: no such points or file, or one that was measured on another model than ``model``.
    """
    if stroke is None:
        return None
    if not isinstance(stroke, str | Path):
        return check_points(name, stroke)
    try:
        return read_stroke(stroke, model)
    except TableError as error:
        raise ValueError(f"{name}: {error}") from error


@dataclass(frozen=True, slots=True)
class ReconnectPolicy:
    """The way in which a lost link is opened again.

    Attributes:
        first_delay: seconds before the first try, 0..10.
        max_delay: the delay doubles up to this, in seconds, 0.01..60.
        give_up_after: seconds after which the hand gives up, while the event loop runs; None tries for ever.
        activate: whether a gripper that comes back without its activation is activated. The fingers MOVE
            then, at a moment that you do not choose: leave it off unless nothing can be in their way.
    """

    first_delay: float = 0.05
    max_delay: float = 2.0
    give_up_after: float | None = None
    activate: bool = False

    def __post_init__(self) -> None:
        """Check the values, and keep them as plain floats.

        Raises:
            TypeError: not a number, or activate is not a bool.
            ValueError: outside its range.
        """
        self._keep("first_delay", 0.0, 10.0)
        self._keep("max_delay", 0.01, 60.0)
        if self.give_up_after is not None:
            self._keep("give_up_after", 0.0, 86400.0)
        check_flag("activate", self.activate)

    def _keep(self, name: str, low: float, high: float) -> None:
        object.__setattr__(self, name, check_seconds(name, getattr(self, name), low, high))


@dataclass(frozen=True, slots=True)
class HandOptions:
    """The options of a hand, checked. Opens nothing and needs no running loop.

    :class:`~robotiq_async.RobotiqHand` documents each; ``link``, ``units`` and ``log`` follow from them.
    """

    address: Annotated[
        str | Tunnel,
        Option(
            "Gripper: tcp://, rtu://, rtu+tcp://, urcap://, sim://, or the scheme of a tunnel",
            _check_address,
            Place.FILE | Place.ROS,
        ),
    ] = "sim://"
    name: Annotated[str | None, Option("Name of the hand in errors and in the log", _check_name)] = None
    device_id: Annotated[
        int | None, _by_link("Modbus unit id (1..247 on a serial line)", "device_id", 0, 255, Place.ROS)
    ] = None
    read_function: Annotated[
        int | None, _by_link("Modbus function that reads the status", "read_function", 3, 4, Place.ROS)
    ] = None
    write_function: Annotated[
        int | None,
        Option(
            "Modbus function that writes the request: 16, or 23, which also reads the status",
            _check_write_function,
            Place.FILE | Place.COMMAND_LINE | Place.ROS,
            16,
            23,
            TCP_REGISTERS.write_function,
            RTU_REGISTERS.write_function,
        ),
    ] = None
    poll_interval: Annotated[
        float,
        _seconds(
            "Seconds between polls, at least; a serial line may take longer",
            0.001,
            0.1,
            Place.FILE | Place.ROS,
        ),
    ] = POLL_INTERVAL_S
    write_spacing: Annotated[
        float,
        _seconds(
            f"Seconds from one write to the next ({JAW_WRITE_SPACING_S} unless given for a 2F or Hand-E), 0 "
            "if the gripper loses no write. Stops do not wait",
            0.0,
            LONGEST_SPACING_S,
            Place.FILE | Place.ROS,
        ),
    ] = WRITE_SPACING_S
    connect_timeout: Annotated[float, _seconds("Seconds for opening the link", 0.01, 5.0)] = CONNECT_TIMEOUT_S
    response_timeout: Annotated[
        float,
        _seconds(
            "Seconds for one answer", 0.005, LONGEST_RESPONSE_S, Place.FILE | Place.ROS | Place.COMMAND_LINE
        ),
    ] = RESPONSE_TIMEOUT_S
    activation_timeout: Annotated[float, _seconds("Seconds for an activation", 0.01, 120.0)] = (
        ACTIVATION_TIMEOUT_S
    )
    reconnect: Annotated[
        bool | ReconnectPolicy, Option("Whether a lost link is opened again", _check_reconnect)
    ] = True
    speed: Annotated[int, _byte("Speed of the axes until another is set, in counts")] = DEFAULT_SPEED
    force: Annotated[int, _byte("Force of the axes until another is set, in counts")] = DEFAULT_FORCE
    request_address: Annotated[int | None, _by_link("First request register", "request", 0, LAST_BLOCK)] = (
        None
    )
    status_address: Annotated[int | None, _by_link("First status register", "status", 0, LAST_BLOCK)] = None
    calibration: Annotated[SpeedCalibration | None, Option("How fast this gripper is", _check_speeds)] = None
    force_calibration: Annotated[
        ForceCalibration | None, Option("Labels of the force values", _check_forces)
    ] = None
    stroke: Annotated[
        Points | None,
        Option(
            "Measured openings of this gripper: a file of measure stroke",
            check_stroke,
            Place.FILE | Place.COMMAND_LINE | Place.ROS,
            is_file=True,
        ),
    ] = None
    keep_grip: Annotated[bool, Option("Whether a stop keeps a grip in force", check_flag, Place.FILE)] = False
    model: Annotated[
        Model,
        Option(
            f"Model of the gripper: {', '.join(MODELS)}",
            _check_model,
            Place.FILE | Place.COMMAND_LINE | Place.ROS,
            choices=tuple(MODELS),
        ),
    ] = None  # type: ignore[assignment]  # the address's; a name becomes its model

    link: GripperLink = field(default=None, repr=False, compare=False)  # type: ignore[assignment]
    """The way to the gripper; made from the address."""
    units: Units = field(init=False, repr=False, compare=False)
    """Units of positions, speeds and forces; default timeouts of moves come from its speeds."""
    log: Log = field(init=False, repr=False, compare=False)  # for the events of the hand

    def __post_init__(self) -> None:
        self._keep("name", _check_name("name", self.name))  # the log of the link begins with it
        if self.link is None:
            registers = {name: getattr(self, name) for name, each in OPTIONS.items() if each.tcp is not None}
            self._keep("link", gripper_link(self.address, registers, self.given_name, self.model))
            if self.link.stroke is not None:
                self._keep("stroke", self._stroke_of_address(self.link.stroke))
        self._keep("model", self.link.model)
        self._keep("stroke", check_stroke("stroke", self.stroke, self.model))
        if isinstance(self.write_spacing, Usual):
            self._keep("write_spacing", usual_write_spacing(self.model))
        for name, option in OPTIONS.items():
            self._keep(name, option.check(name, getattr(self, name)))
        self._keep("units", units_of(self.calibration, self.force_calibration, self.model, self.stroke))
        self._keep("log", Log(self.given_name or self.link.address))

    def _keep(self, name: str, value: object) -> None:
        object.__setattr__(self, name, value)

    def _stroke_of_address(self, file: str) -> Path:
        if self.stroke is not None:
            raise ValueError(f"stroke is given twice: by the address {self.link.address}, and beside it")
        return Path(file)

    @property
    def given_name(self) -> str:
        """The given name; empty for a hand without a name."""
        return self.name or ""

    @property
    def policy(self) -> ReconnectPolicy | None:
        """The answer to a lost link; None to give up at once."""
        if isinstance(self.reconnect, ReconnectPolicy):
            return self.reconnect
        return ReconnectPolicy() if self.reconnect else None

    @staticmethod
    def in_files() -> tuple[str, ...]:
        """The names of the options that the file of an agent has."""
        return tuple(offered(Place.FILE))

    def make_transport(self) -> Link:
        """A transport for one start of the hand."""
        return self.link.make(connect_timeout=self.connect_timeout, response_timeout=self.response_timeout)


def _table() -> Mapping[str, Option]:
    hints = get_type_hints(HandOptions, include_extras=True)
    return {
        each.name: replace(hints[each.name].__metadata__[0], default=each.default)
        for each in fields(HandOptions)
        if hasattr(hints[each.name], "__metadata__")
    }


OPTIONS: Final = _table()  # the table: every option by name, in the order of the arguments of a hand


def offered(place: Place) -> dict[str, Option]:
    """The options that a place offers."""
    return {name: option for name, option in OPTIONS.items() if place in option.places}


def units_of(
    calibration: object, force_calibration: object, model: Model = THREE_FINGER, stroke: object = None
) -> Units:
    """Meaning of the values of a hand; None for the usual speeds of its model and the manual's figures."""
    speeds = _check_speeds("calibration", calibration)
    forces = _check_forces("force_calibration", force_calibration)
    points = check_stroke("stroke", stroke)
    for name, each in (("calibration", speeds), ("force_calibration", forces)):
        if each is not None and each.model not in (None, model):
            raise ValueError(f"{name} ({each.source}) is of a {each.model}, and the gripper is a {model}")
    return Units(
        replace(speeds, model=model) if speeds else SpeedCalibration.usual(model),
        forces or ForceCalibration.nominal(model),
        model.stroke.measured(points or ()),
    )


class UnitsByModel:
    """The units of a hand that learns the model and the measured points of its gripper later.

    Raises:
        TypeError, ValueError: of the calibrations.
    """

    def __init__(
        self, calibration: SpeedCalibration | None, force_calibration: ForceCalibration | None
    ) -> None:
        self._of = cache(partial(units_of, calibration, force_calibration))  # loops need them in every cycle
        named = [getattr(each, "model", None) for each in (calibration, force_calibration)]
        self.model: Model = next(filter(None, named), THREE_FINGER)  # as long as the gripper has not said it
        self._of(self.model)

    def __call__(self, model: Model, points: Points = ()) -> Units:
        return self._of(model, points or None)
