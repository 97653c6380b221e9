"""Commands: what is written, what moves, and for how long it counts as moving."""

from __future__ import annotations

import pytest

from robotiq_async import ConnectionLostError, Finger, NotActivatedError
from robotiq_async.calibration.scales import closing_time
from robotiq_async.control.pending import changes
from robotiq_async.control.waiters import Move
from robotiq_async.local.session import usual_time
from tests.control.other_client import going_to
from tests.control.scan import Outcome, Scan

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def test_settings_between_two_polls_are_one_write_and_the_last_value_wins(scan: Scan) -> None:
    writes = len(scan.written)
    outcomes = [scan.command(A, position=value) for value in (10, 20, 30)]
    outcomes.append(scan.command(B, speed=7))
    outcomes.append(scan.command(C, force=9))
    scan.step()
    assert len(scan.written) == writes + 1
    image = scan.last_image
    assert (image.position(A), image.axes[1].speed, image.axes[2].force) == (30, 7, 9)
    assert [outcome.answers for outcome in outcomes] == [[None]] * 5


def test_is_moving_from_the_command_until_the_end(scan: Scan) -> None:
    outcome = scan.command(A, position=200)
    assert scan.controller.is_moving
    while not outcome.is_answered:
        scan.step()
    assert scan.controller.is_moving, "acknowledged, but it does not act yet"
    scan.until(lambda: not scan.controller.is_moving)
    assert not scan.gripper.is_moving
    assert scan.gripper.position(A) == pytest.approx(200, abs=2)


def default_timeout(scan: Scan, position: int, axes: Finger, speed: int | None = None) -> float:
    scan.controller.move(Move(position, axes, scan.now, Outcome()), speed, None)
    return usual_time(position, axes, scan.latest, scan.controller.speeds, closing_time)


def test_the_default_timeout_follows_from_distance_and_speed(scan: Scan) -> None:
    assert default_timeout(scan, 241, A, 0) == pytest.approx(2 * 10.021 + 2, abs=0.1)
    assert default_timeout(scan, 241, A, 255) == pytest.approx(2 * 2.12 + 2, abs=0.1)
    assert default_timeout(scan, 6, A, 0) == pytest.approx(2.0, abs=0.1)


def test_a_command_does_not_activate_a_gripper_that_was_reset_since_the_last_poll(scan: Scan) -> None:
    """Every image repeats rACT = 1. Written on the status of the poll before, it activated the gripper."""
    scan.run(0.1)
    writes = len(scan.written)
    scan.gripper.power_cycle()
    asked = scan.command(A, position=200)
    scan.run(1.0)
    assert isinstance(asked.error, NotActivatedError)
    assert len(scan.written) == writes
    assert not scan.latest.activation_echo


def test_the_default_timeout_goes_by_the_speed_an_axis_has_or_is_about_to_get(scan: Scan) -> None:
    usual = default_timeout(scan, 241, A)
    scan.controller.command(changes(A, None, 0))
    slow = default_timeout(scan, 241, A)
    assert slow > usual
    scan.hold()
    scan.run(0.5)
    assert default_timeout(scan, 241, A) == slow, "it has it by now"
    assert default_timeout(scan, 241, B) == usual


def test_a_hand_that_cannot_move_has_no_default_timeout() -> None:
    scan = Scan()
    with pytest.raises(ConnectionLostError):
        default_timeout(scan, 241, A)
    scan.connect(activate=False)
    with pytest.raises(NotActivatedError):
        default_timeout(scan, 241, A)


def test_before_the_first_status_nothing_moves_and_nothing_is_written() -> None:
    scan = Scan()
    assert not scan.controller.is_moving
    assert scan.controller.decide(scan.now) is None


def test_a_gripper_that_is_not_active_moves_when_a_status_says_so(scan: Scan) -> None:
    scan.gripper.write(0, going_to(200))
    scan.run(0.5)
    scan.controller.lost(None)
    assert scan.controller.is_moving, "as far as is known"
