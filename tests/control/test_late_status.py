"""An object status that trails the echo by some reads: no move ends before it begins, and nothing lies."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import pytest

from robotiq_async import Finger, MoveResult, MoveSupersededError, ObjectStatus
from robotiq_async.control.entry import Entry
from robotiq_async.control.rest import LAG_READS, LAG_S, LONG_AGO, Moment, Rest, Target, may_move, rest_of
from robotiq_async.values.enums import NO_AXES
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from tests.control.other_client import image
from tests.control.scan import POLL_S, Outcome, Scan, started

A, B, C, S = THREE_FINGER.axes
ABC = Finger.ABC
MOVING, OPENING, CLOSING, THERE = ObjectStatus
LAGS = pytest.mark.parametrize("lag", [0, 1, 8])
LAGS_AND_CYCLES = pytest.mark.parametrize(
    ("lag", "device_cycle"), [(0, 0.2), (1, 0.005), (8, 0.005), (8, 0.2)]
)
"""Without a lag, the usual device cycle is that of all other tests."""
FEW_POLLS_S = 6 * POLL_S


def ended(scan: Scan, outcome: Outcome) -> MoveResult:
    """The result of a move, checked: the hand is not moving, and stays where it is."""
    scan.until(lambda: outcome.is_answered)
    result, status = outcome.result, scan.controller.status
    assert status is not None
    moves = [axis for axis in status.model.axes if axis in status.moving]
    axes = list(result.outcomes)
    travels = scan.travels()
    assert not set(axes) & set(moves)
    scan.run(0.5)
    for axis in axes:
        assert scan.gripper.travel(axis) - travels[axis] <= 2, f"{axis} went on"
        assert scan.latest.finger_status(axis) is result.outcomes[axis], axis
    return result


def ready(lag: int, device_cycle: float = 0.005) -> Scan:
    """A hand that is open, and reports it: after an activation alone gDT is 0, as in a motion."""
    scan = started(device_cycle, lag=lag)
    scan.moved(0)
    scan.run(LAG_S + 0.1)
    return scan


def holding(lag: int, device_cycle: float = 0.005) -> Scan:
    """All fingers hold something at 150."""
    scan = ready(lag, device_cycle)
    scan.gripper.place_object(ABC, 150)
    assert ended(scan, scan.move(255, speed=255)[1]).contacts == ABC
    return scan


# -- lag x what happens ------------------------------------------------------------------------------------


@LAGS_AND_CYCLES
@pytest.mark.parametrize(("position", "speed"), [(255, 255), (20, 128), (12, 128)])
def test_a_move_ends_there(lag: int, device_cycle: float, position: int, speed: int) -> None:
    scan = ready(lag, device_cycle)
    result = ended(scan, scan.move(position, speed=speed)[1])
    assert set(result.outcomes.values()) == {THERE}
    assert all(abs(at - min(position, 241)) <= 2 for at in result.positions.values())


@LAGS_AND_CYCLES
@pytest.mark.parametrize("at", [9, 60, 150])
def test_a_move_ends_in_contact(lag: int, device_cycle: float, at: int) -> None:
    scan = ready(lag, device_cycle)
    scan.gripper.place_object(ABC, at)
    result = ended(scan, scan.move(255, speed=255)[1])
    assert result.contacts == ABC
    assert all(position == pytest.approx(at, abs=1) for position in result.positions.values())


@LAGS
@pytest.mark.parametrize("what", ["there", "within a count", "latched", "open"])
def test_a_move_of_nothing_ends_within_a_few_polls(lag: int, what: str) -> None:
    scan = ready(lag)
    if what == "latched":
        scan = holding(lag)
    else:
        scan.moved(0 if what == "open" else 100)
    scan.run(1.0)
    target = {"there": 100, "within a count": 101, "latched": 200, "open": 0}[what]
    _, outcome = scan.move(target)
    assert scan.until(lambda: outcome.is_answered) <= FEW_POLLS_S
    assert ended(scan, outcome).contacts == (ABC if what == "latched" else Finger(0))


@LAGS_AND_CYCLES
def test_a_move_that_supersedes_another_ends_where_it_was_sent(lag: int, device_cycle: float) -> None:
    """It comes at every moment of the first one: at its start, in between, at its end, and after it."""
    for seconds in (0.005, 0.02, 0.05, 0.85, 0.9, 1.2):
        scan = ready(lag, device_cycle)
        _, first = scan.move(100, speed=255)
        scan.run(seconds)
        _, second = scan.move(30, speed=255)
        result = ended(scan, second)
        assert result.positions == dict.fromkeys((A, B, C), pytest.approx(30, abs=2)), seconds
        assert set(result.outcomes.values()) == {THERE}
        assert first.is_answered


@LAGS_AND_CYCLES
def test_a_part_that_is_let_go_of_is_no_contact(lag: int, device_cycle: float) -> None:
    """`open()` of a held part reported a contact while closing, and ended before it began."""
    scan = holding(lag, device_cycle)
    result = ended(scan, scan.move(0)[1])
    assert result.contacts == Finger(0)
    assert all(position <= 7 for position in result.positions.values())


@LAGS_AND_CYCLES
@pytest.mark.parametrize("polls", [1, 3, 8, 60])
def test_a_part_that_is_let_go_of_and_gripped_again_at_once(
    lag: int, device_cycle: float, polls: int
) -> None:
    """The part is gone by then: the status of the grip before is no grip now."""
    scan = holding(lag, device_cycle)
    scan.move(0)
    scan.run(polls * POLL_S)
    scan.gripper.remove_object(ABC)
    _, again = scan.move(255)
    result = ended(scan, again)
    # Who had not begun to open is in the contact still: a contact latches.
    latched = {axis for axis, how in result.outcomes.items() if how is CLOSING}
    assert all(abs(result.positions[axis] - 150) <= 1 for axis in latched)
    assert all(result.positions[axis] >= 240 for axis in result.outcomes if axis not in latched)


@LAGS_AND_CYCLES
@pytest.mark.parametrize("polls", [1, 3, 8])
def test_an_axis_sent_away_from_a_part_and_back_is_stopped_by_a_hold(
    lag: int, device_cycle: float, polls: int
) -> None:
    scan = holding(lag, device_cycle)
    scan.move(0)
    scan.run(polls * POLL_S)
    scan.gripper.remove_object(ABC)
    scan.move(255)
    scan.run(2 * device_cycle + 0.005)
    was_moving = scan.gripper.is_moving
    scan.hold()
    scan.run(2 * device_cycle + 0.1)
    travels = scan.travels()
    scan.run(1.0)
    after = scan.travels()
    if was_moving:
        assert all(after[axis] - travels[axis] <= 2 for axis in THREE_FINGER.axes), "it went on after a hold"


@LAGS_AND_CYCLES
def test_a_hold_keeps_a_grip(lag: int, device_cycle: float) -> None:
    scan = holding(lag, device_cycle)
    scan.move(200, S)
    scan.run(0.3)
    scan.hold()
    scan.run(1.0)
    assert scan.gripper.grips == ABC
    assert scan.last_image.position(S) < 200


@LAGS_AND_CYCLES
@pytest.mark.parametrize("seconds", [0.0, 0.01, 0.03, 0.3])
def test_a_motion_that_is_held_stops(lag: int, device_cycle: float, seconds: float) -> None:
    scan = ready(lag, device_cycle)
    _, outcome = scan.move(255, speed=255)
    scan.step()
    scan.run(seconds)
    scan.hold()
    scan.run(0.5)
    assert isinstance(outcome.error, MoveSupersededError)
    travels = scan.travels()
    scan.run(0.5)
    assert scan.travels() == travels
    result = ended(scan, scan.move(60, A)[1])
    assert abs(result.positions[A] - 60) <= 2


@LAGS_AND_CYCLES
def test_two_moves_at_once_end_each_in_its_time(lag: int, device_cycle: float) -> None:
    scan = ready(lag, device_cycle)
    scan.gripper.place_object(B, 60)
    _, short = scan.move(40, A, speed=255)
    _, held = scan.move(255, B, speed=255)
    scan.step()
    _, long = scan.move(200, C, speed=128)
    results = []
    for outcome in (short, held, long):
        scan.until(lambda outcome=outcome: outcome.is_answered)  # type: ignore[misc]
        results.append(outcome.result)
    assert [result.positions[axis] for result, axis in zip(results, (A, B, C), strict=True)] == [
        pytest.approx(at, abs=2) for at in (40, 60, 200)
    ]
    assert [result.contacts for result in results] == [Finger(0), B, Finger(0)]
    assert results[0].duration < results[1].duration < results[2].duration


@LAGS_AND_CYCLES
@pytest.mark.parametrize("after", ["more force", "a halt"])
def test_a_second_try_sees_that_the_part_is_gone(lag: int, device_cycle: float, after: str) -> None:
    """This is a program's test whether a part is still there: the contact of before must not answer."""
    scan = holding(lag, device_cycle)
    if after == "a halt":
        scan.halt()
        scan.run(2 * device_cycle + 0.02)
    scan.gripper.remove_object(ABC)
    if after == "more force":
        scan.run(0.5)
    _, outcome = scan.move(254, force=200) if after == "more force" else scan.move(255)
    assert ended(scan, outcome).contacts == Finger(0)


# -- short motions before -----------------------------------------------------------------------------------

SHORT = [1, 3, 8, 15, 30]
PAUSES_S = [0.0, 0.03, 0.12, 0.3]
MODELS_AND_LAGS = pytest.mark.parametrize(
    ("model", "lag"),
    [(THREE_FINGER, 4), (TWO_FINGER_85, 20), (THREE_FINGER, 48)],
    ids=["3f-4", "2f85-20", "3f-48"],
)
"""The lag in polls: 0.02 to 0.24 s."""


def at_100(lag: int, model: Model) -> Scan:
    """A hand whose finger A, or jaw, has rested at 100 for a while."""
    scan = Scan(lag=lag, model=model, speed=255)
    scan.start()
    return back_at_100(scan)


def back_at_100(scan: Scan) -> Scan:
    """The same, after the part is gone."""
    scan.gripper.remove_object(A)
    scan.moved(100, A)
    scan.run(0.4)
    return scan


def each_short_motion(lag: int, model: Model) -> Iterator[Scan]:
    """The hand after each short first motion and every other pause; the other model has the rest."""
    scan = at_100(lag, model)
    for number, counts in enumerate(SHORT):
        for pause in PAUSES_S[(number + len(model.axes)) % 2 :: 2]:
            scan.moved(100 + counts, A)
            scan.run(pause)
            yield scan
            back_at_100(scan)


@MODELS_AND_LAGS
def test_a_move_after_a_short_one_ends_where_it_was_sent(lag: int, model: Model) -> None:
    """The late object status of the first motion, moving and then at position, is not that of the second."""
    for scan in each_short_motion(lag, model):
        result = ended(scan, scan.move(200, A)[1])
        assert abs(result.positions[A] - 200) <= 2
        assert result.reached == A


@MODELS_AND_LAGS
def test_a_part_that_is_met_after_a_short_motion_is_held(lag: int, model: Model) -> None:
    for scan in each_short_motion(lag, model):
        scan.gripper.place_object(A, 180)
        assert ended(scan, scan.move(255, A)[1]).contacts == A
        assert scan.gripper.grips == A


@MODELS_AND_LAGS
def test_a_part_is_let_go_of_after_a_short_motion(lag: int, model: Model) -> None:
    scan = at_100(lag, model)
    scan.moved(108, A)
    for pause in PAUSES_S:
        scan.gripper.place_object(A, 180)
        assert ended(scan, scan.move(255, A)[1]).contacts == A
        scan.run(pause)
        result = ended(scan, scan.move(150, A)[1])
        assert result.contacts == NO_AXES
        assert abs(result.positions[A] - 150) <= 2
        scan.moved(158, A)
        assert ended(scan, scan.move(60, A)[1]).reached == A


@MODELS_AND_LAGS
def test_a_hold_after_a_short_motion_stops_the_second(lag: int, model: Model) -> None:
    for scan in each_short_motion(lag, model):
        _, second = scan.move(250, A)
        scan.run(0.05)
        scan.hold(A)
        scan.run(0.05)
        assert second.is_answered
        travel = scan.gripper.travel(A)
        scan.run(0.5)
        assert scan.gripper.travel(A) - travel <= 2, "it went on after a hold"


@MODELS_AND_LAGS
def test_a_stop_that_keeps_a_grip_leaves_no_motion_after_a_short_one(lag: int, model: Model) -> None:
    for counts in (3, 15):
        for pause in (0.0, 0.12):
            scan = at_100(lag, model)
            scan.moved(100 + counts, A)
            scan.run(pause)
            scan.command(A, position=250)
            scan.run(0.02)
            scan.stop(keep_grip=True)
            travel = scan.gripper.travel(A)
            scan.now += 5
            assert scan.gripper.travel(A) == travel, (counts, pause)


@pytest.mark.parametrize("lag", [4, 20, 48])
@pytest.mark.parametrize("pause", [0.0, 0.03, 0.12])
def test_a_short_motion_of_another_client_does_not_end_ours(lag: int, pause: float) -> None:
    scan = at_100(lag, THREE_FINGER)
    here = {axis: scan.last_image.position(axis) for axis in THREE_FINGER.axes}
    scan.gripper.write(0, image(here | {A: 108}))
    scan.run(0.01 + pause)
    result = ended(scan, scan.move(200, A)[1])
    assert abs(result.positions[A] - 200) <= 2


# -- what cannot be reached --------------------------------------------------------------------------------


@LAGS
def test_an_axis_at_a_software_limit_ends_when_the_lag_is_over(lag: int) -> None:
    """It is "reached" far from its request, and nothing has moved: the status may be late, or right."""
    scan = ready(lag)
    scan.moved(255, S)
    scan.run(1.0)
    _, outcome = scan.move(240, S)
    took = scan.until(lambda: outcome.is_answered)
    assert took == pytest.approx(LAG_S, abs=0.05)
    assert outcome.result.outcomes == {S: THERE}


# -- every reader -----------------------------------------------------------------------------------------


@LAGS_AND_CYCLES
def test_a_hand_that_was_sent_off_is_moving_until_it_has_stopped(lag: int, device_cycle: float) -> None:
    scan = ready(lag, device_cycle)
    scan.run(1.0)
    scan.command(A, position=60)
    while scan.gripper.position(A) < 60:
        scan.step()
        assert scan.controller.is_moving
    scan.until(lambda: not scan.controller.is_moving, 1.0)


@LAGS_AND_CYCLES
def test_a_grip_is_kept_and_what_was_just_sent_off_is_held(lag: int, device_cycle: float) -> None:
    scan = holding(lag, device_cycle)
    scan.command(S, position=200)
    scan.step()
    scan.stop(keep_grip=True)
    travels = scan.travels()
    assert scan.gripper.grips == ABC
    scan.now += 5
    assert scan.travels() == travels


@LAGS
@pytest.mark.parametrize("polls", [1, 3, 8])
def test_a_grip_that_is_being_let_go_of_is_not_kept_for_one(lag: int, polls: int) -> None:
    scan = holding(lag)
    scan.command(ABC, position=0)
    scan.run(polls * POLL_S)
    scan.stop(keep_grip=True)
    travels = scan.travels()
    scan.now += 5
    assert scan.travels() == travels, "it went on after the end"


@LAGS
@pytest.mark.parametrize("target", [0, 200])
def test_the_first_write_beside_another_clients_leaves_it_what_it_has_just_asked(
    lag: int, target: int
) -> None:
    """Found with a gDT from before, an axis would have been sent back to where it came from."""
    scan = Scan(lag=lag)
    scan.gripper.place_object(B, 150)
    scan.gripper.write(0, [0x0100])
    scan.now += 10
    scan.gripper.write(0, image({B: 255}))
    for _ in range(500):
        scan.now += POLL_S
        scan.status()
    scan.gripper.write(0, image({B: target}))
    scan.come_back(0.01)
    scan.command(S, position=100)
    scan.run(3)
    assert scan.gripper.position(B) == pytest.approx(6 if target == 0 else 150, abs=2)
    assert scan.last_image.position(B) == target


# -- one axis ----------------------------------------------------------------------------------------------


NOW = Moment(10.0, 1000)
OLD = Moment(NOW.time - LAG_S, NOW.reads - LAG_READS)


def asked(position: int, *, again: bool = False, since: Moment | None = LONG_AGO) -> Target:
    """One request of A."""
    request = Request(go=True, axes=(AxisRequest(position),) * 4)
    return Target(A, Entry(request, request.echo, is_ours=True, sent=0.0), again, since)


def rest(what: ObjectStatus, position: int, *asked: Target) -> Rest:
    """The known rest of an axis with these requests, the oldest first."""
    return rest_of(asked, THREE_FINGER, what, position)


def doubted(what: ObjectStatus, position: int, *asked: Target) -> bool:
    return may_move(asked, THREE_FINGER, what, position)


def test_a_status_is_trusted_unless_an_earlier_request_explains_it() -> None:
    assert rest(THERE, 100, asked(255)) is Rest.PROVEN
    assert rest(MOVING, 100, asked(255)) is Rest.UNKNOWN
    assert not doubted(CLOSING, 100, asked(0))
    assert rest(CLOSING, 9, asked(0), asked(255)) is Rest.PROVEN, "it fits the new request alone"
    assert rest(CLOSING, 9, asked(255), asked(0)) is Rest.UNKNOWN
    to_and_fro = asked(255), asked(0), asked(255)
    assert rest(CLOSING, 150, *to_and_fro) is Rest.UNKNOWN, "it fitted before, and was contradicted since"
    assert doubted(CLOSING, 150, *to_and_fro)


def test_an_axis_that_is_where_it_was_asked_to_be_rests_and_an_older_status_may_follow() -> None:
    assert rest(THERE, 101, asked(0), asked(100)) is Rest.KNOWN
    assert rest(THERE, 101, asked(100)) is Rest.PROVEN
    assert rest(THERE, 110, asked(0), asked(100)) is Rest.UNKNOWN


@pytest.mark.parametrize(("seconds", "reads"), [(0.001, 0), (0.0, 1)])
def test_the_lag_takes_both_time_and_reads(seconds: float, reads: int) -> None:
    assert OLD.is_lag_over(NOW)
    assert not Moment(OLD.time + seconds, OLD.reads + reads).is_lag_over(NOW)
    assert LONG_AGO.is_lag_over(Moment(0.0, 0))


def test_nothing_is_known_under_what_does_not_act() -> None:
    assert rest(THERE, 100, asked(101), asked(100, since=None)) is Rest.UNKNOWN


def asked_of(scan: Scan, axis: Finger) -> int:
    """The number of requests of an axis that a status may be from."""
    return len(scan.controller.ledger.requests.targets[axis])


@LAGS
def test_every_request_but_the_last_is_forgotten_when_the_lag_is_over(lag: int) -> None:
    scan = started(lag=lag)
    for position in (40, 80, 120, 160):
        scan.command(A, position=position)
        scan.run(0.02)
    scan.run(2 * LAG_S + LAG_READS * POLL_S)
    assert asked_of(scan, A) == 1


def test_a_status_after_a_motion_is_not_from_before_it() -> None:
    """Statuses come in their order; but a motion may be that of a request before, if there was one."""
    scan = started()
    scan.moved(20, A)
    scan.run(1.0)
    scan.command(A, position=255)
    scan.until(lambda: bool(scan.latest.moving))
    assert asked_of(scan, A) == 1
    scan.command(A, position=0)
    scan.run(0.02)
    assert asked_of(scan, A) == 2


@pytest.mark.parametrize(("position", "doubtful"), [(100, True), (102, True), (103, False), (105, False)])
def test_an_axis_between_two_requests_may_have_some_counts_to_go(position: int, doubtful: bool) -> None:
    assert doubted(THERE, position, asked(100), asked(104)) is doubtful


def test_a_contact_that_is_tried_again_is_known_when_the_lag_is_over() -> None:
    twice = asked(255), asked(255, again=True)
    assert rest(CLOSING, 150, *twice) is Rest.UNKNOWN
    assert not doubted(CLOSING, 150, *twice), "for a hold it is a grip"
    assert rest(CLOSING, 150, *twice[1:]) is Rest.PROVEN


# -- another client, while the object status is late ------------------------------------------------------


def changed(words: Sequence[int], positions: Mapping[Finger, int]) -> Registers:
    """An image of a client that reads what the gripper was asked, and changes these axes at full speed."""
    read = Request.from_registers(words)
    axes = tuple(replace(each, speed=255) for each in read.axes)
    return replace(read, axes=axes).with_positions(positions).registers


def holds_on_at_60(device_cycle: float = 0.005) -> Scan:
    """B opens, slowly and seen to move; there is an object at 60."""
    scan = Scan(device_cycle=device_cycle, lag=50, speed=0)
    scan.start()
    scan.moved(57, B, speed=255)
    scan.run(1.0)
    scan.gripper.place_object(B, 60)
    scan.command(B, 30, speed=0)
    scan.run(0.3)
    return scan


def closes_to_the_object(scan: Scan) -> None:
    _, outcome = scan.move(255, B, speed=0)
    result = ended(scan, outcome)
    assert result.contacts == B
    assert result.positions[B] == pytest.approx(60, abs=2)


@pytest.mark.parametrize("since", [0.1, 0.15, 0.2])
def test_a_contact_under_our_request_that_another_client_repeated_ends_no_later_move(since: float) -> None:
    """Ours has not shown as the client copies it: B closes by the client's image, and touches."""
    scan = holds_on_at_60()
    scan.command(B, 200)
    scan.step()
    scan.gripper.write(0, changed(scan.written[-1], {A: 100}))
    scan.run(0.15)
    scan.gripper.write(0, changed(scan.gripper.request_registers, {B: 40}))
    scan.run(since)
    closes_to_the_object(scan)


@pytest.mark.parametrize("since", [0.1, 0.15, 0.2])
def test_a_contact_under_our_request_that_no_status_showed_ends_no_later_move(since: float) -> None:
    """Ours acts, and B touches, between two polls; another client's image shows then."""
    scan = holds_on_at_60()
    scan.command(B, 200, speed=255)
    scan.step()
    for _ in range(30):
        scan.now += POLL_S
        scan.status()  # what the gripper shows comes late, and no poll asks for it
    scan.gripper.write(0, changed(scan.gripper.request_registers, {B: 40}))
    scan.now += POLL_S
    scan.run(since)
    closes_to_the_object(scan)


def test_a_move_that_another_client_repeats_before_gdt_shows_it_goes_on() -> None:
    """A gDT from before shows A at rest where it stands: that does not make its place its request."""
    scan = started(lag=8)
    scan.moved(30)
    scan.run(1.0)
    _, outcome = scan.move(200, A)
    scan.run(2 * POLL_S)
    scan.gripper.write(0, changed(scan.gripper.request_registers, {B: 50}))
    while not outcome.is_answered:
        scan.step()
        assert scan.controller.is_moving or outcome.is_answered
    assert outcome.result.positions[A] == pytest.approx(200, abs=2)
