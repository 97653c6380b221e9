"""Figures for Prometheus, requested as Prometheus does."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import threading
import urllib.request

import anyio
import pytest
from prometheus_client.parser import text_string_to_metric_families

from robotiq_async import TWO_FINGER_85, Finger, GripperFaultError, MoveSupersededError, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.metrics import MOST_SCRAPES, serve_metrics
from tests.patience import patience

Samples = dict[tuple[str, str], float]


async def page(where: tuple[str, int]) -> str:
    """The page that Prometheus gets."""

    def get() -> str:
        with urllib.request.urlopen(f"http://{where[0]}:{where[1]}/metrics", timeout=patience(10)) as answer:
            text: str = answer.read().decode()
            return text

    return await asyncio.to_thread(get)


async def asked(where: tuple[str, int]) -> Samples:
    """Every sample, by its name and its second label."""
    families = text_string_to_metric_families(await page(where))
    return {
        (sample.name, next((v for k, v in sample.labels.items() if k != "hand"), "")): sample.value
        for family in families
        for sample in family.samples
    }


async def test_the_figures_are_the_hands(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    async with serve_metrics(hand, port=0) as where:
        assert where[0] == "127.0.0.1"
        await hand.move(100)
        gripper.place_object(Finger.ABC, 150)
        await hand.move(200)
        moving = asyncio.create_task(hand.move(0, speed=0))
        await hand.wait_for_state(State.RUNNING_CC)
        await hand.halt()
        with pytest.raises(MoveSupersededError):
            await moving
        moving = asyncio.create_task(hand.move(0, speed=0))
        await asyncio.sleep(0)  # begun
        moving.cancel()
        await asyncio.gather(moving, return_exceptions=True)
        moving = asyncio.create_task(hand.move(0, speed=0))
        await asyncio.sleep(0.02)
        gripper.inject_fault(13)
        with pytest.raises(GripperFaultError):
            await moving
        first = await asked(where)
        statistics = hand.statistics
        second = await asked(where)
    outcomes = ["reached", "contact", "MoveSupersededError", "cancelled", "GripperFaultError"]
    moves = {key[1]: value for key, value in first.items() if key[0] == "robotiq_moves_total"}
    assert moves == dict.fromkeys(outcomes, 1.0)
    assert dict(statistics.moves) == dict.fromkeys(outcomes, 1)
    assert first["robotiq_faults_total", ""] == 1
    for name in ("polls", "writes", "overruns", "reconnects", "foreign_commands"):
        key = (f"robotiq_{name}_total", "")
        assert first[key] <= getattr(statistics, name) <= second[key]
    assert 0 < first["robotiq_round_trip_p50_seconds", ""] <= first["robotiq_round_trip_p99_seconds", ""] < 1
    states = {key[1]: value for key, value in first.items() if key[0] == "robotiq_state"}
    assert states.pop("FAULT") == 1
    assert set(states.values()) == {0}
    assert len(states) == len(State) - 1


async def test_each_hand_has_its_name() -> None:
    left, right = RobotiqHand(name="left"), RobotiqHand()
    async with serve_metrics(left, right, port=0) as where:
        families = list(text_string_to_metric_families(await page(where)))
    labels = {sample.labels["hand"] for family in families for sample in family.samples}
    assert labels == {"left", right.address}
    samples = [sample for family in families for sample in family.samples]
    assert len({(each.name, *each.labels.items()) for each in samples}) == len(samples)


async def test_the_fault_of_a_controller_is_a_figure_of_hands_with_a_status() -> None:
    gripper = SimulatedGripper(model=TWO_FINGER_85)
    gripper.controller_fault = 0x0C
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address, name="jaw") as jaw,
        serve_metrics(jaw, RobotiqHand(name="idle"), port=0) as where,
    ):
        text = await page(where)
    lines = [line for line in text.splitlines() if line.startswith("robotiq_controller_fault")]
    assert lines == ['robotiq_controller_fault{hand="jaw"} 12.0']


async def test_connections_that_ask_nothing_use_up_neither_threads_nor_files(hand: RobotiqHand) -> None:
    """Each kept a thread and a file of the program that polls: then no link could be opened again."""
    async with serve_metrics(hand, port=0) as where, asyncio.timeout(patience(20)):
        threads = threading.active_count()
        opened = [await asyncio.open_connection(*where) for _ in range(2 * MOST_SCRAPES)]
        opened[0][1].write(b"GET /metr")
        assert threading.active_count() <= threads + MOST_SCRAPES
        for reader, writer in opened:
            with contextlib.suppress(ConnectionResetError):
                assert not await reader.read()
            writer.close()
        await asked(where)


async def test_no_name_server_is_asked_for_the_name_of_this_machine(
    hand: RobotiqHand, monkeypatch: pytest.MonkeyPatch
) -> None:
    """http.server asks for it, in the event loop: one that did not answer held up the polling for seconds."""
    names: list[str] = []
    monkeypatch.setattr(socket, "getfqdn", names.append)
    async with serve_metrics(hand, host="127.0.0.1", port=0) as where:
        await asked(where)
    assert not names


async def test_a_want_of_threads_uses_up_nothing(hand: RobotiqHand, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each scrape in that time was counted as one that runs: the server then refused all for good."""
    async with serve_metrics(hand, port=0) as where:

        def start(_: threading.Thread) -> None:
            raise RuntimeError("can't start new thread")

        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, "start", start)
            for _ in range(2 * MOST_SCRAPES):
                reader, writer = await asyncio.open_connection(*where)
                with contextlib.suppress(ConnectionError):
                    assert await reader.read() == b""
                writer.close()
        assert "robotiq_polls" in await page(where)


async def test_it_ends_with_the_block(hand: RobotiqHand) -> None:
    async with serve_metrics(hand, port=0) as where:
        with pytest.raises(OSError, match="in use"):
            async with serve_metrics(hand, port=where[1]):
                pass
        await asked(where)
    with pytest.raises(OSError, match="refused"):
        await asked(where)


async def test_it_ends_with_a_block_that_is_cancelled(hand: RobotiqHand) -> None:
    """As by stops_on_signals(): in a cancelled scope every await is cancelled again."""
    with anyio.CancelScope() as scope:
        async with serve_metrics(hand, port=0) as where:
            scope.cancel()
            await asyncio.sleep(60)
    with pytest.raises(OSError, match="refused"):
        await asked(where)


async def test_wrong_arguments(hand: RobotiqHand) -> None:
    twice = RobotiqHand(name="left"), RobotiqHand(name="left")
    for hands, port, words in (
        ((), 0, "at least one hand"),
        ((hand,), 65536, r"port must be in 0\.\.65535"),
        (twice, 0, "different names, got 'left' twice"),
    ):
        with pytest.raises(ValueError, match=words):
            async with serve_metrics(*hands, port=port):
                pass
