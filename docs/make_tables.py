"""The tables and the diagram in docs/ that repeat what the code says; make_pages.py writes them.

Each is between ``<!-- begin NAME -->`` and ``<!-- end NAME -->``; the rest of a page is written
by hand. A test compares the pages with what this script makes.
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
import tomllib
from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import Final

from robotiq_async import ReconnectPolicy, RobotiqHand
from robotiq_async.values import registers
from robotiq_async.values.enums import (
    Fault,
    Initialization,
    Mode,
    ObjectStatus,
    State,
    Trigger,
)
from robotiq_async.values.model import MODELS
from robotiq_async.values.registers import RTU_REGISTERS, TCP_REGISTERS, Field
from robotiq_async.values.states import MOVES, SEQUENCES, TABLE, Verdict

ROOT: Final = Path(__file__).parents[1]
DOCS: Final = ROOT / "docs"


def table(head: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    """A table in markdown."""
    lines = [head, ["--"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


# -- layers --------------------------------------------------------------------------------------------


def layers() -> str:
    """The folders from top to bottom, as the contract of import-linter orders them."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = contracts["tool"]["importlinter"]["contracts"]
    order = next(each["layers"] for each in contracts if each["id"] == "layers")
    return table(
        ["layer", "for"],
        ([f"`{name}`", _purpose(name)] for layer in order for name in re.findall(r"[a-z_0-9]+", layer)),
    )


def _purpose(name: str) -> str:
    """The first sentence of a package's or module's docstring."""
    path = ROOT / "robotiq_async" / name
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    text = ast.get_docstring(ast.parse(file.read_text(encoding="utf-8"))) or ""
    return _plain(text.split("\n\n")[0]).rstrip(".")


# -- states --------------------------------------------------------------------------------------------


def inhibit() -> str:
    """The calls that an inhibit refuses."""
    except_for = {Trigger.ASK_COMMAND: "; a command that sets only a speed passes"}
    return "\n".join(f"- {each.value}{except_for.get(each, '')}" for each in Trigger if each in MOVES)


FAMILIES: Final = {
    Trigger.ASK_STOP: State.DO_SHUTDOWN,
    Trigger.LINK_LOST: State.DISCONNECTED,
    Trigger.ASK_RESET: State.DO_RESET,
    Trigger.HALT_RESETS: State.DO_RESET,
    Trigger.ASK_HALT: State.DO_RESET,
}
"""Triggers that lead from nearly every state to the same one. The last is drawn nowhere: see the table."""


def diagram() -> str:
    """The states for Mermaid, in two pictures: what calls lead to, and what a status shows.

    One alone is 1,500 pixels wide, and its text too small to read on the site. What leads from any state is
    drawn once.
    """
    seen = [trigger for trigger in Trigger if trigger.is_seen]
    follows = {state for state, row in TABLE.items() if all(isinstance(row[each], State) for each in seen)}
    shown = {each: Counter(TABLE[state][each] for state in follows).most_common(1)[0][0] for each in seen}
    lines = ['state "any state with a link" as any']
    lines += [f"any --> {FAMILIES[each].name}: {each.value}" for each in list(FAMILIES)[:-1]]
    shows = ["direction LR", "state shown <<choice>>"]
    shows += [f"{state.name} --> shown" for state in TABLE if state in follows and is_on_the_way(state)]
    shows += [f"shown --> {shown[each].name}: {each.value}" for each in seen]  # type: ignore[union-attr]
    for source, row in TABLE.items():
        drawn = FAMILIES | (shown if source in follows else {})
        for target in TABLE:
            found = [each.value for each in Trigger if row[each] is target is not drawn.get(each)]
            if found and target is not source:
                lines.append(f"{source.name} --> {target.name}: {', '.join(found)}")
    return f"{_drawn(lines)}\n\nThe condition that a status shows:\n\n{_drawn(shows)}"


def _drawn(lines: Sequence[str]) -> str:
    return "```mermaid\n" + "\n    ".join(("stateDiagram-v2", *lines)) + "\n```"


def is_on_the_way(state: State) -> bool:
    """Whether a hand does not stay there by itself."""
    return state in SEQUENCES or state is State.DISCONNECTED


def asked() -> str:
    """The answers to each call, except for start() and stop(), which a sentence describes.

    States that answer alike share a row.
    """
    told = (Trigger.ASK_START, Trigger.ASK_STOP)
    triggers = [trigger for trigger in Trigger if trigger.name.startswith("ASK_") and trigger not in told]

    def cell(source: State, to: State | Verdict) -> str:
        if isinstance(to, Verdict):
            return to.value
        return "stays" if source is to else to.name

    alike: dict[tuple[str, ...], list[str]] = {}
    for state, row in TABLE.items():
        answers = tuple(cell(state, row[trigger]) for trigger in triggers)
        alike.setdefault(answers, []).append(f"**{state.name}**")
    return table(
        ["state", *(trigger.value for trigger in triggers)],
        ([", ".join(states), *answers] for answers, states in alike.items()),
    )


# -- registers -----------------------------------------------------------------------------------------


def request_fields() -> str:
    """The request block."""
    return _fields("r")


def status_fields() -> str:
    """The status block."""
    return _fields("gk")


def _fields(prefix: str) -> str:
    found = sorted(_named(prefix), key=lambda each: (each[1][0].byte, each[1][0].shift))
    return table(
        ["byte", "bits", "name", "meaning"],
        (
            [
                ", ".join(dict.fromkeys(str(field.byte) for field in fields)),
                ", ".join(dict.fromkeys(_bits(field) for field in fields)),
                name,
                fields[0].doc if len(fields) == 1 else re.sub(r"^A: | of A\b", "", fields[0].doc),
            ]
            for name, fields in found
        ),
    )


def _named(prefix: str) -> Iterator[tuple[str, Sequence[Field]]]:
    """The fields of a block with the names of the manual; those that every axis has are one row."""
    for name, value in vars(registers).items():
        if re.fullmatch(f"[{prefix}][A-Z]{{2,3}}", name):
            if isinstance(value, Field):
                yield name, (value,)
            else:
                yield f"{name}A to {name}S", value


def _bits(field: Field) -> str:
    last = field.shift + field.width - 1
    return str(field.shift) if field.width == 1 else f"{field.shift}-{last}"


def links() -> str:
    """The addresses of the blocks on either link."""
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


def codes() -> str:
    """The names of the codes of gDT, gIMC and gMOD."""
    kinds = {"gDT": ObjectStatus, "gIMC": Initialization, "gMOD": Mode}
    named = (
        f"{field} as `{kind.__name__}`: {', '.join(f'{int(code)} `{code.name}`' for code in kind)}"
        for field, kind in kinds.items()
    )
    return textwrap.fill("; ".join(named) + ".", 120, break_on_hyphens=False)


def faults() -> str:
    """The codes of gFLT."""
    return table(
        ["gFLT", "`Fault`", "models", "severity", "meaning"],
        (
            [
                f"0x{int(fault):02X}",
                f"`{fault.name}`",
                _models_with(fault),
                fault.severity.value,
                fault.description,
            ]
            for fault in Fault
        ),
    )


def _models_with(fault: Fault) -> str:
    names = [model.title for model in MODELS.values() if fault in model.faults]
    return "all" if len(names) == len(MODELS) else ", ".join(names)


# -- reference -----------------------------------------------------------------------------------------


def models() -> str:
    """The models, side by side."""
    return table(
        [
            "model",
            "name",
            "axes",
            "stroke",
            "speed",
            "force",
            "reads open, closed",
            "unit id: TCP, serial",
        ],
        (
            [
                each.title,
                f"`{each.name}`",
                ", ".join(each.names),
                f"{each.stroke.mm:g} mm",
                "{:g}-{:g} mm/s".format(*each.speeds_mm_s),
                "{:g}-{:g} N".format(*each.forces_n),
                f"{each.stroke.open_reading}, {each.stroke.closed_reading}",
                f"{each.tcp.device_id}, {each.rtu.device_id}",
            ]
            for each in MODELS.values()
        ),
    )


def options() -> str:
    """The constructor's options, from its signature and the docstring of the class."""
    return _arguments(RobotiqHand, "Args")


def reconnect_policy() -> str:
    """The fields of ReconnectPolicy."""
    return _arguments(ReconnectPolicy, "Attributes")


def _arguments(documented: Callable[..., object], section: str) -> str:
    """Those that the docstring has, each with its default; what they mean is on the page of the API."""
    parameters = inspect.signature(documented).parameters
    text = inspect.getdoc(documented) or ""
    (body,) = re.findall(rf"^{section}:\n((?: .*\n?|\n(?= ))+)", text, re.MULTILINE)
    names = re.findall(r"^    (\w+): ", body, re.MULTILINE)
    return _listed(f"{name}={_default(parameters[name].default)}" for name in names)


def _listed(words: Iterable[str]) -> str:
    return textwrap.fill(", ".join(f"`{each}`" for each in words), 120, break_on_hyphens=False)


def _default(value: object) -> str:
    return f'"{value}"' if isinstance(value, str) else repr(value)


def _plain(text: str) -> str:
    """A docstring's text in markdown."""
    text = re.sub(r":\w+:`~?\.?([^`]+)`", r"`\1`", " ".join(text.split()))
    return text.replace("``", "`")


PAGES: Final[dict[str, dict[str, Callable[[], str]]]] = {
    "architecture.md": {"layers": layers},
    "state-machine.md": {"diagram": diagram, "asked": asked, "inhibit": inhibit},
    "registers.md": {
        "request": request_fields,
        "status": status_fields,
        "links": links,
        "codes": codes,
        "gFLT": faults,
    },
    "how-to/models.md": {"models": models},
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
