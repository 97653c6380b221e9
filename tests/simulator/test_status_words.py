"""The first two status bytes in the manual's examples."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from robotiq_async.values.enums import NO_AXES, Finger

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench


def test_switched_on(bench: Bench) -> None:
    assert bench.gripper.status_registers() == (0, 0, 0x0600, 6, 0, 0x0600, 137, 0)


@pytest.mark.parametrize(
    ("touched", "seconds", "going", "halted"),
    [
        (NO_AXES, 0.5, (0x39, 0xC0), (0x31, 0xC0)),
        (NO_AXES, 3.0, (0xF9, 0xFF), (0xF1, 0xFF)),
        (Finger.A | Finger.B, 1.6, (0x39, 0xCA), (0x31, 0xCA)),
        (Finger.B, 3.0, (0x79, 0xFB), (0x71, 0xFB)),
        (Finger.ABC, 3.0, (0xB9, 0xEA), (0xB1, 0xEA)),
    ],
)
def test_closing(
    active: Bench, touched: Finger, seconds: float, going: tuple[int, int], halted: tuple[int, int]
) -> None:
    if touched:
        active.gripper.place_object(touched, 150)
    active.go(255)
    active.wait(seconds)
    assert active.words == going
    active.write(go=False)
    assert active.words == halted


def test_two_fingers_stopped_while_opening(active: Bench) -> None:
    active.close()
    active.gripper.place_object(Finger.A | Finger.C, 100, opening=True)
    active.reach(0)
    assert active.words == (0x79, 0xDD)


def test_the_scissor_is_not_part_of_the_summary(individual: Bench) -> None:
    individual.gripper.place_object(Finger.SCISSOR, 150)
    individual.reach({Finger.SCISSOR: 255})
    assert individual.words == (0xF9, 0xBF)
