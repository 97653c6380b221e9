"""The buttons of the page follow the state: what may be pressed, and why not; and colours one can read."""

from __future__ import annotations

import pytest

pytest.importorskip("nicegui", reason="the page needs the extra web")

from robotiq_async import Finger, Inhibit, State
from robotiq_async.tools.actions import ACTIONS
from robotiq_async.tools.description.palette import AXIS_COLORS
from robotiq_async.tools.web.page.mirror import HandMirror
from robotiq_async.tools.web.page.pages import THEME
from robotiq_async.tools.web.page.widgets.allowed import (
    INHIBITED,
    NO_CONNECTION,
    QUIET,
    TRIGGERS,
    what_helps,
    why_not,
)
from robotiq_async.tools.web.page.widgets.words import banner_words, state_words
from robotiq_async.values.model import TWO_FINGER_85
from robotiq_async.values.states import MOVES, TABLE
from robotiq_async.values.status import RobotiqStatus

MOTIONS = ["open", "close", "move", "force"]
BUTTONS = [*MOTIONS, "speed", "activate", "reset", "release", "recover", "permit"]
TABLE_OF_THE_PAGE = {
    # state: what may be pressed; inhibited: the same.
    State.RUNNING_IDLE: ("open close move force speed reset", "speed reset permit"),
    State.FAULT: ("release recover reset", "reset permit"),
    State.RESET: ("activate recover reset", "reset permit"),
    State.ATR_DONE: ("recover reset", "reset permit"),
    State.WF_ACTIVATION: ("recover reset", "reset permit"),
    State.WF_ATR: ("recover reset", "reset permit"),
    State.DO_RESET: ("recover", "permit"),
    State.DISCONNECTED: ("", "permit"),
    State.SHUTDOWN: ("", "permit"),
}
INHIBIT = Inhibit("HALT was pressed", "the page", 1.79e9)


def shown(
    state: State, *, inhibit: Inhibit | None = None, registers: tuple[int, ...] = (0,) * 8
) -> HandMirror:
    status = RobotiqStatus(registers, model=TWO_FINGER_85)
    return HandMirror(0, "here", state=state, status=status, inhibited=inhibit)


@pytest.mark.parametrize("state", TABLE_OF_THE_PAGE, ids=lambda state: state.name)
def test_what_may_be_pressed(state: State) -> None:
    for inhibit, allowed in zip((None, INHIBIT), TABLE_OF_THE_PAGE[state], strict=True):
        hand = shown(state, inhibit=inhibit)
        whys = {name: why_not(name, hand, is_quiet=False) for name in BUTTONS}
        assert {name for name, why in whys.items() if not why} == set(allowed.split())
        if hand.is_lost:
            assert {why for name, why in whys.items() if name != "permit"} == {NO_CONNECTION}
        elif inhibit:
            assert whys["open"] == INHIBITED
        assert {why_not(name, hand, is_quiet=True) for name in BUTTONS} == {QUIET}


def test_every_action_has_its_row_but_a_halt_which_is_always_there() -> None:
    assert ACTIONS.keys() - TRIGGERS.keys() == {"halt", "permit", "recover"}


@pytest.mark.parametrize(
    "state", [state for state in State if state not in (State.DISCONNECTED, State.SHUTDOWN)]
)
def test_no_button_may_be_pressed_that_the_hand_would_refuse(state: State) -> None:
    for name, trigger in TRIGGERS.items():
        if not why_not(name, shown(state), is_quiet=False):
            assert isinstance(TABLE[state][trigger], State), f"{name} in {state.name}"
    for name, trigger in TRIGGERS.items():
        is_refused = bool(why_not(name, shown(state, inhibit=INHIBIT), is_quiet=False))
        assert is_refused or trigger not in MOVES or name == "speed"


@pytest.mark.parametrize(
    ("state", "inhibit", "helps", "words"),
    [
        (State.FAULT, None, "recover", "no fault"),
        (State.RESET, None, "activate", "moves its fingers"),
        (State.FAULT, INHIBIT, "permit", "motion is inhibited: HALT was pressed (the page), since "),
        (State.RUNNING_IDLE, None, "", ""),
    ],
)
def test_what_helps_stands_first(state: State, inhibit: Inhibit | None, helps: str, words: str) -> None:
    hand = shown(state, inhibit=inhibit)
    assert what_helps(hand, is_quiet=False) == helps
    assert words in banner_words(hand)
    assert what_helps(hand, is_quiet=True) == ""


def test_a_part_that_is_held_is_named() -> None:
    registers = (0xB900, 0x00FF, 0x6400, 0, 0, 0, 0, 0)
    words, color = state_words(shown(State.RUNNING_IDLE, registers=registers), is_quiet=False)
    assert words.startswith("holding ")
    assert words.endswith(" mm")
    assert color == "positive"


def luminance(color: str) -> float:
    """Relative, of WCAG 2.2."""
    parts = [int(color[at : at + 2], 16) / 255 for at in (1, 3, 5)]
    linear = [part / 12.92 if part <= 0.04045 else ((part + 0.055) / 1.055) ** 2.4 for part in parts]
    return sum(weight * part for weight, part in zip((0.2126, 0.7152, 0.0722), linear, strict=True))


def contrast(one: str, other: str) -> float:
    light, dark = sorted((luminance(one), luminance(other)), reverse=True)
    return (light + 0.05) / (dark + 0.05)


def test_colours_that_can_be_read() -> None:
    """Lines and areas need 3, text 4.5; in_browser.py measures all text of the page."""
    assert set(AXIS_COLORS) == set(Finger.ALL)
    for color in AXIS_COLORS.values():
        assert min(contrast(color, "#ffffff"), contrast(color, "#121212")) >= 3
    for color in THEME.values():
        assert contrast(color, "#ffffff") >= 4.5
