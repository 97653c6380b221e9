"""Real sessions of zenoh over loopback: who gets in, what each role may do, many at once, uvloop."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from datetime import UTC, datetime, timedelta
from pathlib import Path

import pytest

from robotiq_async import Finger, RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.keys.access import AccessList, Role, access_control, rights
from robotiq_async.fleet.keys.authority import Authority, Pair
from robotiq_async.fleet.keys.certificates import HERE, issue, make_authority
from robotiq_async.fleet.keys.key_folder import ACCESS
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.network.configuration import agent_configuration, client_configuration
from robotiq_async.fleet.network.route import Route
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.errors import ConnectFailedError, NotAllowedError
from tests.fleet.sessions import LEFT, PATIENCE, free_port, line

ONE = f"{LEFT.base}/*"
FLEET = "robotiq/v1/lab/*/*/summary"
MANY = 600
"""More than a channel of zenoh's holds: halting so many never began."""


# -- access ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site with an agent and a client in each role, and one that is shut out."""
    folder = tmp_path_factory.mktemp("keys")
    make_authority(folder)
    issue(folder, "cell-1", Role.AGENT)
    for name, role in (
        ("alice", Role.READ),
        ("panel", Role.HALT),
        ("bob", Role.OPERATE),
        ("eve", Role.OPERATE),
    ):
        issue(folder, name, role)
    clients = AccessList(("alice",), ("panel",), ("bob",))
    (folder / "agent-cell-1" / ACCESS).write_text(clients.text(), encoding="utf-8")
    return folder


@pytest.mark.parametrize(
    ("who", "halts", "commands"),
    [("read-alice", False, False), ("halt-panel", True, False), ("operate-bob", True, True)],
)
async def test_each_role_watches_and_does_what_it_may(
    keys: Path, who: str, halts: bool, commands: bool
) -> None:
    async with line() as here:
        publish = (await here.agent(keys / "agent-cell-1")).publish
        client = await here.client(keys / who)
        one, fleet = client.subscribe(ONE), client.subscribe(FLEET)
        await client.watch("robotiq/v1/lab/*/*/alive/*").wait()
        await client.watch("robotiq/v1/*/*/*/alive/*").wait()
        assert await client.bus.announced("robotiq/v1/lab/*/*/alive/*", timeout=5.0) == [
            LEFT.key("alive", "77")
        ]
        assert await client.may("info")
        assert await client.may("halt") is halts
        assert await client.may("lease") is commands
        assert await client.may("cmd", "move") is commands
        publish("feed")
        await one.wait()
        assert not fleet.is_set()
        publish("summary")
        await fleet.wait()


async def test_a_subscription_that_is_too_wide_and_a_key_without_a_rule_are_silent(keys: Path) -> None:
    """In sessions of their own: what comes for one subscription of a session is given to all that match."""
    async with line() as here:
        publish = (await here.agent(keys / "agent-cell-1")).publish
        narrow, wide = await here.client(keys / "read-alice"), await here.client(keys / "operate-bob")
        all_of_one = wide.subscribe(f"{LEFT.base}/**")
        feed, other = narrow.subscribe(LEFT.key("feed")), narrow.subscribe(LEFT.key("other"))
        # Answers come behind the word of the subscriptions.
        await wide.watch(LEFT.key("alive", "*")).wait()
        await narrow.watch(LEFT.key("alive", "*")).wait()
        assert await wide.may("info")
        assert await narrow.may("info")
        publish("other")
        publish("feed")
        await feed.wait()
        assert await wide.may("info")
        assert not any(event.is_set() for event in (all_of_one, other))


async def test_who_is_not_in_the_list_gets_in_and_gets_nothing(keys: Path) -> None:
    async with line() as here:
        publish = (await here.agent(keys / "agent-cell-1")).publish
        eve, alice = await here.client(keys / "operate-eve"), await here.client(keys / "read-alice")
        heard, seen = eve.subscribe(ONE), eve.watch("robotiq/v1/*/*/*/alive/*")
        feed = alice.subscribe(ONE)
        await asyncio.gather(eve.connected.wait(), alice.watch("robotiq/v1/*/*/*/alive/*").wait())
        assert await alice.may("info")
        assert not any([await eve.may(verb) for verb in ("info", "halt", "lease", "cmd/move")])
        publish("feed")
        await feed.wait()
        assert await eve.bus.announced("robotiq/v1/*/*/*/alive/*", timeout=0.1) == []
        assert not any(event.is_set() for event in (heard, seen))


async def test_wildcards_open_nothing(keys: Path) -> None:
    """A request whose key includes what is another role's."""
    async with line() as here:
        await here.agent(keys / "agent-cell-1")
        alice, bob = await here.client(keys / "read-alice"), await here.client(keys / "operate-bob")
        for client in (alice, bob):
            await client.watch(LEFT.key("alive", "*")).wait()
            assert await client.may("info")
        for parts in (("*",), ("**",), ("h$*",), ("h*lt",), ("cmd", "*"), ("cmd", "mov$*"), ("lea$*",)):
            assert not await alice.may(*parts), parts
        for key in ("**", "robotiq/**", "robotiq/v1/lab/*/left/halt", "robotiq/v1/*/cell-1/left/cmd/move"):
            assert await bob.bus.ask(key, b"?", timeout=1.0, urgency=Urgency.COMMAND) is None, key


async def test_nobody_publishes_answers_or_is_present_in_place_of_an_agent(keys: Path) -> None:
    """Not even for clients in zenoh's sense, for whom the agent would carry on what others say."""
    async with line() as here:
        agent = await here.agent(keys / "agent-cell-1")
        bob, alice = [await here.client(keys / who, "client") for who in ("operate-bob", "read-alice")]
        heard, seen, asked = alice.subscribe(ONE), alice.watch(LEFT.key("alive", "78")), asyncio.Event()
        bob.kept.append(bob.bus.announce(LEFT.key("alive", "78")))
        bob.kept.append(bob.bus.serve(LEFT.key("stop"), lambda _: asked.set()))
        for each in (bob, alice):
            await each.watch(LEFT.key("alive", "77")).wait()
            assert await each.may("info")
        bob.bus.publisher(LEFT.key("feed"), Urgency.COMMAND)(b"false news")
        assert not await alice.may("stop")
        assert await bob.may("info")
        assert await alice.may("info")
        assert not any(event.is_set() for event in (agent.heard, heard, seen, asked))
        agent.publish("feed")
        await heard.wait()


async def test_no_certificate_and_one_of_a_stranger_do_not_even_get_a_connection(
    keys: Path, tmp_path: Path
) -> None:
    make_authority(tmp_path)
    foreign = issue(tmp_path, "bob", Role.OPERATE)
    mixed = tmp_path / "mixed"  # a stranger who believes in our authority
    mixed.mkdir()
    for name, source in (("ca.pem", keys / "operate-bob"), ("cert.pem", foreign), ("key.pem", foreign)):
        (mixed / name).write_bytes((source / name).read_bytes())
    async with line() as here:
        await here.agent(keys / "agent-cell-1")
        strangers = [await here.client(each) for each in (None, foreign, mixed)]
        bob = await here.client(keys / "operate-bob")
        await bob.connected.wait()
        assert not any(stranger.connected.is_set() for stranger in strangers)
        assert not any([await stranger.may("halt") for stranger in strangers])


async def test_a_certificate_ends_and_so_does_the_link(keys: Path, tmp_path: Path) -> None:
    make_authority(tmp_path)
    agent = issue(tmp_path, "cell-1", Role.AGENT)
    late, soon = issue(tmp_path, "late", Role.READ), issue(tmp_path, "soon", Role.READ)
    authority = Authority.load(Pair(*[(tmp_path / name).read_bytes() for name in ("ca.pem", "ca.key")]))
    for folder, seconds in ((late, -1), (soon, 3)):
        until = datetime.now(UTC) + timedelta(seconds=seconds)
        pair = authority.certify(Role.READ.common_name("soon"), until)
        (folder / "cert.pem").write_bytes(pair.certificate)
        (folder / "key.pem").write_bytes(pair.key)
    async with line() as here:
        await here.agent(agent)
        refused, client = await here.client(late), await here.client(soon)
        await client.watch(LEFT.key("alive", "*")).wait()
        assert not refused.connected.is_set()
        await client.disconnected.wait()


async def test_a_client_does_not_pass_for_an_agent_nor_one_host_for_another(keys: Path) -> None:
    """Who listens shows a certificate for servers, and for the address that was connected to."""
    async with line() as one, line() as two, line("127.0.0.2") as three:
        await one.server(keys / "operate-bob")
        await two.server(keys / "agent-cell-1")
        await three.server(keys / "agent-cell-1")
        assert "127.0.0.2" not in HERE
        clients = [await each.client(keys / "read-alice") for each in (one, three, two)]
        await clients[-1].connected.wait()
        assert [client.connected.is_set() for client in clients] == [False, False, True]


async def test_with_an_empty_list_nobody_may_anything(tmp_path: Path) -> None:
    make_authority(tmp_path)
    agent, bob = issue(tmp_path, "cell-1", Role.AGENT), issue(tmp_path, "bob", Role.OPERATE)
    (agent / ACCESS).write_text("", encoding="utf-8")
    async with line() as here:
        await here.agent(agent)
        client = await here.client(bob)
        await client.connected.wait()
        assert not await client.may("info")


def test_rights_grow_with_the_role() -> None:
    read, halt, operate = map(rights, (Role.READ, Role.HALT, Role.OPERATE))
    assert set(read) < set(halt) < set(operate)


def test_every_right_has_its_rule_and_what_is_not_allowed_is_denied() -> None:
    control = access_control("lab", "cell-1", AccessList(("a",), ("b",), ("c", "d")))
    rules = control["rules"]
    assert isinstance(rules, list)
    assert {rule["id"] for rule in rules} == set(rights(Role.OPERATE))
    assert control["default_permission"] == "deny"
    assert not any("**" in key for rule in rules for key in rule["key_exprs"])


def test_an_agent_with_keys_needs_an_access_list(keys: Path) -> None:
    with pytest.raises(ValueError, match=r"access\.toml: No such file"):
        agent_configuration("lab", "cell-1", ["tls/127.0.0.1:7447"], keys=keys / "operate-bob")


def test_clients_connect_encrypted_or_on_this_machine(keys: Path) -> None:
    with pytest.raises(ValueError, match="open to everyone"):
        client_configuration(["tcp/cell-1:7447"])
    with pytest.raises(ValueError, match="needs keys"):
        client_configuration(["tls/cell-1:7447"])
    with pytest.raises(ValueError, match=r"must begin with tls/"):
        client_configuration(["tcp/127.0.0.1:7447"], keys=keys / "operate-bob")
    with pytest.raises(ValueError, match=r"key\.pem"):
        client_configuration(["tls/cell-1:7447"], keys=keys)
    assert "access_control" not in client_configuration(["tls/cell-1:7447"], keys=keys / "operate-bob")
    assert client_configuration(["tcp/cell-1:7447"], insecure=True)["mode"] == "peer"


# -- roles -------------------------------------------------------------------------------------------------


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


# -- idle connections --------------------------------------------------------------------------------------


async def test_idle_connections_keep_nobody_out() -> None:
    """300 of them, by a client that only opens them, kept new clients out for 12 s."""
    port = free_port()
    endpoint = f"tcp/127.0.0.1:{port}"
    async with contextlib.AsyncExitStack() as stack:
        agent = await open_bus(agent_configuration("lab", "cell-1", [endpoint]), endpoint)
        stack.push_async_callback(agent.close)
        agent.serve("robotiq/v1/lab/cell-1/*/info", lambda query: query.reply(b"!"))
        for _ in range(300):
            idle = stack.enter_context(socket.socket())
            idle.connect(("127.0.0.1", port))
        client = await open_bus(client_configuration([endpoint]), endpoint)
        stack.push_async_callback(client.close)
        async with asyncio.timeout(8):
            asked = None
            while asked is None:
                asked = await client.ask(
                    "robotiq/v1/lab/cell-1/left/info", b"?", timeout=1.0, urgency=Urgency.COMMAND
                )


# -- announced ---------------------------------------------------------------------------------------------


async def test_many_are_found_at_once() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    agent = await open_bus(agent_configuration("lab", "cell", [endpoint]), endpoint)
    client = await open_bus(client_configuration([endpoint]), endpoint)
    try:
        keys = {f"robotiq/v1/lab/cell/g{number}/alive/1" for number in range(MANY)}
        tokens = [agent.announce(key) for key in keys]
        found: set[str] = set()
        async with asyncio.timeout(20):
            while found != keys:
                found = set(await client.announced("robotiq/v1/lab/*/*/alive/*", timeout=0.5))
        assert await client.announced("robotiq/v1/nowhere/**", timeout=0.5) == []
        for take_back in tokens:
            take_back()
    finally:
        await client.close()
        await agent.close()
    assert await client.announced("robotiq/v1/**", timeout=0.5) == []


async def test_endpoints_that_are_not_reached() -> None:
    """One that is written as a name is another word for what zenoh is connected to."""
    numbers = [free_port() for _ in range(3)]
    agents = [
        await open_bus(agent_configuration("lab", "cell", [f"tcp/127.0.0.1:{n}"]), "a") for n in numbers[:2]
    ]
    endpoints = [
        f"tcp/{host}:{n}" for host, n in zip(("127.0.0.1", "localhost", "127.0.0.1"), numbers, strict=True)
    ]
    client = await open_bus(client_configuration(endpoints), "b")
    try:
        async with asyncio.timeout(20):
            while len(await client.unreached()) > 1:  # noqa: ASYNC110  # there is no event to wait for
                await asyncio.sleep(0.05)
        assert await client.unreached() == endpoints[2:]
        await agents[1].close()
        async with asyncio.timeout(20):
            while await client.unreached() != endpoints[1:]:  # noqa: ASYNC110
                await asyncio.sleep(0.05)
    finally:
        for bus in (client, *agents):
            await bus.close()


# -- uvloop ------------------------------------------------------------------------------------------------


async def moved() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    async with SimulatorServer(SimulatedGripper(speedup=20, spread=False)) as server:
        serving = await open_bus(agent_configuration("lab", "cell", [endpoint]), endpoint)
        agent = asyncio.ensure_future(
            Agent("lab", "cell", {"left": RobotiqHand(server.address)}, serving).run()
        )
        asking = await open_bus(client_configuration([endpoint]), endpoint)
        async with RemoteHand("zenoh://lab/cell/left", bus=asking) as hand:
            result = await hand.move(80, Finger.A, speed=255)
            assert result.positions[Finger.A] == pytest.approx(80, abs=2)
            first = await anext(statuses := hand.statuses(1000))
            for position in range(80, 120):
                hand.command(Finger.A, position=position)
                await asyncio.sleep(0.005)
            await hand.halt()
            assert not hand.is_moving
            assert hand.is_in_control
            times = [first.timestamp, *(status.timestamp for status in statuses.drain())]
            assert times == sorted(times)
            assert len(times) > 5
        agent.cancel()
        await asyncio.gather(agent, return_exceptions=True)
        for bus in (asking, serving):
            await bus.close()


def test_a_hand_moves_and_halts_in_uvloop() -> None:
    uvloop = pytest.importorskip("uvloop")

    async def main() -> None:
        async with asyncio.timeout(3 * PATIENCE):
            await moved()

    uvloop.run(main())
