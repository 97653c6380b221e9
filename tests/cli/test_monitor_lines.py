"""``robotiq-async monitor`` without a screen: what people and programs read."""

from __future__ import annotations

import asyncio
import json
import os
import select
import signal
import sys
import time
from typing import TYPE_CHECKING, Any

import pytest

from robotiq_async import Fault, Finger, RobotiqHand
from robotiq_async.cli.output.lines import print_objects
from robotiq_async.hands.options import LATE_POLLS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.forked import ROOT, forking
from tests.grippers import shows, until
from tests.patience import patience

if TYPE_CHECKING:
    from tests.cli.conftest import Shell


async def test_in_a_pipe_it_prints_every_poll_as_an_object(shell: Shell, server: SimulatorServer) -> None:
    async with RobotiqHand(server.address):
        process = await shell.start("monitor", server.address)
        objects: list[dict[str, Any]] = []
        while len(objects) < 50:
            line = await shell.read_line(process)
            objects += [json.loads(line)] if LATE_POLLS not in line else []
        process.send_signal(signal.SIGINT)
        outcome = await shell.finish(process)
    assert outcome.code == 0
    assert {each["kind"] for each in objects} == {"status"}
    sequences = [each["sequence"] for each in objects]
    assert sequences == list(range(sequences[0], sequences[0] + 50))
    assert objects[0]["state"] == "RUNNING_IDLE"
    assert objects[0]["A"]["position"] == 6
    assert abs(objects[-1]["time"] - time.time()) < 20


async def test_objects_tell_of_faults_and_lost_links(
    shell: Shell, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    process = await shell.start("monitor", "--json", server.address)
    await shell.read_line(process)
    gripper.inject_fault(Fault.SCISSOR_BLOCKED)

    async def object_of(kind: str, **fields: object) -> dict[str, Any]:
        while True:
            found: dict[str, Any] = json.loads(await shell.read_line(process))
            if found["kind"] == kind and fields.items() <= found.items():
                return found

    assert (await object_of("fault"))["fault"] == "SCISSOR_BLOCKED"
    await object_of("transition", target="FAULT")
    assert (await object_of("status", fault_code=14))["state"] in ("RESET", "FAULT")
    server.cut()
    await object_of("transition", target="DISCONNECTED")
    assert (await object_of("status"))["fault_code"] == 14, "it comes back by itself"


async def test_watch_prints_what_changes(
    shell: Shell, server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    async with RobotiqHand(server.address) as hand:
        process = await shell.start("monitor", "--watch", server.address)
        assert await shell.read_line(process) == f"Gripper {server.address}"
        assert (await shell.read_line(process)).endswith(" state    RUNNING_IDLE")
        while LATE_POLLS in (line := await shell.read_line(process)):
            pass
        assert "A=6 - B=6 - C=6" in line
        await hand.move(100, Finger.A)
        lines = []
        while "A=100 AT_POSITION" not in (line := await shell.read_line(process)):
            lines.append(line)
        assert {line[13:].split()[0] for line in lines} <= {"status", "log"}
        assert any("another client commands" in line for line in lines), "this test is that client"
        gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
        kinds: set[str] = set()
        while not kinds >= {"state", "fault"}:
            kinds.add((await shell.read_line(process))[13:].split()[0])
        process.send_signal(signal.SIGTERM)
        assert (await shell.finish(process)).code == 0


async def test_a_hand_that_has_ended_ends_it(
    server: SimulatorServer, capfd: pytest.CaptureFixture[str]
) -> None:
    hand = RobotiqHand(server.address)
    await hand.start(activate=False)
    printing = asyncio.create_task(print_objects(hand))
    for _ in range(5):
        await anext(hand.statuses())
    await hand.stop()
    async with asyncio.timeout(patience(5)):
        await printing
    assert '"target":"SHUTDOWN"' in capfd.readouterr().out


async def test_a_reader_that_stops_reading_does_not_hold_up_the_polling(
    server: SimulatorServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A full pipe: the gripper is read on, and the reader learns what it has missed."""
    reading, writing = os.pipe()
    hand = RobotiqHand(server.address, poll_interval=0.002)
    await hand.start(activate=False)
    with os.fdopen(writing, "w") as full, os.fdopen(reading) as reader:
        monkeypatch.setattr(sys, "stdout", full)
        printing = asyncio.create_task(print_objects(hand, buffer=50))
        await shows(hand, lambda it: it.sequence > 1000)  # half a megabyte, and a pipe holds 64 KiB

        def read_until_missed() -> list[dict[str, Any]]:
            objects = []
            for line in reader:
                objects.append(json.loads(line))
                if objects[-1]["kind"] == "missed":
                    break
            return objects

        objects = await asyncio.to_thread(read_until_missed)
        printing.cancel()
        await asyncio.gather(printing, return_exceptions=True)
        await asyncio.to_thread(reader.readline)
    await hand.stop()
    assert objects[-1]["count"] > 100
    assert len(objects) < 500


async def test_a_signal_ends_it_although_its_output_is_not_read(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    """Its writer is stuck in a full pipe: the end does not wait for it. Nor does it stop the fingers."""
    async with RobotiqHand(server.address) as hand:
        await hand.move(50)
        before = gripper.request_registers
        reading, writing = os.pipe()
        arguments = ("-m", "robotiq_async", "monitor", "--json", server.address)
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        with forking():
            process = await asyncio.create_subprocess_exec(
                sys.executable, *arguments, stdout=writing, env=environment
            )
        await until(lambda: not select.select([], [writing], [], 0)[1], within=60)
        os.close(writing)
        full_at = hand.status.sequence
        await shows(hand, lambda status: status.sequence > full_at + 200)
        process.send_signal(signal.SIGTERM)
        async with asyncio.timeout(patience(10)):
            assert await process.wait() == 0
        assert gripper.request_registers == before
        os.close(reading)
