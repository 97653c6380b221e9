"""``robotiq-async fleet keys``."""

from __future__ import annotations

from collections.abc import Callable
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


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        ("", 2, ["FOLDER"]),
        ("keys --read a/b", 2, ["'a/b'", "A-Z"]),
        ("keys --agent cell-1=1.2", 2, ["'1.2'", "host"]),
        ("keys --agent cell-1=", 2, ["''", "host"]),
        ("keys --agent a --agent a=b", 2, ["named twice"]),
        ("keys --read bob --days 0", 2, ["--days", "1..36500", "0"]),
        ("keys --read bob --days x", 2, ["--days"]),
        ("keys --wirte bob", 2, ["--wirte"]),
        ("keys --read bob --days 4000", 1, ["the authority ends on"]),
        ("file --read bob", 1, ["file"]),
    ],
)
def test_what_it_refuses_is_one_line(
    arguments: str,
    code: int,
    words: list[str],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("file").touch()
    assert main(["fleet", "keys", *arguments.split()]) == code
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    for word in words:
        assert word in err
    assert not list(tmp_path.glob("keys/*-*"))
    assert Path("keys").exists() == (code == 1 and arguments.startswith("keys"))


def test_it_overwrites_nothing_and_makes_nothing_then(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["fleet", "keys", str(tmp_path), "--read", "bob"]) == 0
    assert main(["fleet", "keys", str(tmp_path), "--read", "alice", "--read", "bob"]) == 1
    assert "read-bob exists already: nothing was made" in capsys.readouterr().err
    assert not (tmp_path / "read-alice").exists()


def test_without_the_extra_one_line_names_it(
    call: Call, without: Callable[[str], None], tmp_path: Path
) -> None:
    without("cryptography")
    outcome = call("fleet", "keys", str(tmp_path / "keys"))
    outcome.assert_failed(1, "cryptography", "pip install 'cryptography")
