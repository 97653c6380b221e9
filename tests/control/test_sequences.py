"""Activation, reset, release and shutdown, sent one status after another."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import NamedTuple

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
STOPPED = status_of(0x31, 0xC0, echo=ECHO)

Begin = Callable[[Callable[[RobotiqStatus], Request]], Sequence]
BEGIN_WITH = {activation: RESET, reset: RUNNING, automatic_release: FAULTY, shutdown: RUNNING}


class Again(NamedTuple):
    """A status after which the request is written again: it should show by now, and may be forgotten."""

    status: RobotiqStatus


def first(begin: Begin, status: RobotiqStatus | None = None, image: Request = IMAGE) -> Request:
    """What a sequence writes after the first status."""
    sequence = begin(lambda _: replace(image, go=False))
    assert next(sequence) is None, "it has not seen anything yet"
    request = sequence.send(status or BEGIN_WITH[begin])
    assert request is not None
    return request


def begun(begin: Begin, *shown: RobotiqStatus | Again) -> Sequence:
    """A sequence that has written its request, and has seen these statuses since."""
    sequence = begin(lambda _: replace(IMAGE, go=False, release=False))
    next(sequence)
    request = sequence.send(BEGIN_WITH[begin])
    assert request is not None
    for each in shown:
        if isinstance(each, Again):
            assert sequence.send(each.status) == request, each
        else:
            assert sequence.send(each) is None, each
    return sequence


# -- the first status, and what is written -----------------------------------------------------------------


@pytest.mark.parametrize("begin", BEGIN_WITH)
def test_the_image_is_made_from_the_status_that_a_sequence_begins_with(begin: Begin) -> None:
    """Between being asked for and being carried out, the gripper may have done something else."""
    asked: list[RobotiqStatus] = []

    def image(status: RobotiqStatus) -> Request:
        asked.append(status)
        return IMAGE

    sequence = begin(image)
    next(sequence)
    assert not asked, "nothing has been seen yet"
    sequence.send(BEGIN_WITH[begin])
    sequence.send(BUSY)
    assert asked == [BEGIN_WITH[begin]]


@pytest.mark.parametrize(
    ("begin", "shown"),
    [
        # Another client has activated it meanwhile, or it reports a fault.
        *((activation, shown) for shown in (READY, RUNNING, BUSY, FAULTY, RELEASED)),
        # The raised rACT would activate it.
        *((automatic_release, shown) for shown in (RESET, status_of(0x00, fault=0x09), status_of(0x30))),
    ],
)
def test_an_activation_needs_a_reset_gripper_and_a_release_one_that_is_not(
    begin: Begin, shown: RobotiqStatus
) -> None:
    sequence = begin(lambda _: IMAGE)
    next(sequence)
    with pytest.raises(StopIteration):
        sequence.send(shown)


@pytest.mark.parametrize("shown", [READY, RUNNING, BUSY, FAULTY, RELEASED, RESET])
def test_a_reset_begins_for_any_status(shown: RobotiqStatus) -> None:
    """An emergency is not weighed."""
    assert first(reset, shown).activate is False


@pytest.mark.parametrize(
    ("begin", "changed_bits"),
    [(activation, 0x0800), (reset, 0x0900), (automatic_release, 0x0800), (shutdown, 0x0800)],
)
def test_a_sequence_changes_these_bits_of_the_image_and_no_other(begin: Begin, changed_bits: int) -> None:
    """Of the first register: rACT and rGTO by a reset, rGTO else."""
    request = first(begin)
    assert request.registers[0] ^ IMAGE.registers[0] == changed_bits
    assert request.registers[1:] == IMAGE.registers[1:]


def test_an_activation_and_a_release_raise_their_bit() -> None:
    assert first(activation, image=Request()).registers == (0x010C, 0, 0, 0, 0, 0, 0, 0)
    assert first(automatic_release, image=Request(activate=True)).registers[0] == 0x110C


def test_a_shutdown_with_nothing_to_stop_writes_nothing() -> None:
    sequence = shutdown(lambda _: None)
    next(sequence)
    with pytest.raises(StopIteration):
        sequence.send(RUNNING)


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
        # Only gACT = 0 and gIMC = 0 end a reset.
        (reset, [status_of(0x30), status_of(0x10), Again(RUNNING), Again(READY), status_of(0x30)], RESET),
        # A fault may outlast it.
        *(
            (reset, [Again(status_of(0x01, fault=code)), status_of(0x00, fault=code)], RESET)
            for code in (0x09, 0x0B, 0x0D, 0x0E, 0x0F, 0x0C)
        ),
        (reset, [Again(status_of(0x01, fault=0x0B)), Again(status_of(0x01))], RESET),  # gIMC = 0: a release
        (
            automatic_release,
            [status_of(0x39, fault=0x0A), RELEASING, status_of(0x01, fault=0x0B), status_of(0x01)],
            RELEASED,
        ),
        (automatic_release, [READY, RUNNING, FAULTY], RELEASED),  # from before the request
        # The whole last image is echoed; gGTO = 0 alone is not enough.
        (shutdown, [Again(status_of(0x39, 0xC0, echo=ECHO))], STOPPED),
        *(
            (shutdown, [Again(status_of(0x31, echo=echo)), Again(status_of(0x39, echo=ECHO))], STOPPED)
            for echo in ((11, 20, 30, 40), (10, 21, 30, 40), (10, 20, 31, 40), (10, 20, 30, 41), (0,) * 4)
        ),
        (shutdown, [status_of(0x30, echo=ECHO)], STOPPED),
        (shutdown, [status_of(0x30), status_of(0x10)], RESET),  # it would activate a gripper that was reset
    ],
)
def test_a_sequence_waits_and_ends(
    begin: Begin, shown: list[RobotiqStatus | Again], end: RobotiqStatus
) -> None:
    sequence = begun(begin, *shown)
    with pytest.raises(StopIteration):
        sequence.send(end)


@pytest.mark.parametrize(
    ("begin", "shown", "then", "error", "message"),
    [
        *(
            (activation, [RESET, shown], RESET, NotActivatedError, "reset while it activated")
            for shown in (status_of(0x01), BUSY, status_of(0x21))
        ),
        *(
            (activation, [BUSY], status_of(0x11, fault=code), GripperFaultError, f"0x{code:02X}")
            for code in (Fault(0x0D), Fault(0x0E), Fault(0x0F), Fault(0x01), Fault(0x0C))
        ),
        (automatic_release, [RELEASING], RESET, NotActivatedError, "reset during the automatic release"),
    ],
)
def test_a_sequence_fails(
    begin: Begin, shown: list[RobotiqStatus], then: RobotiqStatus, error: type[Exception], message: str
) -> None:
    sequence = begun(begin, *shown)
    with pytest.raises(error, match=message):
        sequence.send(then)
