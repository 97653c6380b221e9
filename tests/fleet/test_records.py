"""Settings on a disk that is slow or full: what is answered, what the next agent knows, what is logged."""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from robotiq_async import Finger
from robotiq_async.fleet.agent.records import KEPT_S, Records
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.values.request import Request
from tests.fleet.lab import LEFT, Lab, lab
from tests.virtual import inside

A = Finger.A


class Disk:
    """The behaviour of the system when a new record is opened for writing.

    Attributes:
        is_full: whether that fails.
        writes: the number of tries.
        moves_on: cleared while the disk stalls.
    """

    def __init__(self) -> None:
        self.is_full = False
        self.writes = 0
        self.moves_on = threading.Event()
        self.moves_on.set()
        self._open = os.open

    def open(self, path: Any, *arguments: Any, **options: Any) -> int:
        if str(path).endswith(".new"):
            self.writes += 1
            self.moves_on.wait()
            if self.is_full:
                raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        return self._open(path, *arguments, **options)


@pytest.fixture
def disk(monkeypatch: pytest.MonkeyPatch) -> Iterator[Disk]:
    it = Disk()
    monkeypatch.setattr(os, "open", it.open)
    yield it
    it.moves_on.set()


@pytest.fixture
def records(tmp_path: Path, disk: Disk) -> Records:  # lies below it
    return Records(tmp_path)


def force_of(folder: Path, client: RemoteHand) -> object:
    """The force of finger A that the next agent would know of a client."""
    assert client._remote.session is not None
    record = Records(folder).read(LEFT)
    kept = {} if record is None else record["settings"]["clients"]
    return kept.get(client._remote.session.dialog.client, {}).get("1", {}).get("force")


async def written(records: Records) -> None:
    """Wait for the thread that writes, for which virtual time does not pass."""
    while records._writing:
        time.sleep(0.001)  # noqa: ASYNC251
        await asyncio.sleep(0)


@inside(lab, "records")
async def test_a_slow_disk_delays_an_answer_by_a_tenth_of_a_second(
    here: Lab, hand: RemoteHand, records: Records, disk: Disk, tmp_path: Path
) -> None:
    await hand.set_force(10, A)
    await written(records)
    loop, tries = asyncio.get_running_loop(), disk.writes
    disk.moves_on.clear()
    before = loop.time()
    await hand.set_force(200, A)
    assert KEPT_S <= loop.time() - before < 2 * KEPT_S
    for value in range(50):  # a loop is not delayed at all
        hand.command(A, force=value)
        await asyncio.sleep(0.01)
    await asyncio.sleep(0.1)
    assert Request.from_registers(here.gripper.request_registers).axes[0].force == 49
    before = loop.time()
    await hand.halt()
    assert loop.time() - before < 2 * KEPT_S
    assert force_of(tmp_path, hand) == 10, "of an agent that is killed now the next has the record before"
    assert disk.writes == tries + 1
    disk.moves_on.set()
    await written(records)
    assert force_of(tmp_path, hand) == 49
    assert disk.writes == tries + 2, "what waited is one record"


@inside(lab, "records")
async def test_a_full_disk_is_said_once_and_the_next_agent_knows_nothing(
    here: Lab,
    hand: RemoteHand,
    records: Records,
    disk: Disk,
    tmp_path: Path,
    caplog: pytest.LogCaptureFixture,
) -> None:
    await hand.set_force(10, A)
    disk.is_full = True
    with caplog.at_level(logging.WARNING):
        for value in (200, 201):
            await hand.set_force(value, A)
            await written(records)
    said = "FLEET.toml's speeds and forces count"
    assert caplog.text.count(said) == 1
    assert "No space left" in caplog.text
    assert Records(tmp_path).read(LEFT) is None, "rather none than an older one"
    disk.is_full = False
    await hand.set_force(202, A)
    await written(records)
    assert force_of(tmp_path, hand) == 202


@inside(lab, "records")
async def test_without_a_thread_there_is_rather_no_record_than_an_older_one(
    here: Lab,
    hand: RemoteHand,
    records: Records,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The log said that no client would come back by itself, and the older record let one."""

    def start(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    await hand.set_force(10, A)
    await written(records)
    with monkeypatch.context() as short:
        short.setattr(threading.Thread, "start", start)
        await hand.set_force(200, A)
    assert Records(tmp_path).read(LEFT) is None
    assert "can't start new thread" in caplog.text
    await hand.set_force(201, A)
    await written(records)
    assert force_of(tmp_path, hand) == 201
