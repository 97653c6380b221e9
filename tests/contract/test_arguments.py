"""Bad arguments are refused by name, value and range, and nothing is sent."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from robotiq_async import Finger
from robotiq_async.fleet import RemoteHand
from robotiq_async.hands import Hand
from tests.calls import CALLS, called
from tests.contract.bench import Bench, at_rest, contract

Bad = list[tuple[type[Exception], list[Any]]]
NO_INTEGERS = [1.0, "3", True, b"3", [3], np.bool_(True), np.float64(3)]
OF_BYTES: Bad = [(TypeError, NO_INTEGERS), (ValueError, [-1, 256, 10**400])]
OTHERS: dict[str, Bad] = {
    "fingers": [(TypeError, NO_INTEGERS), (ValueError, [-1, 0, 16, 256, 10**400])],
    "buffer": [(TypeError, NO_INTEGERS), (ValueError, [-1, 0, 10**400])],
    "lost_after": [
        (TypeError, ["1", True, np.bool_(True), np.complex64(1)]),
        (ValueError, [0, 0.001, -1, 3601, float("nan"), float("inf"), 10**400]),
    ],
    "timeout": [
        (TypeError, ["1", True, np.bool_(True), np.complex64(1)]),
        (ValueError, [0, -1, float("nan"), float("inf"), 10**400]),
    ],
}
"""Values refused for arguments that are no bytes."""
NAMES = {call: [name for name in arguments if name != "states"] for call, arguments in CALLS.items()}


@contract
async def test_a_wrong_argument(here: Bench) -> None:
    hand, writes = here.make(), here.writes
    await refuses_wrong_arguments(hand)
    await hand.start()
    await refuses_wrong_arguments(hand)
    await asyncio.sleep(0.1)
    assert here.writes == writes
    await hand.stop()


async def refuses_wrong_arguments(hand: Hand) -> None:
    for call, names in NAMES.items():
        for name in names:
            for kind, values in OTHERS.get(name, OF_BYTES):
                for bad in values:
                    words = rf"{name} must be .*{re.escape(repr(bad)[:60])}"
                    await refuses(hand, call, {name: bad}, kind, words)


async def refuses(
    hand: Hand, call: str, arguments: dict[str, Any], kind: type[Exception], words: str
) -> None:
    """Make a call that raises an error of a kind, and begins with these words."""
    error = None
    try:
        await called(hand, call, **arguments)
    except Exception as caught:  # noqa: BLE001  # looked at below
        error = caught
    assert isinstance(error, kind), f"{call}({arguments}): {error!r}"
    assert re.match(words, str(error)), f"{call}({arguments}): {error!r}"


@contract
async def test_of_several_wrong_arguments_the_first_is_named(here: Bench) -> None:
    for call, names in NAMES.items():
        for first, name in enumerate(names[:-1]):
            wrong = dict.fromkeys(names[first:], -1)
            await refuses(here.make(), call, wrong, ValueError, f"{name} must be")


@contract
@pytest.mark.parametrize(
    ("call", "kind", "words"),
    [
        (lambda hand: hand.command(), ValueError, "at least one of position, speed and force"),
        (lambda hand: hand.wait_for_state(), ValueError, "states"),
        (lambda hand: hand.wait_for_state("FAULT"), TypeError, "states must be State members, got 'FAULT'"),
        (
            lambda hand: hand.grip_events(since="now"),
            TypeError,
            "since must be None or a RobotiqStatus, got 'now'",
        ),
    ],
)
async def test_arguments_that_do_not_fit(
    here: Bench, hand: Hand, call: Callable[[Hand], Any], kind: type[Exception], words: str
) -> None:
    writes = here.writes
    with pytest.raises(kind, match=re.escape(words)):
        await call(hand)
    await asyncio.sleep(0.1)
    assert here.writes == writes


@contract
@pytest.mark.parametrize(
    ("fingers", "at_least"), [(Finger.ABC, 4), (Finger.ABC, 0), (Finger.A, 2), (Finger.ALL, 5)]
)
async def test_more_contacts_than_axes(here: Bench, hand: Hand, fingers: Finger, at_least: int) -> None:
    writes = here.writes
    with pytest.raises(ValueError, match=rf"at_least must be in 1\.\.{len(fingers)}, got {at_least}"):
        await hand.grasp(fingers, at_least=at_least)
    await asyncio.sleep(0.1)
    assert here.writes == writes


@contract
async def test_an_integer_mask_is_as_good_as_fingers(here: Bench, hand: Hand) -> None:
    await hand.set_speed(5, 10)
    assert [axis.speed for axis in here.last_write.axes] == [128, 5, 128, 5]
    result = await hand.move(50, 1)
    assert set(result.outcomes) == {Finger.A}


@contract
async def test_integers_of_numpy_are_integers(here: Bench, hand: Hand) -> None:
    abc: Any = np.int64(7)
    value: Any = np.uint8(90)
    seconds: Any = np.float32(30)
    result = await hand.move(value, abc, speed=value, force=value, timeout=seconds)
    assert set(result.outcomes) == {Finger.A, Finger.B, Finger.C}
    await hand.set_position(value, abc)
    await hand.set_speed(value, abc)
    await hand.set_force(value, abc)
    hand.command(abc, position=value, speed=value, force=value)
    await hand.hold(abc)
    assert await hand.wait_for_state(hand.state, timeout=seconds) is hand.state
    await at_rest(hand)
    for axis in here.last_write.axes[:3]:
        assert (axis.position, axis.speed, axis.force) == (90, 90, 90)
    assert hand.status.current(abc & 1) == hand.status.current(Finger.A)
    hand.statuses(value)
    hand.requests(value)


def test_with_names_async_with_for_a_hand_on_another_host() -> None:
    hand: Any = RemoteHand("zenoh://lab/cell/left")
    with pytest.raises(TypeError, match="'async with'"), hand:
        pass
