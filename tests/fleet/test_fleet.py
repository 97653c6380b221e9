"""A fleet: its members, the age of their summaries, and the rest of one that was not entered."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from robotiq_async import State
from robotiq_async.fleet.fleet import Fleet, Summaries
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.values.errors import ProtocolError
from tests.fleet.lab import LEFT, Lab, lab
from tests.fleet.network import Network
from tests.virtual import inside, virtual

AHEAD = 5000.0
"""Our clock is so far ahead of the agent's."""


def summary(stamp: float, age: object = 0.0, **fields: Any) -> bytes:
    usual = {
        "to": LEFT.base,
        "epoch": 7,
        "stamp": stamp,
        "age": age,
        "state": "RUNNING_IDLE",
        "fault": 0,
        "model": "3f",
        "is_moving": False,
        "holder": None,
        "problem": "",
        "address": "tcp://192.168.1.11:502",
    }
    return json.dumps(usual | fields).encode()


def seen_at(summaries: Summaries, payload: bytes, arrival: float) -> Any:
    read = summaries.read(payload, arrival)
    assert read is not None
    assert read[0] == LEFT
    return read[1]["seen_at"]


def test_the_age_counts_from_when_the_agent_saw_the_gripper() -> None:
    summaries = Summaries()
    assert seen_at(summaries, summary(10.0, 0.25), 10.0 + AHEAD) == AHEAD + 9.75
    late = seen_at(summaries, summary(11.0, 0.25), 14.0 + AHEAD)
    assert late == pytest.approx(AHEAD + 10.75, abs=0.01), "the time on its way counts too"
    assert seen_at(summaries, summary(15.0, 4.5), 15.0 + AHEAD) == pytest.approx(AHEAD + 10.5, abs=0.01)
    assert seen_at(summaries, summary(16.0, None), 16.0 + AHEAD) is None, "it has not been read yet"


def test_an_overtaken_summary_is_dropped_and_each_run_has_its_own_clock() -> None:
    summaries = Summaries()
    assert seen_at(summaries, summary(10.0), 10.0 + AHEAD) == 10.0 + AHEAD
    assert summaries.read(summary(9.0, state="FAULT"), 10.1 + AHEAD) is None
    assert seen_at(summaries, summary(3.0, 1.0, epoch=8), 20.0 + AHEAD) == 19.0 + AHEAD


@pytest.mark.parametrize(
    "payload",
    [
        b"",
        b"[]",
        b"?",
        b"\xff",
        b"{}",
        summary(1.0, state="dancing"),
        summary(1.0, fault=99),
        summary(float("nan")),
        summary(1.0, float("inf")),
        summary(1.0, age="old"),
        summary(1.0, to="robotiq/v1/*/*/*"),
        summary(1.0, to=3),
        summary(1.0, holder=3),
        summary(1.0, model=None),
        summary(1.0, epoch="?"),
        b"[" * 3000,
    ],
)
def test_malformed_summaries_are_refused(payload: bytes) -> None:
    with pytest.raises(ProtocolError, match="a summary that cannot be read"):
        Summaries().read(payload, 1.0)


@pytest.mark.parametrize("fault", [None, 0, 14])
def test_of_a_model_that_is_unknown_here_the_state_is_known(fault: int | None) -> None:
    """The fault of a code depends on the model. Such a gripper was not to be seen at all."""
    read = Summaries().read(summary(1.0, model="5f\n", fault=fault, state="FAULT"), 1.0)
    assert read is not None
    assert (read[1]["model"], read[1]["state"], read[1]["fault"]) == ("5f\\n", State.FAULT, None)


@inside(lab)
async def test_the_age_of_a_gripper_that_is_out_of_reach_grows_although_its_agent_is_heard(here: Lab) -> None:
    async with Fleet("lab", bus=here.network.bus("screen")) as fleet:
        loop = asyncio.get_running_loop()
        await asyncio.sleep(1.5)
        seen = fleet.members[LEFT].seen_at
        assert seen is not None
        assert loop.time() - seen < 1.1
        stopped = loop.time()
        await here.server.stop()
        await asyncio.sleep(5)
        member = fleet.members[LEFT]
        assert member.seen_at == pytest.approx(stopped, abs=0.1)
        assert member.state in (State.DISCONNECTED, State.SHUTDOWN)
        await here.server.start()


@virtual
async def test_a_flood_of_summaries_that_are_none_fills_no_log(caplog: pytest.LogCaptureFixture) -> None:
    network = Network()
    async with Fleet("lab", bus=network.bus("screen")):
        publish = network.bus("stranger").publisher(LEFT.key("summary"), Urgency.TELEMETRY)
        for _ in range(1100):
            publish(b"rubbish\n\x1b[2J")
            await asyncio.sleep(0.01)
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == 2
    assert "1000 similar" in lines[1] or "1001 similar" in lines[1] or "999 similar" in lines[1]
    assert all(line.isprintable() for line in lines)


@pytest.mark.parametrize("turns", range(6))
@virtual
async def test_an_entry_that_is_cancelled_leaves_nothing(turns: int) -> None:
    network = Network()
    bus = network.bus("screen")
    fleet = Fleet("lab", bus=bus)
    entering = asyncio.create_task(fleet.__aenter__())
    for _ in range(turns):
        await asyncio.sleep(0)
    entering.cancel()
    await asyncio.gather(entering, return_exceptions=True)
    assert entering.cancelled()
    assert (bus.subscribers, bus.watchers) == ([], [])
    with pytest.raises(RuntimeError, match="not entered"):
        fleet.hand(LEFT)
    async with fleet:  # and it may be tried again
        assert not fleet.members
