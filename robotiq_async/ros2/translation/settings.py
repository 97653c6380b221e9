"""The parameters of the node: names, descriptions, ranges and checks. Some are options of the hand."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from typing import Any, Final

from ...calibration import read_stroke
from ...fleet.network.route import parse_remote_address
from ...hands import Option, Place, offered
from ...link import is_remote, parse_address
from ...values import check_int, check_number, model_of

Value = str | int | float | bool
AS_USUAL: Final = -1  # represents None: a parameter of ROS always has a value
OF_HAND: Final = offered(Place.ROS)  # the parameters that are options of the hand


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter."""

    default: Value  # its default, of the parameter's type
    description: str  # for `ros2 param describe`
    low: float = 0.0  # the lowest value of a number
    high: float = 0.0  # the highest value of a number
    live: bool = False  # whether it may be changed while the node is configured


def _of_hand(name: str, option: Option) -> Parameter:
    text, low, default = option.help, option.low, option.default
    if option.choices:
        return Parameter("", f"{text}; empty: as the address says.")
    if option.is_file:
        return Parameter("", f"{text}; empty for nominal ones.")
    if default is None:  # it depends on the link
        text += f"; {AS_USUAL} stands for {option.tcp} over TCP, {option.rtu} on a serial line"
        low = default = AS_USUAL
    # A plain float: ROS does not accept subclasses.
    default = float(default) if isinstance(default, float) else default
    return Parameter(default, f"{text}.", low, option.high, live=name in ("speed", "force"))  # type: ignore[arg-type]


PARAMETERS: Final[Mapping[str, Parameter]] = {
    **{name: _of_hand(name, option) for name, option in OF_HAND.items()},
    "address": Parameter(
        "sim://",
        "The gripper: tcp://HOST[:502], rtu:///dev/ttyUSB0, rtu+tcp://HOST:PORT, urcap://HOST, "
        "zenoh://SITE/HOST/GRIPPER (set up on its host: the other options of the hand have no effect), "
        "or sim://, simulated.",
    ),
    "publish_rate": Parameter(50.0, "Joint states a second.", 1.0, 200.0),
    "joint_prefix": Parameter(
        "",
        "Prefix of the name of every joint: left_ makes left_finger_1_joint_1. Letters, digits, _ . / and -.",
    ),
    "frame_id": Parameter("", "Frame in the headers of the joint states, which need none."),
    "urdf": Parameter("", "File to publish as robot_description, unchanged; empty for the packaged one."),
    "allow_stalling": Parameter(
        True, "Whether a goal that ends in a contact, a grasp, succeeds. False aborts it.", live=True
    ),
    "autostart": Parameter(
        False, "Whether the node configures and activates itself when it starts. That moves nothing."
    ),
}
"""The parameters by name."""


@dataclass(frozen=True, slots=True)
class NodeSettings:
    """The parameters, checked.

    Attributes:
        options: of the hand, as keywords of :class:`~robotiq_async.RobotiqHand`, without the next three.

    The others are the parameters by the same names.
    """

    options: Mapping[str, Any]
    address: str
    speed: int
    force: int
    publish_rate: float
    joint_prefix: str
    frame_id: str
    urdf: str
    allow_stalling: bool
    autostart: bool


def check_settings(values: Mapping[str, object]) -> NodeSettings:
    """Check all parameters.

    Raises:
        ValueError: a value out of range or of the wrong type; names the parameter, the value and the range.
    """
    checked = {name: check_parameter(name, values[name]) for name in PARAMETERS}
    own = {each.name for each in fields(NodeSettings)}
    options = {name: _option_value(name, checked.pop(name)) for name in OF_HAND if name not in own}
    return NodeSettings(options, **checked)  # type: ignore[arg-type]


def _option_value(name: str, value: Value) -> object:
    # The default of the option, which may be None: None as write_spacing stands for another value of a jaw.
    return OF_HAND[name].default if value == PARAMETERS[name].default else value


def check_parameter(name: str, value: object) -> Value:
    """Check a value, and return it in the parameter's type; an integer is accepted for a float."""
    parameter = PARAMETERS[name]
    try:
        if isinstance(parameter.default, bool):
            return _check_kind(name, value, bool, "true or false")
        if isinstance(parameter.default, str):
            text = _check_kind(name, value, str, "a string")
            check = _CHECKS.get(name)
            return text if check is None else check(str(text))
        if isinstance(parameter.default, int):
            number = check_int(name, value, int(parameter.low), int(parameter.high))
            if AS_USUAL < number < (low := int(OF_HAND[name].low)):
                raise ValueError(
                    f"{name} must be {AS_USUAL} or in {low}..{int(parameter.high)}, got {value!r}"
                )
            return number
        what = "seconds" if name in OF_HAND else "a number"
        return check_number(name, value, parameter.low, parameter.high, what)
    except TypeError as error:
        raise ValueError(str(error)) from None


def _check_kind(name: str, value: object, kind: type[Value], what: str) -> Value:
    if not isinstance(value, kind):
        raise TypeError(f"{name} must be {what}, got {value!r}")
    return value


def _check_address(address: str) -> str:
    parse = parse_remote_address if is_remote(address) else parse_address
    parse(address)
    return address


def _check_prefix(prefix: str) -> str:
    # Other characters are invalid in the names of a URDF or of frames.
    if not re.fullmatch(r"[A-Za-z0-9_./-]*", prefix):
        raise ValueError(f"joint_prefix may have letters, digits, _ . / and -, got {prefix!r}")
    return prefix


def _check_model(text: str) -> str:
    return model_of(text).name if text else ""


def _check_file(path: str) -> str:
    if path:
        read_stroke(path)
    return path


_CHECKS: Final = {
    "address": _check_address,
    "model": _check_model,
    "stroke": _check_file,
    "joint_prefix": _check_prefix,
}
"""Checks of strings, by parameter."""
