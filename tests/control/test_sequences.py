"""Activation, reset, release and shutdown, sent one status after another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from robotiq_async.control.sequences import Sequence, activation, automatic_release, reset, shutdown
from robotiq_async.values.enums import Fault, Mode
from robotiq_async.values.errors import GripperFaultError, NotActivatedError
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.register_words import status_of

IMAGE = Request(
    activate=True,
    go=True,
    release=True,
    mode=Mode.PINCH,
    axes=(AxisRequest(10, 1, 5), AxisRequest(20, 2, 6), AxisRequest(30, 3, 7), AxisRequest(40, 4, 8)),
)
"""An image with something in every field, so that what a sequence keeps can be told from what it sets."""
ECHO = (10, 20, 30, 40)

RESET = status_of(0x00)
BUSY = status_of(0x11)
READY = status_of(0x31)
RUNNING = status_of(0x39, 0xC0)
FAULTY = status_of(0x39, fault=0x0E)
RELEASING = status_of(0x11, fault=0x0B)
RELEASED = status_of(0x01, fault=0x0F)


def at_rest(_: RobotiqStatus) -> Request:
    """What the image is before a sequence changes it."""
    return replace(IMAGE, go=False)


def last_image(_: RobotiqStatus) -> Request:
    return replace(IMAGE, go=False, release=False)


def first(sequence: Sequence, status: RobotiqStatus) -> Request:
    """What a sequence writes after the first status; it writes once."""
    assert next(sequence) is None, "it has not seen anything yet"
    request = sequence.send(status)
    assert request is not None
    return request


def waits(sequence: Sequence, *statuses: RobotiqStatus) -> None:
    """The sequence sees these and writes nothing."""
    for status in statuses:
        assert sequence.send(status) is None


def written_again(sequence: Sequence, last: Request, *statuses: RobotiqStatus) -> None:
    """What does not show by when it should act was forgotten, perhaps."""
    for status in statuses:
        assert sequence.send(status) == last


def ends(sequence: Sequence, status: RobotiqStatus) -> None:
    """The sequence sees this and ends with it."""
    with pytest.raises(StopIteration):
        sequence.send(status)


def writes_nothing(sequence: Sequence, status: RobotiqStatus) -> None:
    """The sequence sees its first status and ends with it."""
    assert next(sequence) is None
    ends(sequence, status)


def differing_bits(request: Request) -> int:
    """What a sequence changed of the image: bits of the first register; nothing else may differ."""
    assert request.registers[1:] == IMAGE.registers[1:]
    return request.registers[0] ^ IMAGE.registers[0]


# -- the first status --------------------------------------------------------------------------------------


@pytest.mark.parametrize("begin", [activation, reset, automatic_release, shutdown])
def test_the_image_is_made_from_the_status_that_a_sequence_begins_with(
    begin: Callable[[Callable[[RobotiqStatus], Request]], Sequence],
) -> None:
    """Between being asked for and being carried out, the gripper may have done something else."""
    asked: list[RobotiqStatus] = []

    def image(status: RobotiqStatus) -> Request:
        asked.append(status)
        return IMAGE

    now = RESET if begin is activation else FAULTY
    sequence = begin(image)
    next(sequence)
    assert not asked, "nothing has been seen yet"
    sequence.send(now)
    sequence.send(BUSY)
    assert asked == [now]


@pytest.mark.parametrize("shown", [READY, RUNNING, BUSY, FAULTY, RELEASED])
def test_an_activation_begins_with_nothing_but_a_reset_gripper(shown: RobotiqStatus) -> None:
    """Another client has activated it meanwhile, or it reports a fault."""
    writes_nothing(activation(at_rest), shown)


@pytest.mark.parametrize("shown", [READY, RUNNING, BUSY, FAULTY, RELEASED, RESET])
def test_a_reset_begins_whatever_the_gripper_shows(shown: RobotiqStatus) -> None:
    """An emergency is not weighed."""
    assert first(reset(at_rest), shown).activate is False


@pytest.mark.parametrize("shown", [RESET, status_of(0x00, fault=0x09), status_of(0x30)])
def test_a_release_does_not_begin_with_a_gripper_that_has_been_reset(shown: RobotiqStatus) -> None:
    """The raised rACT would activate it."""
    writes_nothing(automatic_release(at_rest), shown)


# -- activation --------------------------------------------------------------------------------------------


def test_an_activation_raises_ract_and_neither_goes_nor_releases() -> None:
    request = first(activation(at_rest), RESET)
    assert (request.activate, request.go, request.release) == (True, False, False)
    assert differing_bits(request) == 0x1800
    assert first(activation(lambda _: Request()), RESET).registers == (0x010C, 0, 0, 0, 0, 0, 0, 0)


def test_an_activation_ends_when_the_gripper_is_active() -> None:
    sequence = activation(at_rest)
    first(sequence, RESET)
    waits(sequence, status_of(0x01), BUSY, BUSY, status_of(0x21))
    ends(sequence, READY)


def test_statuses_from_before_the_request_do_not_end_an_activation() -> None:
    sequence = activation(at_rest)
    first(sequence, RESET)
    waits(sequence, RESET, RESET, RESET, BUSY)
    ends(sequence, READY)


def test_an_activation_without_a_visible_beginning_ends_too() -> None:
    sequence = activation(at_rest)
    first(sequence, RESET)
    waits(sequence, RESET)
    ends(sequence, READY)


@pytest.mark.parametrize("begun", [status_of(0x01), BUSY, status_of(0x21)])
def test_an_activation_that_falls_back_to_reset_has_failed(begun: RobotiqStatus) -> None:
    sequence = activation(at_rest)
    first(sequence, RESET)
    waits(sequence, RESET, begun)
    with pytest.raises(NotActivatedError, match="reset while it activated"):
        sequence.send(RESET)


@pytest.mark.parametrize("code", [0x0D, 0x0E, 0x0F, 0x01, 0x0C])
def test_an_activation_ends_with_a_major_or_unassigned_fault(code: int) -> None:
    sequence = activation(at_rest)
    first(sequence, RESET)
    waits(sequence, BUSY)
    with pytest.raises(GripperFaultError) as caught:
        sequence.send(status_of(0x11, fault=code))
    assert caught.value.fault is Fault(code)


@pytest.mark.parametrize("code", [0x05, 0x06, 0x07, 0x09, 0x0A, 0x0B])
def test_an_activation_waits_for_priority_and_minor_faults_to_clear(code: int) -> None:
    sequence = activation(at_rest)
    first(sequence, RESET)
    waits(sequence, status_of(0x11, fault=code), status_of(0x01, fault=code), BUSY)
    ends(sequence, READY)


def test_a_ready_gripper_with_a_minor_fault_is_not_ready_yet() -> None:
    sequence = activation(at_rest)
    first(sequence, RESET)
    waits(sequence, BUSY, status_of(0x31, fault=0x0A))
    ends(sequence, READY)


def test_a_ready_gripper_with_a_priority_fault_is_ready() -> None:
    sequence = activation(at_rest)
    first(sequence, RESET)
    ends(sequence, status_of(0x31, fault=0x07))


# -- reset -------------------------------------------------------------------------------------------------


def test_a_reset_clears_ract_rgto_and_ratr() -> None:
    request = first(reset(at_rest), RUNNING)
    assert (request.activate, request.go, request.release) == (False, False, False)
    assert differing_bits(request) == 0x1900


def test_a_reset_ends_when_both_gact_and_gimc_are_zero() -> None:
    sequence = reset(at_rest)
    image = first(sequence, RUNNING)
    waits(sequence, status_of(0x30), status_of(0x10))
    written_again(sequence, image, RUNNING, READY)
    waits(sequence, status_of(0x30))
    ends(sequence, RESET)


@pytest.mark.parametrize("code", [0x09, 0x0B, 0x0D, 0x0E, 0x0F, 0x0C])
def test_a_fault_may_outlast_a_reset_and_does_not_end_it(code: int) -> None:
    sequence = reset(at_rest)
    image = first(sequence, RUNNING)
    written_again(sequence, image, status_of(0x01, fault=code))
    waits(sequence, status_of(0x00, fault=code))
    ends(sequence, RESET)


def test_gimc_zero_alone_is_an_automatic_release_and_not_a_reset() -> None:
    sequence = reset(at_rest)
    image = first(sequence, RUNNING)
    written_again(sequence, image, status_of(0x01, fault=0x0B), status_of(0x01))
    ends(sequence, RESET)


# -- automatic release -------------------------------------------------------------------------------------


def test_a_release_raises_ratr_and_keeps_ract() -> None:
    request = first(automatic_release(lambda _: Request(activate=True)), FAULTY)
    assert (request.activate, request.go, request.release) == (True, False, True)
    assert request.registers[0] == 0x110C
    assert differing_bits(first(automatic_release(at_rest), FAULTY)) == 0x0800


def test_a_release_ends_with_fault_0x0f() -> None:
    sequence = automatic_release(at_rest)
    first(sequence, FAULTY)
    waits(sequence, status_of(0x39, fault=0x0A), RELEASING, status_of(0x01, fault=0x0B), status_of(0x01))
    ends(sequence, RELEASED)


def test_statuses_from_before_the_request_do_not_end_a_release() -> None:
    sequence = automatic_release(at_rest)
    first(sequence, FAULTY)
    waits(sequence, READY, RUNNING, status_of(0x39, fault=0x0E))
    ends(sequence, RELEASED)


def test_a_release_during_which_the_gripper_is_reset_has_failed() -> None:
    sequence = automatic_release(at_rest)
    first(sequence, FAULTY)
    waits(sequence, RELEASING)
    with pytest.raises(NotActivatedError, match="reset during the automatic release"):
        sequence.send(RESET)


# -- shutdown ----------------------------------------------------------------------------------------------


def test_a_shutdown_writes_the_last_image_as_it_is() -> None:
    assert first(shutdown(last_image), RUNNING) == last_image(RUNNING)


def test_a_shutdown_with_nothing_to_stop_writes_nothing() -> None:
    writes_nothing(shutdown(lambda _: None), RUNNING)


def test_a_shutdown_ends_when_the_complete_last_image_is_echoed() -> None:
    sequence = shutdown(last_image)
    written_again(sequence, first(sequence, RUNNING), status_of(0x39, 0xC0, echo=ECHO))
    ends(sequence, status_of(0x31, 0xC0, echo=ECHO))


@pytest.mark.parametrize(
    "echo", [(11, 20, 30, 40), (10, 21, 30, 40), (10, 20, 31, 40), (10, 20, 30, 41), (0, 0, 0, 0)]
)
def test_a_cleared_go_bit_alone_does_not_end_a_shutdown(echo: tuple[int, ...]) -> None:
    sequence = shutdown(last_image)
    written_again(sequence, first(sequence, RUNNING), status_of(0x31, echo=echo), status_of(0x39, echo=ECHO))
    ends(sequence, status_of(0x31, echo=ECHO))


def test_a_shutdown_does_not_end_while_the_activation_bit_differs() -> None:
    sequence = shutdown(last_image)
    first(sequence, RUNNING)
    waits(sequence, status_of(0x30, echo=ECHO))
    ends(sequence, status_of(0x31, echo=ECHO))


def test_a_shutdown_does_not_activate_a_gripper_that_was_reset_meanwhile() -> None:
    sequence = shutdown(last_image)
    first(sequence, RUNNING)
    waits(sequence, status_of(0x30), status_of(0x10))
    ends(sequence, RESET)


def test_a_shutdown_of_a_reset_gripper_leaves_it_reset() -> None:
    sequence = shutdown(lambda _: Request(activate=False))
    assert first(sequence, status_of(0x08)).registers[0] == 0x000C
    ends(sequence, RESET)
