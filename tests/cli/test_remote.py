"""Every command on a gripper of another host: an agent in a process of its own, and zenoh between."""

from __future__ import annotations

import asyncio
import json
import os
import signal
import time
from asyncio.subprocess import Process
from collections.abc import AsyncIterator, Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from robotiq_async import Finger, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.cli.conftest import PATIENCE, Beside, Call, Shell
from tests.cli.terminal import Terminal

pytest.importorskip("zenoh")
import zenoh

from robotiq_async.cli.commands.fleet import _print_row
from robotiq_async.cli.keys.issuing import issue, make_authority
from robotiq_async.fleet.fleet import Member
from robotiq_async.fleet.keys.access import Role
from robotiq_async.fleet.network.configuration import session_configuration
from robotiq_async.fleet.wire.names import GripperName
from tests.fleet.sessions import free_port
from tests.grippers import until
from tests.patience import patience

ADDRESS = "zenoh://lab/cell/left"


def free_endpoint() -> str:
    return f"tcp/127.0.0.1:{free_port()}"


@pytest.fixture
def endpoint(monkeypatch: pytest.MonkeyPatch) -> str:
    """The endpoint of the agent; the commands find it in their environment."""
    endpoint = free_endpoint()
    monkeypatch.setitem(os.environ, "ROBOTIQ_ASYNC_CONNECT", endpoint)
    return endpoint


class Brake:
    """A gripper's time: it can be slowed down, for commands take a while to start on a busy machine."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._since, self._before, self._rate = self._loop.time(), 0.0, 1.0

    def __call__(self) -> float:
        return self._before + self._rate * (self._loop.time() - self._since)

    def slow_down(self) -> None:
        self._before, self._since, self._rate = self(), self._loop.time(), 0.01


@dataclass
class Served:
    """A gripper, and where it is."""

    gripper: SimulatedGripper
    address: str
    brake: Brake

    async def moves(self) -> None:
        """Wait until finger A is on its way, and let it take long."""
        await until(lambda: self.gripper.position(Finger.A) >= 20)
        self.brake.slow_down()


@pytest.fixture
async def gripper() -> AsyncIterator[Served]:
    brake = Brake()
    async with SimulatorServer(SimulatedGripper(brake, speedup=20, spread=False)) as server:
        yield Served(server.gripper, server.address, brake)


def fleet_file(folder: Path, endpoint: str, gripper: str, way: str = "listen") -> Path:
    file = folder / f"{way}.toml"
    file.write_text(
        f'site = "lab"\nhost = "cell"\n{way} = ["{endpoint}"]\n[grippers.left]\naddress = "{gripper}"\n'
    )
    return file


@pytest.fixture
def serving(
    beside: Callable[..., Beside], endpoint: str, there: SimulatorServer, tmp_path: Path
) -> Callable[..., Beside]:
    """Starts an agent of a gripper, that of the fixture unless another one is named."""
    return lambda gripper=there.address: beside("agent", str(fleet_file(tmp_path, endpoint, gripper)))


@pytest.fixture
async def agent(shell: Shell, endpoint: str, gripper: Served, tmp_path: Path) -> Process:
    process = await shell.start("agent", str(fleet_file(tmp_path, endpoint, gripper.address)))
    assert await shell.read_line(process) == ADDRESS
    return process


def test_status_move_and_the_demo(call: Call, serving: Callable[..., Beside]) -> None:
    agent = serving()
    assert agent.read_line() == ADDRESS
    call("move", "100", "--yes", "--fingers", "A", "--speed", "255", ADDRESS).assert_succeeded()
    outcome = call("status", "--json", ADDRESS)
    outcome.assert_succeeded()
    assert abs(json.loads(outcome.out)["A"]["position"] - 100) <= 2
    outcome = call("demo", "--yes", ADDRESS)
    outcome.assert_succeeded()
    assert f"async with RemoteHand('{ADDRESS}') as hand:" in outcome.out
    agent.finish(signal.SIGINT).assert_succeeded()


def test_an_agent_says_which_gripper_is_simulated(serving: Callable[..., Beside]) -> None:
    agent = serving("sim://")
    assert agent.read_line() == ADDRESS
    assert agent.read_error() == "robotiq-async: left: Simulated gripper sim://"
    agent.finish(signal.SIGINT).assert_succeeded()


def test_the_log_of_an_agent_calls_each_gripper_by_its_name(
    serving: Callable[..., Beside], refusing: str
) -> None:
    agent = serving(f"tcp://{refusing}")
    assert agent.read_error().startswith(f"robotiq-async: left: cannot connect to tcp://{refusing}: ")
    agent.finish(signal.SIGINT)


def test_an_agent_serves_although_its_output_is_not_read(call: Call, serving: Callable[..., Beside]) -> None:
    """``robotiq-async agent FLEET.toml | true``: it ended, and stopped the fingers."""
    process = serving().process
    assert process.stdout is not None
    assert process.stderr is not None
    process.stdout.close()
    ends = time.monotonic() + patience(PATIENCE)
    while call("status", ADDRESS).code and time.monotonic() < ends:
        assert process.poll() is None
    process.send_signal(signal.SIGTERM)
    assert process.wait(patience(PATIENCE)) == 0
    assert "Error" not in process.stderr.read()


def test_a_move_asks_first(call: Call, endpoint: str) -> None:
    # No agent is there: a command that connects ends with 1.
    call("move", "100", ADDRESS).assert_failed(2, "this moves the gripper at zenoh://lab/cell/left")


async def test_monitor_and_record(shell: Shell, agent: Process, tmp_path: Path) -> None:
    watching = await shell.start("monitor", "--json", ADDRESS)
    assert "state" in await shell.read_line(watching)
    recording = await shell.start("record", str(tmp_path / "a.mcap"), ADDRESS)
    assert ADDRESS in await shell.read_line(recording)
    assert "Recording in" in await shell.read_line(recording)
    (await shell.run("move", "60", "--yes", ADDRESS)).assert_succeeded()
    for process in (watching, recording):
        process.send_signal(signal.SIGINT)
        (await shell.finish(process)).assert_succeeded()
    assert (tmp_path / "a.mcap").stat().st_size > 1000


def test_nothing_answers(call: Call, endpoint: str) -> None:
    call("status", ADDRESS).assert_failed(1, "cannot connect to zenoh://lab/cell/left")


async def test_a_list_and_a_halt(shell: Shell, agent: Process, gripper: Served) -> None:
    listed = await shell.run("fleet", "--json")
    listed.assert_succeeded()
    row = json.loads(listed.out)
    assert (row["address"], row["model"], row["fault"]) == (ADDRESS, "3f", "NONE")
    moving = await shell.start("move", "255", "--yes", "--speed", "0", ADDRESS)
    await gripper.moves()
    halted = await shell.run("fleet", "halt", "lab")
    halted.assert_succeeded()
    assert halted.out == f"{ADDRESS}  stopped\n"
    (await shell.finish(moving)).assert_failed(1, "halted")
    assert not gripper.gripper.is_moving
    refused = await shell.run("move", "255", "--yes", ADDRESS)
    refused.assert_failed(1, "motion is inhibited: fleet halt")
    (await shell.run("fleet", "permit", ADDRESS)).assert_failed(2, "--yes")
    permitted = await shell.run("fleet", "permit", "--yes", ADDRESS)
    permitted.assert_succeeded()
    assert permitted.out.startswith(f"{ADDRESS}  permitted; motion is inhibited: fleet halt")


def test_a_list_has_a_gripper_of_a_model_that_is_unknown_here(capsys: pytest.CaptureFixture[str]) -> None:
    _print_row(Member(GripperName.parse(ADDRESS), True, 1, State.FAULT, "5f"))
    name, state, fault, _, _, *words = capsys.readouterr().out.split()
    assert (name, state, fault) == (ADDRESS, "FAULT", "?")
    assert " ".join(words) == "the model '5f' is unknown here: update robotiq_async"


async def test_a_yes_permits_the_gripper_and_the_halt_that_the_question_shows(
    shell: Shell, agent: Process
) -> None:
    """One gripper after another: the first was permitted, by the halt of then, once all were answered."""
    (await shell.run("fleet", "halt", "lab")).assert_succeeded()
    asking = Terminal("-m", "robotiq_async", "fleet", "permit", ADDRESS, ADDRESS)
    await asking.shows(b"motion is inhibited: fleet halt")
    await asking.shows(b"Continue? [y/N]")
    (await shell.run("fleet", "halt", "lab")).assert_succeeded()
    asking.press("y\n")
    await asking.shows(b"not permitted, as a halt came after the one that was seen")
    await asking.shows(b", 2 halts")
    asking.press("n\n")
    assert await asking.end() == 1
    assert b"motion is not permitted: 2 of 2" in asking.out
    (await shell.run("move", "9", "--yes", ADDRESS)).assert_failed(1, "motion is inhibited")
    again = Terminal("-m", "robotiq_async", "fleet", "permit", ADDRESS, ADDRESS)
    await again.shows(b"Continue? [y/N]")
    again.press("y\n")
    assert await again.end() == 0
    assert b"permitted; motion is inhibited: fleet halt" in again.out
    assert b"was not inhibited" in again.out
    (await shell.run("move", "9", "--yes", ADDRESS)).assert_succeeded()


def test_a_halt_that_reaches_no_gripper_fails(call: Call, endpoint: str) -> None:
    call("fleet", "halt").assert_failed(1, "nothing was stopped", f"not reached: {endpoint}")


async def test_an_agent_that_gets_sigterm_stops_the_fingers(
    shell: Shell, agent: Process, gripper: Served
) -> None:
    moving = await shell.start("move", "255", "--yes", "--speed", "0", ADDRESS)
    await gripper.moves()
    agent.send_signal(signal.SIGTERM)
    (await shell.finish(agent)).assert_succeeded()
    assert not gripper.gripper.is_moving
    assert (await shell.finish(moving)).code == 1


@pytest.fixture
def router(endpoint: str) -> Iterator[zenoh.Session]:
    """A router at the endpoint, in this process."""
    configuration = session_configuration([endpoint], []) | {"mode": "router"}
    with zenoh.open(zenoh.Config.from_json5(json.dumps(configuration))) as session:
        yield session


def test_a_second_agent_is_refused(
    call: Call,
    beside: Callable[..., Beside],
    there: SimulatorServer,
    endpoint: str,
    router: zenoh.Session,
    tmp_path: Path,
) -> None:
    """It hears of the first one from the router, which knows it by then, however slow the first one is."""
    file = str(fleet_file(tmp_path, endpoint, there.address, "connect"))
    assert beside("agent", file).read_line() == ADDRESS
    by = time.monotonic() + patience(PATIENCE)
    while not list(router.liveliness().get("robotiq/v1/lab/cell/left/alive/*", timeout=1.0)):
        assert time.monotonic() < by, "the router has not heard of the first agent"
    call("agent", file).assert_failed(1, f"another agent serves {ADDRESS}")


def test_an_agent_that_waits_for_its_router_says_so_and_can_be_ended(
    beside: Callable[..., Beside], tmp_path: Path
) -> None:
    file, router = tmp_path / "FLEET.toml", free_endpoint()
    file.write_text(f'site = "lab"\nconnect = ["{router}"]\n[grippers.left]\naddress = "sim://"\n')
    agent = beside("agent", str(file))
    assert agent.read_error() == f"robotiq-async: {router} is not there yet: waiting"
    assert agent.finish(signal.SIGTERM).code == 0


def test_an_agent_that_does_not_trust_its_router_says_that_nobody_comes_through(
    beside: Callable[..., Beside], tmp_path: Path
) -> None:
    file = tmp_path / "FLEET.toml"
    make_authority(tmp_path)
    keys, router = issue(tmp_path, "cell", Role.AGENT), free_endpoint().replace("tcp/", "tls/")
    text = f'site = "lab"\nkeys = "{keys.name}"\nconnect = ["{router}"]\n[grippers]\nleft = {{address = "sim://"}}\n'
    for trust, words in (("", "no trusts_router"), ("trusts_router = true\n", "not there yet: waiting")):
        file.write_text(trust + text)
        agent = beside("agent", str(file))
        assert words in agent.read_error()
        assert agent.finish(signal.SIGTERM).code == 0


def test_a_file_is_checked(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "FLEET.toml"
    file.write_text('site = "lab"\nhost = "cell"\n[grippers.left]\naddress = "tcp://192.168.1.11"\n')
    outcome = call("agent", "--check", str(file))
    outcome.assert_succeeded()
    assert outcome.out.split() == [ADDRESS, "tcp://192.168.1.11"]
    file.write_text('site = "lab"\n[grippers.left]\nadress = "tcp://192.168.1.11"\n')
    call("agent", "--check", str(file)).assert_failed(2, "adress", "address", "line 3")


@pytest.mark.parametrize("command", [("fleet", "halt"), ("fleet",), ("status", ADDRESS)])
def test_a_route_that_cannot_be_meant_is_one_line(
    call: Call, monkeypatch: pytest.MonkeyPatch, command: tuple[str, ...]
) -> None:
    monkeypatch.setitem(os.environ, "ROBOTIQ_ASYNC_CONNECT", "tcp/192.168.1.1:7447")
    call(*command).assert_failed(2, "tcp/192.168.1.1:7447", "insecure")
