"""Code runs, quoted messages are the library's, and what is generated is fresh. Links: ``make docs``."""

from __future__ import annotations

import asyncio
import inspect
import logging
import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import AsyncExitStack, redirect_stdout
from io import StringIO
from pathlib import Path
from types import CodeType
from typing import Any

import pytest

from docs import make_layout, make_pages
from robotiq_async import Finger, RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import model_of
from tests.docs.agents import ROOM, agent_of_the_pages
from tests.docs.pages import (
    DOCS,
    PAGES,
    ROOT,
    TUTORIAL,
    Block,
    blocks,
    compiled_prompt,
    named,
    outputs,
    read,
    requirements,
    run_prompt,
)
from tests.docs.test_tutorial import agree
from tests.forked import CORE, forking
from tests.grippers import activate_beforehand
from tests.patience import patience

FRONT = [ROOT / name for name in ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "SECURITY.md")]
FIXTURES = DOCS / "how-to" / "testing.md"
"""Is for pytest, which runs it in tests/testing/."""
BEHIND = "anyio.*,numpy.*,pluggy.*,pymodbus.*"
"""Packages that mypy need not read."""


# -- where code runs ------------------------------------------------------------------------------------


def awaits_at_the_top(block: Block) -> bool:
    """Whether it is for a prompt or a notebook; in a program it would be a syntax error."""
    return bool(compiled_prompt(block.text, "page").co_flags & inspect.CO_COROUTINE)


def test_a_page_says_where_code_runs_that_awaits_at_the_top() -> None:
    for page in [*PAGES, *FRONT]:
        found = [block.text for block in blocks(read(page), "python") if awaits_at_the_top(block)]
        said = read(page).partition(found[0])[0] if found else ""
        assert not found or "python -m asyncio" in said, page


def test_a_page_with_code_names_its_environment() -> None:
    for page in {*(page for page, _ in CODE), FIXTURES}:
        assert requirements(read(page)).startswith((".", '".[')), page
        is_for_the_prompt = any(map(awaits_at_the_top, blocks(read(page), "python")))
        assert ("`python -m asyncio`" in read(page)) == is_for_the_prompt, page


# -- what is made from the code --------------------------------------------------------------------------


def test_nothing_is_stale(capsys: pytest.CaptureFixture[str]) -> None:
    assert make_pages.main(["--check"]) == 0, capsys.readouterr().out


def test_a_stale_page_is_named_and_made_again(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    layout = tmp_path / "layout.json"
    monkeypatch.setattr(make_layout, "FILE", layout)
    assert make_pages.main(["--check"]) == 1
    assert capsys.readouterr().out == "layout.json is stale: run docs/make_pages.py\n"
    assert not layout.exists()
    assert make_pages.main([]) == 0
    assert read(layout) == make_layout.draw()
    assert make_pages.main(["--check"]) == 0


# -- code ----------------------------------------------------------------------------------------------


CODE = [
    (page, block)
    for page in PAGES
    if page not in (TUTORIAL, FIXTURES)  # the blocks of the tutorial belong together: test_tutorial
    for block in blocks(read(page), "python")
]
OUTPUTS = {
    (page, block): shown for page in PAGES if page != TUTORIAL for block, shown in outputs(read(page)).items()
}
"""The output on the page behind a block."""


@pytest.fixture
def restored_logging() -> Iterator[None]:
    loggers = [logging.getLogger(name) for name in ("", "robotiq_async", "pymodbus.logging")]
    before = [(logger, logger.level, logger.handlers[:]) for logger in loggers]
    yield
    for logger, level, handlers in before:
        logger.setLevel(level)
        logger.handlers[:] = handlers


def compiled(page: Path, block: Block, address: str) -> CodeType:
    quick = block.text.replace('"sim://"', '"sim://?speedup=20"')
    source = "\n" * (block.line - 1) + quick.replace("tcp://192.168.1.11", address)
    return compiled_prompt(source, str(page))


@pytest.mark.parametrize(("page", "block"), CODE, ids=lambda value: named(value) or f"line {value.line}")
async def test_code_runs(
    page: Path, block: Block, restored_logging: None, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with AsyncExitStack() as stack:
        server = await stack.enter_async_context(SimulatorServer(SimulatedGripper(speedup=20)))
        if ROOM in block.text:
            for variable, value in (await stack.enter_async_context(agent_of_the_pages())).items():
                monkeypatch.setenv(variable, value)
        names: dict[str, Any] = {}
        with redirect_stdout(StringIO()) as printed:
            await run_prompt(compiled(page, block, server.address), names)
        shown = OUTPUTS.get((page, block))
        assert shown is None or agree(shown.text, printed.getvalue()), printed.getvalue()
        for function in [value for key, value in names.items() if key.startswith("test_")]:
            await function()


@pytest.mark.virtual_time
@pytest.mark.parametrize("closed", [False, True])
async def test_the_first_move_of_a_real_gripper_ends_wherever_its_fingers_are(closed: bool) -> None:
    """In real time: from closed fingers it takes twice the five seconds that it had."""
    page = DOCS / "how-to" / "first-hour.md"
    (block,) = [block for _, block in CODE if "Finger.A" in block.text and _ == page]
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    await activate_beforehand(gripper)
    async with SimulatorServer(gripper) as server:
        async with RobotiqHand(server.address) as hand:
            await (hand.close if closed else hand.open)(speed=255)
        with redirect_stdout(StringIO()) as printed:
            await run_prompt(compiled(page, block, server.address), {})
    assert printed.getvalue().count("<MoveResult A=") == block.text.count("await hand.") > 0
    assert gripper.position(Finger.B) > 200 or not closed, "only A has moved"


@pytest.mark.parametrize(
    ("number", "address", "model", "words"),
    [
        (0, "rtu:///dev/ttyUSB0?model=2f85", "2f85", b"holding a part of 30 mm\n"),
        (1, "tcp://192.168.1.11", "3f", b"holding it with A|B|C\n"),
    ],
)
async def test_the_programs_of_the_readme_end_with_their_part(
    tmp_path: Path, number: int, address: str, model: str, words: bytes
) -> None:
    example = blocks(read(ROOT / "README.md"), "python")[number]
    assert address in example.text
    program = tmp_path / "example.py"
    async with SimulatorServer(SimulatedGripper(speedup=20, model=model_of(model))) as server:
        server.gripper.place_object(Finger.ABC, position=150)
        program.write_text(example.text.replace(address, server.address), encoding="utf-8")
        with forking(CORE):
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, str(program)),
                env={"PYTHONPATH": str(ROOT)},
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
            )
        printed, err = await asyncio.wait_for(process.communicate(), patience(30))
    assert process.returncode == 0, err
    assert b"Traceback" not in err
    assert printed == words


def test_the_readme_is_read_in_one_go() -> None:
    """900 words are four minutes."""
    assert len(read(ROOT / "README.md").split()) <= 900


def test_the_code_of_the_first_page_is_seen_whole_on_the_site() -> None:
    """A window of 1280 pixels shows 84 characters; the warning that the jaw moves was cut off."""
    lines = [line for block in blocks(read(ROOT / "README.md")) for line in block.text.splitlines()]
    assert [line for line in lines if len(line) > 84] == []


def test_the_code_for_typed_projects_passes_mypy_strict(tmp_path: Path) -> None:
    files: list[str] = []
    for block in blocks(read(FIXTURES), "python"):
        files.append(f"line_{block.line}.py")
        (tmp_path / files[-1]).write_text(block.text, encoding="utf-8")
    assert files
    # What the library and pytest import themselves is a third of what mypy would read, and in no type here.
    skip = f"[mypy-{BEHIND}]\nfollow_imports = skip\nfollow_imports_for_stubs = True\n"
    (tmp_path / "mypy.ini").write_text(f"[mypy]\nstrict = True\n{skip}", encoding="utf-8")
    # Mypy keeps what it knows of files that stay as they are: pytest's take a second of a CPU.
    command = [sys.executable, "-m", "mypy", f"--cache-dir={ROOT / '.mypy_cache' / 'docs'}", *files]
    checked = subprocess.run(command, capture_output=True, text=True, check=False, cwd=tmp_path)
    assert checked.returncode == 0, checked.stdout + checked.stderr


# -- messages ------------------------------------------------------------------------------------------


def source() -> str:
    """The library's code, with strings that are split over lines put together and values left out."""
    text = "\n".join(read(file) for file in sorted((ROOT / "robotiq_async").rglob("*.py")))
    text = re.sub(r'"\s*\n\s*f?"', "", text)
    return re.sub(r"\{[^{}\n]*\}", "...", text)


def is_from(words: str, known: str) -> bool:
    """Whether the library has these words; a value may stand in one place among them."""
    blanks = [found.start() for found in re.finditer(" ", words)]
    return words in known or any(words[:at] in known and words[at + 1 :] in known for at in blanks)


def test_quoted_messages_are_the_librarys() -> None:
    known = source()
    page = read(DOCS / "how-to" / "troubleshooting.md")
    quoted = [line for block in blocks(page, "text") for line in block.text.splitlines()]
    quoted += re.findall(r"^\| `([^|]+)` \|", page, re.MULTILINE)
    pieces = [
        piece.strip(" `,:()")
        for line in quoted
        for piece in re.split(r"\.\.\.|`, `|: |tcp://192\S+|\d+", line)
    ]
    assert len(pieces) > 20
    assert [piece for piece in pieces if not is_from(piece, known)] == []


def test_a_message_the_library_does_not_have_is_recognized() -> None:
    assert is_from("a hand runs on", source())
    assert not is_from("your gripper is on fire", source())
