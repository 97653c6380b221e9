"""Records: who may reacquire the lease automatically, and inhibits, kept over a restart of the agent.

A person halts the gripper, then the agent is killed and restarted. The client that commanded before, and did
not receive that halt, reacquires the lease automatically; the new run of the agent must refuse this, and
needs the record to know. Without a record no client may reacquire automatically.

An inhibit that a person has set counts until a person lifts it, so its record counts after a restart of the
machine, too: an outdated inhibit can only refuse motion. The new file is on the disk before it replaces the
old file. If it cannot be written, an empty file takes its place: an unreadable record counts as an inhibit.
"""

from __future__ import annotations

import asyncio
import json
import os
from contextlib import suppress
from pathlib import Path
from typing import Any, Final

from ...runtime import Log, in_a_thread
from ..wire.names import GripperName
from ..wire.values import Fields

KEPT_S: Final = 0.1  # seconds that the answer to a halt waits for its record at most; a disk may stall
_NOT_READABLE: Final = "cannot be read"  # no inhibit, and not None
_BOOT: Final = Path("/proc/sys/kernel/random/boot_id")


class Records:
    """Keeps a file for each gripper, for the next run of the agent; without a folder it keeps nothing.

    The folder is created when it is needed. A file is valid until the machine restarts: the last write may
    not have reached the disk then, unless it has an inhibit.
    """

    def __init__(self, folder: Path | None = None) -> None:
        self._folder = folder
        self._boot = _boot()
        self._newest: dict[GripperName, tuple[bytes, bool]] = {}
        """The record that waits for the write before it, and whether it has an inhibit."""
        self._writing: dict[GripperName, asyncio.Future[None]] = {}
        self._has_failed = False

    def read(self, name: GripperName) -> Fields | None:
        """The record of a gripper; None if it is not known for certain."""
        if self._folder is None or not os.access(self._folder, os.W_OK):
            return None  # may be outdated: the run before this one could not replace it
        record = self._stored(name)
        return record if record and self._boot and record.get("boot") == self._boot else None

    def read_inhibit(self, name: GripperName) -> object:
        """The inhibit in the record of a gripper, of any age; None if it has none.

        Of a record that cannot be read, something that is no inhibit.
        """
        record = self._stored(name)
        return _NOT_READABLE if record is None else record.get("inhibited")

    def _stored(self, name: GripperName) -> Fields | None:
        # Empty without a record, None if it cannot be read.
        try:
            record = json.loads(self._path(name).read_bytes()) if self._folder else {}
        except (FileNotFoundError, NotADirectoryError):
            return {}
        except (OSError, ValueError, RecursionError):
            return None
        return record if isinstance(record, dict) else None

    def keep(self, name: GripperName, record: Fields) -> None:
        """Replace the record of a gripper; never blocks."""
        if self._folder is None:
            return
        data = json.dumps({"boot": self._boot, **record}).encode()
        self._newest[name] = data, record.get("inhibited") is not None
        if name not in self._writing:
            self._begin(name)

    async def kept(self) -> None:
        """Wait until all records are written, KEPT_S at most."""
        loop = asyncio.get_running_loop()
        until = loop.time() + KEPT_S
        while self._writing and (left := until - loop.time()) > 0:  # a write may wait for the one before it
            await asyncio.wait(list(self._writing.values()), timeout=left)

    def _begin(self, name: GripperName) -> None:
        data, inhibits = self._newest.pop(name)
        self._writing[name] = writing = in_a_thread(
            lambda: self._write(self._path(name), data, sync=inhibits)
        )
        writing.add_done_callback(lambda done: self._end(name, done, inhibits))

    def _end(self, name: GripperName, done: asyncio.Future[None], inhibits: bool) -> None:
        del self._writing[name]
        error = None if done.cancelled() else done.exception()
        if error is not None:  # an outdated record could admit a barred client
            with suppress(OSError):
                self._drop(self._path(name), inhibits)
        if error is not None and not self._has_failed:
            self._has_failed = True
            Log().warning(
                "%s: after a restart no client reacquires the lease automatically, FLEET.toml's speeds and "
                "forces count, and an inhibit has lost its reason, or is lost",
                error,
            )
        if name in self._newest:
            self._begin(name)

    def _drop(self, path: Path, inhibits: bool) -> None:
        if inhibits:
            path.write_bytes(b"")  # needs no space if there was a record
        else:
            path.unlink(missing_ok=True)

    def _write(self, path: Path, data: bytes, *, sync: bool) -> None:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        new = path.with_suffix(".new")
        with suppress(FileNotFoundError):
            new.unlink()
        file = os.open(new, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
        with os.fdopen(file, "wb") as opened:
            opened.write(data)
            if sync:
                opened.flush()
                os.fsync(opened.fileno())
        new.replace(path)
        if sync:
            _sync_folder(path.parent)

    def _path(self, name: GripperName) -> Path:
        assert self._folder is not None, "nothing is kept without one"
        # Names cannot contain a plus.
        return self._folder / f"{name.site}+{name.host}+{name.gripper}.json"


def file_records() -> Records:
    """Records in systemd's ``StateDirectory=``, else in the user's state folder (XDG)."""
    folder = os.environ.get("STATE_DIRECTORY", "").split(":")[0]
    if folder:
        return Records(Path(folder))
    state = os.environ.get("XDG_STATE_HOME")
    try:
        return Records((Path(state) if state else Path.home() / ".local" / "state") / "robotiq-async")
    except RuntimeError:  # a user without a home
        Log().warning("no folder for records: after a restart no client reacquires the lease automatically")
        return Records()


def _sync_folder(folder: Path) -> None:
    with suppress(OSError):  # no system but POSIX opens folders; the file itself is on the disk
        opened = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(opened)
        finally:
            os.close(opened)


def _boot() -> Any:  # noqa: ANN401  # only compared
    # Identifies this run of the machine; None where the system has no such figure. Records are then not used.
    try:
        return _BOOT.read_text(encoding="ascii").strip() or None
    except OSError:
        return None
