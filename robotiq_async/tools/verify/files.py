"""The folder of a report: recording, report.json, report.md."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from ...link.address import Address
from ...runtime.concurrency import in_a_thread
from .page import page
from .recording import Recording
from .report import Report, Scrubber, as_json, write_files

JSON: Final = "report.json"
PAGE: Final = "report.md"


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
        path.mkdir(parents=True, exist_ok=True)
        self.recording = Recording(path, self._scrubber.clean)

    def save(self, report: Report) -> None:
        """Write the report as it is now.

        Raises:
            OSError: that failed.
        """
        clean = self._scrubber.clean
        write_files(self.path, [(JSON, as_json(clean(report.as_dict()))), (PAGE, clean(page(report)))])

    async def end(self, report: Report) -> str:
        """Write all that is left; why that failed, or nothing."""
        await self.recording.end()
        try:
            await in_a_thread(lambda: self.save(report))
        except OSError as error:
            return error.strerror or str(error)
        return self.recording.failure
