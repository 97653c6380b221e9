"""Shell lines of the pages name things that exist: commands, options, make's targets, extras, files.

It is parsed and not run: most of it is for a gripper, a second machine or a ROS. What runs are the lines that
end by themselves (tests/cli/test_pages.py), the commands (tests/cli), the targets (CI) and the Python code
(test_pages, environments).
"""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from robotiq_async.cli.app import build
from tests.docs.pages import PAGES, ROOT, blocks, named, read

READ = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
COMMAND_LINE = build()
OTHERS = {
    *("cp", "curl", "export", "ls", "python3", "python3.12", "ros2", "socat", "source", "sudo"),
    *("lerobot-record", "lerobot-replay", "lerobot-teleoperate"),
}
"""Programs that are not ours: ``python3 -m venv``, and what ROS, LeRobot and the shell have."""
TARGETS = set(re.findall(r"^([a-z0-9-]+):", read(ROOT / "Makefile"), re.MULTILINE))
EXTRAS = tomllib.loads(read(ROOT / "pyproject.toml"))["project"]["optional-dependencies"]


def words_of(line: str) -> list[str]:
    """The words of the first command on a line, without variables before it and what it is piped into."""
    words = shlex.split(line, comments=True)
    while words and re.match(r"[A-Z_]+=", words[0]):
        del words[0]
    ends = [number for number, word in enumerate(words) if word in ("|", ">", "&", "&&", ";", "2>")]
    return words[: min(ends, default=len(words))]


def lines(page: Path) -> Iterator[tuple[int, str]]:
    """The shell lines of a page, with their numbers."""
    for block in blocks(read(page), "sh"):
        for number, line in enumerate(block.text.replace("\\\n", " ").splitlines(), block.line):
            if line.strip() and not line.startswith("#"):
                yield number, line.strip()


@pytest.mark.parametrize("page", READ, ids=named)
def test_it_can_be_typed(page: Path) -> None:
    for number, line in lines(page):
        try:
            check(line)
        except Exception as error:
            error.add_note(f"line {number}: {line}")
            raise


def check(line: str) -> None:
    words = words_of(line)
    program = Path(words[0]).name
    if program == "robotiq-async":
        COMMAND_LINE.parse_args(words[1:], print_error=False, exit_on_error=False)
    elif program == "make":
        assert {word for word in words[1:] if "=" not in word} <= TARGETS
    elif program == "pip" and words[1] == "install":
        wanted = re.findall(r"\.\[(.*)\]", " ".join(words))
        assert {extra for each in wanted for extra in each.split(",")} <= set(EXTRAS)
    elif program == "pip" and words[1] == "wheel":
        assert words[-1] == ".", "of the clone"
    elif program == "python":
        files = [
            word for word in words[1:] if word.endswith(".py") and "/" in word and not word.startswith("..")
        ]
        modules = [words[number + 1] for number, word in enumerate(words) if word == "-m"]
        assert all((ROOT / each).is_file() for each in files)
        assert all(has(each) for each in modules)
    else:
        assert program in OTHERS, f"what is {program}?"


def has(module: str) -> bool:
    """Whether ``python -m`` finds it: in Python, among the packages of the page, or in the clone."""
    place = ROOT.joinpath(*module.split("."))
    return (
        module in ("asyncio", "pytest", "venv", "http.server")
        or place.is_dir()
        or place.with_suffix(".py").is_file()
    )


def test_a_command_that_is_not_there_is_found() -> None:
    with pytest.raises(Exception, match="turbo"):
        check("robotiq-async move 255 --turbo")
    with pytest.raises(AssertionError):
        check("make coffee")
