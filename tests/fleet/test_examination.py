"""Each ailment of a connection to an agent is found, and reported with its remedy."""

from __future__ import annotations

import asyncio
import json
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from robotiq_async import Finger, State
from robotiq_async.cli.keys.issuing import issue, make_authority
from robotiq_async.fleet.keys.access import Role
from robotiq_async.fleet.network.bus import Query, Urgency
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentAnswer
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.local.robotiq_hand import RobotiqHand
from robotiq_async.simulator import SimulatorServer
from robotiq_async.tools.doctor import Finding, Level, examine_remote
from robotiq_async.tools.doctor.findings import GiveUpError
from robotiq_async.tools.doctor.fleet import examine_keys
from robotiq_async.values.model import TWO_FINGER_85
from tests.fleet.lab import LEFT, Lab, lab
from tests.fleet.network import MemoryBus, Network
from tests.fleet.sessions import line
from tests.virtual import inside, until, virtual

HEALTHY = [
    "address",
    "agent",
    "access",
    "version",
    "round trip",
    "statuses",
    "gripper",
    "activation",
    "fault",
    "commanded by",
]


async def findings(address: str, bus: MemoryBus | None = None) -> dict[str, Finding]:
    found: list[Finding] = []
    await examine_remote(address, found.append, bus=bus)
    assert all(finding.advice for finding in found if finding.level is not Level.GOOD)
    return {finding.what: finding for finding in found}


def levels(found: dict[str, Finding]) -> set[Level]:
    return {finding.level for finding in found.values()}


async def examined(here: Lab) -> dict[str, Finding]:
    return await findings(str(LEFT), here.network.bus("doctor"))


# -- an agent and a gripper --------------------------------------------------------------------------------


@inside(lab)
async def test_a_healthy_one(here: Lab) -> None:
    writes = len(here.gripper.writes)
    found = await examined(here)
    assert len(here.gripper.writes) == writes
    assert list(found) == HEALTHY
    assert levels(found) == {Level.GOOD}
    assert " a second, 0.0 % lost" in found["statuses"].found
    assert found["commanded by"].found == "no client"


@inside(lab)
async def test_an_examination_leaves_the_holder_its_lease(here: Lab, hand: RemoteHand) -> None:
    examining = asyncio.create_task(examined(here))
    for _ in range(4):
        await hand.move(100, Finger.A)
        await hand.move(0, Finger.A)
    found = await examining
    assert hand.is_in_control
    assert levels(found) == {Level.GOOD}
    assert "@" in found["commanded by"].found


@inside(lab)
async def test_a_gripper_of_another_name(here: Lab) -> None:
    found = await findings("zenoh://lab/cell/right", here.network.bus("doctor"))
    assert list(found) == ["address", "agent"]
    assert found["agent"].level is Level.BAD
    assert str(LEFT) in found["agent"].found


@virtual
async def test_no_agent_at_all() -> None:
    found = await findings(str(LEFT), Network().bus("doctor"))
    assert list(found) == ["address", "agent"]
    assert "robotiq-async agent" in found["agent"].advice


def out_of_reach(here: Lab) -> None:
    here.server.refuse()
    here.server.cut()


def slow(here: Lab) -> None:
    here.network.delay("agent", "doctor", 0.15)


@pytest.mark.parametrize(
    ("ail", "what", "words"),
    [
        (lambda here: here.network.bus("other").announce(LEFT.key("alive", "1")), "agent", "2 serve"),
        (out_of_reach, "gripper", "robotiq-async doctor tcp://"),
        (lambda here: here.gripper.inject_fault(13), "fault", "0x0D"),
        (slow, "round trip", "lose the lease"),
    ],
)
@inside(lab)
async def test_an_ailment(here: Lab, ail: Callable[[Lab], object], what: str, words: str) -> None:
    ail(here)
    await asyncio.sleep(0.1)
    found = (await examined(here))[what]
    assert found.level is Level.BAD
    assert words in found.found + found.advice


@inside(lab)
async def test_a_gripper_whose_link_was_lost_later(here: Lab, reader: RemoteHand) -> None:
    """It was well, "in DISCONNECTED", and its last status was taken for the present one."""
    await until(lambda: reader.state is State.RUNNING_IDLE)
    out_of_reach(here)
    await until(lambda: here.local.state is State.DISCONNECTED)
    found = await examined(here)
    assert found["gripper"].level is Level.BAD
    assert "the link is down" in found["gripper"].found
    assert "activation" not in found


@inside(lab, model=TWO_FINGER_85)
async def test_the_fault_of_a_jaw_is_one_of_a_jaw(here: Lab) -> None:
    """It had a scissor that met something."""
    here.gripper.inject_fault(0x0A)
    assert "UNDER_VOLTAGE" in (await examined(here))["fault"].found


@inside(lab)
async def test_messages_under_the_wrong_key(here: Lab) -> None:
    publish = here.network.bus("stray").publisher(LEFT.key("feed"), Urgency.TELEMETRY)
    other = GripperName("lab", "cell", "right")

    async def stray() -> None:
        while True:
            publish(json.dumps({"mark": other.mark}).encode())
            await asyncio.sleep(0.1)

    task = asyncio.create_task(stray())
    found = await examined(here)
    task.cancel()
    assert found["misrouted"].level is Level.DOUBT


# -- agents of another kind --------------------------------------------------------------------------------


def info(**changes: object) -> dict[str, object]:
    usual: dict[str, object] = {
        "epoch": 1,
        "stamp": 0.0,
        "version": "9.9.9",
        "window": 1.0,
        "statistics": {"period_p99": 0.005},
        "problem": "",
        "state": "RUNNING_IDLE",
        "address": "sim://",
        "holder": None,
    }
    return usual | changes


async def examined_beside(said: Any) -> dict[str, Finding]:
    """An agent that answers with a value or with bytes."""
    network = Network()
    bus = network.bus("agent")
    bus.announce(LEFT.key("alive", "1"))

    def hear(question: Query) -> None:
        number = json.loads(question.payload)["number"]
        if isinstance(said, bytes):
            question.reply(said)
        elif said is not None:
            question.reply(AgentAnswer(LEFT.base, number, 1, said).pack())

    bus.serve(LEFT.key("info", "*"), hear)
    return await findings(str(LEFT), network.bus("doctor"))


@virtual
async def test_one_whose_statuses_are_not_heard() -> None:
    found = await examined_beside(info())
    assert found["statuses"].level is Level.BAD
    assert found["version"].found.startswith("9.9.9 there")


@virtual
async def test_an_agent_that_does_not_answer() -> None:
    found = await examined_beside(None)
    assert list(found) == ["address", "agent", "access"]
    assert found["access"].level is Level.BAD


@virtual
@pytest.mark.parametrize(
    "said", [b"?", b'{"version": 2}', b'{"version": 1}', {"state": "RUNNING_IDLE"}], ids=str
)
async def test_one_of_another_version(said: Any) -> None:
    found = await examined_beside(said)
    assert list(found) == ["address", "agent", "access"]
    assert found["access"].level is Level.BAD


# -- certificates ------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def authority(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder: Path = tmp_path_factory.mktemp("keys")
    make_authority(folder)
    issue(folder, "bob", Role.OPERATE)
    issue(folder, "alice", Role.READ)
    issue(folder, "panel", Role.HALT, days=20)
    issue(folder, "cell", Role.AGENT)
    return folder


def examined_keys(folder: Path, *, days: float = 0) -> dict[str, Finding]:
    found: list[Finding] = []
    try:
        examine_keys(folder, found.append, now=datetime.now(UTC) + timedelta(days=days))
    except GiveUpError:
        assert found[-1].level is Level.BAD
    return {finding.what: finding for finding in found}


def test_the_role_of_a_certificate(authority: Path) -> None:
    found = examined_keys(authority / "operate-bob")
    assert "bob: may watch, halt and command" in found["role"].found
    assert levels(found) == {Level.GOOD}
    found = examined_keys(authority / "agent-cell")
    assert found["role"].level is Level.BAD


def test_a_certificate_that_expires_soon_and_one_that_has_expired(authority: Path) -> None:
    found = examined_keys(authority / "halt-panel")
    assert "panel: may watch and halt," in found["role"].found
    assert found["certificate"].level is Level.DOUBT
    for days in (21, -2):
        found = examined_keys(authority / "halt-panel", days=days)
        assert list(found) == ["certificate"]


@pytest.mark.parametrize("name", ["ca.pem", "cert.pem", "key.pem"])
@pytest.mark.parametrize("how", ["missing", "malformed", "another's"])
def test_files_that_do_not_belong_together(authority: Path, tmp_path: Path, name: str, how: str) -> None:
    folder = tmp_path / "bob"
    folder.mkdir()
    for file in (authority / "operate-bob").iterdir():
        (folder / file.name).write_bytes(file.read_bytes())
    make_authority(tmp_path / "other")
    other = issue(tmp_path / "other", "bob", Role.OPERATE)
    if how == "missing":
        (folder / name).unlink()
    else:
        (folder / name).write_bytes(b"?" if how == "malformed" else (other / name).read_bytes())
    found = examined_keys(folder)
    assert list(found) == ["certificate"]
    assert name in found["certificate"].found or how == "another's"


def test_a_key_that_others_may_read(authority: Path) -> None:
    key = authority / "read-alice" / "key.pem"
    key.chmod(0o640)
    found = examined_keys(authority / "read-alice")
    assert found["private key"].level is Level.DOUBT
    key.chmod(0o600)


# -- the way there -----------------------------------------------------------------------------------------


@asynccontextmanager
async def listening(hear: Callable[..., Any]) -> AsyncIterator[str]:
    server = await asyncio.start_server(hear, "127.0.0.1", 0)
    async with server:
        yield f"127.0.0.1:{server.sockets[0].getsockname()[1]}"


async def hang_up(_: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    writer.close()


async def test_nothing_listens() -> None:
    async with listening(hang_up) as where:
        pass
    found = await findings(f"{LEFT}?connect=tcp/{where}")
    assert list(found) == ["address", "port"]
    assert found["port"].found == f"tcp/{where}: nothing listens"


async def test_a_name_that_does_not_exist() -> None:
    found = await findings(f"{LEFT}?connect=tcp/nowhere.invalid:7447&insecure=1")
    assert list(found) == ["address", "port"]
    assert "spelling" in found["port"].advice


async def test_a_listener_without_certificates(authority: Path) -> None:
    async with listening(hang_up) as where:
        found = await findings(f"{LEFT}?connect=tls/{where}&keys={authority / 'operate-bob'}")
    assert found["port"].level is Level.GOOD
    assert found["certificates"].level is Level.BAD


async def test_a_way_that_is_not_protected() -> None:
    found = await findings(f"{LEFT}?connect=tcp/192.0.2.1:7447")
    assert list(found) == ["address", "way"]
    assert "open to everyone" in found["way"].found


@pytest.mark.parametrize("address", ["zenoh://lab/cell", "zenoh://lab/cell/*", "zenoh://a/b/c?x=1"])
async def test_a_malformed_address(address: str) -> None:
    with pytest.raises(ValueError, match="malformed"):
        await findings(address)


# -- all of it, over zenoh ---------------------------------------------------------------------------------


async def test_each_role_over_zenoh(authority: Path, tmp_path: Path) -> None:
    make_authority(tmp_path)
    stranger = issue(tmp_path, "bob", Role.OPERATE)
    folders = [authority / "operate-bob", authority / "read-alice", stranger]
    async with line(seconds=60) as here, SimulatorServer() as server:
        await here.serve(RobotiqHand(server.address), authority / "agent-cell")
        operator, reader, refused = await asyncio.gather(
            *(findings(f"{LEFT}?connect={here.endpoint}&keys={folder}") for folder in folders)
        )
    for found in (operator, reader):
        assert {each.what for each in found.values() if each.level is Level.BAD} == set()
        assert found["no certificate"].found == "refused, as it must be"
    assert refused["certificates"].level is Level.BAD
    assert "agent" not in refused
