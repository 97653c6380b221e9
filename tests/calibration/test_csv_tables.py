"""Tables of runs in CSV files: read whole or refused, written whole or not at all."""

from __future__ import annotations

import os
import stat
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.calibration.csv_tables import (
    SPEED_LAYOUT,
    Layout,
    TableError,
    read_table,
    write_table,
)
from robotiq_async.calibration.thesis import CLOSING_MS, FOAM_GRAMS, RIGID_GRAMS

HEADER = "speed_value,run_1_ms,run_2_ms"


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "table.csv"


def refusal(file: Path, text: str, layout: Layout = SPEED_LAYOUT) -> str:
    file.write_text(text, encoding="utf-8")
    with pytest.raises(TableError) as caught:
        read_table(file, layout)
    assert isinstance(caught.value, ValueError)
    message = str(caught.value)
    assert message.startswith(str(file))
    return message.removeprefix(str(file))


@given(
    st.integers(1, 4).flatmap(
        lambda runs: st.dictionaries(
            st.integers(0, 255),
            st.tuples(*[st.integers(0, SPEED_LAYOUT.high)] * runs),
            min_size=1,
            max_size=20,
        )
    )
)
def test_a_table_is_read_as_it_was_written(
    tmp_path_factory: pytest.TempPathFactory, table: dict[int, tuple[int, ...]]
) -> None:
    file = tmp_path_factory.getbasetemp() / "table.csv"
    write_table(file, SPEED_LAYOUT, table)
    assert read_table(file, SPEED_LAYOUT) == table


def test_the_thesis_tables_are_there() -> None:
    assert sorted(CLOSING_MS) == [*range(0, 256, 4), 255]
    assert CLOSING_MS[0] == (10021, 10021, 10021)
    for table in (FOAM_GRAMS, RIGID_GRAMS):
        assert sorted(table) == list(range(0, 251, 25))
        assert {len(runs) for runs in table.values()} == {3}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ": the file is empty"),
        ("speed_value\n0\n", ", line 1: expected the columns speed_value,run_1_ms, got speed_value"),
        ("speed,run_1_ms\n0,1\n", ", line 1: expected the columns speed_value,run_1_ms"),
        ("speed_value,run_1_ms,run_3_ms\n", ", line 1: expected the columns"),
        ("force_value,run_1_g\n0,1\n", ", line 1: expected the columns"),
        (f"{HEADER}\n0,1\n", ", line 2: expected 3 columns, got 2"),
        (f"{HEADER}\n0,1,2,3\n", ", line 2: expected 3 columns, got 4"),
        (f"{HEADER}\n0,1,2\n4,fast,2\n", ", line 3: run_1_ms must be an integer in 0..600000, got 'fast'"),
        (f"{HEADER}\n0,1,\n", ", line 2: run_2_ms must be an integer in 0..600000, got ''"),
        (f"{HEADER}\n0,1,-2\n", ", line 2: run_2_ms must be an integer"),
        (f"{HEADER}\n0,1,600001\n", ", line 2: run_2_ms must be an integer in 0..600000, got '600001'"),
        (f"{HEADER}\n256,1,2\n", ", line 2: speed_value must be an integer in 0..255, got '256'"),
        (f"{HEADER}\n0,1,2\n\n0,3,4\n", ", line 4: speed_value 0 appears twice"),
        (f'{HEADER}\n0,"1,2\n', ", line 2: unexpected end of data"),
    ],
)
def test_a_bad_table_is_refused_with_file_line_and_reason(file: Path, text: str, words: str) -> None:
    assert words in refusal(file, text)


def test_a_file_that_cannot_be_read_is_refused(tmp_path: Path) -> None:
    with pytest.raises(TableError, match="cannot be read: No such file"):
        read_table(tmp_path / "nowhere.csv", SPEED_LAYOUT)
    with pytest.raises(TableError, match="cannot be read: Is a directory"):
        read_table(tmp_path, SPEED_LAYOUT)
    with pytest.raises(TableError, match="/dev/zero, line 1: it has more than 10000 characters"):
        read_table("/dev/zero", SPEED_LAYOUT)
    (tmp_path / "latin").write_bytes(b"speed_value,run_1_ms\n0,\xff\n")
    with pytest.raises(TableError, match="cannot be read"):
        read_table(tmp_path / "latin", SPEED_LAYOUT)


def test_tables_of_spreadsheets_are_read(file: Path) -> None:
    file.write_bytes(b"\xef\xbb\xbfspeed_value,run_1_ms\r\n0, 10\r\n")
    assert read_table(file, SPEED_LAYOUT) == {0: (10,)}


def test_rows_are_sorted_and_what_was_there_is_replaced_whole(file: Path) -> None:
    file.write_text("something longer that was there before\n" * 10, encoding="utf-8")
    write_table(file, SPEED_LAYOUT, {255: (1,), 0: (2,)})
    assert file.read_text(encoding="utf-8") == "speed_value,run_1_ms\n0,2\n255,1\n"
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_a_failed_write_leaves_what_was_there_and_nothing_else(file: Path) -> None:
    write_table(file, SPEED_LAYOUT, {0: (1,)})
    with pytest.raises(RuntimeError):
        write_table(file, SPEED_LAYOUT, {0: (2,), 4: Unwritable()})
    assert read_table(file, SPEED_LAYOUT) == {0: (1,)}
    assert [path.name for path in file.parent.iterdir()] == [file.name]


def test_a_new_file_has_the_mode_that_the_umask_leaves_and_keeps_another(file: Path) -> None:
    before = os.umask(0o027)
    try:
        write_table(file, SPEED_LAYOUT, {0: (1,)})
        assert stat.S_IMODE(file.stat().st_mode) == 0o640
        for mode in (0o600, 0o660):
            file.chmod(mode)
            write_table(file, SPEED_LAYOUT, {0: (2,)})
            assert stat.S_IMODE(file.stat().st_mode) == mode
    finally:
        os.umask(before)


def test_a_planted_link_is_not_followed(file: Path) -> None:
    """Others may write in the folder, too: the name of the file beside can be guessed."""
    victim = file.with_name("victim")
    victim.write_text("precious", encoding="utf-8")
    file.with_name(f".{file.name}.{os.getpid()}").symlink_to(victim)
    write_table(file, SPEED_LAYOUT, {0: (1,)})
    assert victim.read_text(encoding="utf-8") == "precious"
    assert read_table(file, SPEED_LAYOUT) == {0: (1,)}


def test_a_link_to_the_table_stays_one(file: Path) -> None:
    write_table(file, SPEED_LAYOUT, {0: (1,)})
    link = file.with_name("link.csv")
    link.symlink_to(file)
    write_table(link, SPEED_LAYOUT, {0: (2,)})
    assert link.is_symlink()
    assert read_table(file, SPEED_LAYOUT) == {0: (2,)}


class Unwritable(tuple[int, ...]):
    """A row that cannot be turned into text."""

    __slots__ = ()

    def __iter__(self) -> object:  # type: ignore[override]
        raise RuntimeError("in the middle of the file")
