"""``robotiq-async monitor``: its screen driven by textual's pilot, its lines read by a program."""

from __future__ import annotations

import asyncio
import contextlib
import fcntl
import json
import os
import pty
import signal
import struct
import sys
import termios
from collections import deque
from collections.abc import AsyncIterator, Callable, Mapping
from typing import TYPE_CHECKING, Any

import pytest
from textual.pilot import Pilot
from textual.widgets import RichLog, Static

from robotiq_async import Fault, Finger, RobotiqHand, RobotiqStatus, State
from robotiq_async.actions import Operator
from robotiq_async.cli import main
from robotiq_async.cli.lines import print_objects
from robotiq_async.cli.screen import Monitor
from robotiq_async.cli.widgets import Axes, Question, position_bar, sparkline
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.cli.conftest import ROOT

if TYPE_CHECKING:
    from tests.cli.conftest import Shell

    Screen = Pilot[None]


@pytest.fixture
async def gripper() -> SimulatedGripper:
    return SimulatedGripper(speedup=20)


@pytest.fixture
async def server(gripper: SimulatedGripper) -> AsyncIterator[SimulatorServer]:
    async with SimulatorServer(gripper) as server:
        yield server


WITHOUT = """
import importlib.util, sys
find = importlib.util.find_spec
importlib.util.find_spec = lambda name, *rest: None if name == "{}" else find(name, *rest)
from robotiq_async.cli import main
sys.exit(main({}))
"""
SLOWLY = 0.05
"""The pilot waits for a moment in which the process does nothing: at 200 Hz there is none."""


@pytest.fixture
async def operator(server: SimulatorServer) -> AsyncIterator[Operator]:
    hand = RobotiqHand(server.address, poll_interval=SLOWLY)
    operator = Operator(hand)
    await hand.start(activate=False)
    yield operator
    await hand.stop()


@pytest.fixture
async def active(operator: Operator) -> Operator:
    await operator.hand.activate()
    return operator


@contextlib.asynccontextmanager
async def shown(operator: Operator, remarks: deque[str] | None = None) -> AsyncIterator[Screen]:
    async with Monitor(operator, remarks).run_test(size=(100, 30)) as pilot:
        yield pilot


async def until(pilot: Screen, condition: Callable[[], bool]) -> None:
    """Let the screen live until it is so."""
    async with asyncio.timeout(20):
        while not condition():
            await pilot.pause(0.02)


def log(pilot: Screen) -> str:
    return "\n".join(line.text for line in pilot.app.query_one("#log", RichLog).lines)


def text(pilot: Screen, where: str) -> str:
    return str(pilot.app.query_one(where, Static).render())


def axes(pilot: Screen) -> list[str]:
    return pilot.app.query_one(Axes).render().plain.split("\n")[1:]


# -- what is shown -----------------------------------------------------------------------------------------


async def test_it_shows_the_gripper_before_anything_happens(operator: Operator) -> None:
    async with shown(operator) as pilot:
        assert operator.hand.address in text(pilot, "#state")
        assert "RESET" in text(pilot, "#state")
        assert "no fault" in text(pilot, "#state")
        assert [line.split()[0] for line in axes(pilot)] == ["A", "B", "C", "SCISSOR"]
        assert "6 → 0" in axes(pilot)[0]
        await until(pilot, lambda: "reconnects 0" in text(pilot, "#link"))
        assert "speed 128  force 64" in text(pilot, "#link")
    assert not operator.has_moved


async def test_it_follows_the_axes(active: Operator, gripper: SimulatedGripper) -> None:
    gripper.place_object(Finger.A, 120)
    async with shown(active) as pilot:
        await active.hand.close()
        await until(pilot, lambda: "241 → 255 there" in axes(pilot)[1])
        assert "120 → 255 CONTACT closing" in axes(pilot)[0]
        assert set(sparkline_of(axes(pilot)[0])) & set("▅▆▇"), "390 mA while it grips"
        assert set(sparkline_of(axes(pilot)[3])) == {"▁"}


def sparkline_of(line: str) -> str:
    return line.rpartition(" mA")[0][-30:-5].strip()


async def test_a_fault_is_told_in_words_and_stays_in_the_log(
    active: Operator, gripper: SimulatedGripper
) -> None:
    async with shown(active) as pilot:
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await until(pilot, lambda: "major fault 0x0E: interference on the scissor" in text(pilot, "#state"))
        gripper.clear_faults()
        await until(pilot, lambda: "no fault" in text(pilot, "#state"))
        await until(pilot, lambda: "RUNNING_IDLE -> FAULT" in log(pilot))
        assert "SCISSOR_BLOCKED" in log(pilot)
        assert "0x00 NONE" in log(pilot)


async def test_a_lost_gripper_is_a_state_and_comes_back(active: Operator, server: SimulatorServer) -> None:
    async with shown(active) as pilot:
        server.refuse()
        server.cut()
        await until(pilot, lambda: "DISCONNECTED" in text(pilot, "#state"))
        assert "no gripper answers: what you see is" in text(pilot, "#state")
        assert all(span.style == "dim" for span in pilot.app.query_one(Axes).render().spans[-1:])
        await pilot.press("o")
        await until(pilot, lambda: "open: the link is down" in log(pilot))
        await server.accept()
        await until(pilot, lambda: "RUNNING_IDLE" in text(pilot, "#state"))
        await until(pilot, lambda: "reconnects 1" in text(pilot, "#link"))
        assert pilot.app.is_running


async def test_what_the_library_remarks_comes_into_the_log(operator: Operator) -> None:
    remarks: deque[str] = deque()
    async with shown(operator, remarks) as pilot:
        remarks.append("polling is late")
        await until(pilot, lambda: "polling is late" in log(pilot))


async def test_another_client_is_told(active: Operator, gripper: SimulatedGripper) -> None:
    async with shown(active) as pilot:
        request = list(gripper.request_registers)
        request[1] = 77
        gripper.write(0, request)
        await until(pilot, lambda: "ANOTHER CLIENT" in text(pilot, "#link"))


async def test_it_paints_a_dozen_times_a_second_and_not_at_every_poll(server: SimulatorServer) -> None:
    painted: list[object] = []

    class Counted(Axes):
        def show(self, status: RobotiqStatus, peaks_ma: Mapping[Finger, int]) -> None:
            painted.append(status)
            super().show(status, peaks_ma)

    async with RobotiqHand(server.address) as hand, shown(Operator(hand)) as pilot:
        panel = pilot.app.query_one(Axes)
        panel.__class__ = Counted
        statuses = hand.statuses(1000)
        for _ in range(200):
            await anext(statuses)
        assert 2 <= len(painted) <= 20
        assert painted[-1] is not painted[0], "the newest one"


# -- keys --------------------------------------------------------------------------------------------------


async def test_keys_open_close_and_spread(active: Operator) -> None:
    hand = active.hand
    async with shown(active) as pilot:
        for key, axis, target in (
            ("c", Finger.B, 255),
            ("o", Finger.B, 0),
            ("1", Finger.SCISSOR, 0),
            ("3", Finger.SCISSOR, 255),
            ("2", Finger.SCISSOR, 100),
        ):
            await pilot.press(key)
            await until(pilot, lambda: hand.status.requested_position(axis) == target)  # noqa: B023
        await until(pilot, lambda: "normal: SCISSOR at" in log(pilot))
    assert active.has_moved


@pytest.mark.parametrize("key", ["space", "h"])
async def test_halt_is_one_key(key: str) -> None:
    async with SimulatorServer(SimulatedGripper(speedup=4)) as slow:
        hand = RobotiqHand(slow.address, poll_interval=SLOWLY)
        operator = Operator(hand)
        async with hand, shown(operator) as pilot:
            await pilot.press("c")
            await until(pilot, lambda: hand.is_moving)
            await pilot.press(key)
            await until(pilot, lambda: "halt: every axis stands still" in log(pilot))
            assert not hand.is_moving
            await until(pilot, lambda: "close: " in log(pilot))


async def test_speed_and_force_by_keys(active: Operator) -> None:
    async with shown(active) as pilot:
        await pilot.press("plus")
        await until(pilot, lambda: "speed 144  force 64" in text(pilot, "#link"))
        await pilot.press("minus")
        await until(pilot, lambda: "speed 128  force 64" in text(pilot, "#link"))
        await pilot.press("left_square_bracket")
        await until(pilot, lambda: "speed 128  force 48" in text(pilot, "#link"))
        await pilot.press("right_square_bracket")
        await until(pilot, lambda: "speed 128  force 64" in text(pilot, "#link"))


@pytest.mark.parametrize(
    ("key", "warning"), [("r", "DROPS"), ("l", "OPEN slowly"), ("a", "MOVE"), ("v", "DROPS")]
)
@pytest.mark.parametrize("answer", ["n", "escape"])
async def test_what_is_dangerous_asks_first(
    key: str, warning: str, answer: str, active: Operator, gripper: SimulatedGripper
) -> None:
    requests = active.hand.requests()
    async with shown(active) as pilot:
        await pilot.press(key)
        await until(pilot, lambda: isinstance(pilot.app.screen, Question))
        assert warning in str(pilot.app.screen.query_one("#question", Static).render())
        await pilot.press("o", "r")  # nothing else works meanwhile
        assert isinstance(pilot.app.screen, Question)
        await pilot.press(answer)
        await until(pilot, lambda: not isinstance(pilot.app.screen, Question))
    assert requests.take_nowait() is None


async def confirmed(pilot: Screen, key: str) -> None:
    await pilot.press(key)
    await until(pilot, lambda: isinstance(pilot.app.screen, Question))
    await pilot.press("y")


async def test_a_yes_resets_and_activates(active: Operator) -> None:
    async with shown(active) as pilot:
        await confirmed(pilot, "r")
        await until(pilot, lambda: active.hand.state is State.RESET)
        await confirmed(pilot, "a")
        await until(pilot, lambda: "activate: the gripper is active" in log(pilot))


async def test_halt_works_while_a_question_is_open() -> None:
    async with SimulatorServer(SimulatedGripper(speedup=4)) as slow:
        hand = RobotiqHand(slow.address, poll_interval=SLOWLY)
        async with hand, shown(Operator(hand)) as pilot:
            await pilot.press("c")
            await until(pilot, lambda: hand.is_moving)
            await pilot.press("r")
            await until(pilot, lambda: isinstance(pilot.app.screen, Question))
            await pilot.press("space")
            await until(pilot, lambda: not hand.is_moving)
            assert isinstance(pilot.app.screen, Question)


async def test_what_is_refused_is_told(operator: Operator) -> None:
    async with shown(operator) as pilot:
        await pilot.press("c")
        await until(pilot, lambda: "close: " in log(pilot))
        assert "not activated" in log(pilot)
    assert not operator.has_moved


@pytest.mark.parametrize("key", ["q", "ctrl+c"])
async def test_quitting_in_a_motion_holds_it(key: str) -> None:
    async with SimulatorServer(SimulatedGripper(speedup=4)) as slow:
        hand = RobotiqHand(slow.address, poll_interval=SLOWLY)
        async with hand:
            async with shown(Operator(hand)) as pilot:
                await pilot.press("c")
                await until(pilot, lambda: hand.is_moving)
                await pilot.press(key)
                await until(pilot, lambda: not pilot.app.is_running)
            async with asyncio.timeout(5):
                async for status in hand.statuses():
                    if not status.is_moving:
                        break
            assert status.position(Finger.A) < 200


# -- pictures of numbers -----------------------------------------------------------------------------------


def test_the_bar() -> None:
    assert position_bar(0, 0, 10).plain == "▼·········"
    assert position_bar(255, 255, 10).plain == "█████████▼"
    assert position_bar(128, 255, 10).plain == "█████····▼"
    assert position_bar(255, 128, 10).plain.index("▼") in (4, 5)


def test_the_sparkline() -> None:
    assert sparkline([0, 500, 250], 5) == "  ▁█▄"
    assert sparkline([0, 20, 0], 3) == "▁▁▁"
    assert sparkline([0, 1000, 500, 2000], 2) == "▄█"
    assert sparkline(range(0, 1000, 10), 10) == "▁▂▃▃▄▅▅▆▇█"


# -- without a screen --------------------------------------------------------------------------------------


async def test_in_a_pipe_it_prints_every_poll_as_an_object(shell: Shell, server: SimulatorServer) -> None:
    async with RobotiqHand(server.address):
        process = await shell.start("monitor", server.address)
        objects = [json.loads(await shell.read_line(process)) for _ in range(50)]
        process.send_signal(signal.SIGINT)
        outcome = await shell.finish(process)
    assert outcome.code == 130
    assert {each["kind"] for each in objects} == {"status"}
    sequences = [each["sequence"] for each in objects]
    assert sequences == list(range(sequences[0], sequences[0] + 50))
    assert objects[0]["state"] == "RUNNING_IDLE"
    assert objects[0]["A"]["position"] == 6


async def test_objects_tell_of_faults_and_lost_links(
    shell: Shell, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    process = await shell.start("monitor", "--json", server.address)
    await shell.read_line(process)
    gripper.inject_fault(Fault.SCISSOR_BLOCKED)

    async def object_of(kind: str, **fields: object) -> dict[str, Any]:
        while True:
            found: dict[str, Any] = json.loads(await shell.read_line(process))
            if found["kind"] == kind and fields.items() <= found.items():
                return found

    assert (await object_of("fault"))["name"] == "SCISSOR_BLOCKED"
    await object_of("transition", target="FAULT")
    assert (await object_of("status", fault=14))["state"] in ("RESET", "FAULT")
    server.cut()
    await object_of("transition", target="DISCONNECTED")
    assert (await object_of("status"))["fault"] == 14, "it comes back by itself"


async def test_watch_prints_what_changes(
    shell: Shell, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    async with RobotiqHand(server.address) as hand:
        process = await shell.start("monitor", "--watch", server.address)
        assert "A=6 - B=6 - C=6" in await shell.read_line(process)
        await hand.move(100, Finger.A)
        lines = []
        while "A=100 AT_POSITION" not in (line := await shell.read_line(process)):
            lines.append(line)
        assert all(" status   A=" in line for line in lines)
        gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
        told = {(await shell.read_line(process))[13:].split()[0] for _ in range(2)}
        assert told == {"state", "fault"}
        process.send_signal(signal.SIGTERM)
        assert (await shell.finish(process)).code == 143


async def test_it_only_looks(shell: Shell, server: SimulatorServer, gripper: SimulatedGripper) -> None:
    before = gripper.request_registers
    process = await shell.start("monitor", "--watch", server.address)
    await shell.read_line(process)
    process.send_signal(signal.SIGINT)
    await shell.finish(process)
    assert gripper.request_registers == before


async def test_a_reader_that_stops_reading_does_not_hold_up_the_polling(
    server: SimulatorServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full pipe: the gripper is read on, and the reader is told what it has missed."""
    reading, writing = os.pipe()
    hand = RobotiqHand(server.address, poll_interval=0.002)
    await hand.start(activate=False)
    with os.fdopen(writing, "w") as full, os.fdopen(reading) as reader:
        monkeypatch.setattr(sys, "stdout", full)
        printing = asyncio.create_task(print_objects(hand, buffer=50))
        async with asyncio.timeout(20):
            async for status in hand.statuses():
                if status.sequence > 1000:  # half a megabyte, and a pipe holds 64 KiB
                    break

        def read_until_missed() -> list[dict[str, Any]]:
            objects = []
            for line in reader:
                objects.append(json.loads(line))
                if objects[-1]["kind"] == "missed":
                    break
            return objects

        objects = await asyncio.to_thread(read_until_missed)
        printing.cancel()
        await asyncio.gather(printing, return_exceptions=True)
        await asyncio.to_thread(reader.readline)
    await hand.stop()
    assert objects[-1]["count"] > 100
    assert len(objects) < 500


def test_wrong_usage(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["monitor", "--watch", "--json"]) == 2
    assert "exclude" in capsys.readouterr().err


async def test_nobody_there_is_one_line(shell: Shell) -> None:
    (await shell.run("monitor", "tcp://127.0.0.1:1")).assert_failed(1, "127.0.0.1:1")


# -- on a terminal -----------------------------------------------------------------------------------------


class Terminal:
    """Python on a terminal of its own (Linux, macOS)."""

    def __init__(self, *arguments: str) -> None:
        self.out = b""
        self._process, self._fd = pty.fork()
        if self._process == 0:
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
            os.environ |= {"TERM": "xterm-256color", "PYTHONPATH": str(ROOT)}
            os.execv(sys.executable, [sys.executable, *arguments])
        asyncio.get_running_loop().add_reader(self._fd, self._read)
        self._read_something = asyncio.Event()

    def _read(self) -> None:
        try:
            self.out += os.read(self._fd, 65536)
        except OSError:  # the command has ended
            asyncio.get_running_loop().remove_reader(self._fd)
        self._read_something.set()

    async def shows(self, words: bytes) -> None:
        async with asyncio.timeout(30):
            while words not in self.out:
                self._read_something.clear()
                await self._read_something.wait()

    def press(self, keys: str) -> None:
        os.write(self._fd, keys.encode())

    def kill(self, number: signal.Signals) -> None:
        os.kill(self._process, number)

    def hang_up(self) -> None:
        asyncio.get_running_loop().remove_reader(self._fd)
        os.close(self._fd)

    async def end(self) -> int:
        async with asyncio.timeout(30):
            _, status = await asyncio.to_thread(os.waitpid, self._process, 0)
        return os.waitstatus_to_exitcode(status)


async def told_to_go(gripper: SimulatedGripper) -> None:
    """Wait for a command of another process."""
    async with asyncio.timeout(20):
        while not gripper.request_registers[0] & 0x0800:  # noqa: ASYNC110
            await asyncio.sleep(0.01)


async def test_quitting_without_having_moved_leaves_the_fingers_alone(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    async with RobotiqHand(server.address) as hand:
        await hand.move(100)
        before = gripper.request_registers
        terminal = Terminal("-m", "robotiq_async", "monitor", server.address)
        await terminal.shows(b"RUNNING_IDLE")
        terminal.press("q")
        await terminal.shows(b"The fingers were left as they are")
        assert await terminal.end() == 0
        assert gripper.request_registers == before


@pytest.mark.parametrize(("number", "code"), [(signal.SIGTERM, 143), (signal.SIGINT, 130)])
async def test_a_signal_stops_what_was_moved(number: signal.Signals, code: int) -> None:
    gripper = SimulatedGripper(speedup=4)
    async with SimulatorServer(gripper) as server:
        async with RobotiqHand(server.address):
            pass
        terminal = Terminal("-m", "robotiq_async", "monitor", server.address)
        await terminal.shows(b"RUNNING_IDLE")
        terminal.press("c")
        await told_to_go(gripper)
        terminal.kill(number)
        await terminal.shows(b"The fingers were stopped")
        assert await terminal.end() == code
        assert b"Traceback" not in terminal.out
        assert not gripper.request_registers[0] & 0x0800


async def test_a_terminal_that_is_closed_stops_what_was_moved() -> None:
    gripper = SimulatedGripper(speedup=4)
    async with SimulatorServer(gripper) as server:
        async with RobotiqHand(server.address):
            pass
        terminal = Terminal("-m", "robotiq_async", "monitor", server.address)
        await terminal.shows(b"RUNNING_IDLE")
        terminal.press("c")
        await told_to_go(gripper)
        terminal.hang_up()
        await terminal.end()
        assert not gripper.request_registers[0] & 0x0800


async def test_without_textual_one_line_names_the_extra_and_another_way() -> None:
    terminal = Terminal("-c", WITHOUT.format("textual", ["monitor"]))
    await terminal.shows(b"pip install 'robotiq-async[monitor]', or pass --watch")
    assert await terminal.end() == 1
