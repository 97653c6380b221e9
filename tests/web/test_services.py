"""Commands by name: what is refused, and what is done."""

from __future__ import annotations

import json

import pytest

from robotiq_async import Finger, RobotiqHand
from robotiq_async.tools.actions import ACTIONS, Operator
from robotiq_async.tools.web.commands import SERVICES

pytestmark = pytest.mark.virtual_time


@pytest.fixture
async def operator(hand: RobotiqHand) -> Operator:
    return Operator(hand)


async def call(operator: Operator, name: str, **arguments: object) -> str:
    return await SERVICES[f"/gripper/{name}"].call(operator, json.dumps(arguments).encode())


async def test_move_with_everything(operator: Operator) -> None:
    requests = operator.hand.requests()
    words = await call(operator, "move", position=90, fingers="A,B", speed=200, force=7)
    assert words.startswith("A at 90, B")
    sent = requests.take_nowait()
    assert sent is not None
    axes = sent.request.axes
    assert [(axis.position, axis.speed, axis.force) for axis in axes[:2]] == [(90, 200, 7)] * 2
    assert axes[2].position != 90
    assert operator.has_moved


async def test_move_moves_the_fingers_by_default(operator: Operator) -> None:
    await call(operator, "move", position=60)
    status = operator.hand.status
    assert [status.requested_position(axis) for axis in Finger.ABC] == [60] * 3
    assert status.requested_position(Finger.SCISSOR) != 60


@pytest.mark.parametrize("what", ["speed", "force"])
async def test_speed_and_force_of_all_axes_or_some(operator: Operator, what: str) -> None:
    requests = operator.hand.requests()
    assert await call(operator, f"set_{what}", value=33) == "set"
    assert await call(operator, f"set_{what}", value=44, fingers="scissor") == "set"
    images = [sent.request for sent in requests.drain()]
    assert [getattr(axis, what) for axis in images[0].axes] == [33] * 4
    assert [getattr(axis, what) for axis in images[-1].axes] == [33, 33, 33, 44]


@pytest.mark.parametrize("name", [name for name, action in ACTIONS.items() if action.warning])
@pytest.mark.parametrize("confirm", [False, 1, "true"])
async def test_dangerous_services_must_be_confirmed(operator: Operator, name: str, confirm: object) -> None:
    requests = operator.hand.requests()
    with pytest.raises(ValueError, match=f"{name} needs confirm = true: "):
        await call(operator, name, confirm=confirm)
    with pytest.raises(ValueError, match="needs the argument 'confirm'"):
        await call(operator, name)
    assert requests.take_nowait() is None


@pytest.mark.parametrize(
    ("name", "payload", "words"),
    [
        ("open", b"{", "takes a JSON object"),
        ("open", b"[]", "takes a JSON object"),
        ("open", b"\xff\xfe", "takes a JSON object"),
        ("open", b"[" * 2000, "takes a JSON object"),
        ("move", b'{"position": ' + b"[" * 2000 + b"]" * 2000 + b"}", "takes a JSON object"),
        ("open", b'{"speed": 1}', "has no argument 'speed'; it has: none"),
        ("move", b"{}", "needs the argument 'position'"),
        ("move", b'{"position": 256}', "0..255"),
        ("move", b'{"position": 1.5}', "0..255"),
        ("move", b'{"position": true}', "0..255"),
        ("move", b'{"position": "9"}', "0..255"),
        ("move", b'{"position": 9, "fingers": "D"}', "fingers must name axes"),
        ("move", b'{"position": 9, "fingers": 7}', "fingers must be a text"),
        ("set_speed", b'{"value": 300}', "0..255"),
    ],
)
async def test_wrong_requests_are_refused_before_anything_is_sent(
    operator: Operator, name: str, payload: bytes, words: str
) -> None:
    requests = operator.hand.requests()
    with pytest.raises((ValueError, TypeError), match=words.replace("..", r"\.\.")):
        await SERVICES[f"/gripper/{name}"].call(operator, payload)
    assert requests.take_nowait() is None
    assert not operator.has_moved


async def test_an_empty_request_is_one_without_arguments(operator: Operator) -> None:
    assert await SERVICES["/gripper/halt"].call(operator, b" ") == "every axis has stopped"
