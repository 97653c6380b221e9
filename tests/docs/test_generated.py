"""What scripts have made of the code is what they would make of it now."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import combinations, pairwise

import pytest

from docs import make_diagram, make_tables
from robotiq_async import State
from robotiq_async.control.state_machine import TABLE, Verdict
from robotiq_async.values.trigger import Trigger
from tests.docs.pages import DOCS

Box = tuple[float, float, float, float]
PICTURE = make_diagram.draw()


def test_the_picture_is_up_to_date() -> None:
    assert make_diagram.PICTURE.read_text(encoding="utf-8") == PICTURE, "run docs/make_diagram.py"


@pytest.mark.parametrize("page", make_tables.PAGES)
def test_the_tables_are_up_to_date(page: str) -> None:
    text = (DOCS / page).read_text(encoding="utf-8")
    assert make_tables.filled(page, text) == text, "run docs/make_tables.py"


def test_a_page_without_a_place_for_its_table_is_an_error() -> None:
    with pytest.raises(ValueError, match="no place for the table 'asked'"):
        make_tables.filled("state-machine.md", "")


def test_an_entry_that_nobody_drew_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TABLE[State.WF_RESET], Trigger.SEEN_FAULT, State.ATR_DONE)
    with pytest.raises(ValueError, match="not drawn: WF_RESET -> ATR_DONE"):
        make_diagram.draw()


def test_a_line_without_an_entry_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(TABLE[State.FAULT], Trigger.ASK_RELEASE, Verdict.NOT_NOW)
    with pytest.raises(ValueError, match="no entry for the line FAULT -> DO_ATR"):
        make_diagram.draw()


# -- legible: nothing lies on something else -------------------------------------------------------------


def elements(tag: str) -> list[ET.Element]:
    return ET.fromstring(PICTURE).findall(f"{{http://www.w3.org/2000/svg}}{tag}")


def boxes() -> list[Box]:
    found = []
    for rect in elements("rect")[1:]:  # the first one is the paper
        x, y = float(rect.attrib["x"]), float(rect.attrib["y"])
        found.append((x, y, x + float(rect.attrib["width"]), y + float(rect.attrib["height"])))
    return [box for box in found if box[2] - box[0] == make_diagram.BOX_WIDTH]


def labels() -> list[tuple[str, Box]]:
    """What is written beside the arrows, with the room it takes: 6.6 for a character of DejaVu Sans."""
    found = []
    for text in elements("text"):
        if "font-size" in text.attrib or "text-anchor" not in text.attrib:
            continue  # the name of a box, or a note below the picture
        words, x, y = text.text or "", float(text.attrib["x"]), float(text.attrib["y"])
        width = 6.6 * len(words)
        left = x - {"start": 0.0, "middle": width / 2, "end": width}[text.attrib["text-anchor"]]
        found.append((words, (left, y - 10, left + width, y + 3)))
    return found


def strokes() -> list[Box]:
    """The straight pieces of all arrows, as thin boxes."""
    found = []
    for path in elements("path"):
        corners = [
            tuple(map(float, corner.split())) for corner in path.attrib["d"].replace("M", "").split("L")
        ]
        found += [(min(a, c), min(b, d), max(a, c), max(b, d)) for (a, b), (c, d) in pairwise(corners)]
    return found


def overlap(one: Box, other: Box, slack: float = 1.0) -> bool:
    return (
        one[0] < other[2] - slack
        and other[0] < one[2] - slack
        and one[1] < other[3] - slack
        and other[1] < one[3] - slack
    )


def test_there_is_a_box_for_every_state() -> None:
    assert len(boxes()) == len(State) == 14
    assert not any(overlap(one, other) for one, other in combinations(boxes(), 2))


def test_no_label_lies_on_another_on_a_box_or_on_an_arrow() -> None:
    for (words, room), (others, other) in combinations(labels(), 2):
        assert not overlap(room, other), f"{words!r} on {others!r}"
    for words, room in labels():
        assert not any(overlap(room, box) for box in boxes()), f"{words!r} on a box"
        for left, top, right, bottom in strokes():
            assert not overlap(room, (left - 1, top - 1, right + 1, bottom + 1)), f"{words!r} on an arrow"


def test_no_arrow_runs_through_a_box() -> None:
    for left, top, right, bottom in strokes():
        for box in boxes():
            assert not overlap((left - 1, top - 1, right + 1, bottom + 1), box, slack=2.0), (
                left,
                top,
                right,
                bottom,
            )


def test_everything_lies_on_the_paper() -> None:
    for left, top, right, bottom in [*boxes(), *(room for _, room in labels()), *strokes()]:
        assert left >= 0
        assert top >= 0
        assert right <= make_diagram.WIDTH
        assert bottom <= make_diagram.HEIGHT
