"""Shell lines of the pages name things that exist: commands, options, make's targets, extras, files.

It is parsed and not run: most of it is for a gripper, a second machine or a ROS. What runs are the lines that
end by themselves (tests/cli/test_pages.py), the commands (tests/cli), the targets (CI) and the Python code
(test_pages, environments).
"""

from __future__ import annotations

import re
import shlex
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from robotiq_async.cli.app import build
from robotiq_async.runtime.extras import install
from robotiq_async.runtime.shell import quoted
from tests.docs.pages import PAGES, ROOT, blocks, named, read
from tests.docs.prompts import NotForThisPromptError, command_prompt, powershell

READ = [*PAGES, ROOT / "README.md", ROOT / "CONTRIBUTING.md"]
COMMAND_LINE = build()
OTHERS = {
    *("cp", "curl", "export", "ls", "printf", "python3", "python3.12", "ros2", "socat", "source", "sudo"),
    *("lerobot-record", "lerobot-replay", "lerobot-rollout", "lerobot-teleoperate", "lerobot-train"),
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


# -- Windows: what its prompts make of a line --------------------------------------------------------------

NOT_FOR_WINDOWS = ("chmod", "export", "ls", "make", "python3", "ros2", "socat", "source", "sudo", "lerobot-")
"""Programs that there are not. On Windows python3 is py (README, Install)."""
ALIKE = [*PAGES, ROOT / "README.md"]


@pytest.mark.parametrize("page", ALIKE, ids=named)
def test_windows_prompts_read_a_line_as_the_shell_does(page: Path) -> None:
    """PowerShell with the comment behind it, the command prompt without."""
    for number, line in lines(page):
        words = shlex.split(line, comments=True)
        if words[0].startswith(NOT_FOR_WINDOWS) or re.search(r"[|&$>;~]|^[A-Z_]+=|/bin/", line):
            continue
        where = f"{page.name}, line {number}: {line}"
        assert powershell(line) == words, where
        assert command_prompt(re.sub(r"\s+#\s.*", "", line)) == words, where


def test_the_lines_for_windows_are_read_by_both_prompts() -> None:
    (block,) = blocks(read(ROOT / "README.md"), "bat")
    assert [command_prompt(line) for line in block.text.splitlines()] == [
        ["py", "-m", "venv", "gripper"],
        ["gripper\\Scripts\\activate"],
        ["pip", "install", ".[cli]"],
    ]
    assert all(powershell(line) == command_prompt(line) for line in block.text.splitlines())


@pytest.mark.parametrize("extra", sorted(EXTRAS))
def test_advice_on_an_extra_can_be_typed_in_every_shell(extra: str) -> None:
    advice, _, _ = install(extra).partition(" (")
    assert shlex.split(advice) == powershell(advice) == command_prompt(advice)


def test_a_list_in_powershell_is_found() -> None:
    with pytest.raises(NotForThisPromptError, match=r"^, outside"):
        powershell("robotiq-async move 255 --fingers A,B")


def test_an_address_in_advice_can_be_typed_in_every_shell() -> None:
    for address in ("tcp://192.168.1.11:502", "rtu:///dev/ttyUSB0?baud=9600&parity=E", "tcp://[fe80::1]:502"):
        advice = f"robotiq-async doctor {quoted(address)}"
        assert shlex.split(advice) == powershell(advice) == command_prompt(advice)
        assert shlex.split(advice)[-1] == address


@pytest.mark.parametrize("prompt", [powershell, command_prompt])
@pytest.mark.parametrize("line", ["pip install '.[cli]'", "status rtu://COM3?baud=9600&parity=E", "a > b"])
def test_a_line_that_windows_reads_otherwise_is_found(prompt: Callable[[str], list[str]], line: str) -> None:
    with pytest.raises(NotForThisPromptError):
        prompt(line)
    assert command_prompt('a "b c"d ""') == powershell('a "b c"d ""') == ["a", "b cd", ""]
