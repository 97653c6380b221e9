"""With the option that the report names, a hand keeps its contract on a gripper with the habit.

A scene is tried in one of its forms: they differ in what the hand is asked, and not in the gripper's habit.
Of a habit that shows in some scenes only, these are tried (``SHOWING``).
"""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Iterator
from functools import partial
from itertools import chain, product
from pathlib import Path
from typing import Any

import pytest

from robotiq_async.simulator.troubles.trouble import parse_troubles
from tests import contract
from tests.contract.bench import HABIT, LOCAL
from tests.verify.matrix import HABITS, options

ROWS = [(trouble, option) for trouble, _, option in HABITS if option != "-"] + [("write-spacing", "-")]
FORGOTTEN = "the write that the gripper forgets is the other client's"
IMPATIENT = "the test itself waits for less"
SLOWER = "the test counts polls or milliseconds at 200 Hz"
AT_200_HZ = dict.fromkeys(
    [
        "test_a_command_moves_from_the_moment_it_is_asked_for",
        "test_timestamps_are_of_this_process_and_only_rise",
        "test_statistics",
    ],
    SLOWER,
)
EXCEPT: dict[str, dict[str, str]] = {
    "write-spacing": {"test_superseded_by_another_client_of_the_gripper": FORGOTTEN},
    "write-spacing 0.03": {
        "test_superseded_by_another_client_of_the_gripper": FORGOTTEN,
        "test_a_foreign_reset": FORGOTTEN,
    },
    "slow-activation 35": {"test_a_cancelled_activation_goes_on": IMPATIENT, "test_statistics": SLOWER},
    "delay": AT_200_HZ,
}
"""Tests of the contract that a habit keeps from passing, whatever the hand does, and why."""


FILES = sorted(file.stem for file in Path(contract.__path__[0]).glob("test_*.py"))
"""Of the contract."""
OF_OTHERS = ("test_differences", "test_physics", "test_shared_line", "test_units")
"""Hands on other hosts, and what has no scene of its own."""
ASKING = [file for file in FILES if file not in ("test_arguments", *OF_OTHERS)]
"""All but what is refused before the gripper is asked anything."""
# For a new scene or habit: a set is what fails when every scene is tried without the option of its row.
SHOWING: dict[str, set[str]] = {
    # Without the option no scene finds its gripper. With it they differ in the function code of a read alone:
    # the first connection, the next ones, each kind of answer, and another start.
    "function-3-only": {
        "test_a_reset_gripper_is_activated",
        "test_it_may_be_started_again",
        "test_the_newest_status",
        "test_while_the_link_is_down",
    },
    # Those that fail with an activation_timeout of 25 s, the one that waits for less itself, and one that
    # shows that the hand polls as slowly as it was told.
    "slow-activation 35": {
        "test_a_cancelled_activation_goes_on",
        "test_a_command_during_an_activation",
        "test_a_foreign_reset",
        "test_a_major_fault",
        "test_a_released_gripper_is_left_released",
        "test_a_reset_gripper_is_activated",
        "test_a_state_that_lasts_for_a_moment",
        "test_a_stop_ends_every_wait",
        "test_an_activation_that_ends_in_a_fault_fails_the_start",
        "test_an_activation_under_way_is_waited_for",
        "test_an_emergency_release",
        "test_opening_releases_the_part_and_a_reset_loses_it",
        "test_release_reset_activate",
        "test_statistics",
        "test_transitions_lose_nothing",
        "test_while_reset_nothing_moves",
    },
    # Those that fail with answers that take 0.2 s; one that stops, one that waits, and lost links.
    "delay": {
        "test_a_command_moves_from_the_moment_it_is_asked_for",
        "test_a_finger_that_presses_again_after_a_fault_has_kept_its_grip",
        "test_a_grasp_that_is_given_up_holds_what_moves_and_keeps_the_grip",
        "test_a_halt_stops_every_axis",
        "test_a_lost_link_ends_a_move",
        "test_a_minor_fault_ends_a_move_and_nothing_resumes",
        "test_a_part_that_slips_and_is_held_again",
        "test_a_release_only_in_fault",
        "test_cancelled_at_any_moment",
        "test_it_may_be_started_again",
        "test_recover_waits_for_a_minor_fault_and_writes_nothing",
        "test_statistics",
        "test_statuses_opened_before_the_start_end_after_the_stop",
        "test_stop_stops_the_fingers_and_keeps_the_activation",
        "test_streams_wait_out_a_lost_link",
        "test_timestamps_are_of_this_process_and_only_rise",
        "test_too_slow",
    },
    # Those that fail where a hand keeps no distance between writes.
    "write-spacing": {
        "test_a_hold_keeps_axes_where_they_are",
        "test_a_loop_that_commands_at_every_status",
        "test_a_stop_that_keeps_a_grip_holds_what_moves",
        "test_requests",
        "test_speed_and_force_start_no_motion",
        "test_superseded_by_another_client_of_the_gripper",
    },
}
"""The scenes in which a habit shows; in the others a hand with the option meets a plain gripper."""
# And those that fail where a hand keeps its usual distance, and not that of the option.
SHOWING["write-spacing 0.03"] = SHOWING["write-spacing"] | {
    "test_a_foreign_reset",
    "test_a_halt_stops_every_axis",
    "test_a_major_fault",
    "test_a_minor_fault_ends_a_move_and_nothing_resumes",
    "test_a_part_taken_away_still_counts_as_held_until_the_fingers_press_again",
    "test_a_released_gripper_is_left_released",
    "test_a_state_that_lasts_for_a_moment",
    "test_an_activation_that_ends_in_a_fault_fails_the_start",
    "test_an_emergency_release",
    "test_cancelled",
    "test_halted",
    "test_opening_releases_the_part_and_a_reset_loses_it",
    "test_release_reset_activate",
    "test_statistics",
    "test_superseded_by_another_move",
    "test_the_other_calls_take_them_too",
    "test_transitions_lose_nothing",
}


def scenes(file: str) -> Iterator[tuple[str, partial[None]]]:
    """Every test of a file of the contract on a hand of this process, but those that need a fixture."""
    for name, test in vars(importlib.import_module(f"tests.contract.{file}")).items():
        marks = [mark for mark in getattr(test, "pytestmark", []) if mark.name == "parametrize"]
        if not name.startswith("test_") or not any(mark.args[0] == "where" for mark in marks):
            continue
        for chosen in product(*map(choices, marks)):
            arguments = {key: value for choice in chosen for key, value in choice.items()}
            if arguments["where"] == LOCAL and inspect.signature(test).parameters.keys() <= arguments.keys():
                yield name, partial(test, **arguments)


def choices(mark: pytest.Mark) -> list[dict[str, Any]]:
    """The arguments that a mark gives to a test, for each of its values."""
    names, values = mark.args[:2]
    names = [each.strip() for each in names.split(",")] if isinstance(names, str) else list(names)
    values = [getattr(each, "values", each) if hasattr(each, "marks") else each for each in values]
    several = [
        each if len(names) > 1 or isinstance(each, pytest.ParameterSet) else (each,) for each in values
    ]
    return [dict(zip(names, each, strict=True)) for each in several]


@pytest.mark.parametrize(("trouble", "option"), ROWS)
def test_with_its_option_a_hand_keeps_its_contract(trouble: str, option: str) -> None:
    # 35 s at 200 Hz for every scene would be most of the time that these take.
    slowly = {"poll_interval": 0.1} if trouble.startswith("slow-activation") else {}
    shown, exceptions = SHOWING[trouble], EXCEPT.get(trouble, {}).keys()
    habit = HABIT.set((parse_troubles(trouble)[0], slowly | options(option)))
    failed, tried = set(), set()
    try:
        for name, scene in chain.from_iterable(dict(scenes(file)).items() for file in ASKING):
            if name not in shown:
                continue
            tried.add(name)
            try:
                scene()
            except Exception:  # noqa: BLE001  # every way to fail counts
                failed.add(name)
    finally:
        HABIT.reset(habit)
    assert tried == shown
    assert failed == exceptions


def test_no_exception_is_of_a_scene_that_there_is_not() -> None:
    names = [name for file in ASKING for name, _ in scenes(file)]
    assert len(names) > 140
    assert {name for exceptions in EXCEPT.values() for name in exceptions} <= set(names)
