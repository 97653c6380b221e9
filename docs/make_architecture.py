"""Draws docs/architecture.svg: the rooms of the package and who may import whom.

The layers are those of the import contract in pyproject.toml, which `make lint` keeps; what each room is
for is the first line of its docstring.
"""

from __future__ import annotations

import ast
import textwrap
import tomllib
from pathlib import Path
from typing import Final
from xml.sax.saxutils import escape

ROOT: Final = Path(__file__).parents[1]
PACKAGE: Final = ROOT / "robotiq_async"
PICTURE: Final = ROOT / "docs" / "architecture.svg"

WIDTH: Final = 900
MARGIN: Final = 16
GAP: Final = 10
LINE: Final = 17
HEAD: Final = 24
CHARACTER: Final = 6.4
"""Width of a character of the description, at most."""


def layers() -> list[list[str]]:
    """The layers from the top, each with the rooms that stand side by side in it.

    Raises:
        KeyError, StopIteration: pyproject.toml has no such contract.
    """
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    contracts = project["tool"]["importlinter"]["contracts"]
    contract = next(each for each in contracts if each["id"] == "layers")
    return [[name.strip() for name in layer.split("|")] for layer in contract["layers"]]


def purpose(name: str) -> str:
    """The first line of a room's docstring.

    Raises:
        ValueError: it has none.
    """
    path = PACKAGE / name / "__init__.py" if (PACKAGE / name).is_dir() else PACKAGE / f"{name}.py"
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    if not text:
        raise ValueError(f"{path.name} of {name} does not say what it is for")
    return text.partition("\n\n")[0].replace("\n", " ").replace("``", "")


def draw() -> str:
    """The picture."""
    body, y = [], MARGIN
    for rooms in layers():
        width = (WIDTH - 2 * MARGIN - GAP * (len(rooms) - 1)) / len(rooms)
        texts = [textwrap.wrap(purpose(room), int((width - 20) / CHARACTER)) for room in rooms]
        height = HEAD + LINE * max(map(len, texts)) + 8
        for index, (room, lines) in enumerate(zip(rooms, texts, strict=True)):
            x = MARGIN + index * (width + GAP)
            body.append(box(room, lines, x, y, width, height))
        y += height + GAP
    return "\n".join([*head(y - GAP + MARGIN), *body, "</svg>", ""])


def box(room: str, lines: list[str], x: float, y: float, width: float, height: float) -> str:
    """One room: its name, and what it is for."""
    name = f"{room}/" if (PACKAGE / room).is_dir() else f"{room}.py"
    rows = "".join(f'<tspan x="{x + 10:.0f}" dy="{LINE}">{escape(line)}</tspan>' for line in lines)
    return (
        f'<rect x="{x:.0f}" y="{y}" width="{width:.0f}" height="{height}" rx="4"/>'
        f'<text class="name" x="{x + 10:.0f}" y="{y + 19}">{escape(name)}</text>'
        f'<text x="{x + 10:.0f}" y="{y + HEAD - 3}">{rows}</text>'
    )


def head(height: float) -> list[str]:
    """Size, title and colours; they follow a dark page."""
    return [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {WIDTH} {height:.0f}" role="img">',
        '<title id="title">The rooms of robotiq_async: each imports only what stands below it</title>',
        "<style>",
        "svg { font: 12px sans-serif; background: #fff } text { fill: #222 }",
        ".name { font: bold 13px monospace; fill: #0b4f8a } rect { fill: #f4f7fa; stroke: #9ab }",
        "@media (prefers-color-scheme: dark) { svg { background: #16191d } text { fill: #ddd }",
        " .name { fill: #7cc0ff } rect { fill: #20262d; stroke: #567 } }",
        "</style>",
    ]
