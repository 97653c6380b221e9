"""What can happen to a hand, and which of five conditions a status shows."""

from __future__ import annotations

import pytest

from robotiq_async.control.triggers import classify
from robotiq_async.values.enums import Trigger
from tests.register_words import status_of


def test_what_a_status_shows_is_one_of_five_conditions() -> None:
    seen = [trigger for trigger in Trigger if trigger.is_seen]
    assert seen == [trigger for trigger in Trigger if trigger.name.startswith("SEEN_")]
    assert len(seen) == 5


@pytest.mark.parametrize(
    ("byte_0", "byte_1", "fault", "condition"),
    [
        (0x00, 0x00, 0x00, Trigger.SEEN_RESET),
        (0x01, 0x00, 0x00, Trigger.SEEN_BUSY),  # rACT taken over, not begun yet
        (0x11, 0x00, 0x00, Trigger.SEEN_BUSY),  # activating
        (0x21, 0x00, 0x00, Trigger.SEEN_BUSY),  # changing mode
        (0x30, 0x00, 0x00, Trigger.SEEN_BUSY),  # rACT cleared, not reset yet
        (0x31, 0x00, 0x00, Trigger.SEEN_READY),
        (0x39, 0xC0, 0x00, Trigger.SEEN_READY),  # closing
        (0xB9, 0xEA, 0x00, Trigger.SEEN_READY),  # object held
        (0xF9, 0xFF, 0x00, Trigger.SEEN_READY),  # position reached
        # Priority codes are no faults.
        (0x11, 0x00, 0x05, Trigger.SEEN_BUSY),
        (0x21, 0x00, 0x06, Trigger.SEEN_BUSY),
        (0x00, 0x00, 0x07, Trigger.SEEN_RESET),
        (0x31, 0x00, 0x07, Trigger.SEEN_READY),
        # Minor and major ones are, whatever else the status shows.
        (0x00, 0x00, 0x09, Trigger.SEEN_FAULT),
        (0x39, 0x00, 0x0A, Trigger.SEEN_FAULT),
        (0x11, 0x00, 0x0D, Trigger.SEEN_FAULT),
        (0x39, 0x00, 0x0E, Trigger.SEEN_FAULT),
        (0x31, 0x00, 0x0C, Trigger.SEEN_FAULT),  # unassigned
        # gIMC = 0 with a fault is an automatic release and not a reset.
        (0x01, 0x00, 0x0B, Trigger.SEEN_FAULT),
        (0x09, 0x00, 0x0B, Trigger.SEEN_FAULT),
        (0x00, 0x00, 0x0B, Trigger.SEEN_FAULT),
        (0x01, 0x00, 0x0F, Trigger.SEEN_RELEASED),
        (0x00, 0x00, 0x0F, Trigger.SEEN_RELEASED),
        (0x31, 0x00, 0xF0, Trigger.SEEN_READY),  # the high nibble is no fault code
    ],
)
def test_a_status_shows(byte_0: int, byte_1: int, fault: int, condition: Trigger) -> None:
    assert classify(status_of(byte_0, byte_1, fault)) is condition


@pytest.mark.parametrize("code", range(1, 16))
def test_no_fault_that_matters_is_taken_for_a_reset(code: int) -> None:
    status = status_of(0x00, fault=code)
    assert (classify(status) is Trigger.SEEN_RESET) == (code in (0x05, 0x06, 0x07))
