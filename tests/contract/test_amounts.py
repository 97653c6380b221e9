"""Millimetres, fractions and newtons of a label are as good as counts, and are refused in their own unit."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from typing import Any

import pytest

from robotiq_async import HAND_E, JAW, TWO_FINGER_85, TWO_FINGER_140, Finger
from robotiq_async.hands import Hand
from robotiq_async.values.status import Part
from tests.contract.bench import Bench, at_rest, contract, on_model

jaw = on_model(TWO_FINGER_85, TWO_FINGER_140, HAND_E)


@jaw
@contract
async def test_a_move_in_millimetres(here: Bench, hand: Hand) -> None:
    result = await hand.move(mm=40, mm_per_s=80, label_n=100)
    axis = here.last_write.axes[0]
    assert (axis.position, axis.speed, axis.force) == (
        hand.units.position(mm=40),
        hand.units.speed(mm_per_s=80),
        hand.units.force(label_n=100),
    )
    assert result.reached == JAW
    assert result.opening_mm(JAW) == pytest.approx(40, abs=1)
    assert hand.status.opening_mm(JAW) == result.opening_mm(JAW)
    assert result.as_dict()["A"]["opening_mm"] == result.opening_mm(JAW)
    assert f"{result.opening_mm(JAW):.1f} mm open" in repr(result)


@jaw
@contract
async def test_the_other_calls_take_them_too(here: Bench, hand: Hand) -> None:
    units = hand.units
    await hand.set_speed(mm_per_s=80)
    await hand.set_force(label_n=100)
    await hand.set_position(mm=40)
    axis = here.last_write.axes[0]
    asked = (units.position(mm=40), units.speed(mm_per_s=80), units.force(label_n=100))
    assert (axis.position, axis.speed, axis.force) == asked
    await at_rest(hand)
    await hand.set_position(open_fraction=0.25)
    assert here.last_write.axes[0].position == units.position(open_fraction=0.25)
    await at_rest(hand)
    hand.command(open_fraction=0.5, mm_per_s=60, label_n=50)
    await at_rest(hand)
    axis = here.last_write.axes[0]
    asked = (units.position(open_fraction=0.5), units.speed(mm_per_s=60), units.force(label_n=50))
    assert (axis.position, axis.speed, axis.force) == asked
    assert hand.status.open_fraction(JAW) == pytest.approx(0.5, abs=0.02)
    for call in (hand.open, hand.close, hand.grasp):
        await call(mm_per_s=100, label_n=30)
        axis = here.last_write.axes[0]
        assert (axis.speed, axis.force) == (units.speed(mm_per_s=100), units.force(label_n=30))


@jaw
@contract
async def test_a_part_is_held_and_has_a_width(here: Bench, hand: Hand) -> None:
    assert hand.part is None
    here.gripper.place_object(JAW, position=150)
    grasp = await hand.grasp(label_n=60)
    assert grasp
    width = grasp.width_mm
    assert width == pytest.approx(hand.units.mm(150), abs=1)
    assert hand.part == Part(JAW, width)
    assert grasp.as_dict()["width_mm"] == width
    await hand.open()
    assert hand.part is None


@jaw
@contract
async def test_what_is_not_held_has_no_width(here: Bench, hand: Hand) -> None:
    grasp = await hand.grasp()
    assert not grasp
    assert grasp.width_mm is None
    assert "width_mm" not in grasp.as_dict()
    assert grasp.move.opening_mm(JAW) == pytest.approx(0, abs=1)


@contract
async def test_fingers_of_a_3_finger_have_openings_and_no_width(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(Finger.ABC, position=150)
    grasp = await hand.grasp()
    assert grasp
    assert grasp.width_mm is None
    assert hand.part == Part(Finger.ABC, None)
    result = await hand.move(mm=100, fingers=Finger.A)
    assert set(result.outcomes) == {Finger.A}
    assert result.opening_mm(Finger.A) == hand.status.opening_mm(Finger.A) == pytest.approx(100, abs=2)
    assert "mm open" not in repr(result), "there is no single width"
    with pytest.raises(ValueError, match="the scissor has no opening"):
        result.opening_mm(Finger.SCISSOR)


Refusal = tuple[Callable[[Any], Any], type[Exception], str]
REFUSED: list[Refusal] = [
    (lambda hand: hand.move(mm=50.1), ValueError, "mm must be millimetres in 0.0..50.0, got 50.1"),
    (
        lambda hand: hand.set_position(mm=-1),
        ValueError,
        "mm must be millimetres in 0.0..50.0, got -1",
    ),
    (lambda hand: hand.move(mm="40"), TypeError, "mm must be millimetres in 0.0..50.0, got '40'"),
    (lambda hand: hand.move(mm=True), TypeError, "mm must be millimetres in 0.0..50.0, got True"),
    (
        lambda hand: hand.command(open_fraction=40),
        ValueError,
        "open_fraction must be a share, closed to open, in 0.0..1.0, got 40",
    ),
    (
        lambda hand: hand.close(mm_per_s=10),
        ValueError,
        "mm_per_s must be millimetres a second in 20.0..150.0, got 10",
    ),
    (
        lambda hand: hand.grasp(label_n=131),
        ValueError,
        "label_n must be newton of a label (no measured force) in 20.0..130.0, got 131",
    ),
    (
        lambda hand: hand.move(40.5),
        TypeError,
        "position must be an int in 0..255, got 40.5; millimetres are mm=40.5",
    ),
    (
        lambda hand: hand.move(3, mm=40),
        TypeError,
        "one of position, mm, open_fraction can be given, got position=3 and mm=40",
    ),
    (
        lambda hand: hand.command(mm=40, open_fraction=0.5),
        TypeError,
        "one of position, mm, open_fraction can be given, got mm=40 and open_fraction=0.5",
    ),
    (
        lambda hand: hand.set_speed(3, mm_per_s=40),
        TypeError,
        "one of value, mm_per_s can be given, got value=3 and mm_per_s=40",
    ),
    (
        lambda hand: hand.open(force=3, label_n=40),
        TypeError,
        "one of force, label_n can be given, got force=3 and label_n=40",
    ),
    (lambda hand: hand.move(), TypeError, "move() needs one of position, mm, open_fraction"),
    (lambda hand: hand.set_force(), TypeError, "set_force() needs one of value, label_n"),
    (lambda hand: hand.command(), ValueError, "command() needs at least one of position"),
]


@on_model(HAND_E)
@contract
async def test_what_is_refused_is_refused_in_its_unit_and_nothing_is_sent(here: Bench, hand: Hand) -> None:
    writes = here.writes
    for call, kind, words in REFUSED:
        with pytest.raises(kind, match=f"^{re.escape(words)}"):
            await (call(hand) or asyncio.sleep(0))
    await asyncio.sleep(0.1)
    assert here.writes == writes


@contract
async def test_the_scissor_has_neither_millimetres_nor_a_fraction(here: Bench, hand: Hand) -> None:
    writes = here.writes
    with pytest.raises(ValueError, match="mm is of fingers, for the scissor has no opening"):
        await hand.move(mm=40, fingers=Finger.ALL)
    with pytest.raises(ValueError, match="open_fraction is of fingers, for the scissor has no opening"):
        hand.command(Finger.SCISSOR, open_fraction=0.5)
    await hand.set_speed(mm_per_s=60)
    assert len({axis.speed for axis in here.last_write.axes}) == 1, "a speed is of all axes"
    assert here.writes == writes + 1
