"""Cases that were found: troubles that overlap, cancelled ends, words and refusals."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async.simulator import SimulatorServer, Trouble, parse_troubles
from robotiq_async.simulator import parse_troubles as plan_of
from robotiq_async.values.enums import Fault
from tests.simulator.test_fault_injector import cancelled, is_answered, is_let_in, simulator, status
from tests.simulator.test_server import raw_client
from tests.virtual import virtual


@pytest.mark.parametrize(
    "trouble", [Trouble("delay", 0.1234567), Trouble("drop", at=12345.678), Trouble("drop", lasts=86399.99)]
)
def test_words_keep_all_digits(trouble: Trouble) -> None:
    assert parse_troubles(str(trouble)) == [trouble]


def test_a_remark_may_hold_a_semicolon() -> None:
    assert parse_troubles("drop  # lost; then found") == [Trouble("drop")]


@pytest.mark.parametrize("words", ["power cut at 5", "powercut now"])
def test_an_unknown_kind_is_named(words: str) -> None:
    with pytest.raises(ValueError, match="unknown trouble"):
        parse_troubles(words)


@virtual
@pytest.mark.parametrize(
    ("kind", "request_"),
    [
        ("wrong-function", "04 0000 0009"),
        ("wrong-length", "05 0000 0001"),
        ("wrong-echo", "06 07d0 0001"),
        ("wrong-echo", "10 0000 0009 12" + "00" * 18),
    ],
)
async def test_a_corrupted_refusal_is_sent(kind: str, request_: str) -> None:
    async with simulator() as server, raw_client(server) as client:
        await server.fault_injector.begin(Trouble(kind))
        client.writer.write(client.frame(bytes.fromhex(request_)))
        async with asyncio.timeout(5):
            assert await client.reader.read(100)


@virtual
async def test_two_slow_devices_are_both_undone() -> None:
    async with simulator() as server:
        one = await server.fault_injector.begin(Trouble("slow-device", 0.2))
        other = await server.fault_injector.begin(Trouble("slow-device", 0.5))
        await server.fault_injector.end(one)
        assert server.gripper.device_cycle != 0.005, "the other one lasts"
        await server.fault_injector.end(other)
        assert server.gripper.device_cycle == 0.005


@virtual
@pytest.mark.parametrize(
    ("first", "second", "left"),
    [
        ("fault 14", "interference", 14),
        ("interference", "fault 9", 10),
        ("fault 9", "fault 14", 9),
    ],
)
async def test_a_fault_outlasts_another(first: str, second: str, left: int) -> None:
    async with simulator() as server:
        (lasting,), (ending,) = plan_of(first), plan_of(second)
        async with server.fault_injector.making(lasting):
            async with server.fault_injector.making(ending):
                pass
            assert status(server).fault is Fault(left)


@virtual
@pytest.mark.parametrize("words", ["drop; silence at 100", "drop every 10"])
async def test_cancelled_it_ends_what_has_met_nothing(words: str) -> None:
    async with simulator() as server, raw_client(server) as client:
        plan = asyncio.create_task(server.fault_injector.run(plan_of(words)))
        await asyncio.sleep(1)
        await cancelled(plan)
        assert server.fault_injector.ongoing == ()
        assert await is_answered(client)


@virtual
async def test_a_plan_waits_for_what_happens_once() -> None:
    async with simulator() as server, raw_client(server) as client:
        plan = asyncio.create_task(server.fault_injector.run(plan_of("drop")))
        await asyncio.sleep(100)
        assert not plan.done()
        assert not await is_answered(client)
        await plan
        assert server.fault_injector.ongoing == ()


@pytest.mark.parametrize("turns", range(5))
async def test_cancelled_while_it_ends_clients_are_let_in_and_the_server_can_stop(turns: int) -> None:
    server = SimulatorServer()
    async with server:
        begun = await server.fault_injector.begin(Trouble("refuse"))
        ending = asyncio.create_task(server.fault_injector.end(begun))
        for _ in range(turns):
            await asyncio.sleep(0)
        await cancelled(ending)
        await server.fault_injector.end(begun)
        assert await is_let_in(server)
    assert not await is_let_in(server)


@virtual
async def test_a_reply_that_comes_later_is_not_overtaken() -> None:
    async with simulator() as server, raw_client(server) as client:
        await server.fault_injector.begin(Trouble("late"))
        requests = [client.frame(bytes.fromhex("04 0000 0008")), client.frame(bytes.fromhex("04 0000 0002"))]
        for request in requests:
            client.writer.write(request)
            await asyncio.sleep(0.1)
        replies = [await client.reader.readexactly(size) for size in (25, 13)]
        assert [reply[:2] for reply in replies] == [request[:2] for request in requests]
