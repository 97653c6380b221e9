"""Writes the tables in docs/ that repeat what the code says, between their marks.

    python docs/make_tables.py

Each table stands between ``<!-- begin NAME -->`` and ``<!-- end NAME -->``; the rest of a page is written
by hand. A test compares the pages with what this script makes.
"""

from __future__ import annotations

import inspect
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from robotiq_async import ReconnectPolicy, RobotiqHand  # noqa: E402
from robotiq_async.control.state_machine import TABLE, Verdict  # noqa: E402
from robotiq_async.simulator.troubles.trouble import KINDS  # noqa: E402
from robotiq_async.values import registers  # noqa: E402
from robotiq_async.values.calibration.csv_tables import SPEED, read_table, thesis_table  # noqa: E402
from robotiq_async.values.enums import (  # noqa: E402
    Fault,
    Initialization,
    Mode,
    ObjectStatus,
    Severity,
    State,
)
from robotiq_async.values.registers import RTU_REGISTERS, TCP_REGISTERS, Field  # noqa: E402
from robotiq_async.values.trigger import Trigger  # noqa: E402

DOCS: Final = ROOT / "docs"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in markdown."""
    lines = [head, ["--"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


# -- states --------------------------------------------------------------------------------------------


def asked() -> str:
    """What each state answers to each call."""
    return _entries([trigger for trigger in Trigger if trigger.name.startswith("ASK_")])


def seen() -> str:
    """Where each state goes with what a status shows, and with what becomes of a request or the link."""
    return _entries(
        [trigger for trigger in Trigger if not trigger.name.startswith("ASK_")],
        dict.fromkeys(Verdict, ""),
    )


def _entries(triggers: Sequence[Trigger], words: Mapping[Verdict, str] | None = None) -> str:
    """The table's columns for some triggers; what leads to no state is said in these words, or in its own."""

    def cell(source: State, to: State | Verdict) -> str:
        if isinstance(to, Verdict):
            return to.value if words is None else words[to]
        return "stays" if source is to else to.name

    return table(
        ["state", *(trigger.value for trigger in triggers)],
        (
            [f"**{state.name}**", *(cell(state, row[trigger]) for trigger in triggers)]
            for state, row in TABLE.items()
        ),
    )


# -- registers -----------------------------------------------------------------------------------------


def request_fields() -> str:
    """The request block."""
    return _fields("r")


def status_fields() -> str:
    """The status block."""
    return _fields("g")


def _fields(prefix: str) -> str:
    found = sorted(_named(prefix), key=lambda each: (each[1].byte, each[1].shift))
    return table(
        ["register", "half", "byte", "bits", "name", "meaning"],
        (
            [
                str(field.byte // 2),
                "low" if field.byte % 2 else "high",
                str(field.byte),
                _bits(field),
                name,
                field.doc,
            ]
            for name, field in found
        ),
    )


def _named(prefix: str) -> Iterator[tuple[str, Field]]:
    """The fields of a block with the names of the manual."""
    for name, value in vars(registers).items():
        if re.fullmatch(f"{prefix}[A-Z]{{2,3}}", name):
            fields = (value,) if isinstance(value, Field) else value
            axes = ("",) if isinstance(value, Field) else "ABCS"
            yield from zip((name + axis for axis in axes), fields, strict=True)


def _bits(field: Field) -> str:
    last = field.shift + field.width - 1
    return str(field.shift) if field.width == 1 else f"{field.shift}-{last}"


def links() -> str:
    """Where the blocks lie on either link."""
    maps = (TCP_REGISTERS, RTU_REGISTERS)
    return table(
        ["", "Modbus TCP", "Modbus RTU"],
        (
            ["request block, first register", *(f"0x{each.request:04X} ({each.request})" for each in maps)],
            ["status block, first register", *(f"0x{each.status:04X} ({each.status})" for each in maps)],
            ["read with", *(f"function {each.read_function}" for each in maps)],
            ["written with", "function 16", "function 16"],
            ["device id", *(str(each.device_id) for each in maps)],
        ),
    )


def axis_codes() -> str:
    """The codes of gDT."""
    meanings = {
        ObjectStatus.IN_MOTION: "moving; meaningful only while gGTO = 1",
        ObjectStatus.CONTACT_OPENING: "stopped by a contact while opening",
        ObjectStatus.CONTACT_CLOSING: "stopped by a contact while closing",
        ObjectStatus.AT_POSITION: "at the requested position",
    }
    return table(
        ["gDT", "`ObjectStatus`", "meaning"],
        ([str(int(code)), f"`{code.name}`", meanings[code]] for code in ObjectStatus),
    )


def progress_codes() -> str:
    """The codes of gIMC and rMOD."""
    return table(
        ["code", "gIMC: `Initialization`", "rMOD, gMOD: `Mode`"],
        ([str(n), f"`{Initialization(n).name}`", f"`{Mode(n).name}`"] for n in range(4)),
    )


def faults() -> str:
    """The codes of gFLT."""
    state = {
        Severity.NONE: "",
        Severity.PRIORITY: "no change, no error",
        Severity.MINOR: "FAULT, until it clears",
        Severity.MAJOR: "FAULT, until a reset",
    }
    return table(
        ["gFLT", "`Fault`", "severity", "meaning", "the hand is in"],
        (
            [
                f"0x{int(fault):02X}",
                f"`{fault.name}`",
                fault.severity.value,
                fault.description,
                "ATR_DONE, until a reset" if fault is Fault.AUTOMATIC_RELEASE_DONE else state[fault.severity],
            ]
            for fault in Fault
        ),
    )


# -- reference -----------------------------------------------------------------------------------------


def options() -> str:
    """The constructor's options, from its signature and the docstring of the class."""
    return _arguments(RobotiqHand, "Args")


def reconnect_policy() -> str:
    """The fields of ReconnectPolicy."""
    return _arguments(ReconnectPolicy, "Attributes")


# -- simulator -----------------------------------------------------------------------------------------


def troubles() -> str:
    """What can go wrong with the simulator."""
    return table(
        ["kind", "what goes wrong", "VALUE", "unless said", "link"],
        (
            [
                f"`{name}`",
                kind.meaning,
                "" if kind.value is None else f"{kind.value:g}",
                "once" if kind.lasts == 0 else "for ever",
                kind.link or "",
            ]
            for name, kind in KINDS.items()
        ),
    )


# -- measurements --------------------------------------------------------------------------------------


def closing_times() -> str:
    """The thesis's table A1.1 beside a measured one, run by run."""
    thesis = thesis_table("closing_time_ms", SPEED)
    ours = read_table(DOCS / "measured" / "closing_time_ms.csv", SPEED)

    def row(value: int) -> list[str]:
        pairs = list(zip(thesis[value], ours[value], strict=True))
        apart = [f"{100 * (mine / theirs - 1):+.1f}" for theirs, mine in pairs]
        return [str(value), *(str(t) for t, _ in pairs), *(str(m) for _, m in pairs), *apart]

    runs = ("2", "3")
    firsts = ("thesis, ms: run 1", "simulated, ms: run 1", "apart, %: run 1")
    head = ["speed", *(name for first in firsts for name in (first, *runs))]
    return table(head, (row(value) for value in sorted(thesis)))


def _arguments(documented: Callable[..., object], section: str) -> str:
    parameters = inspect.signature(documented).parameters
    text = inspect.getdoc(documented) or ""
    (body,) = re.findall(rf"^{section}:\n((?: .*\n?|\n(?= ))+)", text, re.MULTILINE)
    entries = re.findall(r"^    (\w+): ((?:.*\n?)(?:^     +.*\n?)*)", body, re.MULTILINE)
    return table(
        ["option", "default", "meaning"],
        (
            [f"`{name}`", f"`{_default(parameters[name].default)}`", _plain(meaning)]
            for name, meaning in entries
        ),
    )


def _default(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _plain(text: str) -> str:
    """A docstring's text in markdown."""
    text = re.sub(r":\w+:`~?\.?([^`]+)`", r"`\1`", " ".join(text.split()))
    return text.replace("``", "`")


PAGES: Final[dict[str, dict[str, Callable[[], str]]]] = {
    "state-machine.md": {"asked": asked, "seen": seen},
    "registers.md": {
        "request": request_fields,
        "status": status_fields,
        "links": links,
        "gDT": axis_codes,
        "gIMC": progress_codes,
        "gFLT": faults,
    },
    "how-to/simulator.md": {"troubles": troubles},
    "how-to/measure.md": {"closing_times": closing_times},
    "reference.md": {"options": options, "reconnect": reconnect_policy},
}
"""The tables of each page."""


def filled(page: str, text: str) -> str:
    """A page with its tables as the code has them now.

    Raises:
        ValueError: a table has no place in the page.
    """
    for name, make in PAGES[page].items():
        begin, end = f"<!-- begin {name} -->\n", f"<!-- end {name} -->\n"
        before, found, rest = text.partition(begin)
        _, found_too, after = rest.partition(end)
        if not (found and found_too):
            raise ValueError(f"{page} has no place for the table {name!r}")
        text = f"{before}{begin}\n{make()}\n\n{end}{after}"
    return text


def main() -> None:
    """Fill every page."""
    for page in PAGES:
        path = DOCS / page
        path.write_text(filled(page, path.read_text(encoding="utf-8")), encoding="utf-8")


if __name__ == "__main__":
    main()
