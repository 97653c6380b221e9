"""The plan of a cycle: the table in cycle.py, line by line."""

from __future__ import annotations

import pytest

from robotiq_async.control.controller import NextWrite
from robotiq_async.hands.options import LONGEST_SPACING_S
from robotiq_async.local.cycle import FRESH_S, READS, SOON_S, CycleStep, begins_at_once, next_step

STOP = NextWrite(wait=0.0, is_urgent=True, is_command=False, is_stop=True)
COMMAND = NextWrite(wait=0.0, is_urgent=False, is_command=True, is_stop=False)
PROCEDURE = NextWrite(wait=0.0, is_urgent=False, is_command=False, is_stop=False)
LONG_S = 1e-4  # more than that is too much


@pytest.mark.parametrize(
    ("write", "age", "is_stale", "is_slow", "expected"),
    [
        (STOP, 1.0, False, False, CycleStep.WRITE),
        (STOP, 1.0, False, True, CycleStep.WRITE),
        (STOP._replace(wait=LONGEST_SPACING_S), 1.0, False, False, CycleStep.WAIT),
        (STOP._replace(wait=LONGEST_SPACING_S + LONG_S), 1.0, False, False, CycleStep.READ),
        (STOP, 0.0, True, True, CycleStep.READ),
        (COMMAND, 0.0, False, False, CycleStep.READ),
        (COMMAND, FRESH_S, False, True, CycleStep.WRITE_AND_READ),
        (COMMAND, FRESH_S + LONG_S, False, True, CycleStep.READ),
        (COMMAND._replace(wait=SOON_S), FRESH_S - SOON_S, False, True, CycleStep.WAIT),
        (COMMAND._replace(wait=SOON_S), FRESH_S - SOON_S + LONG_S, False, True, CycleStep.READ),
        (COMMAND._replace(wait=SOON_S + LONG_S), 0.0, False, True, CycleStep.READ),
        (COMMAND, 0.0, True, True, CycleStep.READ),
        (PROCEDURE, 0.0, False, True, CycleStep.READ),
    ],
)
def test_the_first_step(
    write: NextWrite, age: float, is_stale: bool, is_slow: bool, expected: CycleStep
) -> None:
    assert next_step(write, 0, age, is_stale=is_stale, is_slow=is_slow) is expected


@pytest.mark.parametrize("write", [STOP, COMMAND, PROCEDURE])
@pytest.mark.parametrize(
    ("wait", "reads", "is_stale", "expected"),
    [
        (0.0, 1, False, CycleStep.WRITE_AND_READ),
        (0.0, READS, False, CycleStep.WRITE_AND_READ),
        (0.0, READS - 1, True, CycleStep.READ),
        (0.0, READS, True, CycleStep.WRITE),
        (SOON_S, 1, True, CycleStep.WAIT),
        (SOON_S + LONG_S, 1, True, None),
    ],
)
def test_a_step_after_a_read(
    write: NextWrite, wait: float, reads: int, is_stale: bool, expected: CycleStep | None
) -> None:
    now = write._replace(wait=wait)
    assert next_step(now, reads, 0.0, is_stale=is_stale, is_slow=False) is expected


@pytest.mark.parametrize("is_slow", [False, True])
@pytest.mark.parametrize("is_stale", [False, True])
@pytest.mark.parametrize("wait", [0.0, SOON_S, 1.0])
@pytest.mark.parametrize("write", [STOP, COMMAND, PROCEDURE])
def test_a_cycle_that_does_not_begin_with_its_write_begins_with_a_read(
    write: NextWrite, wait: float, is_stale: bool, is_slow: bool
) -> None:
    """The poller plans no further then."""
    write = write._replace(wait=wait)
    if not begins_at_once(write, is_slow=is_slow):
        assert next_step(write, 0, 0.0, is_stale=is_stale, is_slow=is_slow) is CycleStep.READ
