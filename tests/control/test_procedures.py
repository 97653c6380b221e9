"""Activation and release, sent one status after another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from robotiq_async.control.procedures import Steps, activation, automatic_release
from robotiq_async.values.enums import Fault, Mode
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import BUSY, FAULTY, READY, RELEASED, RESET, RUNNING
from tests.register_words import status_of

IMAGE = Request(
    activate=True,
    go=True,
    release=True,
    mode=Mode.PINCH,
    axes=(AxisRequest(10, 1, 5), AxisRequest(20, 2, 6), AxisRequest(30, 3, 7), AxisRequest(40, 4, 8)),
)
"""An image with something in every field, to distinguish those that a procedure keeps from those it sets."""

RELEASING = status_of(0x11, fault=0x0B)

Begin = Callable[[Callable[[RobotiqStatus], Request]], Steps]
BEGIN_WITH: dict[Begin, RobotiqStatus] = {activation: RESET, automatic_release: FAULTY}


def first(begin: Begin, status: RobotiqStatus | None = None, image: Request = IMAGE) -> Request:
    """The write of a procedure after the first status."""
    steps = begin(lambda _: replace(image, go=False))
    assert next(steps) is None, "it has not seen anything yet"
    request = steps.send(status or BEGIN_WITH[begin])
    assert request is not None
    return request


def begun(begin: Begin, *shown: RobotiqStatus) -> Steps:
    """A procedure that has written its request, and has seen these statuses since."""
    steps = begin(lambda _: replace(IMAGE, go=False, release=False))
    next(steps)
    assert steps.send(BEGIN_WITH[begin]) is not None
    for each in shown:
        assert steps.send(each) is None, "it moves the fingers, and is not written again"
    return steps


def end_of(steps: Steps, status: RobotiqStatus) -> str:
    """The reason that a procedure which ends with a status has failed; empty if it has not."""
    with pytest.raises(StopIteration) as end:
        steps.send(status)
    why = end.value.value
    assert isinstance(why, str)
    return why


# -- the first status, and what is written -----------------------------------------------------------------


@pytest.mark.parametrize("begin", BEGIN_WITH)
def test_the_image_is_made_from_the_status_that_a_procedure_begins_with(begin: Begin) -> None:
    """Between its request and its beginning the gripper may have done something else."""
    asked: list[RobotiqStatus] = []

    def image(status: RobotiqStatus) -> Request:
        asked.append(status)
        return IMAGE

    steps = begin(image)
    next(steps)
    assert not asked, "nothing has been seen yet"
    steps.send(BEGIN_WITH[begin])
    steps.send(BUSY)
    assert asked == [BEGIN_WITH[begin]]


@pytest.mark.parametrize(
    ("begin", "shown"),
    [
        # Another client has activated it by then, or it reports a fault.
        *((activation, shown) for shown in (READY, RUNNING, BUSY, FAULTY, RELEASED)),
        # The raised rACT would activate it.
        *((automatic_release, shown) for shown in (RESET, status_of(0x00, fault=0x09), status_of(0x30))),
    ],
)
def test_an_activation_needs_a_reset_gripper_and_a_release_one_that_is_not(
    begin: Begin, shown: RobotiqStatus
) -> None:
    steps = begin(lambda _: IMAGE)
    next(steps)
    assert end_of(steps, shown) == ""


@pytest.mark.parametrize("begin", BEGIN_WITH)
def test_a_procedure_clears_rgto_and_changes_no_other_bit_that_is_set(begin: Begin) -> None:
    request = first(begin)
    assert request.registers[0] ^ IMAGE.registers[0] == 0x0800
    assert request.registers[1:] == IMAGE.registers[1:]


def test_an_activation_and_a_release_raise_their_bit() -> None:
    assert first(activation, image=Request()).registers == (0x010C, 0, 0, 0, 0, 0, 0, 0)
    assert first(automatic_release, image=Request(activate=True)).registers[0] == 0x110C


# -- what ends it ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("begin", "shown", "end"),
    [
        (activation, [status_of(0x01), BUSY, BUSY, status_of(0x21)], READY),
        (activation, [RESET, RESET, RESET, BUSY], READY),  # from before the request
        (activation, [RESET], READY),  # without a visible beginning
        # Priority and minor faults clear, and a minor one is waited for.
        *(
            (activation, [status_of(0x11, fault=code), status_of(0x01, fault=code), BUSY], READY)
            for code in (0x05, 0x06, 0x07, 0x09, 0x0A, 0x0B)
        ),
        (activation, [BUSY, status_of(0x31, fault=0x0A)], READY),
        (activation, [], status_of(0x31, fault=0x07)),
        (
            automatic_release,
            [status_of(0x39, fault=0x0A), RELEASING, status_of(0x01, fault=0x0B), status_of(0x01)],
            RELEASED,
        ),
        (automatic_release, [READY, RUNNING, FAULTY], RELEASED),  # from before the request
    ],
)
def test_a_procedure_waits_and_ends(begin: Begin, shown: list[RobotiqStatus], end: RobotiqStatus) -> None:
    steps = begun(begin, *shown)
    assert end_of(steps, end) == ""


@pytest.mark.parametrize(
    ("begin", "shown", "then", "why"),
    [
        *(
            (activation, [RESET, shown], RESET, "reset while it activated")
            for shown in (status_of(0x01), BUSY, status_of(0x21))
        ),
        *(
            (activation, [BUSY], status_of(0x11, fault=code), f"0x{code:02X}")
            for code in (Fault(0x0D), Fault(0x0E), Fault(0x0F), Fault(0x01), Fault(0x0C))
        ),
        (automatic_release, [RELEASING], RESET, "reset during the automatic release"),
    ],
)
def test_a_procedure_fails(begin: Begin, shown: list[RobotiqStatus], then: RobotiqStatus, why: str) -> None:
    assert why in end_of(begun(begin, *shown), then)
