"""Real sessions of zenoh over loopback: who gets in, what each role may do, many at once, uvloop."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, nullcontext
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import pytest

from robotiq_async import Finger, RobotiqHand
from robotiq_async.cli.keys.authority import Authority, Pair
from robotiq_async.cli.keys.issuing import LOOPBACK_NAMES, issue, make_authority
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.errors import AgentError, NotAllowedError
from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.keys.access import CLIENTS, AccessList, Role, access_control, rights
from robotiq_async.fleet.keys.key_folder import ACCESS
from robotiq_async.fleet.network import zenoh_bus
from robotiq_async.fleet.network.bus import MessageKind, Urgency
from robotiq_async.fleet.network.configuration import (
    QUESTIONS_HZ,
    agent_configuration,
    client_configuration,
    router_configuration,
    session_configuration,
)
from robotiq_async.fleet.network.route import Route
from robotiq_async.fleet.network.zenoh_bus import ZenohBus, open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.runtime import now
from robotiq_async.simulator import SimulatorServer
from robotiq_async.values.errors import ConnectFailedError
from tests.fleet.lab import LEFT
from tests.fleet.sessions import PATIENCE, Client, Line, free_port, line
from tests.grippers import active_gripper
from tests.patience import patience

ONE = f"{LEFT.base}/*"
FLEET = "robotiq/v1/lab/*/*/summary"
OTHER = "robotiq/v1/lab/other/left"
MANY = 600
"""More than a channel of zenoh's holds: halting so many never began."""
each_role = pytest.mark.parametrize(
    ("who", "halts", "commands"),
    [("read-alice", False, False), ("halt-panel", True, False), ("operate-bob", True, True)],
)


# -- access ------------------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def keys(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A site with agents, a router (gate), a client in each role, and one that is shut out."""
    folder = tmp_path_factory.mktemp("keys")
    make_authority(folder)
    for host in ("cell", "other", "gate"):
        issue(folder, host, Role.AGENT)
    for name, role in zip(("alice", "panel", "bob", "eve"), (*CLIENTS, Role.OPERATE), strict=True):
        issue(folder, name, role)
    clients = AccessList(("alice",), ("panel",), ("bob",))
    for host in ("cell", "other", "gate"):
        (folder / f"agent-{host}" / ACCESS).write_text(clients.text(), encoding="utf-8")
    return folder


@each_role
async def test_each_role_watches_and_does_what_it_may(
    keys: Path, who: str, halts: bool, commands: bool
) -> None:
    async with line() as here:
        publish = (await here.answering(keys / "agent-cell")).publish
        client = await here.client(keys / who)
        one, fleet = client.subscribe(ONE), client.subscribe(FLEET)
        await client.watch("robotiq/v1/lab/*/*/alive/*").wait()
        await client.watch("robotiq/v1/*/*/*/alive/*").wait()
        assert await client.bus.announced("robotiq/v1/lab/*/*/alive/*", timeout=patience(PATIENCE)) == [
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
    """Each has a session of its own: a message for one subscription of a session goes to all that match."""
    async with line() as here:
        publish = (await here.answering(keys / "agent-cell")).publish
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


async def test_a_client_not_in_the_list_connects_and_gets_nothing(keys: Path) -> None:
    async with line() as here:
        publish = (await here.answering(keys / "agent-cell")).publish
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
        await here.answering(keys / "agent-cell")
        alice, bob = await here.client(keys / "read-alice"), await here.client(keys / "operate-bob")
        for client in (alice, bob):
            await client.watch(LEFT.key("alive", "*")).wait()
            assert await client.may("info")
        for parts in (("*",), ("**",), ("h$*",), ("h*lt",), ("cmd", "*"), ("cmd", "mov$*"), ("lea$*",)):
            assert not await alice.may(*parts), parts
        for key in ("**", "robotiq/**", "robotiq/v1/lab/*/left/halt", "robotiq/v1/*/cell/left/cmd/move"):
            assert await bob.bus.ask(key, b"?", timeout=1.0, urgency=Urgency.COMMAND) is None, key


async def test_no_client_can_act_as_an_agent(keys: Path) -> None:
    """Not even for clients in zenoh's sense, for whom the agent would pass on the messages of others."""
    async with line() as here:
        agent = await here.answering(keys / "agent-cell")
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
        await here.answering(keys / "agent-cell")
        strangers = [await here.client(each) for each in (None, foreign, mixed)]
        bob = await here.client(keys / "operate-bob")
        await bob.connected.wait()
        assert not any(stranger.connected.is_set() for stranger in strangers)
        assert not any([await stranger.may("halt") for stranger in strangers])


async def test_a_certificate_ends_and_so_does_the_link(keys: Path, tmp_path: Path) -> None:
    make_authority(tmp_path)
    agent = issue(tmp_path, "cell", Role.AGENT)
    late, soon = issue(tmp_path, "late", Role.READ), issue(tmp_path, "soon", Role.READ)
    authority = Authority.load(Pair(*[(tmp_path / name).read_bytes() for name in ("ca.pem", "ca.key")]))
    for folder, seconds in ((late, -1), (soon, 3)):
        until = datetime.now(UTC) + timedelta(seconds=seconds)
        pair = authority.certify(Role.READ.common_name("soon"), until)
        (folder / "cert.pem").write_bytes(pair.certificate)
        (folder / "key.pem").write_bytes(pair.key)
    async with line() as here:
        await here.answering(agent)
        refused, client = await here.client(late), await here.client(soon)
        await client.watch(LEFT.key("alive", "*")).wait()
        assert not refused.connected.is_set()
        await client.disconnected.wait()


async def test_a_client_does_not_pass_for_an_agent_nor_one_host_for_another(keys: Path) -> None:
    """A listener presents a certificate for servers, and for the address that was connected to."""
    async with line() as one, line() as two, line("127.0.0.2") as three:
        await one.server(keys / "operate-bob")
        await two.server(keys / "agent-cell")
        await three.server(keys / "agent-cell")
        assert "127.0.0.2" not in LOOPBACK_NAMES
        clients = [await each.client(keys / "read-alice") for each in (one, three, two)]
        await clients[-1].connected.wait()
        assert [client.connected.is_set() for client in clients] == [False, False, True]


async def test_an_empty_list_denies_everything(tmp_path: Path) -> None:
    make_authority(tmp_path)
    agent, bob = issue(tmp_path, "cell", Role.AGENT), issue(tmp_path, "bob", Role.OPERATE)
    (agent / ACCESS).write_text("", encoding="utf-8")
    async with line() as here:
        await here.answering(agent)
        client = await here.client(bob)
        await client.connected.wait()
        assert not await client.may("info")


def test_every_right_has_its_rule_and_what_is_not_allowed_is_denied() -> None:
    control = access_control("lab", ["cell"], AccessList(("a",), ("b",), ("c", "d")))
    rules = control["rules"]
    assert isinstance(rules, list)
    own = {f"ask info {who}" for who in ("read:a", "halt:b", "operate:c", "operate:d")}
    assert {rule["id"] for rule in rules} == set(rights(Role.OPERATE)) | own
    assert control["default_permission"] == "deny"
    assert not any("**" in key for rule in rules for key in rule["key_exprs"])


def test_an_agent_with_keys_needs_an_access_list(keys: Path) -> None:
    with pytest.raises(ValueError, match=r"access\.toml: No such file"):
        agent_configuration("lab", "cell", ["left"], ["tls/127.0.0.1:7447"], keys=keys / "operate-bob")


def test_clients_connect_encrypted_or_on_this_machine(keys: Path) -> None:
    for endpoint, folder, words in (
        ("tcp/cell:7447", None, "open to everyone"),
        ("tls/cell:7447", None, "needs keys"),
        ("tcp/127.0.0.1:7447", keys / "operate-bob", r"must begin with tls/"),
        ("tls/cell:7447", keys, r"key\.pem"),
    ):
        with pytest.raises(ValueError, match=words):
            client_configuration([endpoint], keys=folder)
    assert "access_control" not in client_configuration(["tls/cell:7447"], keys=keys / "operate-bob")
    assert client_configuration(["tcp/cell:7447"], insecure=True)["mode"] == "peer"


# -- roles -------------------------------------------------------------------------------------------------


@asynccontextmanager
async def served(keys: Path) -> AsyncIterator[str]:
    """An agent with a simulated gripper; gives the endpoint it listens on."""
    async with line(seconds=3 * PATIENCE) as here:
        await here.serve(RobotiqHand("sim://"), keys / "agent-cell")
        yield here.endpoint


def hand(endpoint: str, folder: Path, connect_timeout: float = 60.0) -> RemoteHand:
    address = f"{LEFT}?connect={endpoint}&keys={folder}"
    return RemoteHand(address, control=False, connect_timeout=connect_timeout)


@each_role
async def test_a_hand_does_what_its_role_allows(keys: Path, who: str, halts: bool, commands: bool) -> None:
    async with served(keys) as endpoint, hand(endpoint, keys / who) as remote:
        if halts:  # a refusal takes two seconds, and has its test in virtual time
            await remote.halt()
        with nullcontext() if commands else pytest.raises(NotAllowedError):
            await remote.acquire()
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


async def behind_a_router(here: Line, keys: Path, rules: dict[str, object], *, trusts_router: bool) -> None:
    """An agent that is reached through a router alone."""
    await here.open(rules)
    cell, router = keys / "agent-cell", [here.endpoint]
    bus = await here.open(
        agent_configuration("lab", "cell", ["left"], [], router, keys=cell, trusts_router=trusts_router)
    )
    await here.serve_over(bus, RobotiqHand("sim://"))


async def trusting(here: Line, keys: Path, host: str, *answers_for: str) -> ZenohBus:
    """The agent of a host, with no rules of its own, that answers to the keys of some hosts."""
    own, router = keys / f"agent-{host}", [here.endpoint]
    bus = await here.open(
        agent_configuration("lab", host, ["left"], [], router, keys=own, trusts_router=True)
    )
    for each in answers_for:
        for verb in ("info/*", "lease", "halt", "cmd/*"):
            here.stack.callback(bus.serve(f"robotiq/v1/lab/{each}/*/{verb}", lambda query: query.reply(b"!")))
        here.stack.callback(bus.announce(f"robotiq/v1/lab/{each}/left/alive/77"))
    return bus


async def test_behind_a_router_that_is_trusted_the_rules_are_the_routers(keys: Path) -> None:
    """The agent sees the router's certificate alone: each client has its role all the same."""
    async with line(seconds=3 * PATIENCE) as here:
        rules = router_configuration("lab", ["cell"], [here.endpoint], keys / "agent-gate")
        await behind_a_router(here, keys, rules, trusts_router=True)
        async with hand(here.endpoint, keys / "operate-bob") as bob:
            await bob.acquire()
            await bob.hold()
            await bob.halt()
        alice, panel, eve, own = [
            await here.client(keys / who)
            for who in ("read-alice", "halt-panel", "operate-eve", "operate-bob")
        ]
        for client in (alice, panel, own):
            await client.watch(LEFT.key("alive", "*")).wait()
        assert [await alice.may(verb) for verb in ("info", "halt", "lease")] == [True, False, False]
        assert [await panel.may(verb) for verb in ("info", "halt", "lease")] == [True, True, False]
        assert [await eve.may(verb) for verb in ("info", "halt", "lease")] == [False] * 3
        for client, is_its_own in ((own, True), (alice, False)):
            question = LEFT.question("operate:bob")
            reply = await client.bus.ask(question, b"?", timeout=patience(PATIENCE), urgency=Urgency.COMMAND)
            assert (reply is not None) is is_its_own


async def test_an_agent_keeps_its_rules_behind_a_router_that_it_does_not_trust(keys: Path) -> None:
    """A reader, a client that is not in the list, and one without keys took control."""
    async with line(seconds=3 * PATIENCE) as here:
        unencrypted = f"tcp/127.0.0.1:{free_port()}"
        router = session_configuration([here.endpoint, unencrypted], (), keys / "agent-gate")
        await behind_a_router(here, keys, router | {"mode": "router"}, trusts_router=False)
        await trusting(here, keys, "other", "other")
        clients = [await here.client(keys / who) for who in ("read-alice", "operate-eve", "operate-bob")]
        clients.append(Client(await here.open(session_configuration([], [unencrypted]))))
        for client in clients:
            await client.watch("robotiq/v1/lab/other/*/alive/*").wait()
            assert await client.bus.ask(
                f"{OTHER}/halt", b"?", timeout=patience(PATIENCE), urgency=Urgency.COMMAND
            )
            assert not any([await client.may(verb) for verb in ("info", "halt", "lease", "cmd/hold")])


def test_a_router_is_trusted_where_it_is_the_only_way_to_an_agent_with_keys(keys: Path) -> None:
    cell, router = keys / "agent-cell", ["tls/127.0.0.1:7447"]
    for listen, connect, folder in (
        (router, router, cell),
        (router, [], cell),
        ([], ["tcp/127.0.0.1:1"], None),
    ):
        with pytest.raises(ValueError, match="trusts_router"):
            agent_configuration("lab", "cell", ["left"], listen, connect, keys=folder, trusts_router=True)
    assert "access_control" in agent_configuration("lab", "cell", ["left"], router, router, keys=cell)


async def test_behind_a_router_an_agent_speaks_for_its_own_host_alone(keys: Path) -> None:
    """One answered the halts, leases and commands of another host, and published its statuses."""
    async with line(seconds=3 * PATIENCE) as here:
        hosts = ["cell", "other"]
        await here.open(router_configuration("lab", hosts, [here.endpoint], keys / "agent-gate"))
        agent = await trusting(here, keys, "other", *hosts)
        bob = await here.client(keys / "operate-bob")
        heard, own = bob.subscribe(ONE), bob.subscribe(f"{OTHER}/*")
        seen = bob.watch(LEFT.key("alive", "*"))
        await bob.watch(f"{OTHER}/alive/*").wait()
        assert await bob.bus.ask(f"{OTHER}/halt", b"?", timeout=patience(PATIENCE), urgency=Urgency.COMMAND)
        assert not any([await bob.may(verb) for verb in ("info", "halt", "lease", "cmd/hold")])
        for base in (LEFT.base, OTHER):
            agent.publisher(f"{base}/feed", Urgency.COMMAND)(b"news")
        await own.wait()
        assert not heard.is_set()
        assert not seen.is_set()


async def test_behind_a_router_an_agent_sees_another_one_of_its_host_and_of_no_other(keys: Path) -> None:
    """The second one began to serve, beside the first."""
    async with line(seconds=3 * PATIENCE) as here:
        hosts = ["cell", "other"]
        await here.open(router_configuration("lab", hosts, [here.endpoint], keys / "agent-gate"))
        await trusting(here, keys, "cell", "cell")
        second, stranger = await trusting(here, keys, "cell"), await trusting(here, keys, "other")
        token = LEFT.key("alive", "77")
        while await second.announced("robotiq/v1/lab/cell/*/alive/*", timeout=patience(1)) != [token]:
            pass
        assert await stranger.announced("robotiq/v1/lab/cell/*/alive/*", timeout=0.5) == []
        with pytest.raises(AgentError, match="another agent serves zenoh://lab/cell/left already"):
            await Agent("lab", "cell", {"left": RobotiqHand("sim://")}, second).run()


# -- without keys ------------------------------------------------------------------------------------------


async def test_idle_connections_keep_no_client_out() -> None:
    """300 of them, by a client that only opens them, kept new clients out for 12 s."""
    async with line(protocol="tcp", seconds=8) as here:
        agent = await here.agent_bus()
        agent.serve(LEFT.key("info", "*"), lambda query: query.reply(b"!"))
        host, _, port = here.endpoint.removeprefix("tcp/").partition(":")
        for _ in range(300):
            here.stack.enter_context(socket.create_connection((host, int(port))))
        client = await here.client(None)
        while (
            await client.bus.ask(LEFT.question("x"), b"?", timeout=patience(1), urgency=Urgency.COMMAND)
            is None
        ):
            pass


async def test_a_flood_of_questions_is_dropped_at_its_connection() -> None:
    """Each took the interpreter from the agent's loop. Those of others, and about others, are answered."""
    names = [GripperName("lab", "cell", f"g{number}") for number in range(16)]
    read: list[str] = []

    def sort(key: str, _: object) -> MessageKind | None:
        read.append(key)
        return None if key.endswith("/flood") else MessageKind.QUESTION

    async with line(protocol="tcp", seconds=20) as here:
        grippers = [each.gripper for each in names]
        agent = await here.open(agent_configuration("lab", "cell", grippers, [here.endpoint]))
        for name in names:
            agent.serve(name.key("info", "*"), lambda query: query.reply(b"!"), sort)
        flooder, other = [await here.client(None) for _ in range(2)]

        def ask(client: Client, name: GripperName, who: str, limit: float = 1.0) -> asyncio.Future[Any]:
            question = name.question(who)
            return client.bus.ask(question, b"?", timeout=patience(limit), urgency=Urgency.QUESTION)

        async def wait_for_answer(client: Client) -> None:
            while await ask(client, names[1], "x") is None:
                pass

        for client in (flooder, other):
            await wait_for_answer(client)
        sent, took = 500, float("inf")
        while took > sent / QUESTIONS_HZ / 2:  # the machine is too busy for a flood
            read.clear()
            begun = now()
            for _ in range(sent):
                ask(flooder, names[0], "flood")
            answers = await asyncio.gather(*(ask(other, name, "x", PATIENCE) for name in names))
            assert None not in answers
            await wait_for_answer(flooder)  # behind the flood
            took = now() - begun
        assert 0 < read.count(names[0].question("flood")) <= took * QUESTIONS_HZ + 1


async def test_many_are_found_at_once() -> None:
    async with line(protocol="tcp", seconds=20) as here:
        agent, client = await here.agent_bus(), (await here.client(None)).bus
        keys = {f"robotiq/v1/lab/cell/g{number}/alive/1" for number in range(MANY)}
        tokens = [agent.announce(key) for key in keys]
        while set(await client.announced("robotiq/v1/lab/*/*/alive/*", timeout=patience(1))) != keys:
            pass
        assert await client.announced("robotiq/v1/nowhere/**", timeout=0.5) == []
        for take_back in tokens:
            take_back()
    assert await client.announced("robotiq/v1/**", timeout=0.5) == [], "closed"


async def test_endpoints_that_are_not_reached() -> None:
    """One that is written as a name is another word for what zenoh is connected to."""
    async with (
        line(protocol="tcp", seconds=20) as one,
        line(protocol="tcp", seconds=20) as two,
        line(protocol="tcp", seconds=20) as none,
    ):
        await one.agent_bus()
        agent = await two.agent_bus()
        endpoints = [one.endpoint, two.endpoint.replace("127.0.0.1", "localhost"), none.endpoint]
        client = await one.open(client_configuration(endpoints))
        while await client.unreached() != endpoints[2:]:  # noqa: ASYNC110  # there is no event to wait for
            await asyncio.sleep(0.05)
        await agent.close()
        while await client.unreached() != endpoints[1:]:  # noqa: ASYNC110
            await asyncio.sleep(0.05)


async def test_a_report_of_endpoints_waits_for_all_names_at_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """With a name server that did not answer, the outcome of a halt of all came a second later for each."""
    names = [f"cell-{number}.invalid" for number in range(4)]
    asked = threading.Barrier(len(names))

    def resolve(host: str, *_: object, **__: object) -> list[object]:
        assert host in names
        asked.wait(2 * patience(PATIENCE))
        raise socket.gaierror("no name server")

    monkeypatch.setattr(zenoh_bus, "RESOLVED_S", 2 * patience(PATIENCE))
    monkeypatch.setattr(socket, "getaddrinfo", resolve)
    endpoints = [f"tcp/{name}:7447" for name in names]
    bus = await open_bus(client_configuration(endpoints, insecure=True), "the fleet")
    try:
        async with asyncio.timeout(patience(PATIENCE)):
            assert await bus.unreached() == endpoints
    finally:
        await bus.close()


# -- uvloop ------------------------------------------------------------------------------------------------


async def moved() -> None:
    server = SimulatorServer(active_gripper(speedup=20.0, spread=False))
    async with line(protocol="tcp", seconds=3 * PATIENCE) as here, server:
        await here.serve(RobotiqHand(server.address))
        client = await here.client(None)
        async with RemoteHand(str(LEFT), bus=client.bus) as hand:
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


def test_a_hand_moves_and_halts_in_uvloop() -> None:
    pytest.importorskip("uvloop").run(moved())
