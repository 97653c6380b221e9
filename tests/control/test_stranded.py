"""A gripper that shows rACT and never activates, as a real one was found: gACT = 1, gIMC = 0, no fault."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from robotiq_async import Finger, NotActivatedError, State
from robotiq_async.control.evidence import STRANDED_READS, STRANDED_S, Evidence
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values import registers as reg
from robotiq_async.values.enums import Trigger
from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, Model
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import Request
from tests.control.scan import POLL_S, Scan
from tests.register_words import status_of

MODELS = pytest.mark.parametrize("model", [THREE_FINGER, TWO_FINGER_85, HAND_E], ids=lambda model: model.name)


class Stranded(SimulatedGripper):
    """It has rACT and does not activate, until it gets a reset."""

    is_stranded = True
    goes = False
    """Whether it shows rGTO."""

    def write(self, address_offset: int, registers: Sequence[int]) -> None:
        self.goes = bool(reg.rGTO.read(registers))
        self.is_stranded = self.is_stranded and bool(reg.rACT.read(registers))
        if not self.is_stranded:
            super().write(address_offset, registers)

    def status_registers(self) -> Registers:
        block = list(super().status_registers())
        if self.is_stranded:
            reg.gACT.write(block, 1)
            reg.gGTO.write(block, self.goes)
        return tuple(block)


def found(model: Model = THREE_FINGER, *, goes: bool = False) -> Scan:
    scan = Scan(model=model)
    scan.gripper = stranded = Stranded(lambda: scan.now, spread=False, model=model)
    stranded.goes = goes
    return scan


def activations(scan: Scan) -> list[bool]:
    return [Request.from_registers(image, scan.gripper.model).activate for image in scan.written]


@MODELS
def test_a_start_resets_it_and_activates(model: Model) -> None:
    """It waited for an activation that nobody had begun."""
    scan = found(model)
    began = scan.now
    scan.start()
    assert activations(scan) == [False, True]
    assert [target for _, target, _ in scan.transitions] == [
        State.DO_ACTIVATION,
        State.WF_ACTIVATION,
        State.RUNNING_IDLE,
    ]
    assert scan.now - began < 60
    assert scan.moved(100, Finger.A).positions[Finger.A] == 100


def test_a_start_that_does_not_activate_finds_it_reset_and_writes_nothing() -> None:
    scan = found()
    scan.connect(activate=False)
    assert scan.state is State.RESET
    assert [trigger for *_, trigger in scan.transitions] == [Trigger.SEEN_STRANDED]
    assert not scan.controller.is_moving
    assert not scan.controller.is_driven
    with pytest.raises(NotActivatedError, match=r"activate\(\) or recover\(\)"):
        scan.move(100)
    scan.run(1.0)
    assert not scan.written


def test_an_activation_resets_it_first() -> None:
    scan = found()
    scan.connect(activate=False)
    scan.controller.activate()
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    assert activations(scan) == [False, True]


def test_a_reset_and_a_stop_work_as_ever() -> None:
    scan = found()
    scan.connect(activate=False)
    scan.controller.reset()
    scan.until(lambda: scan.state is State.RESET, 1.0)
    assert activations(scan) == [False]
    scan.stop()
    assert activations(scan) == [False]


def test_a_stop_before_it_is_decided_ends() -> None:
    scan = found(goes=True)
    scan.see()
    assert scan.controller.evidence.is_undecided
    scan.stop()
    assert not scan.last_image.go
    assert not scan.latest.go_echo


def test_one_that_does_not_reset_gives_an_error(caplog: pytest.LogCaptureFixture) -> None:
    scan = found()
    scan.connect(activate=False)
    scan.forgets = 100
    scan.controller.activate()
    scan.until(lambda: scan.state is State.RESET, 6.0)
    assert "does not report a reset" in caplog.text
    assert activations(scan) == [False]


def test_an_activation_that_another_client_has_just_begun_is_left_alone() -> None:
    """Its gACT shows before gIMC does: for a moment that looks the same."""
    evidence, at = Evidence(), 100.0
    while at < 100.0 + STRANDED_S - POLL_S:
        assert evidence.update(status_of(0x01, at=at), at) is None
        assert evidence.is_undecided
        at += POLL_S
    assert evidence.update(status_of(0x11, at=at), at) is Trigger.SEEN_BUSY
    assert not evidence.is_undecided


def test_an_axis_that_moves_shows_that_it_is_not_stranded() -> None:
    evidence = Evidence()
    for number in range(1000):
        at = 100.0 + number * POLL_S
        assert evidence.update(status_of(0x01, position=number // 50, at=at), at) is None


def test_it_takes_some_reads_on_a_slow_link() -> None:
    evidence = Evidence()
    shown = [evidence.update(status_of(0x01, at=at), at) for at in range(100, 100 + STRANDED_READS)]
    assert shown == [None] * (STRANDED_READS - 1) + [Trigger.SEEN_STRANDED]


@pytest.mark.parametrize("fault", [0x0B, 0x0D, 0x0F])
def test_a_fault_counts_before_it(fault: int) -> None:
    evidence = Evidence()
    shown = {evidence.update(status_of(0x01, fault=fault, at=at), at) for at in range(100, 120)}
    assert shown <= {Trigger.SEEN_FAULT, Trigger.SEEN_RELEASED}


def test_a_hand_that_runs_finds_it_too(scan: Scan) -> None:
    scan.gripper.write(0, [0x0000])
    scan.run(0.1)
    stranded = Stranded(lambda: scan.now, spread=False)
    scan.gripper = stranded
    scan.step()
    assert scan.state is State.WF_ACTIVATION
    scan.run(STRANDED_S + 0.05)
    assert scan.state is State.RESET
    scan.controller.activate()
    scan.until(lambda: scan.state is State.RUNNING_IDLE)


def test_a_lost_link_begins_the_count_again() -> None:
    """Behind it another client may just have raised rACT."""
    evidence, shown = Evidence(), status_of(0x01)
    for read in range(STRANDED_READS - 1):
        assert evidence.update(shown, read * POLL_S) is None
    evidence.lost()
    assert evidence.update(shown, 2 * STRANDED_S) is None
