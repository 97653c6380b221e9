"""Activation, reset, release and shutdown, driven by hand."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.control.sequences import (
    Procedure,
    activation,
    automatic_release,
    echoes,
    reset,
    shutdown,
    signature_of,
    signature_of_status,
)
from robotiq_async.enums import AXES, Fault, Mode
from robotiq_async.errors import GripperFaultError, NotActivatedError
from robotiq_async.wire.request import AxisRequest, Request
from robotiq_async.wire.status import RobotiqStatus
from tests.words import status_of

IMAGE = Request(
    activate=True,
    go=True,
    release=True,
    mode=Mode.PINCH,
    axes=(AxisRequest(10, 1, 5), AxisRequest(20, 2, 6), AxisRequest(30, 3, 7), AxisRequest(40, 4, 8)),
)
"""An image with something in every field, so that what a procedure keeps can be told from what it sets."""
ECHO = (10, 20, 30, 40)

RESET = status_of(0x00)
BUSY = status_of(0x11)
READY = status_of(0x31)
RUNNING = status_of(0x39, 0xC0)
RELEASING = status_of(0x11, fault=0x0B)
RELEASED = status_of(0x01, fault=0x0F)


def first(procedure: Procedure) -> Request:
    """What a procedure sends; it sends once."""
    request = next(procedure)
    assert request is not None
    return request


def waits(procedure: Procedure, *statuses: RobotiqStatus) -> None:
    """The procedure sees these and just reads on."""
    for status in statuses:
        assert procedure.send(status) is None


def ends(procedure: Procedure, status: RobotiqStatus) -> None:
    """The procedure sees this and ends with it."""
    with pytest.raises(StopIteration) as caught:
        procedure.send(status)
    assert caught.value.value is status


def differing_bits(request: Request) -> int:
    """What a procedure changed of the image: bits of the first register; nothing else may differ."""
    assert request.registers[1:] == IMAGE.registers[1:]
    return request.registers[0] ^ IMAGE.registers[0]


# -- activation --------------------------------------------------------------------------------------------


def test_an_activation_raises_ract_and_neither_goes_nor_releases() -> None:
    request = first(activation(IMAGE))
    assert (request.activate, request.go, request.release) == (True, False, False)
    assert differing_bits(request) == 0x1800
    assert first(activation(Request())).registers == (0x010C, 0, 0, 0, 0, 0, 0, 0)


def test_an_activation_ends_when_the_gripper_is_active() -> None:
    procedure = activation(IMAGE)
    first(procedure)
    waits(procedure, status_of(0x01), BUSY, BUSY, status_of(0x21))
    ends(procedure, READY)


def test_statuses_from_before_the_request_do_not_end_an_activation() -> None:
    procedure = activation(IMAGE)
    first(procedure)
    waits(procedure, RESET, RESET, RESET, BUSY)
    ends(procedure, READY)


def test_an_activation_without_a_visible_beginning_ends_too() -> None:
    procedure = activation(IMAGE)
    first(procedure)
    waits(procedure, RESET)
    ends(procedure, READY)


@pytest.mark.parametrize("begun", [status_of(0x01), BUSY, status_of(0x21)])
def test_an_activation_that_falls_back_to_reset_has_failed(begun: RobotiqStatus) -> None:
    procedure = activation(IMAGE)
    first(procedure)
    waits(procedure, RESET, begun)
    with pytest.raises(NotActivatedError, match="reset while it activated"):
        procedure.send(RESET)


@pytest.mark.parametrize("code", [0x0D, 0x0E, 0x0F, 0x01, 0x0C])
def test_an_activation_ends_with_a_major_or_unassigned_fault(code: int) -> None:
    procedure = activation(IMAGE)
    first(procedure)
    waits(procedure, BUSY)
    with pytest.raises(GripperFaultError) as caught:
        procedure.send(status_of(0x11, fault=code))
    assert caught.value.fault is Fault(code)


@pytest.mark.parametrize("code", [0x05, 0x06, 0x07, 0x09, 0x0A, 0x0B])
def test_an_activation_waits_for_priority_and_minor_faults_to_clear(code: int) -> None:
    procedure = activation(IMAGE)
    first(procedure)
    waits(procedure, status_of(0x11, fault=code), status_of(0x01, fault=code), BUSY)
    ends(procedure, READY)


def test_a_ready_gripper_with_a_minor_fault_is_not_ready_yet() -> None:
    procedure = activation(IMAGE)
    first(procedure)
    waits(procedure, BUSY, status_of(0x31, fault=0x0A))
    ends(procedure, READY)


def test_a_ready_gripper_with_a_priority_fault_is_ready() -> None:
    procedure = activation(IMAGE)
    first(procedure)
    ends(procedure, status_of(0x31, fault=0x07))


# -- reset -------------------------------------------------------------------------------------------------


def test_a_reset_clears_ract_rgto_and_ratr() -> None:
    request = first(reset(IMAGE))
    assert (request.activate, request.go, request.release) == (False, False, False)
    assert differing_bits(request) == 0x1900


def test_a_reset_ends_when_both_gact_and_gimc_are_zero() -> None:
    procedure = reset(IMAGE)
    first(procedure)
    waits(procedure, RUNNING, READY, status_of(0x30), status_of(0x01))
    ends(procedure, RESET)


@pytest.mark.parametrize("code", [0x09, 0x0B, 0x0D, 0x0E, 0x0F, 0x0C])
def test_a_fault_may_outlast_a_reset_and_does_not_end_it(code: int) -> None:
    procedure = reset(IMAGE)
    first(procedure)
    waits(procedure, status_of(0x01, fault=code), status_of(0x00, fault=code))
    ends(procedure, RESET)


def test_gimc_zero_alone_is_an_automatic_release_and_not_a_reset() -> None:
    procedure = reset(IMAGE)
    first(procedure)
    waits(procedure, status_of(0x01, fault=0x0B), status_of(0x01))
    ends(procedure, RESET)


# -- automatic release -------------------------------------------------------------------------------------


def test_a_release_raises_ratr_and_keeps_ract() -> None:
    request = first(automatic_release(Request(activate=True, go=True)))
    assert (request.activate, request.go, request.release) == (True, False, True)
    assert request.registers[0] == 0x110C
    assert differing_bits(first(automatic_release(IMAGE))) == 0x0800


def test_a_release_ends_with_fault_0x0f() -> None:
    procedure = automatic_release(IMAGE)
    first(procedure)
    waits(procedure, status_of(0x39, fault=0x0A), RELEASING, status_of(0x01, fault=0x0B), status_of(0x01))
    ends(procedure, RELEASED)


def test_statuses_from_before_the_request_do_not_end_a_release() -> None:
    procedure = automatic_release(IMAGE)
    first(procedure)
    waits(procedure, READY, RUNNING, status_of(0x39, fault=0x0E))
    ends(procedure, RELEASED)


def test_a_release_during_which_the_gripper_is_reset_has_failed() -> None:
    procedure = automatic_release(IMAGE)
    first(procedure)
    waits(procedure, RELEASING)
    with pytest.raises(NotActivatedError, match="reset during the automatic release"):
        procedure.send(RESET)


# -- shutdown ----------------------------------------------------------------------------------------------


def test_a_shutdown_clears_rgto_and_changes_nothing_else() -> None:
    assert differing_bits(first(shutdown(IMAGE))) == 0x0800


def test_a_shutdown_ends_when_the_complete_last_image_is_echoed() -> None:
    procedure = shutdown(IMAGE)
    first(procedure)
    waits(procedure, status_of(0x39, 0xC0, echo=ECHO))
    ends(procedure, status_of(0x31, 0xC0, echo=ECHO))


@pytest.mark.parametrize(
    "echo", [(11, 20, 30, 40), (10, 21, 30, 40), (10, 20, 31, 40), (10, 20, 30, 41), (0, 0, 0, 0)]
)
def test_a_cleared_go_bit_alone_does_not_end_a_shutdown(echo: tuple[int, ...]) -> None:
    procedure = shutdown(IMAGE)
    first(procedure)
    waits(procedure, status_of(0x31, echo=echo), status_of(0x39, echo=ECHO))
    ends(procedure, status_of(0x31, echo=ECHO))


def test_a_shutdown_does_not_end_while_the_activation_bit_differs() -> None:
    procedure = shutdown(IMAGE)
    first(procedure)
    waits(procedure, status_of(0x30, echo=ECHO))
    ends(procedure, status_of(0x31, echo=ECHO))


def test_a_shutdown_of_a_reset_gripper_leaves_it_reset() -> None:
    procedure = shutdown(Request(activate=False, go=True))
    assert first(procedure).registers[0] == 0x000C
    ends(procedure, RESET)


# -- echoes ------------------------------------------------------------------------------------------------


@given(st.tuples(*[st.integers(0, 0xFFFF)] * 8))
def test_what_a_status_echoes_is_what_its_properties_say(block: tuple[int, ...]) -> None:
    status = RobotiqStatus.from_registers(block)
    assert signature_of_status(status) == (
        status.activation_echo,
        status.go_echo,
        *(status.requested_position(axis) for axis in AXES),
    )


@given(
    st.booleans(),
    st.booleans(),
    st.tuples(*[st.integers(0, 255)] * 4),
    st.integers(0, 5),
    st.integers(1, 255),
)
def test_a_status_echoes_an_image_only_if_go_activation_and_all_positions_agree(
    activate: bool, go: bool, positions: tuple[int, ...], which: int, by: int
) -> None:
    image = Request(
        activate=activate, go=go, axes=tuple(AxisRequest(position, 1, 2) for position in positions)
    )
    shown = [*positions, activate, go]
    assert echoes(status_of(0x30 | activate | go << 3, echo=positions), image)
    shown[which] = not shown[which] if which > 3 else (shown[which] + by) % 256
    *others, act, goes = shown
    assert not echoes(status_of(0x30 | act | goes << 3, echo=others), image)


def test_mode_speed_and_force_have_no_part_in_the_echo() -> None:
    plain = Request(activate=True, axes=tuple(AxisRequest(position, 0, 0) for position in ECHO))
    assert signature_of(IMAGE) == (True, True, 10, 20, 30, 40)
    assert signature_of(plain) == (True, False, 10, 20, 30, 40)
    for mode in range(4):
        assert echoes(status_of(0x31 | mode << 1, echo=ECHO), plain)
