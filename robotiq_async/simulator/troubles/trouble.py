"""Troubles as data: one table of kinds, and troubles written as text or as values.

A trouble is an event (a reply is lost, another client writes) or a condition that lasts (the gripper is
silent, the device is slow). As text it is
``KIND [VALUE] [on read|write] [at S] [for S|for ever|once] [every S]``::

    drop at 5                      one reply is lost, 5 s after the beginning
    delay 0.05                     every reply comes 50 ms later
    wrong-unit on write once       the next reply to a write comes from another unit
    power-cut at 10 for 2 every 60
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, get_args

from robotiq_async.values.checks import as_float, as_int, check_seconds

from . import corruption
from .corruption import Corruption

LONGEST_TROUBLE_S: Final = 86400.0
_MOMENT: Final = 0.0
_CONDITION: Final = math.inf

On = Literal["read", "write", "any"]
TroubleLink = Literal["tcp", "rtu", "rtu+tcp", "urcap"]


class TroubleKind(NamedTuple):
    """One kind of trouble.

    Attributes:
        meaning: one line about it.
        lasts: its duration by default: 0 for an event, infinity for a condition.
        value: its default value; None for a kind without a value.
        low: the least value.
        high: the greatest value.
        corruption: its change of a reply, if it has one.
        on: the requests whose replies it can affect.
        link: tcp for a trouble of connections, or of frames of Modbus TCP; rtu for one of frames of a line;
            urcap for one of the text port.
        habit: the habit of the gripper that it changes, if it does.
        is_modbus: whether it concerns functions, registers or checksums, which only Modbus has.
    """

    meaning: str
    lasts: float = _MOMENT
    value: float | None = None
    low: float = 0.0
    high: float = 0.0
    corruption: Corruption | None = None
    on: On = "any"
    link: TroubleLink | None = None
    habit: str | None = None
    is_modbus: bool = False

    def fits(self, link: TroubleLink) -> bool:
        """Whether it can happen on a kind of link.

        A serial server has the frames of a line, and connections. It keeps the silence between frames itself.
        """
        if link == "urcap":
            return self.link in (None, "tcp", "urcap") and not self.is_modbus
        if link == "rtu+tcp":
            is_about_frames = self.corruption is not None
            is_elsewhere = self.link == "urcap" or (self.link == "tcp" and is_about_frames)
            return self is not KINDS["strict-silence"] and not is_elsewhere
        return self.link in (None, link)

    @property
    def links(self) -> tuple[TroubleLink, ...]:
        """The kinds of link that it can happen on."""
        return tuple(link for link in get_args(TroubleLink) if self.fits(link))

    @property
    def can_hit_once(self) -> bool:
        """Whether it makes sense to have it for a single reply or a single moment."""
        is_about_one = self in (KINDS["silence"], KINDS["lost-set"])
        return self.lasts == _MOMENT or self.corruption is not None or is_about_one


KINDS: Final[dict[str, TroubleKind]] = {
    # Replies.
    "delay": TroubleKind("replies come VALUE seconds later", _CONDITION, 0.05, 0, 10, corruption.delay),
    "late": TroubleKind(
        "a reply comes VALUE seconds later, after the client has given up",
        *(_MOMENT, 0.7, 0, 10, corruption.delay),
    ),
    "drop": TroubleKind("a reply is lost; its request was carried out", corruption=corruption.drop),
    "half": TroubleKind("only the first half of a reply comes", corruption=corruption.half),
    "pieces": TroubleKind(
        "replies come in three pieces, VALUE seconds apart", _CONDITION, 0.002, 0, 1, corruption.pieces
    ),
    "twice": TroubleKind("a reply comes twice in one segment", corruption=corruption.twice),
    "wrong-function": TroubleKind(
        "a reply is one to another function", corruption=corruption.wrong_function, is_modbus=True
    ),
    "wrong-length": TroubleKind(
        "a reply is one register short", corruption=corruption.wrong_length, is_modbus=True
    ),
    "wrong-count": TroubleKind(
        "a reply lies about how much it holds", corruption=corruption.wrong_count, is_modbus=True
    ),
    "wrong-transaction": TroubleKind(
        "a reply carries an old transaction number",
        corruption=corruption.wrong_transaction,
        link="tcp",
        is_modbus=True,
    ),
    "wrong-unit": TroubleKind(
        "a reply comes from another unit", corruption=corruption.wrong_unit, is_modbus=True
    ),
    "wrong-protocol": TroubleKind(
        "a reply is of another protocol than Modbus",
        corruption=corruption.wrong_protocol,
        link="tcp",
        is_modbus=True,
    ),
    "wrong-echo": TroubleKind(
        "a reply to a write names another register",
        corruption=corruption.wrong_echo,
        on="write",
        is_modbus=True,
    ),
    "wrong-checksum": TroubleKind(
        "a reply has a wrong checksum", corruption=corruption.wrong_checksum, link="rtu"
    ),
    "byte-before": TroubleKind(
        "a byte VALUE comes before a reply", _MOMENT, 0, 0, 255, corruption.byte_before, link="rtu"
    ),
    "byte-after": TroubleKind(
        "a byte VALUE comes after a reply", _MOMENT, 0, 0, 255, corruption.byte_after, link="rtu"
    ),
    "seven-bits": TroubleKind(
        "replies lose the highest bit of each byte", _CONDITION, corruption=corruption.seven_bits, link="rtu"
    ),
    "garbled": TroubleKind(
        "replies are bytes that mean nothing, as at another rate",
        _CONDITION,
        corruption=corruption.garbled,
        link="rtu",
    ),
    "exception": TroubleKind(
        "a request is answered by exception VALUE",
        *(_MOMENT, 4, 1, 255, corruption.refusal),
        link="tcp",
        is_modbus=True,
    ),
    "uneven-delay": TroubleKind(
        "replies come 10 to 60 ms later as a rule, and one in a hundred up to VALUE seconds",
        *(_CONDITION, 0.26, 0.12, 10, corruption.delay),
    ),
    "latency-timer": TroubleKind(
        "replies wait for the timer of a USB adapter, which ends every VALUE seconds",
        *(_CONDITION, 0.016, 0.001, 1, corruption.delay),
        link="rtu",
    ),
    # Requests and connections.
    "silence": TroubleKind("requests are not heard; connections stay open", _CONDITION),
    "echo": TroubleKind("the line brings back the bytes sent", _CONDITION, link="rtu"),
    "strict-silence": TroubleKind(
        "a request that comes within VALUE seconds after a reply is not heard",
        *(_CONDITION, 0.00175, 0, 1),
        link="rtu",
    ),
    "reset": TroubleKind("all connections are reset", link="tcp"),
    "close": TroubleKind("all connections are closed in order", link="tcp"),
    "accept-silence": TroubleKind(
        "connections are reset; new ones are accepted, not answered", _CONDITION, link="tcp"
    ),
    "refuse": TroubleKind("connections are reset; new ones are refused", _CONDITION, link="tcp"),
    "first-lost": TroubleKind("the first request of a new connection is not heard", _CONDITION, link="tcp"),
    "old-connection": TroubleKind(
        "a forwarder keeps a connection for VALUE seconds after its end, and answers no new one until then",
        *(_CONDITION, 30.0, 0, 3600),
        link="tcp",
    ),
    "multiplexer": TroubleKind(
        "a gateway keeps its own connection: replies come VALUE seconds later, to the client connected then",
        *(_CONDITION, 0.7, 0, 10),
        link="tcp",
    ),
    # The gripper.
    "power-cut": TroubleKind("the gripper has no power, and comes back reset", _CONDITION),
    "idle-reset": TroubleKind(
        "the gripper loses its activation when no request comes for VALUE seconds", _CONDITION, 5.0, 0, 3600
    ),
    "foreign": TroubleKind("another client sends all axes to VALUE", _MOMENT, 128, 0, 255),
    "slow-device": TroubleKind("requests take effect VALUE seconds after they came", _CONDITION, 0.2, 0, 10),
    "interference": TroubleKind("the scissor is blocked: fault 0x0A, after 20 s 0x0E", _CONDITION),
    "fault": TroubleKind("the gripper reports fault VALUE", _CONDITION, 9, 1, 15),
    "controller-fault": TroubleKind(
        "the controller before a jaw reports fault VALUE (kFLT)", *(_CONDITION, 12, 1, 15), is_modbus=True
    ),
    "release": TroubleKind("the gripper releases automatically"),
    "stranded": TroubleKind("the gripper loses its activation and keeps rACT: nothing moves until a reset"),
    "e-stop": TroubleKind(
        "the emergency stop is pressed: fault 0x05; after its end VALUE resets are needed",
        *(_CONDITION, 1, 1, 9),
    ),
    # Habits of grippers, by one source or more.
    "status-lag": TroubleKind(
        "gDT and gSTA lag the rest of the status by VALUE seconds",
        *(_CONDITION, 0.05, 0, 1),
        habit="status_lag",
    ),
    "silence-fault": TroubleKind(
        "the first status after VALUE seconds without a message shows fault 0x09",
        *(_CONDITION, 1.0, 0, 3600),
        habit="silence_fault",
    ),
    "slow-activation": TroubleKind(
        "an activation takes VALUE seconds", *(_CONDITION, 25.0, 0, 600), habit="activation_time"
    ),
    "echoed-limits": TroubleKind(
        "a request beyond a software limit is echoed as the limit", _CONDITION, habit="echoes_limits"
    ),
    "write-spacing": TroubleKind(
        "a write within VALUE seconds of the one before is acknowledged and forgotten",
        *(_CONDITION, 0.01, 0, 1),
        habit="write_spacing",
    ),
    "wake-needed": TroubleKind(
        "on a new connection the first image with rACT only wakes the gripper: its motion is forgotten",
        _CONDITION,
        link="tcp",
    ),
    "registers": TroubleKind(
        "more than VALUE registers of a block are refused: no answer on a serial line",
        *(_CONDITION, 3, 1, 8),
        is_modbus=True,
    ),
    "function-3-only": TroubleKind(
        "function 4 is refused, and function 3 reads the status", _CONDITION, is_modbus=True
    ),
    "no-function-23": TroubleKind(
        "function 23 is refused: no answer on a serial line", _CONDITION, link="rtu"
    ),
    "one-connection-only": TroubleKind(
        "while there is a connection, a new one is reset", _CONDITION, link="tcp"
    ),
    "one-by-one": TroubleKind(
        "the variables of a SET are taken one by one, VALUE seconds apart",
        *(_CONDITION, 0.01, 0, 1),
        link="urcap",
    ),
    "lost-set": TroubleKind(
        "a SET is acknowledged, and does not reach the gripper", _CONDITION, link="urcap"
    ),
    "unreadable": TroubleKind(
        "the answer to a GET is NAME ?, as while the arm is in an emergency stop", _CONDITION, link="urcap"
    ),
}
"""Every kind of trouble, by its name."""


@dataclass(frozen=True, slots=True)
class Trouble:
    """One thing that goes wrong.

    Attributes:
        kind: one of :data:`KINDS`.
        value: its meaning depends on the kind; None for its usual value.
        on: the requests whose replies it is about.
        at: seconds after the beginning of the plan.
        lasts: seconds, infinity for ever, 0 for once (one reply, one request, one cut); None for the
            usual duration of the kind.
        every: seconds after which it comes again, if it does.
    """

    kind: str
    value: float | None = None
    on: On = "any"
    at: float = 0.0
    lasts: float | None = None
    every: float | None = None

    def __post_init__(self) -> None:
        """Check that all of it fits together, and keep plain numbers.

        Raises:
            TypeError: not a number.
            ValueError: no such kind, or something that does not fit it.
        """
        known = KINDS.get(self.kind)
        if known is None:
            raise ValueError(f"unknown trouble {self.kind!r}; known are: {', '.join(KINDS)}")
        if self.value is not None:
            self._keep("value", _checked_value(self.kind, known, self.value))
        if self.on not in get_args(On):
            raise ValueError(f"on must be read, write or any, got {self.on!r}")
        if self.on != "any" and (known.corruption is None or known.on not in ("any", self.on)):
            raise ValueError(f"'on {self.on}' means nothing for {self.kind}")
        self._keep("at", check_seconds("at", self.at, 0, LONGEST_TROUBLE_S))
        if self.lasts is not None and self.lasts != math.inf:
            self._keep("lasts", check_seconds("for", self.lasts, 0, LONGEST_TROUBLE_S))
        if self.duration == 0 and not known.can_hit_once:
            raise ValueError(f"{self.kind} is a condition: give a duration, or leave it out to last for ever")
        if self.every is not None:
            self._keep("every", check_seconds("every", self.every, 0.001, LONGEST_TROUBLE_S))
            if self.every <= self.duration:
                raise ValueError(f"{self.kind} cannot come again after {self.every:g} s: it lasts as long")

    def _keep(self, name: str, number: float) -> None:
        object.__setattr__(self, name, number)

    @property
    def duration(self) -> float:
        """Its duration in seconds: 0 for once, infinity for ever."""
        return KINDS[self.kind].lasts if self.lasts is None else self.lasts

    @property
    def amount(self) -> float:
        """Its value, or the default; 0 for a kind without a value."""
        return (KINDS[self.kind].value if self.value is None else self.value) or 0.0

    def is_about(self, *, write: bool) -> bool:
        """Whether it is about replies to writes, or to reads."""
        this: On = "write" if write else "read"
        return self.on in (this, "any") and KINDS[self.kind].on in (this, "any")

    def __str__(self) -> str:
        words = [self.kind]
        words += [] if self.value is None else [_digits(self.value)]
        words += [] if self.on == "any" else [f"on {self.on}"]
        words += [f"at {_digits(self.at)}"] if self.at else []
        if self.lasts is not None:
            words += ["once" if self.lasts == 0 else f"for {_digits(self.lasts)}"]
        words += [] if self.every is None else [f"every {_digits(self.every)}"]
        return " ".join(words)


def _digits(number: float) -> str:
    """A number with all its digits, and no more."""
    if number == math.inf:
        return "ever"
    return repr(int(number) if number == int(number) else number)


def _checked_value(name: str, kind: TroubleKind, value: object) -> float:
    if kind.value is None:
        raise ValueError(f"{name} takes no value, got {value!r}")
    whole = isinstance(kind.value, int)
    form = "a whole number" if whole else "seconds"
    what = f"the value of {name} must be {form} in {kind.low:g}..{kind.high:g}"
    number: float | None = as_int(value)
    if number is None:
        number = as_float(value)
    if number is None:
        raise TypeError(f"{what}, got {value!r}")
    if not kind.low <= number <= kind.high or (whole and number != int(number)):
        raise ValueError(f"{what}, got {value!r}")
    return number


def parse_troubles(text: str) -> list[Trouble]:
    """Read troubles: one a line, or several with ``;`` between them. Text after a ``#`` is a remark.

    Raises:
        ValueError: a line that is not a trouble, with the reason.
    """
    lines = (part for line in text.splitlines() for part in line.partition("#")[0].split(";"))
    return [_parse_one(line) for line in lines if line.strip()]


def _parse_one(line: str) -> Trouble:
    words = line.split()
    kind = words.pop(0)
    value = None
    if kind not in KINDS:
        Trouble(kind)  # raises for it
    if words and words[0] not in _WORDS:
        value = _number(kind, words.pop(0))
    options: dict[str, str] = {}
    while words:
        word = words.pop(0)
        if word not in _WORDS or word in options or (word != "once" and not words):
            raise ValueError(f"cannot read {line.strip()!r} at {word!r}; the form is: {TROUBLE_FORM}")
        options[word] = "" if word == "once" else words.pop(0)
    if "once" in options and "for" in options:
        raise ValueError(f"cannot read {line.strip()!r}: 'once' and 'for' contradict each other")
    lasts: float | None = 0.0 if "once" in options else None
    if "for" in options:
        lasts = math.inf if options["for"] == "ever" else _number("for", options["for"])
    on = options.get("on", "any")
    return Trouble(
        kind,
        value,
        on=on,  # type: ignore[arg-type]  # checked there
        at=_number("at", options.get("at", "0")),
        lasts=lasts,
        every=_number("every", options["every"]) if "every" in options else None,
    )


TROUBLE_FORM: Final = "KIND [VALUE] [on read|write] [at S] [for S|for ever|once] [every S]"
_WORDS: Final = ("on", "at", "for", "once", "every")


def _number(what: str, text: str) -> float:
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{what} must be followed by a number, got {text!r}") from None
