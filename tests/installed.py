"""A package that is installed as far as its entry points go."""

from __future__ import annotations

from pathlib import Path

import pytest


def install(patch: pytest.MonkeyPatch, folder: Path, name: str, group: str, **entries: str) -> None:
    """Install a distribution of this name with entry points of a group, each ``name="module:object"``."""
    info = folder / f"{name}-1.0.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.0\n", encoding="utf-8")
    lines = "".join(f"{key} = {value}\n" for key, value in entries.items())
    (info / "entry_points.txt").write_text(f"[{group}]\n{lines}", encoding="utf-8")
    patch.syspath_prepend(folder)
