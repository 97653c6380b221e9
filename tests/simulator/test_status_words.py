"""The first two status bytes that the manual's examples show."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotiq_async.values.enums import Finger

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench


def test_switched_on(bench: Bench) -> None:
    assert bench.gripper.status_registers() == (0, 0, 0x0600, 6, 0, 0x0600, 137, 0)


def test_activating(bench: Bench) -> None:
    bench.write(activate=True)
    assert bench.words == (0x11, 0x00)


def test_ready(active: Bench) -> None:
    assert active.words == (0x31, 0x00)


def test_closing(active: Bench) -> None:
    active.go(255)
    active.wait(0.5)
    assert active.words == (0x39, 0xC0)


def test_object_held(active: Bench) -> None:
    active.gripper.place_object(Finger.ABC, 150)
    active.close()
    assert active.words == (0xB9, 0xEA)


def test_position_reached(active: Bench) -> None:
    active.close()
    assert active.words == (0xF9, 0xFF)


def test_one_finger_stopped_early(active: Bench) -> None:
    active.gripper.place_object(Finger.B, 150)
    active.close()
    assert active.words == (0x79, 0xFB)


def test_two_fingers_stopped_while_opening(active: Bench) -> None:
    active.close()
    active.gripper.place_object(Finger.A | Finger.C, 100, opening=True)
    active.close(0)
    assert active.words == (0x79, 0xDD)


def test_one_finger_still_moving_is_moving(active: Bench) -> None:
    active.gripper.place_object(Finger.A | Finger.B, 20)
    active.go(255)
    active.wait(1)
    assert active.words == (0x39, 0xCA)


def test_the_scissor_is_not_part_of_the_summary(individual: Bench) -> None:
    individual.gripper.place_object(Finger.SCISSOR, 150)
    individual.go({Finger.SCISSOR: 255})
    individual.settle()
    assert individual.words == (0xF9, 0xBF)


def test_halted_midway(active: Bench) -> None:
    active.go(255)
    active.wait(0.5)
    active.write(go=False)
    assert active.words == (0x31, 0xC0)


def test_halted_at_the_position(active: Bench) -> None:
    active.close()
    active.write(go=False)
    assert active.words == (0xF1, 0xFF)


def test_halted_in_a_contact(active: Bench) -> None:
    active.gripper.place_object(Finger.ABC, 150)
    active.close()
    active.write(go=False)
    assert active.words == (0xB1, 0xEA)
