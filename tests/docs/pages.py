"""The pages that the tests read."""

from __future__ import annotations

import ast
import inspect
import re
from itertools import pairwise
from pathlib import Path
from types import CodeType, FunctionType
from typing import Any, Final, NamedTuple

ROOT: Final = Path(__file__).parents[2]
DOCS: Final = ROOT / "docs"
PAGES: Final = sorted(DOCS.rglob("*.md"))
"""Everything under docs/."""
TUTORIAL: Final = DOCS / "tutorial.md"


def read(page: Path | str) -> str:
    """The text of a page; a name is one of docs/."""
    return (DOCS / page).read_text(encoding="utf-8")


def named(page: object) -> str:
    """The name of a page in tests; nothing else has a name."""
    return str(page.relative_to(ROOT)) if isinstance(page, Path) else ""


def table(page: Path | str, heading: str = "") -> list[list[str]]:
    """The rows of the tables on a page, heads and all; or in the section of a heading, up to the next one."""
    text = read(page)
    if heading:
        text = text.partition(f"\n{heading}\n")[2].partition("\n#")[0]
    return [
        [cell.strip() for cell in line.strip("|").split("|")]
        for line in text.splitlines()
        if line.startswith("|") and not line.startswith("| --")
    ]


class Block(NamedTuple):
    """A fenced block of a page."""

    language: str  # the word after the fence
    text: str
    line: int  # the first of the text, counted from 1


def blocks(text: str, language: str | None = None) -> list[Block]:
    """The fenced blocks of a page, in their order: all, or those of one language."""
    return [
        Block(found[1], found[2], text[: found.start(2)].count("\n") + 1)
        for found in re.finditer(r"^```(\w*)\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
        if language in (None, found[1])
    ]


def outputs(text: str) -> dict[Block, Block]:
    """The printed outputs on a page: a block of text right after one of Python."""
    return {
        block: following
        for block, following in pairwise(blocks(text))
        if (block.language, following.language) == ("python", "text")
        and following.line == block.line + block.text.count("\n") + 3
    }


def prose(text: str) -> str:
    """A page without its fenced blocks and its comments."""
    return re.sub(r"^```.*?^```$|<!--.*?-->", "", text, flags=re.MULTILINE | re.DOTALL)


def requirements(text: str) -> str:
    """The requirements on a page, as typed behind ``pip install``."""
    return " ".join(re.findall(r'\bpip install (?!"robotiq-async|\.\.\. )([^`\n]+)', text))


# -- code that awaits at the top, as ``python -m asyncio`` and notebooks run it --


def compiled_prompt(source: str | ast.Module, where: str) -> CodeType:
    """Compile it; errors name where it stands."""
    code = compile(source, where, "exec", ast.PyCF_ALLOW_TOP_LEVEL_AWAIT, dont_inherit=True)
    assert isinstance(code, CodeType)
    return code


async def run_prompt(code: CodeType, names: dict[str, Any]) -> None:
    """Run it to its end; the names then hold what it defines."""
    outcome = FunctionType(code, names)()
    if inspect.iscoroutine(outcome):
        await outcome
