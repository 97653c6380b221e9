"""The core, the blocking hand and the command line in a process without what Windows has not."""

from __future__ import annotations

import asyncio
import os
import sys
from pathlib import Path

import pytest

from robotiq_async import Finger
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.forked import ROOT, forking
from tests.patience import patience
from tests.windows import THEIRS

BEGIN = "import sys\nfrom tests.windows import Winmm, become\nbecome(coarse={})\n"
ENVIRONMENT = {
    "PYTHONPATH": str(ROOT),
    "PYTHONWARNDEFAULTENCODING": "1",
    # The one for Windows wants a console of it.
    "TEXTUAL_DRIVER": "textual.drivers.headless_driver:HeadlessDriver",
}

if sys.platform == "win32":
    pytest.skip("the core's own tests run there", allow_module_level=True)


async def on_windows(program: str, *arguments: str, coarse: bool = False) -> str:
    """The output of a program there; it must end well, and complain of nothing but late polls."""
    with forking(THEIRS, ENVIRONMENT):
        process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-c", BEGIN.format(coarse) + program, *arguments),
            cwd=ROOT,
            env=os.environ | ENVIRONMENT,
            stdin=asyncio.subprocess.DEVNULL,
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
    try:
        async with asyncio.timeout(patience(30)):
            out, err = (each.decode() for each in await process.communicate())
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    assert process.returncode == 0, out + err
    assert "Traceback" not in err
    return out


LACKS = """
import asyncio, importlib, os, select, signal, socket, time
from tests.windows import LOOP, MODULES, NAMES

def fails(error, call, *arguments):
    try:
        call(*arguments)
    except error:
        return
    raise AssertionError(f"{call}{arguments} does not raise {error}")

assert sys.platform == "win32"
for module in MODULES:
    fails(ImportError, importlib.import_module, module)
assert not [name for module, names in NAMES.items() for name in names.split() if hasattr(module, name)]

async def main():
    for name in LOOP.split():
        fails(NotImplementedError, getattr(asyncio.get_running_loop(), name), 1, *[print][: "add" in name])

asyncio.run(main())
fails(EncodingWarning, exec, "open('README.md')", {"__name__": "robotiq_async"})
"""
ALL_OF_IT = """
import importlib, pkgutil, robotiq_async
from robotiq_async.cli.tui.screen import DRIVER

assert DRIVER is None, "textual chooses its driver for Windows"
rooms = "values control link session hand runtime simulator sync cli".split()
apart = ("robotiq_async.cli.tui.nonblocking_driver",)  # that of the other systems
count = 0
for found in pkgutil.walk_packages(robotiq_async.__path__, "robotiq_async."):
    if found.name.split(".")[1] in rooms and found.name not in apart and "mechanics" not in found.name:
        importlib.import_module(found.name)
        count += 1
assert count > 140, count
"""


async def test_the_process_lacks_what_windows_lacks_and_all_can_be_imported_there() -> None:
    """All of the core and the command line."""
    await on_windows(LACKS + ALL_OF_IT)


A_HAND = """
import asyncio
from robotiq_async import Finger, RobotiqHand, State

async def main(address):
    assert Winmm.periods == 0
    async with RobotiqHand(address) as hand, RobotiqHand("sim://?speedup=20") as simulated:
        assert Winmm.periods == 1, "one timer for all hands of a loop"
        assert hand.statistics.tick == "loop timer"
        result = await hand.move(100)
        assert all(abs(position - 100) <= 2 for position in result.positions.values())
        assert (await hand.close()).contacts == Finger.ABC
        await hand.halt()
        await hand.open()
        await asyncio.gather(hand.close(), simulated.close())
        await hand.recover()
    assert (Winmm.periods, Winmm.asked) == (0, 1)
    assert hand.state is State.SHUTDOWN

asyncio.run(main(sys.argv[1]))
"""
A_BLOCKING_HAND = """
from robotiq_async.sync import RobotiqHand as BlockingHand

with BlockingHand(sys.argv[1]) as hand:
    assert abs(hand.move(50).positions[Finger.A] - 50) <= 2
    assert hand.close().contacts == Finger.ABC
    for status in hand.statuses():
        if status.position(Finger.A) > 100:
            break
    hand.open()
assert Winmm.periods == 0
"""
A_SILENCE = """
import time
from robotiq_async.link.serial.silence import Silence

async def keep_silent():
    looks, silence, clock = 0, Silence(0.0001), time.monotonic

    def counted():
        nonlocal looks
        looks += 1
        return clock()

    time.monotonic = counted
    for _ in range(5):
        silence.heard = counted()
        await silence.keep(time.monotonic)
    assert looks < 200, f"looking at such a clock until it has moved holds up the loop for 15 ms: {looks}"

asyncio.run(keep_silent())
"""
"""A frame waits in the loop where the clock cannot tell how long."""


@pytest.mark.parametrize("coarse", [False, True], ids=["fine clock", "coarse clock"])
async def test_hands_move_and_their_loop_waits_finely_while_they_poll(*, coarse: bool) -> None:
    """One process for all that a coarse clock could spoil: what it imports takes longer."""
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        server.gripper.place_object(Finger.ABC, 150)
        program = A_HAND + A_BLOCKING_HAND + A_SILENCE if coarse else A_HAND
        await on_windows(program, server.address, coarse=coarse)


COMMANDS = """
import io, signal, threading
from robotiq_async.cli import main

address, folder = sys.argv[1:]

def run(*arguments, code=0):
    found = main(arguments)
    assert found == code, f"{arguments} ends with {found}, and not with {code}"

def answered(answer, *arguments, code):
    streams = sys.stdin, sys.stdout
    for name in ("stdin", "stdout"):
        setattr(sys, name, io.TextIOWrapper(io.BytesIO(answer), encoding="utf-8"))
        getattr(sys, name).isatty = lambda: True
    run(*arguments, code=code)
    sys.stdin, sys.stdout = streams

def interrupted(*arguments, by=signal.SIGINT):
    threading.Timer(1.0, signal.raise_signal, [by]).start()
    run(*arguments)

run("--help")
run("status", address)
run("status", "--json", address)
run("move", "200", address, code=2)  # nobody to ask
answered(b"n\\r\\n", "move", "200", address, code=1)
answered(b"y\\r\\n", "move", "200", address, code=0)
run("status", "127.0.0.1:9", code=1)

run("ports")
run("doctor", address)
run("verify", address, code=2)  # nobody to ask
interrupted("monitor", "--watch", address)
interrupted("simulate", "--port", "0", by=signal.SIGBREAK)

file, table = f"{folder}/grasp.mcap", f"{folder}/grasp.csv"
run("record", file, "--seconds", "0.5", address)
run("replay", file)
run("export", file, table, "--convention", "COUNTS")
assert b"\\r" not in open(table, "rb").read()
interrupted("record", f"{folder}/second.mcap", address)
"""


async def test_the_commands_run(tmp_path: Path) -> None:
    """One process for all of them: what it imports takes longer than they do."""
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        await on_windows(COMMANDS, server.address, str(tmp_path))


async def test_the_monitor_is_driven_by_keys() -> None:
    program = """
import asyncio
from robotiq_async import Finger, RobotiqHand
from robotiq_async.cli.tui.screen import Monitor
from robotiq_async.tools.actions import Operator

async def main(address):
    # The pilot waits for a moment in which nothing happens: at 200 Hz there is none.
    operator = Operator(RobotiqHand(address, poll_interval=0.05))
    await operator.hand.start(activate=False)
    async with Monitor(operator).run_test(size=(100, 30)) as pilot:
        await pilot.press("a")
        while not operator.hand.is_activated:
            await pilot.press("y")  # one that comes too early does not count
            await pilot.pause(0.05)
        while operator.hand.status.position(Finger.A) < 200:
            await pilot.press("c")  # neither does this before the answer to the activation
            await pilot.pause(0.05)
        await pilot.press("space", "q")
    await operator.leave()

asyncio.run(main(sys.argv[1]))
"""
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        await on_windows(program, server.address)
