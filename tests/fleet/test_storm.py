"""Random faults: every setting is right, every outcome is true, and nothing comes late."""

from __future__ import annotations

import pytest

from tests.fleet.storm import WAYS, Image, Note, Storm, storm

COMMANDS = 250


@pytest.mark.parametrize("way", WAYS)
def test_commands_under_faults(way: str) -> None:
    found = storm(way, COMMANDS, seed=3)
    assert found["examples"] == []
    assert found["commands"] == COMMANDS
    assert found["outcomes"]["done"] > COMMANDS / 4
    assert sum(found["faults"].values()) >= 1


def judge(notes: list[Note]) -> Storm:
    it = Storm.__new__(Storm)
    it.notes, it.rivals = notes, []
    return it


def test_the_judge_finds_an_older_setting_and_a_late_one() -> None:
    asked = [Note(1.0, {"force": 10}, 1.1, "done"), Note(2.0, {"force": 200}, 2.1, "done")]
    right = [Image(1.05, 0, 9, 10), Image(2.05, 0, 9, 200)]
    assert judge(asked).wrong("force", right)[0] == []
    assert len(judge(asked).wrong("force", [*right, Image(5.0, 0, 9, 10)])[0]) == 1
    refused, unknown = (
        [asked[0], Note(2.0, {"force": 200}, 2.1, f"E: {words}")]
        for words in ("nothing was done", "may have been carried out")
    )
    for late in (refused, unknown):
        assert len(judge(late).wrong("force", [right[0], Image(4.0, 0, 9, 200)])[0]) == 1
    between = [right[0], Image(2.5, 0, 9, 200), Image(3.0, 0, 9, 10), Image(4.0, 0, 9, 200)]
    assert judge(unknown).wrong("force", between)[0] == [], "it came in time, and is restored"


def test_the_judge_finds_a_false_outcome() -> None:
    done, refused = (
        Note(1.0, {"force": 10}, 1.1, "done"),
        Note(1.0, {"force": 10}, 1.1, "E: nothing was done"),
    )
    with_it, without = [Image(0.5, 0, 9, 5), Image(1.05, 0, 9, 10)], [Image(0.5, 0, 9, 5)]
    assert [judge([done]).is_false(done, images) for images in (with_it, without)] == [False, True]
    assert [judge([refused]).is_false(refused, images) for images in (with_it, without)] == [True, False]
