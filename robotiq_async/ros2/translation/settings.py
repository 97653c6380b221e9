"""The parameters of the node: names, meaning, ranges, and what is made of their values."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from ...fleet.network.route import is_remote, parse_remote_address
from ...link.address import parse_address
from ...session.options import (
    LONGEST_RESPONSE_S,
    LONGEST_SPACING_S,
    POLL_INTERVAL_S,
    RESPONSE_TIMEOUT_S,
    WRITE_SPACING_S,
)
from ...values.checks import check_int, check_number, check_seconds
from ...values.enums import DEFAULT_FORCE, DEFAULT_SPEED

Value = str | int | float | bool
USUAL: Final = -1
"""A parameter of ROS always has a value: this one stands for none."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """One parameter.

    Attributes:
        default: what it is unless somebody says otherwise; its type is that of the parameter.
        description: for ``ros2 param describe``.
        low: the lowest value of a number.
        high: the highest value of a number.
        live: whether it may be changed while the node is connected.
    """

    default: Value
    description: str
    low: float = 0.0
    high: float = 0.0
    live: bool = False


PARAMETERS: Final[Mapping[str, Parameter]] = {
    "address": Parameter(
        "sim://",
        "The gripper: tcp://HOST[:502], rtu:///dev/ttyUSB0, rtu+tcp://HOST:PORT, zenoh://SITE/HOST/GRIPPER, "
        "or sim://, simulated.",
    ),
    "device_id": Parameter(USUAL, "Modbus unit id; -1 is what is usual: 2 over TCP, 9 over RTU.", USUAL, 255),
    "read_function": Parameter(
        USUAL, "Modbus function that reads, 3 or 4; -1 is what is usual: 4 over TCP, 3 over RTU.", USUAL, 4
    ),
    "poll_interval": Parameter(
        float(POLL_INTERVAL_S),
        "Seconds between two polls; 0.005 is 0.015 over RTU. A gripper on another host is polled there.",
        0.001,
        0.1,
    ),
    "write_spacing": Parameter(
        WRITE_SPACING_S,
        "Seconds from one write to the next; 0 for a gripper that forgets none. Stops do not wait.",
        0.0,
        LONGEST_SPACING_S,
    ),
    "response_timeout": Parameter(RESPONSE_TIMEOUT_S, "Seconds for one answer.", 0.005, LONGEST_RESPONSE_S),
    "publish_rate": Parameter(50.0, "Joint states a second.", 1.0, 200.0),
    "joint_prefix": Parameter(
        "", "Stands before the name of every joint, as it is: left_ makes left_finger_1_joint_1."
    ),
    "frame_id": Parameter("", "Of the headers of joint states; joint states need none."),
    "urdf": Parameter(
        "",
        "File to publish as robot_description, as it is; empty for the one that the package brings.",
    ),
    "allow_stalling": Parameter(
        True,
        "Whether a goal that ends in a contact has succeeded: it is a grasp. False aborts it.",
        live=True,
    ),
    "speed": Parameter(DEFAULT_SPEED, "Speed of the axes of a goal, in counts.", 0, 255, live=True),
    "force": Parameter(DEFAULT_FORCE, "Force of the axes of a goal, in counts.", 0, 255, live=True),
    "autostart": Parameter(
        False, "Whether the node configures and activates itself when it starts. That moves nothing."
    ),
}
"""The parameters by name."""


@dataclass(frozen=True, slots=True)
class Settings:
    """The parameters, checked.

    Attributes: as the parameters of the same name.
    """

    address: str
    device_id: int
    read_function: int
    poll_interval: float
    write_spacing: float
    response_timeout: float
    publish_rate: float
    joint_prefix: str
    frame_id: str
    urdf: str
    allow_stalling: bool
    speed: int
    force: int
    autostart: bool


def check_settings(values: Mapping[str, object]) -> Settings:
    """Check the value of every parameter.

    Raises:
        ValueError: a value that will not do; names the parameter, the value and what would do.
    """
    # One after the other: each is told with its own name.
    return Settings(**{name: check_parameter(name, values[name]) for name in PARAMETERS})  # type: ignore[arg-type]


def check_parameter(name: str, value: object) -> Value:
    """A value of a parameter, in its type. An integer will do for a float: people write 50 for 50.0.

    Raises:
        ValueError: it will not do.
    """
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
            if name == "read_function" and number not in (USUAL, 3, 4):
                raise ValueError(f"read_function must be 3, 4 or {USUAL}, got {value!r}")
            return number
        if name.endswith(("interval", "spacing", "timeout")):
            return check_seconds(name, value, parameter.low, parameter.high)
        return check_number(name, value, parameter.low, parameter.high)
    except TypeError as error:
        raise ValueError(str(error)) from None


def _check_kind(name: str, value: object, kind: type[Value], what: str) -> Value:
    if not isinstance(value, kind):
        raise TypeError(f"{name} must be {what}, got {value!r}")
    return value


def _check_address(address: str) -> str:
    """Refuse what is none before anything is opened."""
    parse = parse_remote_address if is_remote(address) else parse_address
    parse(address)
    return address


def _check_prefix(prefix: str) -> str:
    """Refuse what is no part of a name: it gets into a URDF and into the names of frames."""
    if not re.fullmatch(r"[A-Za-z0-9_./-]*", prefix):
        raise ValueError(f"joint_prefix may have letters, digits, _ . / and -, got {prefix!r}")
    return prefix


_CHECKS: Final = {"address": _check_address, "joint_prefix": _check_prefix}
"""Of strings that are not free."""
