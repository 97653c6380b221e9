"""Addresses: a string that names a gripper, and one spelling for all that lead to the same."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from ipaddress import IPv4Address, IPv6Address
from typing import TYPE_CHECKING, Final, Literal

from ..values.checks import check_byte, repr_of
from ..values.model import Model, model_of

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

TCP_PORT: Final = 502  # the port of Modbus TCP, and the gripper's
URCAP_PORT: Final = 63352  # the text port of Robotiq's URCap on a UR controller

TUNNELS: Final = "robotiq_async.tunnels"
"""The group of entry points in which a package names its tunnels: each name is a scheme."""
REMOTE_SCHEME: Final = "zenoh://"  # of a gripper on another host, for a remote hand
FORMS: Final = "tcp://HOST, rtu://DEVICE, rtu+tcp://HOST:PORT, urcap://HOST, sim://, zenoh://..."
"""For messages; docs/how-to/which-wire.md and the help of the command line explain them."""
LONGEST: Final = 200
"""Characters of a message about a malformed address: it is one line of a terminal, or two."""
SHOWN: Final = 70
"""Characters of a malformed address in it."""

BAUD: Final = 115200  # the rate of a serial line, 8N1, as a gripper is shipped (manual 2014, p. 59)
SLOWEST_BAUD: Final = 9600
FASTEST_BAUD: Final = 1_000_000
"""No manual lists the rates that the vendor's tool can set; users have named 125000, 250000 and 500000."""
GRIPPER_OPTIONS: Final = ("model", "stroke")
"""Options at the end of any address."""
LINE_OPTIONS: Final = ("baud", "parity", "stopbits")

LEAST_SPEEDUP: Final = 0.01
MOST_SPEEDUP: Final = 1000.0
"""Speedups of a simulated gripper; faster than that, whole motions pass between two polls."""
SIMULATION_OPTIONS: Final = ("speedup", "object", "physics")


@dataclass(frozen=True, slots=True)
class Simulation:
    """The options of a simulated gripper.

    Attributes:
        speedup: simulated seconds in one second of the clock, 0.01..1000.
        object: position in counts, 0..255, at which the fingers A, B and C meet an object when they close;
            None for no object.
        physics: the scene in which bodies move, as ``table`` or ``box:40x60x80,0.3``; None for no physics. It
            is read when the hand is made.
    """

    speedup: float = 1.0
    object: int | None = None
    physics: str | None = None

    def __str__(self) -> str:
        speedup = int(self.speedup) if self.speedup == int(self.speedup) else self.speedup
        options = [f"speedup={speedup!r}"] if speedup != 1 else []
        options += [] if self.object is None else [f"object={self.object}"]
        options += [] if self.physics is None else [f"physics={self.physics}"]
        return f"?{'&'.join(options)}" if options else ""


NOTHING_SPECIAL: Final = Simulation()


@dataclass(frozen=True, slots=True)
class LineSettings:
    """The settings of a serial port. It sends 8 data bits, as Modbus RTU wants them.

    Attributes:
        baud: bits a second, 9600..1000000.
        parity: "N" (no parity bit), "E" (even) or "O" (odd).
        stopbits: 1 or 2.
    """

    baud: int = BAUD
    parity: str = "N"
    stopbits: int = 1

    @property
    def character_s(self) -> float:
        """Seconds that a character takes."""
        return (9 + (self.parity != "N") + self.stopbits) / self.baud

    def __str__(self) -> str:
        usual = LineSettings()
        given = [name for name in LINE_OPTIONS if getattr(self, name) != getattr(usual, name)]
        return "?" + "&".join(f"{name}={getattr(self, name)}" for name in given) if given else ""


USUAL_LINE: Final = LineSettings()
USUAL: Final = "without them 115200 baud, 8N1, as a gripper comes"


LinkKind = Literal["tcp", "rtu", "rtu+tcp", "urcap", "sim", "tunnel"]

_SOCKETS: Final[dict[str, tuple[LinkKind, int | None]]] = {
    "tcp": ("tcp", TCP_PORT),
    "rtu+tcp": ("rtu+tcp", None),
    "urcap": ("urcap", URCAP_PORT),
}
"""The schemes of sockets, and their ports unless one is given. Serial servers have no usual one."""


@dataclass(frozen=True, slots=True)
class Address:
    """A checked address.

    Attributes:
        kind: "tcp", "rtu", "rtu+tcp", "urcap", "sim" or "tunnel".
        host: host name or IP address (tcp, rtu+tcp, urcap, tunnel), device of the serial port (rtu), empty
            (sim), name of a tunnel that is an object.
        port: TCP port; 0 for the others, and for a tunnel without one.
        simulation: the properties of the gripper (sim); nothing special for the others.
        line: how the serial port sends (rtu); the usual for the others.
        model: of the gripper; None if the address does not name it.
        stroke: absolute path of a file with measured openings, which is read when a hand is made; None for
            nominal ones.
        scheme: of a tunnel; empty for the others, and for a tunnel that is an object.
        options: names and values of options for the tunnel alone.
    """

    kind: LinkKind
    host: str = ""
    port: int = 0
    simulation: Simulation = NOTHING_SPECIAL
    line: LineSettings = USUAL_LINE
    model: Model | None = None
    stroke: str | None = None
    scheme: str = ""
    options: tuple[tuple[str, str], ...] = ()

    @property
    def is_rtu(self) -> bool:
        """Whether a serial line leads to the gripper, from here, from a serial server or from an arm."""
        return self.kind in ("rtu", "rtu+tcp", "tunnel")

    @property
    def is_socket(self) -> bool:
        """Whether it is reached through a network."""
        return self.kind in _SOCKETS

    def __str__(self) -> str:
        query = str(self.simulation) + str(self.line) + own_options(self.options)
        name = None if self.model is None else self.model.name
        for option, value in zip(GRIPPER_OPTIONS, (name, self.stroke), strict=True):
            query += "" if value is None else f"{'&' if query else '?'}{option}={value}"
        if self.kind == "tunnel" and not self.scheme:
            return self.host
        if self.is_socket or self.scheme:
            host = f"[{self.host}]" if ":" in self.host else self.host
            port = f":{self.port}" if self.port else ""
            return f"{self.scheme or self.kind}://{host}{port}{query}"
        return f"{self.kind}://{self.host}{query}"


def own_options(options: Iterable[tuple[str, str]]) -> str:
    """The options of a tunnel as they are written, with the question mark before them; may be empty."""
    written = "&".join(f"{name}={value}" for name, value in options)
    return f"?{written}" if written else ""


def is_remote(address: object) -> bool:
    """Whether an address is one of a gripper on another host; upper or lower case."""
    return isinstance(address, str) and address[: len(REMOTE_SCHEME)].lower() == REMOTE_SCHEME


def parse_address(address: object) -> Address:
    """The address in a string."""
    if not isinstance(address, str):
        raise TypeError(_within(f"address must be a string, such as {FORMS}; got {repr_of(address)}"))
    scheme, separator, rest = address.partition("://")
    scheme = scheme.lower()
    if not separator:
        if re.fullmatch(r"com[0-9]{1,3}|/dev/.*", address, re.IGNORECASE):  # it would be a host
            raise malformed(address, f"a serial port is rtu://{address}")
        scheme, rest = "tcp", address
    try:
        rest, model, stroke = _without_options_of_a_gripper(rest)
        if scheme == "sim" and rest[:1] in ("", "?"):
            return Address("sim", simulation=parse_simulation(rest), model=model, stroke=stroke)
    except ValueError as error:
        raise malformed(address, str(error)) from None
    if scheme == "rtu" and rest.strip("/") and rest == rest.strip() and rest.isprintable():
        if "://" in rest:  # pyserial would open it, and block the event loop for seconds
            what = f"{rest} is no serial port; for one behind a TCP socket use rtu+tcp://HOST:PORT"
            raise malformed(address, what)
        try:
            device, line = _device_and_line(rest)
        except ValueError as error:
            raise malformed(address, str(error)) from None
        return Address("rtu", device, line=line, model=model, stroke=stroke)
    if scheme in _SOCKETS:
        if "?" in rest:  # model and stroke have been taken out
            names = [option.partition("=")[0] for option in rest.partition("?")[2].split("&")]
            what = _unknown(names[0], GRIPPER_OPTIONS)
            if not set(names).isdisjoint(LINE_OPTIONS):
                what = "baud, parity and stopbits are options of a serial port; a serial server has its own"
            raise malformed(address, what)
        kind, usual_port = _SOCKETS[scheme]
        host, port = _host_and_port(rest, usual_port)
        if ":" not in host and _ends_in_a_number(host) and not _is_ipv4(host):
            what = f"{host} is not an IPv4 address: four numbers in 0..255, without leading zeros"
            raise malformed(address, what)
        if host and port is not None:
            return Address(kind, host, port, model=model, stroke=stroke)
    if scheme == "zenoh":
        what = "is a gripper on another host: use robotiq_async.fleet.RemoteHand, or an address here"
        raise ValueError(_within(f"{_shown(address)} {what}: {FORMS}"))
    if scheme in ("sim", "rtu", *_SOCKETS) or not _SCHEME_FORM.fullmatch(scheme):
        raise malformed(address)
    try:
        return _through_a_tunnel(scheme, rest, model, stroke)
    except ValueError as error:
        raise malformed(address, str(error)) from None


_SCHEME_FORM: Final = re.compile("[a-z][a-z0-9+.-]*")


def entry_of(scheme: str) -> EntryPoint | None:
    """The entry point of an installed package under a scheme, or None. It is not loaded.

    Raises:
        ValueError: several packages name the same.
    """
    from importlib.metadata import entry_points  # noqa: PLC0415  # a tenth of the time that all else takes

    found = tuple(entry_points(group=TUNNELS, name=scheme))
    if len({each.value for each in found}) > 1:
        makers = " and ".join(sorted(each.value for each in found))
        raise ValueError(f"several packages have tunnels for {scheme}://: {makers}")
    return found[0] if found else None


def _through_a_tunnel(scheme: str, rest: str, model: Model | None, stroke: str | None) -> Address:
    """An address of a package; only the package knows its options."""
    if entry_of(scheme) is None:
        raise ValueError(f"no package here has {scheme}://; accepted: {FORMS}")
    place, _, query = rest.partition("?")
    host, port = _host_and_port(place, 0)
    if not host or port is None:
        raise ValueError(f"a tunnel is {scheme}://HOST, or {scheme}://HOST:PORT")
    options: dict[str, str] = {}
    for part in query.split("&") if query else ():
        name, separator, value = part.partition("=")
        if not (name and separator and part.isprintable()) or name in options:
            raise ValueError(f"an option of a tunnel is given once, as NAME=VALUE, got {part!r}")
        options[name] = value
    given = tuple(options.items())
    return Address("tunnel", host, port, model=model, stroke=stroke, scheme=scheme, options=given)


def malformed(address: str, why: str = "", forms: str = FORMS) -> ValueError:
    """The error about an address: why it is malformed, else the forms that there are."""
    rest = f": {why}" if why else f"; accepted: {forms}"
    return ValueError(_within(f"malformed address {_shown(address)}{rest}"))


def _shown(address: str) -> str:
    """An address in a message: its beginning and its end if it is long."""
    return repr(address if len(address) <= SHOWN else f"{address[: SHOWN - 13]}...{address[-10:]}")


def _within(message: str) -> str:
    return message if len(message) <= LONGEST else f"{message[: LONGEST - 3]}..."


def _without_options_of_a_gripper(text: str) -> tuple[str, Model | None, str | None]:
    """Take ``model=NAME`` and ``stroke=FILE`` out of the options after a question mark."""
    text, name = _without("model", text, "NAME")
    text, stroke = _without("stroke", text, "FILE")
    if stroke is not None and not os.path.isabs(stroke):
        why = "an address is the same in any folder"
        raise ValueError(f"stroke must be the absolute path of a file, for {why}, got {stroke!r}")
    return text, None if name is None else model_of(name), stroke


def _without(name: str, text: str, form: str) -> tuple[str, str | None]:
    place, _, query = _split(text)
    options = query.split("&") if query else []
    given = [option.removeprefix(f"{name}=") for option in options if option.startswith(f"{name}=")]
    if not given:
        return text, None
    if len(given) > 1:
        raise ValueError(f"{name} must be given once, as {name}={form}")
    others = "&".join(option for option in options if not option.startswith(f"{name}="))
    return place + (f"?{others}" if others else ""), given[0]


def _split(text: str) -> tuple[str, str, str]:
    """A place, the question mark after it (or ""), and the options."""
    begin = _WINDOWS_PATH if text.startswith(_WINDOWS_PATH) else ""
    place, mark, query = text.removeprefix(begin).partition("?")
    return begin + place, mark, query


_WINDOWS_PATH: Final = "\\\\?\\"
"""The path of a serial port may begin with this on Windows."""


def _device_and_line(text: str) -> tuple[str, LineSettings]:
    """Split DEVICE?baud=...&parity=...&stopbits=..."""
    device, mark, query = _split(text)
    given = _options(query if mark else None, LINE_OPTIONS, f" ({USUAL})")
    return device, LineSettings(
        baud=_baud(given["baud"]) if "baud" in given else BAUD,
        parity=_one_of("parity", given.get("parity", "N"), "N", "E", "O"),
        stopbits=int(_one_of("stopbits", given.get("stopbits", "1"), "1", "2")),
    )


def _baud(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,7}", text) or not SLOWEST_BAUD <= int(text) <= FASTEST_BAUD:
        raise ValueError(f"baud must be an integer in {SLOWEST_BAUD}..{FASTEST_BAUD}, got {text!r}")
    return int(text)


def _one_of(name: str, given: str, *known: str) -> str:
    if given.upper() not in known:
        raise ValueError(f"{name} must be {', '.join(known[:-1])} or {known[-1]}, got {given!r}")
    return given.upper()


def _host_and_port(text: str, usual: int | None) -> tuple[str, int | None]:
    """Split HOST, HOST:PORT, [IPv6] or [IPv6]:PORT; the port is None where it is malformed."""
    if text.startswith("["):
        host, bracket, rest = text[1:].partition("]")
        try:
            IPv6Address(host)
        except ValueError:
            return "", None
        if not bracket:
            return "", None
        number, percent, zone = host.partition("%")
        host = number.lower() + percent + _zone(zone)
        separator, port = rest[:1], rest[1:]
        if rest and separator != ":":
            return "", None
    else:
        host, separator, port = text.partition(":")
        if not set(host) <= _HOST_CHARACTERS or host.startswith("-"):
            return "", None
        if not all(1 <= len(label) <= 63 for label in host.removesuffix(".").split(".")):
            return "", None
        host = host.lower()
    if not separator:
        return host, usual
    if not (port.isascii() and port.isdigit() and len(port) <= 5 and 1 <= int(port) <= 65535):
        return host, None
    return host, int(port)


def _zone(text: str) -> str:
    """A zone as it is typed, or as in a URI, where %25 stands for the percent sign before it (RFC 6874)."""
    name = text.removeprefix("25")
    return text if not name or name.isdecimal() else name  # digits are the number of an interface


_HOST_CHARACTERS: Final = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_")


def _is_ipv4(host: str) -> bool:
    try:
        IPv4Address(host)
    except ValueError:
        return False
    return True


def _ends_in_a_number(host: str) -> bool:
    """Whether resolvers take a host for an IPv4 address, in any spelling: 127.1, 0x7f000001.

    They do not agree on all spellings: 192.168.1.011 ends in 9 for one resolver and in 11 for another.
    """
    return re.fullmatch(r"[0-9]+|0x[0-9a-f]*", host.removesuffix(".").rpartition(".")[2]) is not None


def parse_simulation(query: str) -> Simulation:
    """Parse the part after ``sim://``: nothing, or ``?OPTION=VALUE&...``."""
    given = _options(query.removeprefix("?") if query else None, SIMULATION_OPTIONS)
    if "object" in given and "physics" in given:
        raise ValueError("object and physics cannot be combined: physics has its own part")
    return Simulation(
        speedup=_speedup(given["speedup"]) if "speedup" in given else 1.0,
        object=_object(given["object"]) if "object" in given else None,
        physics=given.get("physics"),
    )


def _options(query: str | None, known: Sequence[str], usual: str = "") -> dict[str, str]:
    """Split NAME=VALUE&...; ``usual`` is added to the message about a name that is not known."""
    given: dict[str, str] = {}
    for part in () if query is None else query.split("&"):
        name, separator, value = part.partition("=")
        if name not in known:
            raise ValueError(_unknown(name, (*GRIPPER_OPTIONS, *known)) + usual)
        if not separator or name in given:
            raise ValueError(f"{name} must be given once, as {name}=VALUE")
        given[name] = value
    return given


def _unknown(name: str, known: Sequence[str]) -> str:
    return f"no option {name!r}; known are: {', '.join(known)}"


def _speedup(text: str) -> float:
    is_number = re.fullmatch(r"[0-9]{1,9}(\.[0-9]{1,9})?", text)
    if not is_number or not LEAST_SPEEDUP <= float(text) <= MOST_SPEEDUP:
        raise ValueError(f"speedup must be a number in {LEAST_SPEEDUP:g}..{MOST_SPEEDUP:g}, got {text!r}")
    return float(text)


def _object(text: str) -> int:
    if not re.fullmatch(r"[0-9]{1,9}", text):
        raise ValueError(f"object must be an integer in 0..255, got {text!r}")
    return check_byte("object", int(text))
