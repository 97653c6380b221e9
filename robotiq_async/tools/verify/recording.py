"""Every frame of a run in an MCAP file, with the schemas of the recorder. Needs the extra ``record``.

Statuses and commands are those of a recorded hand. An event of the kind "state" tells that a stage has begun
(``verify stage 4``), one of the kind "log" that an exchange has failed, or what was found in another place.
"""

from __future__ import annotations

import asyncio
import json
import os
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from io import FileIO
from pathlib import Path
from typing import Final

from ...runtime.concurrency import in_a_thread
from ...values.events import SentRequest
from ...values.model import THREE_FINGER, Model, model_of
from ...values.request import Request
from ...values.status import RobotiqStatus
from ..recording.feed import COMMAND, EVENT, STATUS, Message, Topic, compact
from ..recording.mcap_file import McapFile
from ..recording.payloads import Fields
from ..recording.raw_output import write_all
from ..recording.recordings import read_recording
from .recorded_link import Frame

FLUSH_S: Final = 0.5
NAME: Final = "recording.mcap"
STAGE: Final = "verify stage "
"""Before the number, in the event that tells that a stage begins."""


@dataclass
class Segment:
    """What was recorded in a stage, each with its time in seconds."""

    stage: int
    began: float
    statuses: list[tuple[float, RobotiqStatus]] = field(default_factory=list)
    commands: list[tuple[float, Request]] = field(default_factory=list)


def segments(path: Path, stages: tuple[int, ...]) -> list[Segment]:
    """Some stages of a recording, in their order."""
    found: list[Segment] = []
    model = THREE_FINGER
    for entry in read_recording(path):
        seconds = entry.nanoseconds / 1e9
        if entry.topic == EVENT.name:
            fields = json.loads(entry.data)
            target = str(fields.get("target", ""))
            if target.startswith(STAGE):
                model = model_of(fields.get("model"))
                found.append(Segment(int(target.removeprefix(STAGE)), seconds))
        elif found and found[-1].stage in stages:
            registers = tuple(json.loads(entry.data)["registers"])
            if entry.topic == STATUS.name:
                status = RobotiqStatus.from_registers(registers, timestamp=seconds, model=model)
                found[-1].statuses.append((seconds, status))
            elif entry.topic == COMMAND.name:
                found[-1].commands.append((seconds, Request.from_registers(registers, model)))
    return [segment for segment in found if segment.stage in stages]


class Recording:
    """Takes frames; a task writes them to the disk in threads.

    Attributes:
        failure: why nothing is written any more; empty as long as it is.
    """

    def __init__(self, folder: Path, clean: Callable[[str], str], model: Model) -> None:
        """Create the file.

        Args:
            folder: where it goes.
            clean: takes out of a text what must not be in it.
            model: of the gripper.

        Raises:
            OSError: that is not possible.
        """
        self.failure = ""
        self._file = FileIO(folder / NAME, "x")
        self._waiting: list[bytes] = []
        self._count = 0
        self._format = McapFile(self, name="verify", address="")
        self._clean = clean
        self._model = model
        self._epoch = time.time() - asyncio.get_running_loop().time()
        self._counts = {STATUS: 0, COMMAND: 0, EVENT: 0}
        self._over = asyncio.Event()
        self._saving = asyncio.ensure_future(self._save_again_and_again())

    # What the MCAP writer needs of a file.

    def write(self, data: bytes) -> int:
        """Keep bytes until a thread writes them."""
        self._waiting.append(bytes(data))
        self._count += len(data)
        return len(data)

    def tell(self) -> int:
        """How many there were."""
        return self._count

    def flush(self) -> None:
        """Nothing: the disk is a thread's business."""

    # What a run tells.

    def keep(self, frame: Frame) -> None:
        """Take a frame. Never blocks and never fails."""
        if self.failure:
            return
        if frame.kind == "status":
            status = RobotiqStatus(frame.registers, frame.ended, self._counts[STATUS] + 1, self._model)
            self._add(STATUS, frame.ended, status.as_dict())
        elif frame.registers:
            image = Request.from_registers(frame.registers, self._model)
            sent = SentRequest(image, frame.began, frame.kind == "command")
            self._add(COMMAND, frame.began, sent.as_dict())
        if frame.words:
            words = {"kind": "log", "timestamp": frame.ended, "message": self._clean(frame.words)}
            self._add(EVENT, frame.ended, words)

    def begin(self, stage: int) -> None:
        """Note that a stage begins."""
        now = asyncio.get_running_loop().time()
        fields = {"kind": "state", "timestamp": now, "target": f"{STAGE}{stage}", "model": self._model.name}
        self._add(EVENT, now, fields)

    def _add(self, topic: Topic, seconds: float, fields: Fields) -> None:
        self._counts[topic] += 1
        stamp = round((seconds + self._epoch) * 1e9)
        self._format.take(Message(topic, stamp, compact(fields), self._counts[topic]))

    # The disk.

    async def end(self) -> None:
        """Write what is left, and close the file; a failure is kept in :attr:`failure`."""
        self._over.set()
        await self._saving
        if not self.failure:
            self._format.finish()
            await self._save()
        self._file.close()

    async def _save_again_and_again(self) -> None:
        while not (self._over.is_set() or self.failure):
            self._format.flush()
            await self._save()
            try:
                async with asyncio.timeout(FLUSH_S):
                    await self._over.wait()
            except TimeoutError:
                pass

    async def _save(self) -> None:
        data, self._waiting = b"".join(self._waiting), []
        try:
            await in_a_thread(lambda: self._write(data))
        except OSError as error:
            self.failure = error.strerror or str(error)

    def _write(self, data: bytes) -> None:
        write_all(self._file.fileno(), data)
        os.fsync(self._file.fileno())
