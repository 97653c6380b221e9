"""``robotiq-async fleet keys``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async.cli import main

if TYPE_CHECKING:
    from tests.cli.conftest import Call


def test_it_makes_an_authority_and_then_adds_to_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    folder = tmp_path / "keys"
    assert (
        main(["fleet", "keys", str(folder), "--agent", "cell-1=10.0.0.7,cell-1.lab", "--operate", "bob"]) == 0
    )
    out = capsys.readouterr().out
    lines = {line.partition(":")[0]: line for line in out.splitlines()}
    assert "authority" in lines[str(folder / "ca.pem")]
    assert "10.0.0.7, cell-1.lab" in lines[str(folder / "agent-cell-1")]
    assert "command" in lines[str(folder / "operate-bob")]
    assert str(folder / "agent-cell-1" / "access.toml") in lines
    assert "PRIVATE" not in out
    assert main(["fleet", "keys", str(folder), "--read", "alice", "--read", "carl", "--halt", "panel"]) == 0
    assert "the authority" not in capsys.readouterr().out
    assert sorted(path.name for path in folder.iterdir() if path.is_dir()) == [
        "agent-cell-1",
        "halt-panel",
        "operate-bob",
        "read-alice",
        "read-carl",
    ]


def test_it_overwrites_nothing_and_makes_nothing_then(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fleet", "keys", str(tmp_path), "--read", "bob"]) == 0
    assert main(["fleet", "keys", str(tmp_path), "--read", "alice", "--read", "bob"]) == 1
    assert "read-bob exists already: nothing was made" in capsys.readouterr().err
    assert not (tmp_path / "read-alice").exists()


@pytest.mark.parametrize(
    ("folder", "days", "words"), [("keys", "4000", "the authority ends on"), ("file", "30", "file")]
)
def test_a_failed_command_makes_no_key(
    call: Call, tmp_path: Path, folder: str, days: str, words: str
) -> None:
    (tmp_path / "file").touch()
    call("fleet", "keys", str(tmp_path / folder), "--read", "bob", "--days", days).assert_failed(1, words)
    assert not list(tmp_path.glob("keys/*-*"))
