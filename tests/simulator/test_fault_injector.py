"""Troubles that happen: each kind on the wire, plans in virtual time, and how all of it ends."""

from __future__ import annotations

import asyncio
import itertools
import re
import struct
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager, suppress
from dataclasses import replace

import pytest

from robotiq_async.runtime.clock import now
from robotiq_async.simulator import (
    RtuOverTcpSimulatorServer,
    SerialSimulatorServer,
    SimulatorServer,
    Trouble,
)
from robotiq_async.simulator import parse_troubles as plan_of
from robotiq_async.simulator.server.endpoint import SimulatorEndpoint
from robotiq_async.simulator.troubles.fault_injector import Ongoing
from robotiq_async.simulator.troubles.trouble import KINDS
from robotiq_async.values.enums import Fault
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.simulator.conftest import simulator
from tests.simulator.test_serial_frames import READ as READ_SERIAL
from tests.simulator.test_serial_frames import RESET_READING, line
from tests.simulator.test_server import RawClient, raw_client

pytestmark = pytest.mark.virtual_time

READ = bytes.fromhex("04 0000 0001")
AXES_ASKED = tuple(AxisRequest(10 * n, 100 + n, 200 + n) for n in range(1, 5))
ACTIVE = Request(activate=True, axes=AXES_ASKED, individual_fingers=False, individual_scissor=False)
MISFITS = {
    "tcp": {"wrong-checksum"},
    "rtu": {
        *("wrong-transaction", "wrong-protocol", "exception", "reset", "close", "accept-silence", "refuse"),
        *("multiplexer", "wake-needed", "one-connection-only"),
    },
    "rtu+tcp": {"wrong-transaction", "wrong-protocol", "exception"},
}
"""What cannot happen on a kind of link."""


@asynccontextmanager
async def carried_out(
    server: SimulatorServer, words: str, told: list[str]
) -> AsyncIterator[asyncio.Task[None]]:
    """A plan that is under way, with what it has told."""
    plan = asyncio.create_task(
        server.fault_injector.run(plan_of(words), lambda trouble: told.append(str(trouble)))
    )
    try:
        yield plan
    finally:
        await cancelled(plan)


async def cancelled(task: asyncio.Task[None]) -> None:
    task.cancel()
    with suppress(asyncio.CancelledError):
        await task


def write(value: int) -> bytes:
    """A request that writes register 1."""
    return struct.pack(">BHH", 6, 1, value)


def status(server: SimulatorEndpoint) -> RobotiqStatus:
    return RobotiqStatus.from_registers(server.gripper.status_registers())


async def is_answered(client: RawClient, pdu: bytes = READ) -> bool:
    """Whether a request is answered within half a second."""
    client.writer.write(client.frame(pdu))
    try:
        async with asyncio.timeout(0.5):
            transaction, _, answer = await client.reply()
    except TimeoutError:
        return False
    assert (transaction, answer[0]) == (client.transaction, pdu[0])
    return True


async def is_let_in(server: SimulatorServer) -> bool:
    """Whether a new client is let in and answered."""
    try:
        async with raw_client(server) as client:
            return await is_answered(client)
    except ConnectionRefusedError:
        return False


async def activate(server: SimulatorServer) -> None:
    """In the basic mode: B and C follow A, the scissor follows the mode."""
    server.gripper.write(0, ACTIVE.registers)
    await asyncio.sleep(10)
    assert status(server).is_activated


# What one thing after another leads to.

TWICE = tuple(itertools.product(("refuse", "power-cut"), ("refuse", "power-cut"), (1, 2)))
SCENES = {
    "the lost reply to a write": "connect, begin drop on write, read yes, write no, carried out 1, "
    "write yes, hits 1, lasting 0",
    "two drops": "connect, begin drop for 60, begin drop for 60, read no, read no, read no, hits 3, "
    "lasting 2, end 1, lasting 1, read no, end 2, read yes",
    "the older one is not about writes": "connect, begin delay 0.3 on read, begin drop, takes 0.3, hits 1, "
    "lasting 2, write no, lasting 1",
    "in silence nothing is heard and connections stay": "connect, begin silence, write no, read no, "
    "let in no, hits 3, end 1, read yes, writes 0",
    "silence for once": "connect, begin silence once, write no, write yes, writes 1, carried out 2",
    "accepted in silence": "begin accept-silence, connect, write no, writes 0, end 1, read yes",
    "without power the gripper forgets everything": "activate, begin power-cut, powered no, let in no, "
    "end 1, powered yes, let in yes, shows reset",
    # Refused until the last of two ends, in any order.
    **{
        f"{first}, {second}, {ending} first": f"begin {first}, begin {second}, end {ending}, let in no, "
        f"powered {'yes' if (first, second)[2 - ending] == 'refuse' else 'no'}, "
        f"end {3 - ending}, let in yes, powered yes"
        for first, second, ending in TWICE
    },
    # It does not start a server that was stopped.
    **{
        f"{kind} ends after a stop": f"begin {kind}, stop, end 1, running no, powered yes, let in no"
        for kind in ("refuse", "power-cut")
    },
    "two slow devices": "begin slow-device 0.2, begin slow-device 0.5, end 1, cycle 0.5, end 2, cycle 0.005",
    "of two faults the greater lasts": "begin fault 14, begin interference, end 2, fault 14",
    "interference outlasts a fault": "begin interference, begin fault 9, end 2, fault 10",
    "a fault outlasts a greater one": "begin fault 9, begin fault 14, end 2, fault 9",
    "what is over stays over": "begin fault 9, end 1, inject 14, end 1, fault 14",
    "a fault": "activate, begin fault, fault 9, wait 60, fault 9, end 1, fault 0, lasting 0",
    "fault 15": "activate, begin fault 15, fault 15, wait 60, fault 15, end 1, fault 0",
    "interference": "activate, begin interference, fault 10, wait 60, fault 14, end 1, fault 0",
    "a release is an event": "activate, begin release, lasting 0, fault 11, wait 60, fault 15",
    # Any request counts, and the connection stays.
    "an idle gripper loses its activation": "connect, activate, begin idle-reset 2, wait 1.9, read yes, "
    "wait 1.9, write yes, wait 1.9, shows active, wait 0.2, shows reset, read yes, end 1, activate, "
    "wait 100, shows active",
    "what is not heard is no request": "connect, activate, begin idle-reset 2, begin silence, read no, "
    "read no, read no, read no, read no, shows reset",
    "what is heard and not answered is one": "connect, activate, begin idle-reset 2, begin drop for 9, "
    "read no, read no, read no, read no, read no, shows active",
    "an idle gripper without power": "begin power-cut, begin idle-reset 1, wait 5, end 2, powered no",
    "the least patient of two": "activate, begin idle-reset 9, begin idle-reset 2, wait 1, end 2, wait 8, "
    "shows active, wait 2, shows reset",
}
"""Troubles in their own words begin, and the first, the second of them ends; a read, a write (of 1, of 2,
...) of the one client is answered or not, a new client let in or not; hits are those of the first trouble."""


@pytest.mark.parametrize("name", SCENES)
async def test_a_scene(server: SimulatorServer, name: str) -> None:
    injector, gripper = server.fault_injector, server.gripper
    begun: list[Ongoing] = []
    clients: list[RawClient] = []
    values = itertools.count(1)
    async with AsyncExitStack() as stack:
        for step in SCENES[name].split(", "):
            what, _, argument = step.rpartition(" ") if " " in step else (step, "", "")
            match what.split():
                case ["connect"]:
                    clients.append(await stack.enter_async_context(raw_client(server)))
                case ["begin", *_]:
                    begun.append(await injector.begin(*plan_of(step.removeprefix("begin "))))
                case ["end"]:
                    await injector.end(begun[int(argument) - 1])
                case ["read"]:
                    assert await is_answered(clients[0]) is (argument == "yes"), step
                case ["write"]:
                    assert await is_answered(clients[0], write(next(values))) is (argument == "yes"), step
                case ["takes"]:
                    began = now()
                    assert await is_answered(clients[0])
                    assert now() - began == pytest.approx(float(argument), abs=0.01)
                case ["let", "in"]:
                    assert await is_let_in(server) is (argument == "yes"), step
                case ["hits"]:
                    assert begun[0].hits == int(argument)
                case ["lasting"]:
                    assert injector.ongoing == tuple(each for each in begun if not each.over.is_set())
                    assert len(injector.ongoing) == int(argument), step
                case ["carried", "out"]:
                    assert gripper.request_registers[1] == int(argument), step
                case ["writes"]:
                    assert len(gripper.writes) == int(argument)
                case ["activate"]:
                    await activate(server)
                case ["wait"]:
                    await asyncio.sleep(float(argument))
                case ["shows"]:
                    shown = status(server)
                    assert (shown.is_activated, shown.is_reset) == (argument == "active", argument == "reset")
                    assert argument == "active" or gripper.request_registers == (0,) * 8
                case ["fault"]:
                    assert status(server).fault == int(argument), step
                case ["inject"]:
                    gripper.inject_fault(int(argument))
                case ["powered"]:
                    assert gripper.is_powered is (argument == "yes"), step
                case ["running"]:
                    assert server.is_running is (argument == "yes")
                case ["cycle"]:
                    assert gripper.device_cycle == float(argument), step
                case ["stop"]:
                    await server.stop()
                case _:
                    raise AssertionError(step)


# Replies.


async def test_the_policy_decides_on_replies_that_no_trouble_is_about(
    server: SimulatorServer, client: RawClient
) -> None:
    seen: list[bytes] = []

    def policy(reply: bytes) -> list[tuple[float, bytes]]:
        seen.append(reply)
        return [(0.0, reply)]

    server.policy = policy
    async with server.fault_injector.making(Trouble("delay", 0.1, on="read")):
        assert await is_answered(client)
        assert seen == []
        assert await is_answered(client, write(5))
    assert await is_answered(client)
    assert [reply[7] for reply in seen] == [6, 4]


async def ask_and_go(server: SimulatorServer, pdu: bytes = READ) -> bytes:
    """Ask, do not wait for the answer, and return what was asked."""
    async with raw_client(server) as client:
        request = client.frame(pdu)
        client.writer.write(request)
        await asyncio.sleep(0.01)
    return request


async def test_a_multiplexer_hands_late_replies_to_the_next_client(server: SimulatorServer) -> None:
    await server.fault_injector.begin(Trouble("multiplexer", 0.1))
    request = await ask_and_go(server)
    await asyncio.sleep(1)
    async with raw_client(server) as client:
        transaction, _, answer = await client.reply()
        assert (transaction, answer[0]) == (int.from_bytes(request[:2], "big"), request[7])
        assert await is_answered(client), "its own follow"
    async with raw_client(server) as client:
        assert await is_answered(client), "nothing comes twice"


async def test_a_multiplexer_hands_a_late_reply_to_whoever_is_connected_then(server: SimulatorServer) -> None:
    await server.fault_injector.begin(Trouble("multiplexer"))
    began = now()
    await ask_and_go(server, write(5))
    assert server.gripper.request_registers[1] == 5, "it was carried out"
    async with raw_client(server), raw_client(server) as newest:
        assert (await newest.reply())[2][0] == 6
    assert now() - began == pytest.approx(0.7, abs=0.01)


@pytest.mark.parametrize("kind", ["multiplexer", "delay"])
async def test_without_a_multiplexer_replies_of_clients_that_are_gone_are_lost(
    server: SimulatorServer, kind: str
) -> None:
    async with server.fault_injector.making(Trouble(kind, 0.1)):
        await ask_and_go(server)
        await asyncio.sleep(0.2 if kind == "multiplexer" else 0)
    await asyncio.sleep(0.2)
    async with raw_client(server) as client:
        assert await is_answered(client)


async def test_a_multiplexer_keeps_no_more_than_a_hundred_replies(server: SimulatorServer) -> None:
    await server.fault_injector.begin(Trouble("multiplexer", 0.1))
    async with raw_client(server) as client:
        client.writer.write(b"".join(client.frame(READ) for _ in range(300)))
        await asyncio.sleep(0.05)
    await asyncio.sleep(1)
    async with raw_client(server) as client:
        assert [(await client.reply())[0] for _ in range(100)] == list(range(201, 301))
        assert await is_answered(client)


# Troubles that overlap.


@pytest.mark.parametrize(
    ("kind", "request_"),
    [
        ("wrong-function", "04 0000 0009"),
        ("wrong-length", "05 0000 0001"),
        ("wrong-echo", "06 07d0 0001"),
        ("wrong-echo", "10 0000 0009 12" + "00" * 18),
    ],
)
async def test_a_refusal_is_not_corrupted(
    server: SimulatorServer, client: RawClient, kind: str, request_: str
) -> None:
    begun = await server.fault_injector.begin(Trouble(kind))
    assert (await client.ask(bytes.fromhex(request_)))[0] & 0x80
    assert begun.hits == 0


async def test_a_plan_waits_for_what_happens_once(server: SimulatorServer, client: RawClient) -> None:
    plan = asyncio.create_task(server.fault_injector.run(plan_of("drop")))
    await asyncio.sleep(100)
    assert not plan.done()
    assert not await is_answered(client)
    await plan
    assert server.fault_injector.ongoing == ()


# The gripper.


@pytest.mark.parametrize(("value", "position"), [(None, 128), (0, 0)])
async def test_another_client_sends_all_axes_somewhere(
    server: SimulatorServer, value: int | None, position: int
) -> None:
    await activate(server)
    await server.fault_injector.begin(Trouble("foreign", value))
    assert server.fault_injector.ongoing == ()
    image = Request.from_registers(server.gripper.request_registers)
    assert (image.activate, image.go) == (True, True)
    assert image.axes == tuple(replace(axis, position=position) for axis in AXES_ASKED)
    await asyncio.sleep(60)
    reached = [server.gripper.position(axis) for axis in THREE_FINGER.axes]
    assert reached == [max(position, 6)] * 3 + [max(position, 15)]


@pytest.mark.parametrize(("value", "seconds"), [(None, 0.2), (1.5, 1.5)])
async def test_requests_to_a_slow_device_take_effect_later(value: float | None, seconds: float) -> None:
    async with simulator(speedup=5, device_cycle=0.02) as server:
        async with server.fault_injector.making(Trouble("slow-device", value)):
            server.gripper.write(0, Request(activate=True).registers)
            await asyncio.sleep(seconds - 0.01)
            assert not status(server).activation_echo
            await asyncio.sleep(0.02)
            assert status(server).activation_echo
        assert server.gripper.device_cycle == 0.02


# Beginning and ending.


async def test_a_block_that_fails_ends_its_trouble(server: SimulatorServer) -> None:
    with pytest.raises(ZeroDivisionError):
        async with server.fault_injector.making(Trouble("refuse")):
            raise ZeroDivisionError
    assert server.fault_injector.ongoing == ()
    assert await is_let_in(server)


@pytest.mark.parametrize(
    ("kind", "error", "message"),
    [
        *((kind, RuntimeError, "not running") for kind in ("reset", "close", "refuse", "power-cut")),
        ("accept-silence", RuntimeError, "not running"),
        ("wrong-checksum", ValueError, "wrong-checksum does not fit a simulator on tcp"),
    ],
)
async def test_what_cannot_begin_changes_nothing(kind: str, error: type[Exception], message: str) -> None:
    server = SimulatorServer()
    with pytest.raises(error, match=message):
        await server.fault_injector.begin(Trouble(kind))
    assert server.fault_injector.ongoing == ()
    assert server.gripper.is_powered


def test_what_fits_which_link() -> None:
    servers = SimulatorServer(), SerialSimulatorServer("/dev/ttyFAR"), RtuOverTcpSimulatorServer()
    for kind, server in itertools.product(KINDS, servers):
        if kind not in MISFITS[server.link]:
            server.fault_injector.check([Trouble(kind)])
        else:
            message = f"{kind} does not fit a simulator on {server.link}"
            with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
                server.fault_injector.check([Trouble("silence"), Trouble(kind)])


async def test_of_a_plan_that_does_not_fit_nothing_begins() -> None:
    server = SerialSimulatorServer("/dev/ttyFAR")
    told: list[Trouble] = []
    with pytest.raises(ValueError, match="refuse does not fit a simulator on rtu"):
        await server.fault_injector.run(plan_of("fault 9; refuse at 10"), told.append)
    assert told == []
    assert server.fault_injector.ongoing == ()
    assert status(server).fault is Fault.NONE


# Plans.


async def test_each_at_its_time_and_for_as_long_as_it_says(
    server: SimulatorServer, client: RawClient
) -> None:
    began = now()
    told: list[tuple[float, Trouble]] = []
    plan = plan_of("silence at 5 for 2; fault at 6 for 9; drop for 1")
    carrying_out = asyncio.create_task(
        server.fault_injector.run(plan, lambda trouble: told.append((now() - began, trouble)))
    )
    seen = []
    for _ in range(17):
        seen.append((await is_answered(client), status(server).fault))
        await asyncio.sleep(began + len(seen) - now())
    none, fault = Fault.NONE, Fault.COMMUNICATION_NOT_READY
    # A second each: the drop, four quiet ones, two of silence, and the fault.
    expected = [(False, none)] + [(True, none)] * 4 + [(False, none), (False, fault)]
    assert seen == expected + [(True, fault)] * 8 + [(True, none)] * 2
    assert told == [(0, plan[2]), (5, plan[0]), (6, plan[1])]
    assert server.fault_injector.ongoing == ()
    await carrying_out


@pytest.mark.parametrize(("words", "seconds"), [("fault at 1 for 6; close at 4", 7), ("", 0)])
async def test_a_plan_is_over_when_its_last_trouble_is(
    server: SimulatorServer, words: str, seconds: float
) -> None:
    began = now()
    await server.fault_injector.run(plan_of(words))
    assert now() - began == pytest.approx(seconds)
    assert server.fault_injector.ongoing == ()


async def test_again_and_again(server: SimulatorServer) -> None:
    began = now()
    told: list[float] = []
    carrying_out = asyncio.create_task(
        server.fault_injector.run(
            plan_of("power-cut at 1 for 2 every 10"), lambda _: told.append(now() - began)
        )
    )
    powered = []
    for second in range(35):
        await asyncio.sleep(began + second + 0.5 - now())
        powered.append(server.gripper.is_powered)
    assert [second for second, is_on in enumerate(powered) if not is_on] == [1, 2, 11, 12, 21, 22, 31, 32]
    assert told == pytest.approx([1, 11, 21, 31])
    await cancelled(carrying_out)


async def test_once_and_again_and_what_has_met_nothing_does_not_pile_up(
    server: SimulatorServer, client: RawClient
) -> None:
    told: list[str] = []
    async with carried_out(server, "drop every 10", told):
        answered = []
        for pause in (5, 10, 95):
            await asyncio.sleep(pause)
            answered += [await is_answered(client) for _ in range(3)]
    assert answered == [False, True, True] * 3
    assert told == ["drop every 10"] * 12


async def test_it_is_told_before_it_begins(server: SimulatorServer) -> None:
    seen = []
    await server.fault_injector.run(plan_of("fault 9 for 1"), lambda _: seen.append(status(server).fault))
    assert seen == [Fault.NONE]


@pytest.mark.parametrize(
    "words",
    [
        *("accept-silence", "drop for ever", "interference", "drop every 10"),
        *("refuse; power-cut; silence; fault 9; slow-device 3", "refuse for 60 every 61"),
    ],
)
async def test_a_plan_that_is_cancelled_ends_its_troubles(words: str) -> None:
    async with simulator(device_cycle=0.02) as server:
        async with carried_out(server, words, []) as plan:
            await asyncio.sleep(30)
            assert len(server.fault_injector.ongoing) == len(words.split(";"))
        assert plan.cancelled()
        assert server.fault_injector.ongoing == ()
        assert server.gripper.is_powered
        assert server.gripper.device_cycle == 0.02
        assert status(server).fault is Fault.NONE
        assert await is_let_in(server)


@pytest.mark.parametrize("words", ["refuse at 60", "refuse for 1 every 60", "refuse for 1 at 1 every 60"])
async def test_what_has_not_begun_when_the_plan_is_cancelled_never_begins(
    server: SimulatorServer, words: str
) -> None:
    told: list[str] = []
    async with carried_out(server, words, told):
        await asyncio.sleep(30)
    begun = len(told)
    await asyncio.sleep(100)
    assert len(told) == begun
    assert await is_let_in(server)


async def test_a_port_that_somebody_took_meanwhile(server: SimulatorServer) -> None:
    plan = asyncio.create_task(server.fault_injector.run(plan_of("refuse for 10; fault 9; slow-device 3")))
    await asyncio.sleep(5)
    other = await asyncio.get_running_loop().create_server(asyncio.Protocol, "127.0.0.1", server.port)
    with pytest.raises(OSError, match="address in use"):
        await plan
    other.close()
    assert server.fault_injector.ongoing == ()
    assert status(server).fault is Fault.NONE
    assert server.gripper.device_cycle == 0.005


# On a serial line.


@pytest.mark.parametrize("kind", ["silence", "power-cut", "drop"])
async def test_no_answer_on_a_serial_line(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    async with line(monkeypatch) as (server, client):
        async with server.fault_injector.making(Trouble(kind, lasts=60)):
            assert [await client.ask(READ_SERIAL) for _ in range(2)] == [b"", b""]
        assert await client.ask(READ_SERIAL) == RESET_READING


async def test_a_wrong_checksum_on_a_serial_line(monkeypatch: pytest.MonkeyPatch) -> None:
    async with line(monkeypatch) as (server, client):
        await server.fault_injector.begin(Trouble("wrong-checksum"))
        assert await client.ask(READ_SERIAL) == RESET_READING[:-1] + bytes((RESET_READING[-1] ^ 1,))
        assert await client.ask(READ_SERIAL) == RESET_READING
