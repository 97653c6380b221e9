"""The kinds of trouble once more, for the tests: a new kind is a row here."""

from __future__ import annotations

from typing import Final, NamedTuple

REPLY: Final = "one reply, or those of a time; of reads, writes or both"
REPLIES: Final = "all replies until it ends, or one"
WRITE_REPLY: Final = "one reply to a write"
SILENCE: Final = "all requests until it ends, or one"
EVENT: Final = "a moment"
CONDITION: Final = "lasts until it ends; it cannot be for one reply or moment"

ANY: Final = ("tcp", "rtu", "rtu+tcp", "urcap")
MODBUS: Final = ("tcp", "rtu", "rtu+tcp")
LINES: Final = ("rtu", "rtu+tcp")
CONNECTIONS: Final = ("tcp", "rtu+tcp", "urcap")


class Expected(NamedTuple):
    """A kind as users know it.

    Attributes:
        form: what it is about, and how long it lasts.
        links: the kinds of link on which it can happen.
        value: its usual value, the least and the greatest; None if it takes none. Whole numbers are integers,
            seconds are floats.
    """

    form: str
    links: tuple[str, ...]
    value: tuple[float, float, float] | None = None

    @property
    def is_whole(self) -> bool:
        return self.value is not None and isinstance(self.value[0], int)


EXPECTED: Final = {
    "delay": Expected(REPLIES, ANY, (0.05, 0, 10)),
    "late": Expected(REPLY, ANY, (0.7, 0, 10)),
    "drop": Expected(REPLY, ANY),
    "half": Expected(REPLY, ANY),
    "pieces": Expected(REPLIES, ANY, (0.002, 0, 1)),
    "twice": Expected(REPLY, ANY),
    "wrong-function": Expected(REPLY, MODBUS),
    "wrong-length": Expected(REPLY, MODBUS),
    "wrong-count": Expected(REPLY, MODBUS),
    "wrong-transaction": Expected(REPLY, ("tcp",)),
    "wrong-unit": Expected(REPLY, MODBUS),
    "wrong-protocol": Expected(REPLY, ("tcp",)),
    "wrong-echo": Expected(WRITE_REPLY, MODBUS),
    "wrong-checksum": Expected(REPLY, LINES),
    "byte-before": Expected(REPLY, LINES, (0, 0, 255)),
    "byte-after": Expected(REPLY, LINES, (0, 0, 255)),
    "seven-bits": Expected(REPLIES, LINES),
    "garbled": Expected(REPLIES, LINES),
    "exception": Expected(REPLY, ("tcp",), (4, 1, 255)),
    "uneven-delay": Expected(REPLIES, ANY, (0.26, 0.12, 10)),
    "latency-timer": Expected(REPLIES, LINES, (0.016, 0.001, 1)),
    "silence": Expected(SILENCE, ANY),
    "echo": Expected(CONDITION, LINES),
    "strict-silence": Expected(CONDITION, ("rtu",), (0.00175, 0, 1)),
    "reset": Expected(EVENT, CONNECTIONS),
    "close": Expected(EVENT, CONNECTIONS),
    "accept-silence": Expected(CONDITION, CONNECTIONS),
    "refuse": Expected(CONDITION, CONNECTIONS),
    "first-lost": Expected(CONDITION, CONNECTIONS),
    "old-connection": Expected(CONDITION, CONNECTIONS, (30.0, 0, 3600)),
    "multiplexer": Expected(CONDITION, CONNECTIONS, (0.7, 0, 10)),
    "power-cut": Expected(CONDITION, ANY),
    "idle-reset": Expected(CONDITION, ANY, (5.0, 0, 3600)),
    "foreign": Expected(EVENT, ANY, (128, 0, 255)),
    "slow-device": Expected(CONDITION, ANY, (0.2, 0, 10)),
    "interference": Expected(CONDITION, ANY),
    "fault": Expected(CONDITION, ANY, (9, 1, 15)),
    "controller-fault": Expected(CONDITION, MODBUS, (12, 1, 15)),
    "release": Expected(EVENT, ANY),
    "stranded": Expected(EVENT, ANY),
    "e-stop": Expected(CONDITION, ANY, (1, 1, 9)),
    "status-lag": Expected(CONDITION, ANY, (0.05, 0, 1)),
    "silence-fault": Expected(CONDITION, ANY, (1.0, 0, 3600)),
    "slow-activation": Expected(CONDITION, ANY, (25.0, 0, 600)),
    "echoed-limits": Expected(CONDITION, ANY),
    "write-spacing": Expected(CONDITION, ANY, (0.01, 0, 1)),
    "wake-needed": Expected(CONDITION, CONNECTIONS),
    "registers": Expected(CONDITION, MODBUS, (3, 1, 8)),
    "function-3-only": Expected(CONDITION, MODBUS),
    "no-function-23": Expected(CONDITION, LINES),
    "one-connection-only": Expected(CONDITION, CONNECTIONS),
    "one-by-one": Expected(CONDITION, ("urcap",), (0.01, 0, 1)),
    "lost-set": Expected(SILENCE, ("urcap",)),
    "unreadable": Expected(CONDITION, ("urcap",)),
}

CONDITIONS: Final = [name for name, kind in EXPECTED.items() if kind.form == CONDITION]
"""Kinds that cannot be for a single reply or moment."""
EITHER_WAY: Final = [name for name, kind in EXPECTED.items() if kind.form in (REPLY, REPLIES)]
"""Kinds that can be about replies to reads and to writes."""
