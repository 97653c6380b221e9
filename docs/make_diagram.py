"""Draws docs/state-machine.svg from the table in robotiq_async/control/state_machine.py.

    python docs/make_diagram.py

Boxes and lines have their places by hand; what they say comes from the table. Four families of entries
would hide the rest, so they are not drawn line by line but said in words, also made from the table: stop(),
a lost link, reset(), and what a status shows. An entry that is neither drawn nor in a family, and a line
for which the table has no entry, are errors: the picture cannot fall behind unnoticed. A test compares the
file with what this script makes.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from xml.sax.saxutils import escape

ROOT: Final = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from robotiq_async.control.state_machine import SEQUENCES, TABLE, Verdict, states_allowing  # noqa: E402
from robotiq_async.values.enums import State  # noqa: E402
from robotiq_async.values.trigger import Trigger  # noqa: E402

PICTURE: Final = ROOT / "docs" / "state-machine.svg"

WIDTH, HEIGHT = 1220, 784
BOX_WIDTH, BOX_HEIGHT = 150, 46
COLUMNS = (125, 370, 615, 860, 1105)
ROWS = (92, 250, 400, 556)
LINE_HEIGHT = 14

Point = tuple[int, int]

PLACES: Final[dict[State, tuple[int, int]]] = {
    State.DO_SHUTDOWN: (0, 0),
    State.SHUTDOWN: (1, 0),
    State.DISCONNECTED: (2, 0),
    State.RESET: (0, 1),
    State.DO_ACTIVATION: (1, 1),
    State.WF_ACTIVATION: (2, 1),
    State.RUNNING_IDLE: (3, 1),
    State.RUNNING_CC: (4, 1),
    State.WF_RESET: (0, 2),
    State.DO_RESET: (1, 2),
    State.FAULT: (3, 2),
    State.ATR_DONE: (1, 3),
    State.WF_ATR: (2, 3),
    State.DO_ATR: (3, 3),
}
"""Column and row of each box."""

SEEN: Final = tuple(trigger for trigger in Trigger if trigger.is_seen)

FILLS: Final = {
    "DO": "#fff3cd",  # a request is being sent
    "WF": "#dbe9fb",  # waiting for what the gripper reports
    "RUNNING": "#dff2df",
    "FAULT": "#f9dcdc",
    "ATR": "#f9dcdc",
}
STROKES: Final = {"ask": "#1d4f91", "seen": "#2c7a3f", "other": "#555555"}
DASHES: Final = {"ask": "", "seen": "7 4", "other": "2 3"}


@dataclass(frozen=True, slots=True)
class Line:
    """One arrow.

    Attributes:
        source: the state it leaves; None for a short arrow that stands for a family.
        target: the state it leads to.
        points: corners from begin to end.
        label: where its words stand: the baseline of the last line of text.
        anchor: "start", "middle" or "end", as in SVG.
        words: the most characters of a line of text.
    """

    source: State | None
    target: State
    points: tuple[Point, ...]
    label: Point
    anchor: str = "middle"
    words: int = 13


def side(state: State, where: str, shift: int = 0) -> Point:
    """A point on the frame of a state's box: left, right, top or bottom, moved along that side."""
    column, row = PLACES[state]
    x, y = COLUMNS[column], ROWS[row]
    match where:
        case "left":
            return x - BOX_WIDTH // 2, y + shift
        case "right":
            return x + BOX_WIDTH // 2, y + shift
        case "top":
            return x + shift, y - BOX_HEIGHT // 2
    return x + shift, y + BOX_HEIGHT // 2


def across(source: State, target: State, *, shift: int = 0, below: bool = False) -> Line:
    """A level arrow between two boxes of one row, with its words above or below it."""
    to_the_right = PLACES[source][0] < PLACES[target][0]
    begin = side(source, "right" if to_the_right else "left", shift)
    end = side(target, "left" if to_the_right else "right", shift)
    return Line(source, target, (begin, end), ((begin[0] + end[0]) // 2, begin[1] + (17 if below else -7)))


def upright(source: State, target: State, *, shift: int = 0, left: bool = False, words: int = 13) -> Line:
    """An upright arrow between two boxes of one column, with its words beside it."""
    down = PLACES[source][1] < PLACES[target][1]
    begin = side(source, "bottom" if down else "top", shift)
    end = side(target, "top" if down else "bottom", shift)
    label = begin[0] + (-8 if left else 8), (begin[1] + end[1]) // 2 + 4
    return Line(source, target, (begin, end), label, "end" if left else "start", words)


def bent(source: State, target: State, *points: Point, label: Point, anchor: str = "start") -> Line:
    """An arrow with corners."""
    return Line(source, target, points, label, anchor, words=40)


def lines() -> list[Line]:
    """Every arrow between two states."""
    s = State
    from_disconnected = [side(s.DISCONNECTED, "bottom", shift) for shift in (-50, -25)]
    to_reset, to_activation = side(s.RESET, "top"), side(s.DO_ACTIVATION, "top")
    to_idle, around = side(s.RUNNING_IDLE, "top"), side(s.WF_ATR, "bottom")
    fault, fault_right = side(s.FAULT, "left", -11), side(s.FAULT, "right")
    out_of_wf, out_of_cc = side(s.WF_ACTIVATION, "bottom", 20), side(s.RUNNING_CC, "bottom")
    high, low, bottom, margin = ROWS[0] + 56, ROWS[0] + 94, ROWS[3] + 62, 22
    return [
        across(s.DO_SHUTDOWN, s.SHUTDOWN),
        across(s.SHUTDOWN, s.DISCONNECTED),
        bent(
            s.DISCONNECTED,
            s.RESET,
            from_disconnected[0],
            (from_disconnected[0][0], high),
            (to_reset[0], high),
            to_reset,
            label=(to_reset[0] + 10, high - 6),
        ),
        bent(
            s.DISCONNECTED,
            s.DO_ACTIVATION,
            from_disconnected[1],
            (from_disconnected[1][0], low),
            (to_activation[0], low),
            to_activation,
            label=(from_disconnected[1][0] - 10, low - 6),
            anchor="end",
        ),
        upright(s.DISCONNECTED, s.WF_ACTIVATION, shift=10, words=10),
        bent(
            s.DISCONNECTED,
            s.RUNNING_IDLE,
            side(s.DISCONNECTED, "right"),
            (to_idle[0], ROWS[0]),
            to_idle,
            label=(side(s.DISCONNECTED, "right")[0] + 24, ROWS[0] - 7),
        ),
        across(s.RESET, s.DO_ACTIVATION),
        across(s.DO_ACTIVATION, s.WF_ACTIVATION),
        across(s.WF_ACTIVATION, s.RUNNING_IDLE),
        across(s.RUNNING_IDLE, s.RUNNING_CC, shift=-10),
        across(s.RUNNING_CC, s.RUNNING_IDLE, shift=10, below=True),
        upright(s.RUNNING_IDLE, s.FAULT, shift=-30, left=True),
        upright(s.FAULT, s.RUNNING_IDLE, shift=30),
        bent(
            s.RUNNING_CC,
            s.FAULT,
            out_of_cc,
            (out_of_cc[0], fault_right[1]),
            fault_right,
            label=(fault_right[0] + 14, fault_right[1] + 17),
        ),
        Line(
            s.WF_ACTIVATION,
            s.FAULT,
            (out_of_wf, (out_of_wf[0], fault[1]), fault),
            (out_of_wf[0] - 8, (out_of_wf[1] + fault[1]) // 2 + 4),
            "end",
        ),
        Line(
            s.FAULT,
            s.DO_RESET,
            (side(s.FAULT, "left", 11), side(s.DO_RESET, "right", 11)),
            (COLUMNS[2], ROWS[2] + 28),
        ),
        across(s.DO_RESET, s.WF_RESET),
        upright(s.WF_RESET, s.RESET),
        upright(s.FAULT, s.DO_ATR),
        across(s.DO_ATR, s.WF_ATR),
        across(s.WF_ATR, s.ATR_DONE),
        upright(s.ATR_DONE, s.DO_RESET),
        bent(
            s.WF_ATR,
            s.RESET,
            around,
            (around[0], bottom),
            (margin, bottom),
            (margin, ROWS[1]),
            side(s.RESET, "left"),
            label=(COLUMNS[0] - BOX_WIDTH // 2, bottom - 6),
        ),
    ]


def stubs() -> list[tuple[Line, Trigger, str]]:
    """The short arrows that stand for a family, with their trigger and what is said of it."""
    found = []
    for state, shift, trigger, mark in (
        (State.DO_SHUTDOWN, 0, Trigger.ASK_STOP, "¹"),
        (State.DISCONNECTED, 0, Trigger.LINK_LOST, "²"),
        (State.DO_RESET, 40, Trigger.ASK_RESET, "³"),
    ):
        end = side(state, "top", shift)
        begin, label = (end[0], end[1] - 34), (end[0] + 8, end[1] - 20)
        found.append((Line(None, state, (begin, end), label, "start", 40), trigger, mark))
    return found


# -- what the table says -------------------------------------------------------------------------------


def triggers(source: State, target: State) -> list[Trigger]:
    """What leads from one state straight to another, stop and lost link aside."""
    families = {Trigger.ASK_STOP, Trigger.LINK_LOST}
    row = TABLE[source]
    return [trigger for trigger in Trigger if row[trigger] is target and trigger not in families]


def leading(trigger: Trigger, target: State) -> set[State]:
    """The states from which a trigger leads to another one, or leaves it."""
    return {state for state, row in TABLE.items() if row[trigger] is target}


def following() -> list[State]:
    """The states that go wherever a status shows the gripper to be."""
    return [state for state, row in TABLE.items() if all(isinstance(row[each], State) for each in SEEN)]


def usual_target(condition: Trigger) -> State:
    """Where a condition leads from most of the states that follow what is seen."""
    targets = [TABLE[state][condition] for state in following()]
    return max(State, key=targets.count)


def in_words(source: State, trigger: Trigger, target: State) -> bool:
    """Whether an entry is one of a family, or leaves the state as it is."""
    if source is target:
        return True
    if any(trigger is each and target is stub.target for stub, each, _ in stubs()):
        return True
    if trigger is Trigger.ASK_HALT and target is State.DO_RESET:
        return True  # the third family has it too
    return trigger in SEEN and source in following() and target is usual_target(trigger)


def check() -> None:
    """Whether picture and table agree.

    Raises:
        ValueError: a line without an entry, or an entry that is neither drawn nor in a family.
    """
    drawn = {(line.source, line.target) for line in lines()}
    for line in lines():
        assert line.source is not None
        if not triggers(line.source, line.target):
            raise ValueError(f"the table has no entry for the line {line.source.name} -> {line.target.name}")
    for source, row in TABLE.items():
        for trigger, target in row.items():
            if not isinstance(target, State) or (source, target) in drawn:
                continue
            if not in_words(source, trigger, target):
                raise ValueError(f"not drawn: {source.name} -> {target.name} ({trigger.value})")


def kind(trigger: Trigger) -> str:
    """Which of the three kinds of events a trigger is."""
    if trigger in SEEN or trigger is Trigger.ACTIVATES:
        return "seen"
    return "ask" if trigger.name.startswith("ASK_") else "other"


def notes() -> list[str]:
    """The families in words."""
    stoppable = leading(Trigger.ASK_STOP, State.DO_SHUTDOWN)
    assert leading(Trigger.LINK_LOST, State.DISCONNECTED) == stoppable, "the second note is wrong"
    assert TABLE[State.DO_SHUTDOWN][Trigger.LINK_LOST] is Verdict.IGNORED, "the second note is wrong"
    resettable = states_allowing(Trigger.ASK_RESET)
    assert stoppable - resettable == {State.DISCONNECTED}, "the third note is wrong"
    assert resettable - leading(Trigger.ASK_RESET, State.DO_RESET) == {State.DO_RESET}, "it stays"
    assert leading(Trigger.ASK_HALT, State.DO_RESET) == SEQUENCES - {State.DO_RESET}, "it stays, too"
    halt = f"{Trigger.ASK_HALT.value}: from those in which a sequence runs (DO_, WF_)"
    ends = names(set(TABLE) - stoppable)
    leads = [f"{usual_target(each).name} ({each.value.removeprefix('gripper ')})" for each in SEEN]
    return [
        f"¹ {Trigger.ASK_STOP.value}: from the {len(stoppable)} states other than {' and '.join(ends)}.",
        f"² {Trigger.LINK_LOST.value}: from the same states; DO_SHUTDOWN stays what it is.",
        f"³ {Trigger.ASK_RESET.value}: from the same states but {State.DISCONNECTED.name}; {halt}.",
        "A double frame marks a state that follows what every status shows: " + ", ".join(leads[:3]) + ",",
        "    " + ", ".join(leads[3:]) + ". Of these arrows only the usual ones are drawn.",
        "What leaves the state as it is is not drawn. docs/state-machine.md has every entry.",
    ]


def names(states: set[State]) -> list[str]:
    """Names in the order of the table."""
    return [state.name for state in TABLE if state in states]


# -- drawing -------------------------------------------------------------------------------------------


def draw() -> str:
    """The picture as SVG."""
    check()
    head = (
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {HEIGHT}" width="{WIDTH}" '
        f'height="{HEIGHT}" role="img" font-family="DejaVu Sans, Verdana, Arial, sans-serif" font-size="12">'
    )
    parts = [
        head,
        "<title>States of a hand</title>",
        "<desc>Made by docs/make_diagram.py from the table in robotiq_async/control/state_machine.py.</desc>",
        f'<rect width="{WIDTH}" height="{HEIGHT}" fill="#ffffff"/>',
        "<defs>",
        *(_arrow_head(name, color) for name, color in STROKES.items()),
        "</defs>",
    ]
    for line in lines():
        assert line.source is not None
        found = triggers(line.source, line.target)
        parts += _arrow(line, kind(found[0]), [each.value for each in found])
    for stub, trigger, mark in stubs():
        parts += _arrow(stub, kind(trigger), [f"{trigger.value} {mark}"])
    for state in TABLE:
        parts += _box(state)
    parts += _legend()
    return "\n".join([*parts, "</svg>", ""])


def _arrow_head(name: str, color: str) -> str:
    return (
        f'<marker id="{name}" viewBox="0 0 10 10" refX="9" refY="5" markerWidth="8" markerHeight="8" '
        f'orient="auto"><path d="M0 0 L10 5 L0 10 z" fill="{color}"/></marker>'
    )


def _arrow(line: Line, kind: str, words: list[str]) -> Iterator[str]:
    path = " ".join(f"{'M' if not index else 'L'}{x} {y}" for index, (x, y) in enumerate(line.points))
    dash = f' stroke-dasharray="{DASHES[kind]}"' if DASHES[kind] else ""
    yield (
        f'<path d="{path}" fill="none" stroke="{STROKES[kind]}" stroke-width="1.6"{dash} '
        f'marker-end="url(#{kind})"/>'
    )
    text = [part for each in words for part in _wrapped(each, line.words)]
    x, y = line.label
    if line.points[0][1] < y < line.points[-1][1] or line.points[-1][1] < y < line.points[0][1]:
        y += LINE_HEIGHT * (len(text) - 1) // 2  # beside an upright arrow: centred on it
    elif line.source is not None and y > line.points[0][1] and y > line.points[-1][1]:
        y += LINE_HEIGHT * (len(text) - 1)  # below a level one
    for index, part in enumerate(reversed(text)):
        yield (
            f'<text x="{x}" y="{y - LINE_HEIGHT * index}" text-anchor="{line.anchor}" '
            f'fill="{STROKES[kind]}">{escape(part)}</text>'
        )


def _wrapped(text: str, most: int) -> list[str]:
    """Words in lines of at most so many characters."""
    found: list[str] = []
    for word in text.split():
        if found and len(found[-1]) + 1 + len(word) <= most:
            found[-1] += " " + word
        else:
            found.append(word)
    return found


def _box(state: State) -> Iterator[str]:
    column, row = PLACES[state]
    x, y = COLUMNS[column] - BOX_WIDTH // 2, ROWS[row] - BOX_HEIGHT // 2
    fill = FILLS.get(state.name.partition("_")[0], "#eeeeee")
    yield (
        f'<rect x="{x}" y="{y}" width="{BOX_WIDTH}" height="{BOX_HEIGHT}" rx="7" fill="{fill}" '
        'stroke="#333333" stroke-width="1.4"/>'
    )
    if state in following():
        yield (
            f'<rect x="{x + 4}" y="{y + 4}" width="{BOX_WIDTH - 8}" height="{BOX_HEIGHT - 8}" rx="4" '
            'fill="none" stroke="#333333" stroke-width="1"/>'
        )
    yield (
        f'<text x="{COLUMNS[column]}" y="{ROWS[row] + 5}" text-anchor="middle" font-size="13" '
        f'font-weight="bold" fill="#111111">{state.name}</text>'
    )


def _legend() -> Iterator[str]:
    x, y = 40, ROWS[3] + 92
    for name, text in (
        ("ask", "what the program asks"),
        ("seen", "what a status shows"),
        ("other", "what became of a request or of the link"),
    ):
        yield from _arrow(
            Line(None, State.RESET, ((x, y), (x + 44, y)), (x + 54, y + 4), "start", 60), name, [text]
        )
        x += 250
    for index, text in enumerate(notes()):
        at = f'x="40" y="{y + 32 + 17 * index}" xml:space="preserve"'
        yield f'<text {at} fill="#333333">{escape(text)}</text>'


def main() -> None:
    """Write the picture."""
    PICTURE.write_text(draw(), encoding="utf-8")


if __name__ == "__main__":
    main()
