"""``robotiq-async web``, and the demo with its own page."""

# ruff: noqa: E402  # what follows needs(...) cannot be imported without the extra

from __future__ import annotations

import asyncio
import http.client
import os
import signal
import sys
import threading
import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING
from urllib.parse import urlsplit
from urllib.request import url2pathname

import pytest

from robotiq_async import Finger, NotStartedError, RobotiqHand, State
from robotiq_async.cli.browser import opened
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.tools.actions import Operator
from tests.extras import needs

needs("nicegui", "the page needs the extra web")

from robotiq_async.cli.commands.web import AGAIN_S, _leave_all, _try_again
from robotiq_async.tools.web.server import PageServer
from robotiq_async.tools.web.settings import PageSettings
from tests.cli.conftest import Outcome
from tests.grippers import until
from tests.patience import patience

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell


SETTINGS = PageSettings(control=True, addresses=("one", "two"))


def status(url: str) -> int:
    """The page's answer to a browser with this address."""
    parts = urlsplit(url)
    connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=patience(20))
    try:
        connection.request("GET", f"{parts.path}?{parts.query}")
        return connection.getresponse().status
    finally:
        connection.close()


async def test_it_prints_where_to_look_and_leaves_the_fingers_alone(
    shell: Shell, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    async with RobotiqHand(server.address) as hand:
        await hand.move(50)
        before = gripper.request_registers
        nobody = "tcp://127.0.0.1:1"
        process = await shell.start("web", "--port", "0", "--control", server.address, nobody)
        url = await shell.read_line(process)  # of several grippers one may be missing
        assert url.startswith("http://127.0.0.1:")
        assert await asyncio.to_thread(status, url) == 303
        assert await asyncio.to_thread(status, url[:-1]) == 403
        process.send_signal(signal.SIGINT)
        outcome = await shell.finish(process)
        assert (outcome.code, outcome.out) == (0, "")
        assert "The fingers were left as they are: no command from here moved them." in outcome.err
        assert gripper.request_registers == before


PATHS = """
import os, sys
os.environ["PYTHONPATH"] = {!r}
from robotiq_async.cli import main
sys.exit(main(["web", "--port", "0", {!r}]))
"""
UVICORN = """
import os
open({!r}, "w").close()
while os.read(0, 65536):
    pass
raise SystemExit
"""
"""A web server that takes long to start: it ends when its pipe does, before it has served a page."""


@pytest.mark.skipif(os.name != "posix", reason="Windows has no SIGTERM for another process")
async def test_sigterm_ends_it_as_ctrl_c_does(shell: Shell, server: SimulatorServer, tmp_path: Path) -> None:
    (tmp_path / "uvicorn.py").write_text(UVICORN.format(str(tmp_path / "imported")))
    process = await shell.forked("-c", PATHS.format(str(tmp_path), server.address))
    await until((tmp_path / "imported").exists, within=30)
    process.send_signal(signal.SIGTERM)
    assert await shell.finish(process) == Outcome(0, "", "")


@pytest.mark.parametrize(
    ("arguments", "code", "words"),
    [
        (["tcp://127.0.0.1:1", "tcp://127.0.0.1:2"], 1, "127.0.0.1:2"),
        (["tcp://127.0.0.1:1", "127.0.0.1:1"], 2, "is given twice"),
        (["gripper:x"], 2, "gripper:x"),
        (["--port", "70000"], 2, "0..65535"),
        (["--host", "192.0.2.1"], 2, "lets others in: that needs a password or a certificate"),
        (["--password-file", "/nowhere/file"], 1, "/nowhere/file: No such file"),
        (["--certificate", "/nowhere/file"], 1, "/nowhere/file: No such file"),
        (["--certificate", __file__], 2, "needs its key"),
        (["--certificate", __file__, "--key", __file__], 1, "test_web.py"),
        (["--host", "192.0.2.1", "--password-file", "PASSWORD"], 1, "192.0.2.1:"),
        (["--password-file", "SHORT"], 2, "8 characters or more"),
    ],
)
def test_bad_input_is_one_clear_line(
    call: Call, tmp_path: Path, arguments: list[str], code: int, words: str
) -> None:
    (tmp_path / "PASSWORD").write_text("correct horse\n")
    (tmp_path / "SHORT").write_text("horse\n")
    named = [str(tmp_path / each) if each.isupper() else each for each in arguments]
    port = [] if "--port" in named else ["--port", "0"]  # of others that are tested at this moment
    outcome = call("web", *named, *port)
    assert outcome.code == code
    assert words in outcome.err
    assert "Traceback" not in outcome.err
    assert outcome.err.count("\n") == 1


async def test_the_demo_waits_until_the_page_is_opened(shell: Shell) -> None:
    process = await shell.start("demo", "--show")
    while not (line := await shell.read_line(process)).startswith("Watch it move: "):
        assert line, "the demo ended before it named the page"
    url = line.partition(": ")[2].strip()
    assert await asyncio.to_thread(status, url) == 303
    process.send_signal(signal.SIGINT)
    outcome = await shell.finish(process)
    assert outcome.code == 130
    assert "Traceback" not in outcome.err


@pytest.fixture
def screen(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Path:
    """A screen, and a user's home folder."""
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setenv("HOME", str(tmp_path))
    return tmp_path


@pytest.mark.skipif(os.name != "posix", reason="a file's mode says who may read it")
async def test_the_token_is_not_among_the_arguments_of_a_browser(screen: Path) -> None:
    """Every user of a machine can read those."""
    asked: list[tuple[str, int, str]] = []

    def opener(address: str) -> bool:
        file = Path(url2pathname(urlsplit(address).path))
        asked.append((address, file.stat().st_mode & 0o777, file.read_text()))
        return True

    async with opened("http://127.0.0.1:1/?token=secret&x=1", opener) as is_opened:
        assert is_opened
    [(address, mode, text)] = asked
    assert "secret" not in address
    assert (mode, "url=http://127.0.0.1:1/?token=secret&amp;x=1" in text) == (0o600, True)
    assert os.listdir(screen) == [], "it is removed in the end"


@pytest.mark.virtual_time
async def test_a_browser_that_is_busy_until_it_is_closed_holds_up_nothing(screen: Path) -> None:
    closed = threading.Event()
    async with opened("http://127.0.0.1:1/", lambda _: closed.wait(20)) as is_opened:
        assert is_opened
        closed.set()


async def test_where_no_browser_can_be_opened_it_says_so(
    screen: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def broken(_: str) -> bool:
        raise webbrowser.Error("could not locate runnable browser")

    for opener in (lambda _: False, broken):
        async with opened("http://127.0.0.1:1/", opener) as is_opened:
            assert not is_opened
    monkeypatch.setenv("HOME", str(screen / "nowhere"))
    async with opened("http://127.0.0.1:1/", pytest.fail) as is_opened:
        assert not is_opened
    if sys.platform.startswith("linux"):
        monkeypatch.setenv("HOME", str(screen))
        monkeypatch.delenv("DISPLAY")
        monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
        async with opened("http://127.0.0.1:1/", pytest.fail) as is_opened:
            assert not is_opened


@pytest.mark.virtual_time
async def test_all_hands_are_stopped_at_once(server: SimulatorServer, gripper: SimulatedGripper) -> None:
    """One after the other, those whose turn came late moved on for 2 s for each dead link before them."""
    operators = []
    async with SimulatorServer(SimulatedGripper(asyncio.get_running_loop().time, speedup=20)) as dead:
        for address in (dead.address, server.address):
            operators.append(Operator(RobotiqHand(address)))
            await operators[-1].hand.start()
            await operators[-1].move(10, Finger.A)
        moving = asyncio.create_task(operators[1].move(255, Finger.A, speed=0))
        await operators[1].hand.wait_for_state(State.RUNNING_CC)
        await operators[1].hand.wait_for_state(State.RUNNING_IDLE)
        await dead.fault_injector.begin(Trouble("drop"))
        page = PageServer([each.hand for each in operators], SETTINGS, operators=operators)
        leaving = asyncio.create_task(_leave_all(operators, page))
        await operators[1].hand.wait_for_state(State.SHUTDOWN)
        assert not leaving.done()
        assert not gripper.is_moving
        await leaving
        await asyncio.wait({moving})
        assert isinstance(moving.exception(), NotStartedError)


@pytest.mark.virtual_time
async def test_a_hand_that_can_be_reached_again_is_not_started_once_the_page_ends(
    server: SimulatorServer,
) -> None:
    """It was reached while the others were stopped, and left running."""
    async with SimulatorServer(SimulatedGripper(asyncio.get_running_loop().time, speedup=20)) as dead:
        operators = [Operator(RobotiqHand(each.address)) for each in (dead, server)]
        await operators[0].hand.start()
        await operators[0].move(10, Finger.A)
        page = PageServer([each.hand for each in operators], SETTINGS, operators=operators)
        page.updates[1].problem = "no answer"
        trying = asyncio.create_task(_try_again(page, 1, operators[1]))
        await asyncio.sleep(AGAIN_S - 0.5)
        dead.policy = lambda _: []
        leaving = asyncio.create_task(_leave_all(operators, page))
        await trying
        assert not leaving.done()
        await leaving
        assert [each.hand.state for each in operators] == [State.SHUTDOWN, State.DISCONNECTED]
