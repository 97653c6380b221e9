"""Reads the table of docs/under-fault.md."""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import NamedTuple

from robotiq_async.simulator import parse_troubles
from robotiq_async.simulator.troubles.trouble import KINDS
from tests.adversity.cell import LINE_PULLED
from tests.adversity.phases import PHASES, Phase
from tests.pages import table


class Cell(NamedTuple):
    """One cell: a trouble on a kind of link, in a phase, and what comes of it."""

    trouble: str
    link: str
    phase: Phase
    outcome: str


def cells() -> Iterator[Cell]:
    """Every cell, for every kind of link it fits."""
    head, *rows = table("under-fault.md")
    phases = {phase.name: phase for phase in PHASES}
    assert head[1:] == list(phases), "a column for each phase"
    (_, *rests_in), *rows = rows
    of_lines = {words for troubles, *_ in rows if is_of_lines(troubles) for words in words_in(troubles)}
    for troubles, *outcomes in rows:
        for trouble in words_in(troubles):
            for words, link in variants(trouble):
                if link == "rtu" and words in of_lines and not is_of_lines(troubles):
                    continue
                if link == "tcp" and is_of_lines(troubles):
                    continue
                for name, outcome, state in zip(head[1:], outcomes, rests_in, strict=True):
                    ends = outcome if "→" in outcome else f"{outcome} → {state}"
                    yield Cell(words, link, phases[name], ends)


def is_of_lines(troubles: str) -> bool:
    """Whether a row is about serial lines; what it lists is not meant by the others there."""
    return troubles.startswith("on a serial line:")


def words_in(troubles: str) -> list[str]:
    """The troubles of a row."""
    return re.findall(r"`(.+?)`", troubles)


def variants(trouble: str) -> Iterator[tuple[str, str]]:
    """The forms in which a trouble of the table is tried, each with the kind of link."""
    if trouble == LINE_PULLED:
        yield trouble, "rtu"
        return
    (parsed,) = parse_troubles(trouble)
    kind = KINDS[parsed.kind]
    forms = [trouble]
    if parsed.lasts is None and kind.corruption is not None:
        forms = [f"{trouble} once", f"{trouble} for 60"]
    elif parsed.lasts is None and kind.lasts > 0:
        forms = [f"{trouble} for 60"]
    for link in ("tcp", "rtu"):
        if kind.link in (None, link):
            yield from ((form, link) for form in forms)
