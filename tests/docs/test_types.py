"""The pages whose code people copy into typed projects pass a strict type check."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from tests.docs.pages import DOCS, blocks


@pytest.mark.parametrize("page", ["how-to/testing.md"])
def test_the_code_of_a_page_passes_mypy_strict(page: str, tmp_path: Path) -> None:
    found = [block for block in blocks((DOCS / page).read_text()) if block.language == "python"]
    assert found
    files = []
    for block in found:
        files.append(tmp_path / f"line_{block.line}.py")
        files[-1].write_text(block.text)
    checked = subprocess.run(
        [sys.executable, "-m", "mypy", "--strict", "--no-incremental", "--config-file=", *files],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
    )
    assert checked.returncode == 0, checked.stdout + checked.stderr
