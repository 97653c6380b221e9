"""What remote hands and a fleet make of the roles: an agent with keys, and real sessions of zenoh."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.keys.access import Role
from robotiq_async.fleet.keys.certificates import issue, make_authority
from robotiq_async.fleet.network.configuration import agent_configuration
from robotiq_async.fleet.network.route import Route
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.values.errors import ConnectFailedError, NotAllowedError
from tests.fleet.sessions import PATIENCE, free_port


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("keys")
    make_authority(folder)
    issue(folder, "eve", Role.OPERATE)
    (folder / "access.toml").write_text("", encoding="utf-8")
    issue(folder, "cell-1", Role.AGENT)
    for name, role in (("alice", Role.READ), ("panel", Role.HALT), ("bob", Role.OPERATE)):
        issue(folder, name, role)
    return folder


@asynccontextmanager
async def served(keys: Path) -> AsyncIterator[str]:
    """An agent with a simulated gripper; gives the endpoint it listens on."""
    endpoint = f"tls/127.0.0.1:{free_port()}"
    configuration = agent_configuration("lab", "cell-1", [endpoint], keys=keys / "agent-cell-1")
    bus = await open_bus(configuration, endpoint)
    ready = asyncio.Event()
    agent = Agent("lab", "cell-1", {"left": RobotiqHand("sim://")}, bus)
    serving = asyncio.create_task(agent.run(ready.set))
    try:
        async with asyncio.timeout(PATIENCE):
            await ready.wait()
            yield endpoint
    finally:
        serving.cancel()
        await asyncio.gather(serving, return_exceptions=True)
        await bus.close()


def hand(endpoint: str, folder: Path, connect_timeout: float = PATIENCE) -> RemoteHand:
    address = f"zenoh://lab/cell-1/left?connect={endpoint}&keys={folder}"
    return RemoteHand(address, control=False, connect_timeout=connect_timeout)


@pytest.mark.parametrize(
    ("who", "halts", "commands"),
    [("read-alice", False, False), ("halt-panel", True, False), ("operate-bob", True, True)],
)
async def test_a_hand_does_what_its_role_allows(keys: Path, who: str, halts: bool, commands: bool) -> None:
    async with served(keys) as endpoint, hand(endpoint, keys / who) as remote:
        for attempt, is_allowed in ((remote.halt, halts), (remote.acquire, commands)):
            if is_allowed:
                await attempt()
            else:
                with pytest.raises(NotAllowedError):
                    await attempt()
        assert remote.is_in_control is commands


async def test_a_hand_whose_client_is_not_in_the_list_finds_no_agent(keys: Path) -> None:
    async with served(keys) as endpoint:
        with pytest.raises(ConnectFailedError, match="certificate"):
            await hand(endpoint, keys / "operate-eve", connect_timeout=0.1).start()


async def test_a_fleet_is_halted_in_the_role_for_it(keys: Path) -> None:
    async with (
        served(keys) as endpoint,
        hand(endpoint, keys / "read-alice"),  # waits until the agent has reached the gripper
        Fleet("lab", route=Route((endpoint,), keys / "halt-panel")) as fleet,
    ):
        assert list((await fleet.halt_all()).values()) == ["stopped"]
