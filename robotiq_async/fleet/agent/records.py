"""What outlives an agent: who may come back to command by itself, and who must not.

A person has halted the gripper, the agent is killed and started again; whoever commanded before, and has not
heard of that halt, asks for control by itself. The next agent must know. Where it cannot know, nobody comes
back by itself.
"""

from __future__ import annotations

import asyncio
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any, Final, Protocol

from ...runtime.concurrency import in_a_thread
from ...runtime.log import log
from ..wire.names import GripperName
from ..wire.values import Fields

PATIENCE_S: Final = 0.1
"""So long the answer to a halt waits for its record; a disk may stand still."""
_BOOT: Final = Path("/proc/sys/kernel/random/boot_id")


class Records(Protocol):
    """Where an agent keeps what the next one must know."""

    def read(self, name: GripperName) -> Fields | None:
        """What was kept of a gripper; None if that is not known for certain."""

    def keep(self, name: GripperName, record: Fields) -> None:
        """Keep this in place of what was kept before; never blocks."""

    async def kept(self) -> None:
        """Wait until all of it is kept, for a moment."""


class NoRecords:
    """Nothing is known after a restart."""

    def read(self, name: GripperName) -> Fields | None:  # noqa: ARG002
        """See :class:`Records`."""
        return None

    def keep(self, name: GripperName, record: Fields) -> None:
        """See :class:`Records`."""

    async def kept(self) -> None:
        """See :class:`Records`."""


class FileRecords:
    """Files in a folder, one for each gripper.

    They survive the agent, and say nothing after a restart of the machine: the last one may not have reached
    the disk.
    """

    def __init__(self, folder: Path) -> None:
        """Opens nothing.

        Args:
            folder: is made when it is needed.
        """
        self._folder = folder
        self._boot = _boot()
        self._newest: dict[GripperName, bytes] = {}
        self._writing: dict[GripperName, asyncio.Future[None]] = {}
        self._has_failed = False

    def read(self, name: GripperName) -> Fields | None:
        """See :class:`Records`."""
        if not os.access(self._folder, os.W_OK):
            return None  # what is there may be old: the run before this one could not replace it
        try:
            record = json.loads(self._path(name).read_bytes())
        except (OSError, ValueError, RecursionError):
            return None
        return (
            record if isinstance(record, dict) and self._boot and record.get("boot") == self._boot else None
        )

    def keep(self, name: GripperName, record: Fields) -> None:
        """See :class:`Records`."""
        self._newest[name] = json.dumps({"boot": self._boot, **record}).encode()
        if name not in self._writing:
            self._begin(name)

    async def kept(self) -> None:
        """See :class:`Records`."""
        loop = asyncio.get_running_loop()
        until = loop.time() + PATIENCE_S
        while self._writing and (left := until - loop.time()) > 0:  # one may wait for the one before it
            await asyncio.wait(list(self._writing.values()), timeout=left)

    def _begin(self, name: GripperName) -> None:
        data = self._newest.pop(name)
        self._writing[name] = writing = in_a_thread(lambda: self._write(self._path(name), data))
        writing.add_done_callback(lambda done: self._end(name, done))

    def _end(self, name: GripperName, done: asyncio.Future[None]) -> None:
        del self._writing[name]
        error = None if done.cancelled() else done.exception()
        if error is not None and not self._has_failed:
            self._has_failed = True
            log.warning("%s: after a restart of this agent nobody comes back by itself", error)
        if name in self._newest:
            self._begin(name)

    def _write(self, path: Path, data: bytes) -> None:
        self._folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        new = path.with_suffix(".new")
        try:
            with suppress(FileNotFoundError):
                new.unlink()
            file = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
            with os.fdopen(file, "wb") as opened:
                opened.write(data)
            new.replace(path)
        except OSError:
            path.unlink(missing_ok=True)  # an old one would let back in who must not come
            raise

    def _path(self, name: GripperName) -> Path:
        # No name has a plus in it.
        return self._folder / f"{name.site}+{name.host}+{name.gripper}.json"


def file_records() -> Records:
    """Records where systemd says (``StateDirectory=``), else where this user's programs keep such things."""
    told = os.environ.get("STATE_DIRECTORY", "").split(":")[0]
    if told:
        return FileRecords(Path(told))
    state = os.environ.get("XDG_STATE_HOME")
    try:
        return FileRecords((Path(state) if state else Path.home() / ".local" / "state") / "robotiq-async")
    except RuntimeError:  # a user without a home
        log.warning("no folder for records: after a restart of this agent nobody comes back by itself")
        return NoRecords()


def _boot() -> Any:  # noqa: ANN401  # compared, and nothing else
    """Tells this run of the machine from all others; None where nobody can tell."""
    try:
        return _BOOT.read_text(encoding="ascii").strip() or None
    except OSError:
        return None
