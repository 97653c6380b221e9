"""The folder of a report: recording.mcap, report.json, report.md and pictures."""

from __future__ import annotations

import json
import os
import platform
from pathlib import Path
from typing import Final, TypeVar, cast

from ...link.address import Address
from ...runtime.concurrency import in_a_thread
from ...values.model import model_of
from .page import page
from .recording import NAME, Recording
from .report import Report

T = TypeVar("T")

JSON: Final = "report.json"
PAGE: Final = "report.md"


class Scrubber:
    """Takes out of texts what tells where a gripper is: addresses, ports of this machine, users, hosts."""

    def __init__(self, address: Address) -> None:
        names = [str(address), f"{address.host}:{address.port}" if address.port else "", address.host]
        names += [platform.node(), os.path.expanduser("~")]
        self._secrets = sorted({name for name in names if len(name) > 1}, key=len, reverse=True)

    def clean(self, what: T) -> T:
        """The same without; looks into lists and objects."""
        cleaned: object = what
        if isinstance(what, str):
            cleaned = self._cleaned(what)
        elif isinstance(what, dict):
            cleaned = {key: self.clean(value) for key, value in what.items()}
        elif isinstance(what, list):
            cleaned = [self.clean(each) for each in what]
        return cast("T", cleaned)

    def _cleaned(self, text: str) -> str:
        for secret in self._secrets:
            text = text.replace(secret, "HIDDEN")
        return text


class Folder:
    """Where the report of a run goes. Made in a running loop.

    Attributes:
        path: the folder.
        recording: takes the frames.
    """

    def __init__(self, path: Path, address: Address) -> None:
        """Make the folder and begin the recording.

        Args:
            path: may be there already, without a report in it.
            address: of the gripper; it is kept out of everything that is written.

        Raises:
            OSError: it cannot be made or written to, or has a report.
        """
        self.path = path
        self._scrubber = Scrubber(address)
        self._pictures: tuple[str, ...] = ()
        self._why_no_pictures = ""
        path.mkdir(parents=True, exist_ok=True)
        self.recording = Recording(path, self._scrubber.clean, model_of(address.model))

    def save(self, report: Report) -> None:
        """Write the report as it is now.

        Raises:
            OSError: that failed.
        """
        clean = self._scrubber.clean
        fields = json.dumps(clean(report.as_dict()), indent=2, ensure_ascii=False)
        self._write(JSON, f"{fields}\n")
        self._write(PAGE, clean(page(report, self._pictures, self._why_no_pictures)))

    def _write(self, name: str, text: str) -> None:
        """Write a file, whole or not at all."""
        partial = self.path / f".{name}.part"
        with open(partial, "w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        partial.replace(self.path / name)

    async def end(self, report: Report) -> str:
        """Write all that is left; why that failed, or nothing."""
        await self.recording.end()
        try:
            await in_a_thread(lambda: self.save(report))
            await in_a_thread(lambda: self._draw(report))
            await in_a_thread(lambda: self.save(report))
        except OSError as error:
            return error.strerror or str(error)
        return self.recording.failure

    def _draw(self, report: Report) -> None:
        try:
            from .pictures import draw  # noqa: PLC0415  # matplotlib takes a second
        except ImportError as error:
            self._why_no_pictures = str(error)
        else:
            self._pictures = draw(self.path, self.path / NAME, report)
