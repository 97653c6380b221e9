"""Dialogues as they are: generators that are handed outcomes, without a line, a loop or a clock."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from robotiq_async import ConnectionLostError, ProtocolError, ResponseTimeoutError
from robotiq_async.link.dialogue import Dialogues
from robotiq_async.link.exchange import Exchange, Timing
from robotiq_async.link.outcome import Answer, Lost, Noise, Refused, Silent, Stray
from robotiq_async.link.serial.silence import Silence
from robotiq_async.runtime.logger import log
from robotiq_async.values.model import TWO_FINGER_85

IMAGE = (0x0900, 0x00FF, 0x4060, 0, 0, 0, 0, 0)
AT_REST = (0xF900, 0x00FF, 0xE300)
"""Active, go, at 255: as IMAGE asked for it."""
SILENT = Silent(ResponseTimeoutError("no answer"))
NOISE = Noise(ProtocolError("noise"))
LOST = Lost(ConnectionLostError("gone"))
UNKNOWN = Refused(ProtocolError("illegal function"), 1)
GOOD = "the right answer"


class PduExchange(Exchange):
    """A request without a form: what it comes to is given here."""

    def __init__(self, request: bytes, timing: Timing) -> None:
        super().__init__(request[1:], timing)

    def _verdict(self, received: bytes) -> Answer | None:
        raise NotImplementedError


class Place:
    """The line as a dialogue knows it."""

    address = "rtu://X"
    silence = Silence(0.0)
    forgives = True
    is_shared = False

    def now(self) -> float:
        return 1000.0


def speaker(*, is_sure: bool = True) -> Dialogues:
    registers = replace(TWO_FINGER_85.rtu, is_sure=is_sure)
    place: Any = Place()
    return Dialogues(place, registers, PduExchange, 0.4, log)


def answer(exchange: Exchange, words: tuple[int, ...] = AT_REST) -> bytes:
    """The right answer to a request."""
    pdu = exchange.frame
    if pdu[0] == 16:
        return pdu[:5]
    count = int.from_bytes(pdu[3:5], "big")
    block = b"".join(word.to_bytes(2, "big") for word in (*words, *(0,) * 5)[:count])
    return bytes((pdu[0], 2 * count)) + block


def said(dialogue: Any, *outcomes: Any) -> tuple[list[str], Any]:
    """The steps of a dialogue, functions and counts for requests, and how it ends.

    ``outcomes`` are those of its requests, in order; after them each gets the right answer.
    """
    left, steps, outcome = list(outcomes), list[str](), None
    try:
        while True:
            step = dialogue.send(outcome)
            outcome = None
            if isinstance(step, Exchange):
                pdu = step.frame
                steps.append(f"{pdu[0]}x{int.from_bytes(pdu[3:5], 'big')}")
                given = left.pop(0) if left else GOOD
                outcome = answer(step) if given is GOOD else given
            else:
                steps.append(step.name)
    except StopIteration as end:
        return steps, end.value
    except Exception as error:  # noqa: BLE001  # it is what is looked at
        return steps, error


@pytest.mark.parametrize(
    "first", [NOISE, SILENT, Stray(ProtocolError("stray")), Refused(ProtocolError("busy"), 6)]
)
def test_a_read_is_asked_once_more_after_silence_and_a_read_of_another_length(first: Any) -> None:
    steps, status = said(speaker().read(), first)
    assert steps[:3] == ["3x3", "TURN", "HUSH"]
    assert steps[4] == "3x3"
    assert status[:3] == AT_REST


@pytest.mark.parametrize("first", [LOST, Refused(ProtocolError("no"), 2)])
def test_what_a_lost_byte_cannot_explain_ends_a_read(first: Any) -> None:
    assert said(speaker().read(), first) == (["3x3"], first.error)


def test_the_answer_to_an_earlier_probe_does_not_prove_that_no_status_can_follow() -> None:
    """On a shared line the silence of another turn drops what would show that answers come late."""
    dialogues = speaker()
    said(dialogues.opening())
    assert said(dialogues.opening(), SILENT, SILENT)[0] == ["3x1", "TURN", "HUSH", "3x2"]
    assert said(dialogues.opening())[0] == ["3x1"], "the answer may be that to the first one"
    steps, status = said(dialogues.read(), SILENT)
    assert steps == ["3x3", "TURN", "HUSH", "3x2", "3x1", "3x2", "3x3"], "3x2 was asked before 3x3, too"
    assert status[:3] == AT_REST
    assert said(dialogues.read(), SILENT)[0] == ["3x3", "TURN", "HUSH", "3x1", "3x3"]


def test_a_jaw_may_refuse_the_first_read_of_all_and_no_other() -> None:
    """That one asks for eight registers, and a device with three may refuse it."""
    refused, dialogues = Refused(ProtocolError("illegal address"), 2), speaker()
    assert said(dialogues.opening(), refused) == (["3x8", "TURN", "HUSH", "3x1"], None)
    assert said(dialogues.opening(), refused) == (["3x2"], refused.error)


def test_a_second_failure_ends_it_with_the_first_reason() -> None:
    dialogues = speaker()
    said(dialogues.opening())
    assert said(dialogues.read(), NOISE, SILENT) == (["3x3", "TURN", "HUSH", "3x1"], NOISE.error)
    assert said(dialogues.read(), NOISE, GOOD, SILENT) == (
        ["3x3", "TURN", "HUSH", "3x2", "3x3"],
        NOISE.error,
    )
    assert dialogues.repeats == 0


@pytest.mark.parametrize("bad", [NOISE, SILENT, LOST, UNKNOWN])
def test_a_write_is_sent_once(bad: Any) -> None:
    assert said(speaker().write(lambda: IMAGE), bad) == (["READY", "16x3"], bad.error)


@pytest.mark.parametrize("bad", [NOISE, SILENT, Refused(ProtocolError("failure"), 4)])
def test_a_write_with_23_is_in_doubt_and_the_status_tells(bad: Any) -> None:
    dialogues = speaker()
    said(dialogues.opening())
    said(dialogues.write_and_read(lambda: IMAGE))
    steps, written = said(dialogues.write_and_read(lambda: IMAGE), bad)
    assert steps == ["READY", "23x3", "TURN", "HUSH", "3x1", "3x3"]
    assert written.doubt is bad.error
    assert written.registers[:3] == AT_REST


def test_what_was_refused_is_decided_again_and_written_with_16() -> None:
    images = [None, IMAGE]
    assert said(speaker().write_and_read(images.pop), UNKNOWN) == (["READY", "23x3", "READY"], None)
    steps, written = said(speaker().write_and_read(lambda: IMAGE), UNKNOWN)
    assert steps == ["READY", "23x3", "READY", "16x3", "TURN", "3x3"]
    assert written.doubt is None


# -- the trial of function 23 ------------------------------------------------------------------------------


def tried(*outcomes: Any) -> tuple[Dialogues, list[str], Any]:
    dialogues = speaker(is_sure=False)
    said(dialogues.opening())
    assert said(dialogues.write_and_read(lambda: IMAGE))[0] == ["READY", "16x3", "3x3"], (
        "nothing is known yet"
    )
    return dialogues, *said(
        dialogues.write_and_read(lambda: pytest.fail("decided on an old status")), *outcomes
    )


def test_function_23_is_tried_with_the_image_in_force_and_used_from_then_on() -> None:
    dialogues, steps, written = tried()
    assert (steps, written) == (["READY", "23x3"], None)
    assert said(dialogues.write_and_read(lambda: IMAGE))[0] == ["READY", "23x3"]


def test_a_jaw_that_is_silent_on_function_23_costs_a_read_and_no_command() -> None:
    dialogues, steps, written = tried(SILENT)
    assert (steps, written) == (["READY", "23x3", "TURN", "HUSH", "3x1", "3x3"], None)
    assert dialogues.serves_23 is False
    assert said(dialogues.write_and_read(lambda: IMAGE))[0] == ["READY", "16x3", "3x3"]


def test_a_jaw_that_refuses_function_23_costs_nothing_more() -> None:
    dialogues, steps, _ = tried(UNKNOWN)
    assert steps == ["READY", "23x3"]
    assert dialogues.serves_23 is False


@pytest.mark.parametrize(
    ("status", "image"),
    [
        ((0xF900, 0x0064, 0x6600), "0900 0064 0000"),  # at its target
        ((0xF100, 0x0064, 0x6600), "0100 0064 0000"),  # stopped there
        ((0x3100, 0x0064, 0x3000), ""),  # stopped on the way: it may hold something
        ((0xB100, 0x00FF, 0x6000), ""),  # stopped with something in it: the force would change
        ((0xF900, 0x0064, 0x6700), ""),  # not where it was to go: it might move
        ((0xB900, 0x0064, 0x6000), ""),  # it presses: the force would change
        ((0xD900, 0x0064, 0x6400), ""),  # it activates
        ((0x0000, 0x0064, 0x6400), ""),  # it is reset
    ],
)
def test_before_the_first_command_an_adopted_jaw_is_written_what_it_shows(
    status: tuple[int, ...], image: str
) -> None:
    dialogues = speaker(is_sure=False)
    said(dialogues.opening())
    said(dialogues.read(), answer(PduExchange(bytes.fromhex("09 03 07d0 0003"), Timing(0.4)), status))
    dialogue: Any = dialogues.write_and_read(lambda: IMAGE)
    next(dialogue)
    request = dialogue.send(None)
    written = (23, bytes.fromhex(image)) if image else (16, bytes.fromhex("0900 00ff 4060"))
    assert (request.frame[0], request.frame[-6:]) == written


def test_noise_decides_nothing() -> None:
    dialogues, _, _ = tried(NOISE)
    assert dialogues.serves_23 is None


@pytest.mark.parametrize(
    "status",
    [
        (0x3900, 0x00FF, 0x7000),
        (0xF900, 0x00FF, 0x7000),  # gOBJ comes behind the echo: it is that from before the motion
        (0xB900, 0x00FF, 0x7000),
        (0xF100, 0x00FF, 0xE300),
        (0xF900, 0x0080, 0x8000),
        (0xF900, 0x0BFF, 0xE300),
    ],
    ids=["moving", "still there", "still holding", "stopped by another", "another's position", "a fault"],
)
def test_it_is_not_tried_unless_the_jaw_rests_as_it_was_told(status: tuple[int, ...]) -> None:
    dialogues = speaker(is_sure=False)
    said(dialogues.opening())
    said(dialogues.write(lambda: IMAGE))
    said(dialogues.read(), answer(PduExchange(bytes.fromhex("09 03 07d0 0003"), Timing(0.4)), status))
    assert said(dialogues.write_and_read(lambda: IMAGE))[0] == ["READY", "16x3", "3x3"]
