"""Software limits that are echoed in place of the request, and how other clients differ from them."""

from __future__ import annotations

import logging

import pytest

from robotiq_async import ConnectionLostError, Finger, MoveSupersededError, ObjectStatus, State
from robotiq_async.control.entry import Entry
from robotiq_async.control.ledger import WINDOW_S
from robotiq_async.control.limits import ALONE_S, Limits
from robotiq_async.simulator import Habits
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from tests.control.other_client import image
from tests.control.scan import POLL_S, Scan, started
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes
LOW, HIGH = 20, 220
CYCLES = pytest.mark.parametrize("device_cycle", [0.0, 0.005, 0.03, 0.2])
LAGS = pytest.mark.parametrize("lag", [0, 2, 8])


def echoing(device_cycle: float = 0.005, lag: int = 0) -> Scan:
    """A gripper whose scissor has a range of 20..220, and that echoes a limit for requests beyond."""
    habits = Habits(echoes_limits=True)
    scan = Scan(device_cycle=device_cycle, speed=255, lag=lag, scissor_limit=(LOW, HIGH), habits=habits)
    scan.start()
    scan.moved(130, S)
    scan.run(0.6)
    return scan


# -- limits ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("device_cycle", "lag", "request_", "limit"),
    [
        *((0.0, 0, 255, HIGH), (0.0, 2, 230, HIGH), (0.0, 8, 0, LOW)),
        *((0.005, 0, 230, HIGH), (0.005, 2, 0, LOW), (0.005, 8, 255, HIGH)),
        *((0.03, 0, 0, LOW), (0.03, 2, 255, HIGH), (0.03, 8, 230, HIGH)),
        *((0.2, 0, 255, HIGH), (0.2, 2, 230, HIGH), (0.2, 8, 0, LOW)),
    ],
)  # each pair of values
def test_a_move_beyond_a_limit_ends_with_what_it_reached(
    device_cycle: float, lag: int, request_: int, limit: int
) -> None:
    scan = echoing(device_cycle, lag)
    for _ in range(2):
        result = scan.moved(request_, S)
        assert result.outcomes == {S: ObjectStatus.AT_POSITION}
        assert result.positions == {S: limit}
        assert scan.moved(130, S).positions == {S: 130}
    assert scan.controller.foreign_commands == 0


def test_a_limit_is_learned_and_logged_once(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    scan = echoing()
    for request in (255, 130, 250, 130, 255):
        scan.moved(request, S)
    assert caplog.text.count(f"its limit {HIGH}") == 1


def test_a_limit_that_no_axis_has_proven_is_dropped_when_another_client_is_seen() -> None:
    """The apparent limit may have been that client's request: it explains no later echo."""
    scan = echoing()
    scan.move(255, S)
    scan.run(0.05)
    assert scan.controller.foreign_commands == 0, "taken for a limit"
    scan.gripper.write(0, image({A: 50, S: 100}))
    scan.run(1.0)
    _, again = scan.move(255, S)
    scan.run(1.0)
    assert scan.controller.foreign_commands == 2
    assert isinstance(again.error, MoveSupersededError)


def test_a_move_from_a_limit_beyond_it_ends_there_and_the_limit_is_the_request() -> None:
    """The echo does not change, and is that of the move before as well as that of this one."""
    scan = echoing()
    scan.moved(255, S)
    scan.run(1.0)
    scan.command(S, position=HIGH)
    scan.run(1.0)
    asked = scan.now
    assert scan.moved(250, S).positions == {S: HIGH}
    assert scan.now - asked < WINDOW_S, "known by its limit, and not only because all else is too old to show"
    scan.moved(100, A)
    assert scan.last_image.position(S) == HIGH


def test_an_axis_at_its_limit_rests_and_is_left_alone() -> None:
    scan = echoing()
    scan.moved(255, S)
    written = len(scan.written)
    scan.hold()
    scan.run(0.5)
    assert len(scan.written) == written
    scan.moved(100, A)
    assert scan.last_image.position(S) == HIGH
    scan.stop(keep_grip=True)
    assert scan.last_image.go


@pytest.mark.parametrize("position", [180, HIGH - 1])
def test_an_axis_that_a_part_keeps_from_its_limit_is_in_contact_and_proves_no_limit(
    position: int, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    scan = echoing()
    scan.gripper.place_object(S, position)
    assert scan.moved(255, S).contacts == S
    assert "its limit" not in caplog.text


@CYCLES
def test_a_control_loop_beyond_a_limit_commands_alone(device_cycle: float) -> None:
    scan = echoing(device_cycle)
    for position in range(140, 256, 2):
        scan.command(S, position=position)
        scan.step()
    for position in range(254, 120, -2):
        scan.command(S, position=position)
        scan.step()
    _, outcome = scan.move(255, S)
    scan.until(lambda: outcome.is_answered)
    assert outcome.result.positions == {S: HIGH}
    assert scan.controller.foreign_commands == 0


def test_two_moves_at_once_one_of_them_beyond_a_limit() -> None:
    scan = echoing()
    _, finger = scan.move(150, A)
    _, scissor = scan.move(255, S)
    scan.until(lambda: finger.is_answered and scissor.is_answered)
    assert finger.result.positions == {A: 150}
    assert scissor.result.positions == {S: HIGH}


@pytest.mark.parametrize("arrives", [True, False])
def test_what_shows_after_a_lost_link_is_no_limit_of_a_write_that_may_not_have_arrived(
    arrives: bool, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.INFO)
    scan = echoing()
    scan.forgets = not arrives
    lost = scan.command(S, position=255)
    scan.step(answer=False)
    scan.gripper.write(0, scan.last_image.with_positions({S: 200}).registers)
    scan.come_back(0.1)
    assert scan.state is State.RUNNING_IDLE
    assert isinstance(lost.error, ConnectionLostError)
    scan.until(lambda: not scan.controller.is_moving)
    scan.run(1.0)
    assert "its limit" not in caplog.text


def test_after_a_reconnect_it_goes_on() -> None:
    scan = echoing()
    scan.moved(255, S)
    scan.blink()
    assert scan.moved(100, A).positions == {A: 100}
    assert scan.last_image.position(S) == HIGH
    assert scan.moved(130, S).positions == {S: 130}
    assert scan.controller.foreign_commands == 0


# -- other clients -----------------------------------------------------------------------------------------


def beside(scan: Scan, **positions: int) -> Registers:
    """The image of another client that knows all the rest."""
    image = Request.from_registers(scan.gripper.request_registers)
    return image.with_positions({Finger[name]: at for name, at in positions.items()}).registers


@CYCLES
@pytest.mark.parametrize("polls", [1, 5, 60])
def test_a_client_that_writes_after_ours_has_shown_is_one(device_cycle: float, polls: int) -> None:
    scan = started(device_cycle)
    _, outcome = scan.move(200, S, speed=0)
    scan.until(lambda: scan.controller.status is not None and scan.latest.requested_position(S) == 200)
    scan.run(polls * POLL_S)
    scan.gripper.write(0, beside(scan, SCISSOR=180))
    scan.until(lambda: outcome.is_answered, 2.0)
    assert isinstance(outcome.error, MoveSupersededError)
    assert scan.controller.foreign_commands == 1


@CYCLES
@pytest.mark.parametrize(
    "others",
    [
        {"SCISSOR": 50},  # the other way
        {"SCISSOR": 180, "A": 90},  # another axis as well
        {"A": 90},
    ],
    ids=str,
)
def test_a_client_that_writes_just_after_us_is_one(device_cycle: float, others: dict[str, int]) -> None:
    scan = started(device_cycle)
    scan.moved(130, S)
    scan.run(1.0)
    _, outcome = scan.move(200, S, speed=0)
    scan.step()
    scan.gripper.write(0, beside(scan, **others))
    scan.run(1.0)
    assert scan.controller.foreign_commands == 1
    if "SCISSOR" in others:
        assert isinstance(outcome.error, MoveSupersededError)


@CYCLES
def test_a_client_that_takes_the_fingers_just_after_us_is_one(device_cycle: float) -> None:
    """Fingers have a limit only near pinch."""
    scan = started(device_cycle)
    _, outcome = scan.move(255)
    scan.step()
    scan.gripper.write(0, beside(scan, A=100, B=100, C=100))
    scan.until(lambda: outcome.is_answered, 2.0)
    assert isinstance(outcome.error, MoveSupersededError)
    assert scan.controller.foreign_commands == 1


def test_a_client_seen_lately_explains_the_echo_better() -> None:
    scan = echoing()
    scan.gripper.write(0, beside(scan, A=90))
    scan.run(2.0)
    assert scan.controller.foreign_commands == 1
    _, outcome = scan.move(255, S)
    scan.until(lambda: outcome.is_answered)
    assert isinstance(outcome.error, MoveSupersededError)
    scan.run(ALONE_S + 1)
    scan.moved(130, S)
    scan.run(1.0)
    assert scan.moved(255, S).positions == {S: HIGH}


def test_a_client_that_is_taken_for_a_limit_is_not_undone() -> None:
    """It wrote within our device cycle, on our axis, on its way: as a limit would. Nothing moves by it."""
    scan = started(0.03)
    scan.moved(130, S)
    scan.run(1.0)
    _, outcome = scan.move(255, S)
    scan.step()
    scan.gripper.write(0, beside(scan, SCISSOR=180))
    scan.until(lambda: outcome.is_answered)
    assert outcome.result.positions == {S: 180}
    travel = scan.gripper.travel(S)
    scan.moved(100, A)
    assert scan.gripper.travel(S) == travel
    # Next time the request is echoed as it is: it was no limit.
    assert scan.moved(225, S).positions == {S: 225}
    assert scan.controller.foreign_commands == 0


# -- what is learned ---------------------------------------------------------------------------------------

BEFORE = Request(activate=True, go=True, axes=(AxisRequest(0),) * 3 + (AxisRequest(130),))


@pytest.mark.parametrize(
    ("shown", "position", "asked", "expected"),
    [
        ((0, 0, 0, 220), 130, {S: 255}, True),
        ((0, 0, 0, 120), 130, {S: 255}, False),  # behind it
        ((0, 0, 0, 128), 130, {S: 255}, True),  # an axis rests within two counts of its limit
        ((0, 0, 0, 127), 130, {S: 255}, False),
        ((0, 0, 0, 15), 130, {S: 0}, True),
        ((0, 0, 0, 140), 130, {S: 0}, False),
        ((0, 0, 0, 132), 130, {S: 0}, True),
        ((0, 0, 0, 133), 130, {S: 0}, False),
        ((0, 0, 0, 220), 130, {}, False),  # an axis without a request
        ((113, 113, 113, 130), 130, {A: 255, B: 255, C: 255}, False),  # the scissor is not near pinch
        ((113, 113, 113, 130), 219, {A: 255, B: 255, C: 255}, True),
        ((113, 255, 113, 130), 219, {A: 255, B: 255, C: 255}, True),
    ],
)
def test_which_echoes_may_be_limits(
    shown: tuple[int, ...], position: int, asked: dict[Finger, int], expected: bool
) -> None:
    status = status_of(0x39, 0xFF, echo=shown, position=(6, 6, 6, position))
    assert Limits().learn(BEFORE, BEFORE.with_positions(asked), status) is expected


@pytest.mark.parametrize("byte_0", [0x31, 0x38, 0x30], ids=["halt", "reset", "both"])
def test_a_halt_and_a_reset_by_others_are_no_limits(byte_0: int) -> None:
    image = BEFORE.with_positions({S: 255})
    status = status_of(byte_0, 0xFF, echo=(0, 0, 0, 220), position=130)
    assert not Limits().learn(BEFORE, image, status)


def shown(limits: Limits, image: Request) -> None:
    """The gripper echoes an image as it was written."""
    entry = Entry(image, image.echo, is_ours=True, sent=0.0)
    limits.settle(entry, entry, image.echo)


def test_unproven_limits_are_dropped_when_another_client_is_seen(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    limits, image = Limits(), BEFORE.with_positions({S: 255})
    status = status_of(0x39, 0xFF, echo=(0, 0, 0, 220), position=130)
    assert limits.learn(BEFORE, image, status)
    limits.note_other_client(0.0)
    assert not limits.apply(image)
    assert limits.learn(BEFORE, image, status)
    limits.limited[S] = 220
    for _ in range(2):
        limits.note_rest(S, status_of(0x39, 0xFF, echo=(0, 0, 0, 220), position=219))
    assert caplog.text.count("its limit 220") == 1, "no news"
    limits.note_other_client(0.0)
    assert limits.apply(image) == {S: 220}
    shown(limits, image)
    assert not limits.apply(image)


@pytest.mark.parametrize(
    ("position", "is_proven"), [(217, False), (218, True), (220, True), (222, True), (223, False)]
)
def test_an_axis_at_rest_within_two_counts_of_its_limit_proves_it(position: int, is_proven: bool) -> None:
    limits, image = Limits(), BEFORE.with_positions({S: 255})
    assert limits.learn(BEFORE, image, status_of(0x39, 0xFF, echo=(0, 0, 0, 220), position=130))
    limits.limited[S] = 220
    limits.note_rest(S, status_of(0x39, 0xFF, echo=(0, 0, 0, 220), position=position))
    limits.note_other_client(0.0)
    assert bool(limits.apply(image)) is is_proven


@pytest.mark.parametrize(("asked", "limit"), [(255, 220), (0, 20)])
def test_a_request_at_a_limit_does_not_refute_it_and_one_beyond_does(asked: int, limit: int) -> None:
    limits, beyond, at = Limits(), BEFORE.with_positions({S: asked}), BEFORE.with_positions({S: limit})
    assert limits.learn(BEFORE, beyond, status_of(0x39, 0xFF, echo=(0, 0, 0, limit), position=130))
    shown(limits, at)
    assert limits.apply(beyond) == {S: limit}
    shown(limits, beyond)
    assert not limits.apply(beyond)


def test_a_limit_that_may_not_count_yet_is_no_endless_question(scan: Scan) -> None:
    """Two writes are forgotten, and the echo could be a limit of the second: the ledger called itself."""
    scan.command(C, position=1)
    scan.run(0.01)
    scan.forgets = 2
    scan.command(C | S, position=0)
    scan.run(0.3)
    scan.command(C, position=1)
    scan.run(1.0)
    scan.moved(100, A)
    scan.until(lambda: not scan.controller.is_moving)
    assert scan.gripper.position(A) == pytest.approx(100, abs=2)
