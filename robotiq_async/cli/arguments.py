"""Arguments that several sub-commands share: addresses, bytes, fingers, options of the link."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, make_dataclass
from importlib.util import find_spec
from typing import Annotated, Any, Final, Literal, NamedTuple

from cyclopts import Parameter, Token

from ..hands import Option, Place, offered
from ..runtime import install
from ..values import Finger, parse_fingers
from .failures import CommandError, UsageError, usage


def need(module: str, extra: str, instead: str = "") -> None:
    """Fail if the module of an extra is missing; ``instead`` names an alternative."""
    if find_spec(module) is None:
        raise CommandError(f"this needs {module}: {install(extra)}{instead}")


def _integer(name: str, low: int, high: int) -> Callable[[object, Sequence[Token]], int]:
    """A converter for integers in low..high; ``name`` is for an argument that has no option name."""

    # cyclopts' own converter rounds 1.5 to 2.
    def convert(_type: object, tokens: Sequence[Token]) -> int:
        text, where = tokens[0].value, tokens[0].keyword or name
        if not re.fullmatch(r"[+-]?[0-9]{1,9}", text) or not low <= int(text) <= high:
            raise UsageError(f"{where} must be an integer in {low}..{high}, got {text!r}")
        return int(text)

    return convert


def _integers(name: str, low: int, high: int) -> Callable[[object, Sequence[Token]], list[int]]:
    """The same for an option that may be given again."""
    each = _integer(name, low, high)

    def convert(_type: object, tokens: Sequence[Token]) -> list[int]:
        return [each(int, [token]) for token in tokens]

    return convert


AMOUNT_UNITS: Final = {"": "counts", "mm": "mm", "mm/s": "mm_per_s", "N": "label_n"}
"""The units of amounts on the command line, and the arguments of a hand, and of ``values.amounts``, that they
are. A new one is a row here, and one more unit where it may be typed: :data:`Position` and below."""


class Amount(NamedTuple):
    """A position, a speed or a force as it was typed."""

    value: float
    unit: str

    def __str__(self) -> str:
        """The amount as text for a person."""
        return f"{self.value:g} {self.unit}".rstrip()

    @property
    def argument(self) -> dict[str, Any]:
        """The amount as an argument of ``values.amounts``."""
        return {AMOUNT_UNITS[self.unit]: self.value}


def _amount(name: str, *units: str, metavar: str | None = None) -> Parameter:
    """A parameter of counts, or of a number with one of these units, whose range the hand checks."""
    integer = _integer(name, 0, 255)
    form = re.compile(rf"([0-9]{{1,6}}(?:\.[0-9]{{1,6}})?) ?({'|'.join(map(re.escape, units))})")

    def convert(kind: object, tokens: Sequence[Token]) -> Amount:
        if found := form.fullmatch(tokens[0].value):
            return Amount(float(found[1]), found[2])
        try:
            return Amount(integer(kind, tokens), "")
        except UsageError as error:
            raise UsageError(f"{error}; or give it in {' or '.join(units)}, as in 40.5{units[0]}") from None

    return Parameter(converter=convert, n_tokens=1, accepts_keys=False, metavar=metavar)


def _fingers(_type: object, tokens: Sequence[Token]) -> Finger:
    with usage():
        return parse_fingers("--fingers", tokens[0].value)


AddressArgument = Annotated[
    str,
    Parameter(
        help="The gripper: tcp://HOST[:PORT], rtu:///dev/ttyUSB0, rtu+tcp://HOST:PORT, "
        "urcap://HOST, zenoh://SITE/HOST/NAME or sim://."
    ),
]
Flag = Annotated[bool, Parameter(negative=(), show_default=False)]
"""Off unless given. There is no --no- form, and the help shows no default."""
Yes = Annotated[Flag, Parameter(name=("--yes", "-y"))]
Host = Annotated[str, Parameter(metavar="HOST")]
Position = Annotated[Amount, _amount("POSITION", "mm")]
Speed = Annotated[Amount | None, _amount("the value", "mm/s", metavar="0..255|MM/S")]
Force = Annotated[Amount | None, _amount("the value", "N", metavar="0..255|N")]
Byte = Annotated[int, Parameter(converter=_integer("the value", 0, 255), metavar="0..255")]
Port = Annotated[int, Parameter(converter=_integer("the port", 0, 65535), metavar="0..65535")]
Unit = Annotated[int, Parameter(converter=_integer("the unit id", 0, 255), metavar="0..255")]
UnitIds = Annotated[
    list[int], Parameter(converter=_integers("the unit id", 0, 255), metavar="0..255", negative=())
]
StageNumber = Annotated[int, Parameter(converter=_integer("the stage", 0, 9), metavar="0..9")]
Runs = Annotated[int, Parameter(converter=_integer("the runs", 1, 100), metavar="N")]
StepCounts = Annotated[int, Parameter(converter=_integer("the step", 1, 255), metavar="N")]
PointCount = Annotated[int, Parameter(converter=_integer("the points", 2, 50), metavar="N")]
FingersArgument = Annotated[
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


def _argument(option: Option) -> object:
    low, high = option.low, option.high
    if option.choices:
        return Annotated[
            Literal[option.choices] | None,
            Parameter(help=f"{option.help} (default: the model of the address, or {option.choices[0]})."),
        ]
    if option.is_file:
        return Annotated[str | None, Parameter(metavar="FILE.csv", help=f"{option.help}.")]
    if option.default is not None:
        return Annotated[float, Parameter(metavar="SECONDS", help=f"{option.help}, {low:g}..{high:g}.")]
    convert = _integer("the value", int(low), int(high))
    usual = f"{option.tcp}" if option.tcp == option.rtu else f"{option.tcp} on TCP, {option.rtu} serial"
    text = f"{option.help} (default: {usual})."
    return Annotated[int | None, Parameter(converter=convert, metavar=f"{low:g}..{high:g}", help=text)]


_LINK_OPTIONS: Final = offered(Place.COMMAND_LINE)
_LinkArguments: Any = make_dataclass(
    "_LinkArguments",
    [(name, _argument(option), option.default) for name, option in _LINK_OPTIONS.items()],
    frozen=True,
)


@Parameter(name="*")
@dataclass(frozen=True)
class LinkOptions(_LinkArguments):  # type: ignore[misc]  # made from the table of options
    """Options of the link for a gripper with unusual settings; the command doctor finds them."""

    def options(self) -> dict[str, Any]:
        """The options, as RobotiqHand takes them."""
        return asdict(self)


USUAL_LINK: Final = LinkOptions()
