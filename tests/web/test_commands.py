"""Commands of a page by name: what is refused, and what is done."""

from __future__ import annotations

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.tools.actions import ACTIONS, Operator
from robotiq_async.tools.web.commands import call

pytestmark = pytest.mark.virtual_time


@pytest.fixture
async def operator(hand: RobotiqHand) -> Operator:
    return Operator(hand)


async def test_move_moves_the_axes_that_it_names(operator: Operator) -> None:
    requests = operator.hand.requests()
    words = await call(operator, "move", {"position": 90, "fingers": "A,B"})
    assert words.startswith("A at 90, B")
    sent = requests.take_nowait()
    assert sent is not None
    positions = [axis.position for axis in sent.request.axes]
    assert positions[:2] == [90, 90]
    assert 90 not in positions[2:]
    assert operator.has_moved


@pytest.mark.parametrize("what", ["speed", "force"])
async def test_speed_and_force_are_those_of_all_axes(operator: Operator, what: str) -> None:
    requests = operator.hand.requests()
    assert await call(operator, f"set_{what}", {"value": 33}) == "set"
    (sent,) = requests.drain()
    assert [getattr(axis, what) for axis in sent.request.axes] == [33] * 4


@pytest.mark.parametrize("name", [name for name, action in ACTIONS.items() if action.warning])
@pytest.mark.parametrize("confirm", [False, 1, "true"])
async def test_dangerous_commands_must_be_confirmed(operator: Operator, name: str, confirm: object) -> None:
    requests, beside = operator.hand.requests(), {"seen": None} if name == "permit" else {}
    with pytest.raises(ValueError, match=f"{name} needs confirm = true: "):
        await call(operator, name, {"confirm": confirm, **beside})
    with pytest.raises(ValueError, match=f"{name} takes confirm.*, got {{}}"):
        await call(operator, name, {})
    assert requests.take_nowait() is None


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("open", {"speed": 1}, "open takes no arguments, got {'speed': 1}"),
        ("move", {"position": 1}, "move takes fingers, position, got"),
        ("move", {"position": 256, "fingers": "A"}, "0..255"),
        ("move", {"position": 1.5, "fingers": "A"}, "0..255"),
        ("move", {"position": True, "fingers": "A"}, "0..255"),
        ("move", {"position": "9", "fingers": "A"}, "0..255"),
        ("move", {"position": 9, "fingers": "D"}, "fingers must name axes"),
        ("move", {"position": 9, "fingers": 7}, "fingers must be a text"),
        ("set_speed", {"value": 300}, "0..255"),
        ("explode", {}, "there is no command 'explode'"),
    ],
)
async def test_wrong_commands_are_refused_before_anything_is_sent(
    operator: Operator, name: str, arguments: dict[str, object], words: str
) -> None:
    requests = operator.hand.requests()
    with pytest.raises((ValueError, TypeError), match=words.replace("..", r"\.\.")):
        await call(operator, name, arguments)
    assert requests.take_nowait() is None
    assert not operator.has_moved
