"""Arguments that several sub-commands share: the address, bytes, masks of fingers."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib.util import find_spec
from typing import Annotated, Final

from cyclopts import Parameter, Token

from ..runtime.extras import install
from ..session.options import RESPONSE_TIMEOUT_S
from ..values.checks import parse_fingers
from ..values.enums import Finger
from .failures import CommandError, UsageError, usage


def need(module: str, extra: str, instead: str = "") -> None:
    """Refuse to go on without a module of an extra; ``instead`` names an alternative.

    Raises:
        CommandError: it is not.
    """
    if find_spec(module) is None:
        raise CommandError(f"this needs {module}: {install(extra)}{instead}")


def _integer(name: str, low: int, high: int) -> Callable[[object, Sequence[Token]], int]:
    """A converter for integers in low..high; ``name`` is for an argument that has no option name."""

    # cyclopts' own converter would take 1.5 for 2.
    def convert(_type: object, tokens: Sequence[Token]) -> int:
        text, where = tokens[0].value, tokens[0].keyword or name
        if not re.fullmatch(r"[+-]?[0-9]{1,9}", text) or not low <= int(text) <= high:
            raise UsageError(f"{where} must be an integer in {low}..{high}, got {text!r}")
        return int(text)

    return convert


def _fingers(_type: object, tokens: Sequence[Token]) -> Finger:
    with usage():
        return parse_fingers("--fingers", tokens[0].value)


Address = Annotated[
    str,
    Parameter(
        help="The gripper: tcp://HOST[:PORT], rtu:///dev/ttyUSB0, rtu+tcp://HOST:PORT, "
        "zenoh://SITE/HOST/NAME or sim://."
    ),
]
Flag = Annotated[bool, Parameter(negative=(), show_default=False)]
"""Off, unless it is given: there is no --no- form, and no default to be told."""
Yes = Annotated[Flag, Parameter(name=("--yes", "-y"))]
Host = Annotated[str, Parameter(metavar="HOST")]
Position = Annotated[int, Parameter(converter=_integer("POSITION", 0, 255))]
Byte = Annotated[int, Parameter(converter=_integer("the value", 0, 255), metavar="0..255")]
Port = Annotated[int, Parameter(converter=_integer("the port", 0, 65535), metavar="0..65535")]
Unit = Annotated[int, Parameter(converter=_integer("the unit id", 0, 255), metavar="0..255")]
ReadFunction = Annotated[int, Parameter(converter=_integer("the function", 3, 4), metavar="3|4")]
Stage = Annotated[int, Parameter(converter=_integer("the stage", 0, 9), metavar="0..9")]
Seconds = Annotated[float, Parameter(metavar="SECONDS")]
Register = Annotated[int, Parameter(converter=_integer("the register", 0, 65528), metavar="0..65528")]
Fingers = Annotated[
    Finger,
    Parameter(
        converter=_fingers,
        n_tokens=1,
        accepts_keys=False,  # cyclopts makes --fingers.a and so on of a flag otherwise.
        metavar="AXES",
        show_choices=False,
        show_default=lambda mask: mask.name,
    ),
]


@Parameter(name="*")
@dataclass(frozen=True)
class Link:
    """How to reach a gripper that is not set up as usual; the command doctor finds out."""

    device_id: Annotated[Unit | None, Parameter(help="Modbus unit id (default: 2 on TCP, 9 serial).")] = None
    read_function: Annotated[
        ReadFunction | None, Parameter(help="Modbus function that reads (default: 4 on TCP, 3 serial).")
    ] = None
    request_address: Annotated[
        Register | None, Parameter(help="First request register (default: 0 on TCP, 1000 serial).")
    ] = None
    status_address: Annotated[
        Register | None, Parameter(help="First status register (default: 0 on TCP, 2000 serial).")
    ] = None
    response_timeout: Annotated[Seconds, Parameter(help="Seconds for one answer, up to 5.")] = (
        RESPONSE_TIMEOUT_S
    )


USUAL: Final = Link()
