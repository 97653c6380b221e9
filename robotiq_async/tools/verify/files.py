"""The folder of a report: recording.mcap, report.json, report.md and pictures. Needs the extra ``record``.

Statuses and commands are as of a recorded hand. An event of the kind "state" marks the beginning of a
stage (``verify stage 4``), one of the kind "log" a failed exchange, or a finding in another place.
"""

from __future__ import annotations

import asyncio
import json
import os
import platform
import time
from collections.abc import Callable
from io import FileIO
from pathlib import Path
from typing import Final, TypeVar, cast

from ...link import Address
from ...runtime import in_a_thread, write_all
from ...values import Model, Request, RobotiqStatus, SentRequest, model_of
from ..recording.feed import COMMAND, EVENT, STATUS, Message, Topic, compact
from ..recording.payloads import Properties
from ..recording.recorder import FLUSH_S, Outbox
from ..recording.recordings import McapFile
from .catalogue import STAGE
from .recorded_link import RecordedExchange
from .report import Report, page

RECORDING_NAME: Final = "recording.mcap"


class Recording:
    """Takes frames, and cleans their texts; a task writes them to the disk in threads."""

    def __init__(self, folder: Path, clean: Callable[[str], str], model: Model) -> None:
        self.failure: str = ""  # why writing has ended; empty while it runs
        self._file = FileIO(folder / RECORDING_NAME, "x")
        self._outbox = Outbox()
        self._format = McapFile(self._outbox, name="verify", address="")
        self._clean = clean
        self._model = model
        self._epoch = time.time() - asyncio.get_running_loop().time()
        self._counts = {STATUS: 0, COMMAND: 0, EVENT: 0}
        self._over = asyncio.Event()
        self._saving = asyncio.ensure_future(self._keep_saving())

    # The frames of a run.

    def keep(self, frame: RecordedExchange) -> None:
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
        now = asyncio.get_running_loop().time()
        fields = {"kind": "state", "timestamp": now, "target": f"{STAGE}{stage}", "model": self._model.name}
        self._add(EVENT, now, fields)

    def _add(self, topic: Topic, seconds: float, fields: Properties) -> None:
        self._counts[topic] += 1
        stamp = round((seconds + self._epoch) * 1e9)
        self._format.take(Message(topic, stamp, compact(fields), self._counts[topic]))

    # The disk.

    async def end(self) -> None:
        """Write the rest, and close the file; a failure is kept in :attr:`failure`."""
        self._over.set()
        await self._saving
        if not self.failure:
            self._format.finish()
            await self._save()
        self._file.close()

    async def _keep_saving(self) -> None:
        while not (self._over.is_set() or self.failure):
            self._format.flush()
            await self._save()
            try:
                async with asyncio.timeout(FLUSH_S):
                    await self._over.wait()
            except TimeoutError:
                pass

    async def _save(self) -> None:
        data = self._outbox.take()
        try:
            await in_a_thread(lambda: self._write(data))
        except OSError as error:
            self.failure = error.strerror or str(error)

    def _write(self, data: bytes) -> None:
        write_all(self._file.fileno(), data)
        os.fsync(self._file.fileno())


T = TypeVar("T")

JSON: Final = "report.json"
PAGE: Final = "report.md"


class Scrubber:
    """Removes from texts the place of a gripper: addresses, ports of this machine, users, hosts."""

    def __init__(self, address: Address) -> None:
        names = [str(address), f"{address.host}:{address.port}" if address.port else "", address.host]
        names += [platform.node(), os.path.expanduser("~"), *(value for _, value in address.options)]
        self._secrets = sorted({name for name in names if len(name) > 1}, key=len, reverse=True)

    def clean(self, what: T) -> T:
        """The same without these; looks into lists and objects."""
        cleaned: object = what
        if isinstance(what, str):
            text: str = what
            for secret in self._secrets:
                text = text.replace(secret, "HIDDEN")
            cleaned = text
        elif isinstance(what, dict):
            cleaned = {key: self.clean(value) for key, value in what.items()}
        elif isinstance(what, list):
            cleaned = [self.clean(each) for each in what]
        return cast("T", cleaned)


class Folder:
    """The folder for the report of a run. Made in a running loop; OSError if it has a report already."""

    def __init__(self, path: Path, address: Address) -> None:
        self.path = path  # the folder
        self._scrubber = Scrubber(address)
        self._pictures: tuple[str, ...] = ()
        self._why_no_pictures = ""
        path.mkdir(parents=True, exist_ok=True)
        self.recording = Recording(path, self._scrubber.clean, model_of(address.model))  # takes the frames

    def save(self, report: Report) -> None:
        clean = self._scrubber.clean
        fields = json.dumps(clean(report.as_dict()), indent=2, ensure_ascii=False)
        self._write(JSON, f"{fields}\n")
        self._write(PAGE, clean(page(report, self._pictures, self._why_no_pictures)))

    def _write(self, name: str, text: str) -> None:
        """Write a file, whole or not at all."""
        partial = self.path / f".{name}.part"
        try:
            with open(partial, "w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(self.path / name)
        except OSError:
            partial.unlink(missing_ok=True)
            raise

    async def end(self, report: Report) -> str:
        """Write all that is left; return why that failed, or nothing."""
        await self.recording.end()
        try:
            await in_a_thread(lambda: self.save(report))
            await in_a_thread(lambda: self._draw(report))
            await in_a_thread(lambda: self.save(report))
        except OSError as error:
            return error.strerror or str(error)
        return self.recording.failure

    def _draw(self, report: Report) -> None:
        if self.recording.failure:
            self._why_no_pictures = f"the recording has failed: {self.recording.failure}"
            return
        try:
            from .pictures import draw  # noqa: PLC0415  # matplotlib takes a second
        except ImportError as error:
            self._why_no_pictures = str(error)
        else:
            self._pictures = draw(self.path, self.path / RECORDING_NAME, report)
