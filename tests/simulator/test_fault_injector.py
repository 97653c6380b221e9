"""Troubles that happen: each kind on the wire, plans in virtual time, and how all of it ends."""

from __future__ import annotations

import asyncio
import itertools
import re
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import replace

import pytest

from robotiq_async.runtime.clock import now
from robotiq_async.simulator import (
    FaultInjector,
    RtuOverTcpSimulatorServer,
    SerialSimulatorServer,
    SimulatorServer,
    Trouble,
    UrcapSimulatorServer,
)
from robotiq_async.simulator import parse_troubles as plan_of
from robotiq_async.simulator.server.endpoint import SimulatorEndpoint
from robotiq_async.simulator.troubles.trouble import KINDS
from robotiq_async.values.enums import Fault
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.simulator.conftest import simulator
from tests.simulator.kinds import EXPECTED
from tests.simulator.test_serial_frames import READ as READ_SERIAL
from tests.simulator.test_serial_frames import RESET_READING, line
from tests.simulator.test_server import RawClient, raw_client

pytestmark = pytest.mark.virtual_time

READ = bytes.fromhex("04 0000 0001")
AXES_ASKED = tuple(AxisRequest(10 * n, 100 + n, 200 + n) for n in range(1, 5))
ACTIVE = Request(activate=True, axes=AXES_ASKED, individual_fingers=False, individual_scissor=False)


def test_it_shows_what_users_may_call() -> None:
    """The server's part, which decides on requests and replies, is not theirs."""
    shown = {name for name in dir(FaultInjector) if not name.startswith("_")}
    assert shown == {"begin", "check", "end", "making", "ongoing", "run"}


@asynccontextmanager
async def carried_out(
    server: SimulatorServer, words: str, announced: list[str]
) -> AsyncIterator[asyncio.Task[None]]:
    """A plan that runs, with its announcements."""
    plan = asyncio.create_task(
        server.fault_injector.run(plan_of(words), lambda trouble: announced.append(str(trouble)))
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
    """Activate it in the basic mode: B and C follow A, the scissor follows the mode."""
    server.gripper.write(0, ACTIVE.registers)
    await asyncio.sleep(10)
    assert status(server).is_activated


# Replies.


async def test_the_lost_reply_to_a_write(server: SimulatorServer, client: RawClient) -> None:
    lost = await server.fault_injector.begin(Trouble("drop", on="write"))
    assert await is_answered(client)
    assert not await is_answered(client, write(5))
    assert server.gripper.request_registers[1] == 5, "it was carried out"
    assert await is_answered(client, write(6))
    assert lost.hits == 1
    assert server.fault_injector.ongoing == ()


async def test_all_replies_are_lost_until_the_last_of_two_ends(
    server: SimulatorServer, client: RawClient
) -> None:
    one, other = [await server.fault_injector.begin(Trouble("drop", lasts=60)) for _ in range(2)]
    assert [await is_answered(client) for _ in range(3)] == [False] * 3
    assert (one.hits, other.hits) == (3, 0)
    assert server.fault_injector.ongoing == (one, other)
    await server.fault_injector.end(one)
    assert server.fault_injector.ongoing == (other,)
    assert not await is_answered(client)
    await server.fault_injector.end(other)
    assert await is_answered(client)


async def test_the_oldest_trouble_acts(server: SimulatorServer, client: RawClient) -> None:
    older = await server.fault_injector.begin(Trouble("delay", 0.3, on="read"))
    newer = await server.fault_injector.begin(Trouble("drop"))
    began = now()
    assert await is_answered(client)
    assert now() - began == pytest.approx(0.3, abs=0.01)
    assert (older.hits, newer.hits) == (1, 0)
    assert not await is_answered(client, write(5)), "the older one is not about writes"
    assert server.fault_injector.ongoing == (older,)


async def test_a_late_reply_holds_up_the_next_one(server: SimulatorServer, client: RawClient) -> None:
    began = now()
    await server.fault_injector.begin(Trouble("late"))
    client.writer.write(client.frame(write(5)) + client.frame(READ))
    assert (await client.reply())[2][0] == 6
    assert now() - began == pytest.approx(0.7, abs=0.01)
    assert (await client.reply())[2][0] == 4


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


# Requests and connections.


async def test_in_silence_nothing_is_heard_and_connections_stay(
    server: SimulatorServer, client: RawClient
) -> None:
    async with server.fault_injector.making(Trouble("silence")) as silence:
        assert not await is_answered(client, write(5))
        assert not await is_answered(client)
        assert not await is_let_in(server), "new connections are accepted and not answered"
        assert silence.hits == 3
    assert await is_answered(client)
    assert server.gripper.writes == ()


async def test_silence_for_once_is_one_request_that_is_not_heard(
    server: SimulatorServer, client: RawClient
) -> None:
    await server.fault_injector.begin(Trouble("silence", lasts=0))
    assert not await is_answered(client, write(5))
    assert await is_answered(client, write(6))
    assert [each.registers[1] for each in server.gripper.writes] == [6]


async def test_accepted_in_silence_and_answered_after_it(server: SimulatorServer) -> None:
    silence = await server.fault_injector.begin(Trouble("accept-silence"))
    async with raw_client(server) as client:
        assert not await is_answered(client, write(5))
        assert server.gripper.writes == ()
        await server.fault_injector.end(silence)
        assert await is_answered(client)


async def test_without_power_the_gripper_forgets_everything(server: SimulatorServer) -> None:
    await activate(server)
    async with server.fault_injector.making(Trouble("power-cut")):
        assert not server.gripper.is_powered
        assert not await is_let_in(server)
    assert server.gripper.is_powered
    assert await is_let_in(server)
    assert status(server).is_reset
    assert server.gripper.request_registers == (0,) * 8


@pytest.mark.parametrize("first", ["refuse", "power-cut"])
@pytest.mark.parametrize("second", ["refuse", "power-cut"])
@pytest.mark.parametrize("in_order", [True, False])
async def test_refused_until_the_last_of_two_ends(
    server: SimulatorServer, first: str, second: str, in_order: bool
) -> None:
    begun = [await server.fault_injector.begin(Trouble(kind)) for kind in (first, second)]
    assert server.gripper.is_powered == ("power-cut" not in (first, second))
    ending, lasting = begun if in_order else begun[::-1]
    await server.fault_injector.end(ending)
    assert not await is_let_in(server)
    assert server.gripper.is_powered == (lasting.trouble.kind == "refuse")
    await server.fault_injector.end(lasting)
    assert await is_let_in(server)
    assert server.gripper.is_powered


async def ask_and_go(server: SimulatorServer, pdu: bytes = READ) -> bytes:
    """Send a request, do not wait for the answer, and return the request."""
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


async def test_a_multiplexer_sends_a_late_reply_to_the_next_client(server: SimulatorServer) -> None:
    await server.fault_injector.begin(Trouble("multiplexer"))
    began = now()
    await ask_and_go(server, write(5))
    assert server.gripper.request_registers[1] == 5, "it was carried out"
    async with raw_client(server), raw_client(server), raw_client(server) as newest:
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


@pytest.mark.parametrize("kind", ["refuse", "power-cut"])
async def test_ending_it_does_not_start_a_server_that_was_stopped(server: SimulatorServer, kind: str) -> None:
    begun = await server.fault_injector.begin(Trouble(kind))
    await server.stop()
    await server.fault_injector.end(begun)
    assert not server.is_running
    assert server.gripper.is_powered
    assert not await is_let_in(server)


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


async def test_two_slow_devices_are_both_undone(server: SimulatorServer) -> None:
    one = await server.fault_injector.begin(Trouble("slow-device", 0.2))
    other = await server.fault_injector.begin(Trouble("slow-device", 0.5))
    await server.fault_injector.end(one)
    assert server.gripper.device_cycle == 0.5, "the other one lasts"
    await server.fault_injector.end(other)
    assert server.gripper.device_cycle == 0.005


@pytest.mark.parametrize(
    ("first", "second", "left"),
    [
        ("fault 14", "interference", 14),
        ("interference", "fault 9", 10),
        ("fault 9", "fault 14", 9),
    ],
)
async def test_a_fault_outlasts_another(server: SimulatorServer, first: str, second: str, left: int) -> None:
    (lasting,), (ending,) = plan_of(first), plan_of(second)
    async with server.fault_injector.making(lasting):
        async with server.fault_injector.making(ending):
            pass
        assert status(server).fault is Fault(left)


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


@pytest.mark.parametrize(
    ("words", "at_once", "in_a_minute"),
    [("fault", 9, 9), ("fault 15", 15, 15), ("interference", 10, 14), ("release", 11, 15)],
)
async def test_a_fault_is_reported(
    server: SimulatorServer, words: str, at_once: int, in_a_minute: int
) -> None:
    await activate(server)
    (trouble,) = plan_of(words)
    async with server.fault_injector.making(trouble):
        assert status(server).fault == Fault(at_once)
        await asyncio.sleep(60)
        assert status(server).fault == Fault(in_a_minute)
    if words != "release":  # an event, which nothing undoes
        assert status(server).fault is Fault.NONE
    assert server.fault_injector.ongoing == ()


async def test_an_idle_gripper_loses_its_activation(server: SimulatorServer, client: RawClient) -> None:
    await activate(server)
    async with server.fault_injector.making(Trouble("idle-reset", 2)):
        await asyncio.sleep(1.9)
        for _ in range(5):
            assert await is_answered(client), "a request, whatever it asks"
            await asyncio.sleep(1.9)
            assert status(server).is_activated
        await asyncio.sleep(0.2)
        assert status(server).is_reset
        assert server.gripper.request_registers == (0,) * 8
        assert await is_answered(client), "the connection stays"
    await activate(server)
    await asyncio.sleep(100)
    assert status(server).is_activated, "it is over"


@pytest.mark.parametrize(
    ("silent", "is_reset"), [(Trouble("silence"), True), (Trouble("drop", lasts=9), False)]
)
async def test_requests_that_are_not_heard_do_not_count(
    server: SimulatorServer, client: RawClient, silent: Trouble, is_reset: bool
) -> None:
    await activate(server)
    async with (
        server.fault_injector.making(Trouble("idle-reset", 2)),
        server.fault_injector.making(silent),
    ):
        for _ in range(5):
            assert not await is_answered(client)
        assert status(server).is_reset is is_reset


async def test_an_idle_gripper_without_power_stays_without(server: SimulatorServer) -> None:
    async with server.fault_injector.making(Trouble("power-cut")):
        async with server.fault_injector.making(Trouble("idle-reset", 1)):
            await asyncio.sleep(5)
        assert not server.gripper.is_powered


async def test_the_least_patient_of_two_counts(server: SimulatorServer) -> None:
    await activate(server)
    async with server.fault_injector.making(Trouble("idle-reset", 9)):
        async with server.fault_injector.making(Trouble("idle-reset", 2)):
            await asyncio.sleep(1)
        await asyncio.sleep(8)
        assert status(server).is_activated
        await asyncio.sleep(2)
        assert status(server).is_reset


# Beginning and ending.


async def test_a_trouble_that_has_ended_stays_ended(server: SimulatorServer) -> None:
    begun = await server.fault_injector.begin(Trouble("fault", 9))
    await server.fault_injector.end(begun)
    server.gripper.inject_fault(14)
    await server.fault_injector.end(begun)
    assert status(server).fault is Fault.SCISSOR_BLOCKED


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
async def test_a_trouble_that_cannot_begin_changes_nothing(
    kind: str, error: type[Exception], message: str
) -> None:
    server = SimulatorServer()
    with pytest.raises(error, match=message):
        await server.fault_injector.begin(Trouble(kind))
    assert server.fault_injector.ongoing == ()
    assert server.gripper.is_powered


def test_which_troubles_fit_which_link() -> None:
    servers = (
        *(SimulatorServer(), SerialSimulatorServer("/dev/ttyFAR"), RtuOverTcpSimulatorServer()),
        UrcapSimulatorServer(),
    )
    for kind, server in itertools.product(KINDS, servers):
        if kind == "interference" and server.gripper.model is TWO_FINGER_85:
            continue  # of a scissor
        if kind == "controller-fault" and server.gripper.model is THREE_FINGER:
            continue  # of a jaw
        if server.link in EXPECTED[kind].links:
            server.fault_injector.check([Trouble(kind)])
        else:
            message = f"{kind} does not fit a simulator on {server.link}"
            with pytest.raises(ValueError, match=f"^{re.escape(message)}$"):
                server.fault_injector.check([Trouble("silence"), Trouble(kind)])


async def test_of_a_plan_that_does_not_fit_nothing_begins() -> None:
    server = SerialSimulatorServer("/dev/ttyFAR")
    announced: list[Trouble] = []
    with pytest.raises(ValueError, match="refuse does not fit a simulator on rtu"):
        await server.fault_injector.run(plan_of("fault 9; refuse at 10"), announced.append)
    assert announced == []
    assert server.fault_injector.ongoing == ()
    assert status(server).fault is Fault.NONE


# Plans.


async def test_each_at_its_time_and_for_as_long_as_it_says(
    server: SimulatorServer, client: RawClient
) -> None:
    began = now()
    announced: list[tuple[float, Trouble]] = []
    plan = plan_of("silence at 5 for 2; fault at 6 for 9; drop for 1")
    carrying_out = asyncio.create_task(
        server.fault_injector.run(plan, lambda trouble: announced.append((now() - began, trouble)))
    )
    seen = []
    for _ in range(17):
        seen.append((await is_answered(client), status(server).fault))
        await asyncio.sleep(began + len(seen) - now())
    none, fault = Fault.NONE, Fault.COMMUNICATION_NOT_READY
    # A second each: the drop, four quiet ones, two of silence, and the fault.
    expected = [(False, none)] + [(True, none)] * 4 + [(False, none), (False, fault)]
    assert seen == expected + [(True, fault)] * 8 + [(True, none)] * 2
    assert announced == [(0, plan[2]), (5, plan[0]), (6, plan[1])]
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
    announced: list[float] = []
    carrying_out = asyncio.create_task(
        server.fault_injector.run(
            plan_of("power-cut at 1 for 2 every 10"), lambda _: announced.append(now() - began)
        )
    )
    powered = []
    for second in range(35):
        await asyncio.sleep(began + second + 0.5 - now())
        powered.append(server.gripper.is_powered)
    assert [second for second, is_on in enumerate(powered) if not is_on] == [1, 2, 11, 12, 21, 22, 31, 32]
    assert announced == pytest.approx([1, 11, 21, 31])
    await cancelled(carrying_out)


async def test_once_and_again_and_what_has_met_nothing_does_not_pile_up(
    server: SimulatorServer, client: RawClient
) -> None:
    announced: list[str] = []
    async with carried_out(server, "drop every 10", announced):
        answered = []
        for pause in (5, 10, 95):
            await asyncio.sleep(pause)
            answered += [await is_answered(client) for _ in range(3)]
    assert answered == [False, True, True] * 3
    assert announced == ["drop every 10"] * 12


async def test_a_trouble_is_announced_before_it_begins(server: SimulatorServer) -> None:
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
async def test_troubles_not_begun_when_the_plan_is_cancelled_never_begin(
    server: SimulatorServer, words: str
) -> None:
    announced: list[str] = []
    async with carried_out(server, words, announced):
        await asyncio.sleep(30)
    begun = len(announced)
    await asyncio.sleep(100)
    assert len(announced) == begun
    assert await is_let_in(server)


async def test_a_port_that_was_taken_meanwhile(server: SimulatorServer) -> None:
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
