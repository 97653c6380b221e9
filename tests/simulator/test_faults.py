"""Every fault of the table, and the automatic release."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from robotiq_async.calibration.scales import closing_time
from robotiq_async.values.enums import Fault, Finger, Initialization, ObjectStatus, Severity
from robotiq_async.values.model import THREE_FINGER

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

SERIOUS = [fault for fault in Fault if fault.is_serious and fault is THREE_FINGER.faults[int(fault)]]
SERIOUS.remove(Fault.SCISSOR_INTERFERENCE)
PRIORITY = [fault for fault in Fault if fault.severity is Severity.PRIORITY]


@pytest.mark.parametrize("fault", [*SERIOUS, Fault(0x0C)])
def test_a_serious_fault_stops_all_axes(individual: Bench, fault: Fault) -> None:
    individual.go(255)
    individual.wait(0.5)
    individual.gripper.inject_fault(fault)
    stopped_at = individual.positions
    assert individual.fault is fault
    individual.wait(5)
    assert individual.positions == stopped_at
    assert not individual.gripper.is_moving


@pytest.mark.parametrize("fault", PRIORITY)
def test_a_priority_fault_stops_nothing(individual: Bench, fault: Fault) -> None:
    individual.go(255)
    individual.gripper.inject_fault(fault, 30)
    individual.settle()
    assert individual.fault is fault
    assert individual.positions[:3] == (241, 241, 241)
    individual.wait(30)
    assert individual.fault is Fault.NONE


def test_a_minor_fault_ends_by_itself_and_the_motion_goes_on(individual: Bench) -> None:
    """The danger that a hand has to hold its axes against."""
    individual.go(255)
    individual.wait(0.5)
    individual.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 3)
    individual.wait(2.9)
    assert individual.fault is Fault.COMMUNICATION_NOT_READY
    assert not individual.gripper.is_moving
    individual.wait(0.2)
    assert individual.fault is Fault.NONE
    assert individual.gripper.is_moving
    individual.settle()
    assert individual.positions[:3] == (241, 241, 241)


def test_a_major_fault_needs_a_reset(active: Bench) -> None:
    active.gripper.inject_fault(Fault.ACTIVATION_FAULT)
    active.wait(1000)
    active.go(255)
    assert active.fault is Fault.ACTIVATION_FAULT
    assert not active.gripper.is_moving
    active.write(activate=False, go=False)
    assert active.fault is Fault.NONE
    active.activate()


@pytest.mark.parametrize("fault", [Fault.COMMUNICATION_NOT_READY, Fault.SCISSOR_INTERFERENCE])
def test_writing_to_a_gripper_that_is_reset_clears_no_fault(bench: Bench, fault: Fault) -> None:
    """A reset is rACT falling from 1 to 0, not every image in which it is 0."""
    bench.gripper.inject_fault(fault, 3)
    bench.gripper.write(0, [0] * 8)
    bench.wait(0.1)
    assert bench.fault is fault
    bench.write(mode=1)
    assert bench.fault is fault
    bench.wait(3)
    assert bench.fault is Fault.NONE


def test_rewriting_the_image_clears_no_fault_and_releases_nothing(releasing: Bench) -> None:
    releasing.settle()
    before = releasing.gripper.status_registers()
    releasing.write()
    releasing.wait(1)
    assert releasing.gripper.status_registers() == before


def test_clear_faults(individual: Bench) -> None:
    individual.go(255)
    individual.gripper.inject_fault(Fault.ACTIVATION_FAULT)
    individual.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    individual.gripper.clear_faults()
    assert individual.fault is Fault.NONE
    assert individual.gripper.is_moving


def test_the_worst_of_several_faults_is_reported(active: Bench) -> None:
    active.gripper.inject_fault(Fault.ACTIVATION_FAULT, 3)
    active.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 2)
    active.gripper.inject_fault(Fault.ACTIVATION_PENDING, 5)
    seen = []
    for _ in range(3):
        seen.append(active.fault)
        active.wait(2)
    assert seen == [Fault.ACTIVATION_FAULT, Fault.ACTIVATION_FAULT, Fault.ACTIVATION_PENDING]


@pytest.mark.parametrize("fault", [Fault.COMMUNICATION_NOT_READY, Fault(1)])
def test_a_fault_outranks_a_waiting_request(bench: Bench, fault: Fault) -> None:
    bench.write(activate=True, go=True)
    bench.gripper.inject_fault(fault, 1)
    assert bench.fault is fault
    bench.wait(1)
    assert bench.fault is Fault.ACTIVATION_PENDING


def test_a_minor_fault_during_activation_delays_it(bench: Bench) -> None:
    bench.write(activate=True)
    bench.wait(1)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 60)
    bench.wait(59)
    assert bench.status.initialization is Initialization.ACTIVATING
    bench.wait(1)
    bench.settle()
    assert bench.status.initialization is Initialization.COMPLETE
    assert bench.gripper.travel(Finger.A) == 2 * 235


@pytest.mark.parametrize(
    ("fault", "duration", "error"),
    [(0, None, ValueError), (16, None, ValueError), (9, -1, ValueError), (9, "1", TypeError)],
)
def test_bad_injections(bench: Bench, fault: int, duration: float | None, error: type[Exception]) -> None:
    with pytest.raises(error):
        bench.gripper.inject_fault(fault, duration)


# Interference on the scissor.


def test_short_interference_stops_the_scissor_only(individual: Bench) -> None:
    individual.go(200)
    individual.gripper.interfere(10)
    individual.settle()
    assert individual.fault is Fault.SCISSOR_INTERFERENCE
    assert individual.positions == (200, 200, 200, 137)
    individual.wait(10)
    individual.settle()
    assert individual.fault is Fault.NONE
    assert individual.positions[3] == 200


@pytest.mark.parametrize("duration", [None, 20.001, 60])
def test_long_interference_becomes_a_major_fault(individual: Bench, duration: float | None) -> None:
    individual.gripper.interfere(duration)
    individual.wait(19.999)
    assert individual.fault is Fault.SCISSOR_INTERFERENCE
    individual.wait(0.002)
    assert individual.fault is Fault.SCISSOR_BLOCKED
    individual.wait(1000)
    individual.go(100)
    assert individual.fault is Fault.SCISSOR_BLOCKED
    assert not individual.gripper.is_moving


def test_interference_during_a_mode_change(active: Bench) -> None:
    active.write(mode=1)
    active.gripper.interfere(5)
    active.wait(4.9)
    assert active.status.initialization is Initialization.CHANGING_MODE
    assert active.fault is Fault.SCISSOR_INTERFERENCE
    active.wait(0.1)
    active.settle()
    assert active.positions[3] == 219


# Automatic release.


@pytest.fixture(params=["rATR", "emergency"])
def releasing(request: pytest.FixtureRequest, individual: Bench) -> Bench:
    """A gripper that was closed and has begun to release."""
    individual.close()
    if request.param == "rATR":
        individual.write(release=True)
    else:
        individual.gripper.emergency_release()
    return individual


def test_release_opens_all_axes_slowly(releasing: Bench) -> None:
    began = releasing.now
    assert releasing.fault is Fault.AUTOMATIC_RELEASE
    assert releasing.status.initialization is Initialization.RESET
    assert releasing.status.activation_echo
    while releasing.fault is Fault.AUTOMATIC_RELEASE:
        releasing.wait(0.05)
    assert releasing.now - began == pytest.approx(closing_time(0), rel=0.02)
    assert releasing.fault is Fault.AUTOMATIC_RELEASE_DONE
    assert releasing.positions == (6, 6, 6, 15)
    assert releasing.status.is_reset


def test_release_ignores_everything_but_the_activation_bit(releasing: Bench) -> None:
    releasing.go(255, release=False, mode=2, individual_fingers=False)
    releasing.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1)
    releasing.settle()
    assert releasing.positions == (6, 6, 6, 15)
    releasing.go(100)
    releasing.wait(10)
    assert releasing.positions == (6, 6, 6, 15)
    assert releasing.fault is Fault.AUTOMATIC_RELEASE_DONE


@pytest.mark.parametrize("seconds", [1, 60])
def test_a_reset_ends_a_release_and_the_gripper_can_be_activated_again(
    releasing: Bench, seconds: float
) -> None:
    releasing.wait(seconds)
    releasing.write(activate=False, go=False, release=False)
    assert not releasing.gripper.is_moving
    assert releasing.fault is Fault.NONE
    releasing.activate()
    releasing.reach(100)
    assert releasing.positions[0] == 100


def test_release_out_of_a_major_fault(active: Bench) -> None:
    active.close()
    active.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    active.write(release=True)
    assert active.fault is Fault.AUTOMATIC_RELEASE
    active.settle()
    assert active.fault is Fault.AUTOMATIC_RELEASE_DONE
    assert active.positions[0] == 6


def test_release_ends_at_an_obstacle_too(active: Bench) -> None:
    active.close()
    active.gripper.place_object(Finger.A, 100, opening=True)
    active.write_and_settle(release=True)
    assert active.fault is Fault.AUTOMATIC_RELEASE_DONE
    assert active.positions == (100, 6, 6, 15)
    active.gripper.remove_object()
    active.write()
    active.wait(5)
    assert active.positions == (100, 6, 6, 15), "one release is all there is"


def test_release_while_reset_does_nothing(bench: Bench) -> None:
    bench.write(release=True)
    bench.gripper.emergency_release()
    bench.wait(5)
    assert bench.words == (0, 0)
    assert bench.fault is Fault.NONE


def test_a_paused_axis_reads_moving_and_a_contact_keeps_its_code(individual: Bench) -> None:
    individual.gripper.place_object(Finger.A, 20)
    individual.go(255)
    individual.wait(0.5)
    individual.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 3)
    assert individual.outcomes[:2] == (ObjectStatus.CONTACT_CLOSING, ObjectStatus.IN_MOTION)
