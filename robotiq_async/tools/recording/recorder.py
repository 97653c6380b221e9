"""Records everything about a hand in an MCAP file (extra ``record``), or its polls in a table, ``.csv``.

    hand = RobotiqHand(address)
    async with Recorder(hand, "grasp.mcap"), hand:
        ...

In this order the file contains start and stop, and a slow disk does not delay the stop. A blocking hand is
recorded with ``with`` instead of ``async with``.

Six channels: ``/gripper/status`` (every poll), ``/gripper/command`` (every request that was written) and
``/gripper/event`` (transitions, faults and marks) as JSON with a JSON Schema; ``/joint_states``,
``/robot_description`` and ``/tf`` as ROS 2 encodes them. Tools of ROS 2 refuse a file with other channels
than ROS's: ``ros2=True`` writes joint states alone. A table has a row for every poll, and no commands. A
thread writes to the disk twice a second. A killed program loses at most the last half second, and
``robotiq-async recover`` repairs its file.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Final, Protocol, Self

from ...hands import Hand
from ...runtime import Limit, Log, NoThreadError, in_a_thread, wait_shielded, write_all
from ...sync import RobotiqHand as BlockingHand
from ...sync.robotiq_hand import caller_of
from ..errors import RecordingError
from .feed import JOINTS_TOPIC, Feed, Message
from .table import CsvFile

_missing = ""
try:  # Here and not in a constructor: importing takes 0.1 s, in which a hand could not poll.
    from .recordings import McapFile
except ImportError as error:
    _missing = str(error)

FLUSH_S: Final = 0.5
"""Seconds between two writes to the disk."""
DISK_S: Final = 10.0
"""Seconds that the last write may take."""


class Outbox:
    """Buffers the bytes of the file until a thread writes them to the disk."""

    def __init__(self) -> None:
        self._waiting: list[bytes] = []
        self._count = 0

    def write(self, data: bytes) -> int:
        self._waiting.append(bytes(data))
        self._count += len(data)
        return len(data)

    def tell(self) -> int:
        return self._count

    def flush(self) -> None:
        """Do nothing: a thread writes to the disk."""

    def take(self) -> bytes:
        data, self._waiting = b"".join(self._waiting), []
        return data


class _Format(Protocol):
    """Encodes messages into the outbox."""

    def take(self, message: Message) -> None: ...

    def flush(self) -> None: ...

    def finish(self) -> None: ...


def is_table(path: Path | str) -> bool:
    """Whether a recording of this name is a table instead of an MCAP file."""
    return Path(path).suffix.lower() == ".csv"


class Recorder:
    """Records a hand during a block. It only listens; a failing disk does not affect the gripper.

    Attributes:
        path: the file.
        recorded: polls so far; polls of the last half second may not be on the disk yet.
        saved: polls on the disk; 0 once the file has been deleted. An incomplete write does not count.
    """

    def __init__(self, hand: Hand | BlockingHand, path: Path | str, *, ros2: bool = False) -> None:
        """Prepare; opens nothing.

        Args:
            hand: started before or while it is recorded.
            path: a file that does not exist yet; a table with the suffix ``.csv``, otherwise MCAP.
            ros2: write the joint states only, in the profile ``ros2``, for tools of ROS 2.

        Raises:
            ImportError: MCAP without the extra ``record``.
            TypeError: no hand.
            ValueError: ``ros2`` with a table.
        """
        self._caller = caller_of(hand) if isinstance(hand, BlockingHand) else None
        hand = self._caller.hand if self._caller else hand
        if not isinstance(hand, Hand):
            raise TypeError(f"hand must be a hand, got {hand!r}")
        if ros2 and is_table(path):
            raise ValueError(f"ros2 is for MCAP files, and {path} is a table")
        self.path: Path = Path(path)
        self.recorded: int = 0
        self.saved: int = 0
        self._hand = hand
        self._feed = Feed(hand, self._take)
        self._outbox = Outbox()
        self._joints_only = ros2
        self._is_open = False
        self._unsaved = b""  # bytes that could not be written for want of a thread
        self._waits = 0.0  # the seconds for which that has lasted
        self._format = self._make_format(ros2=ros2)
        self._file: FileIO
        self._saving: asyncio.Task[None]
        self._over: asyncio.Event
        self._failed: asyncio.Future[RecordingError]

    @property
    def missed(self) -> int:
        """Statuses that were dropped unrecorded; a blocked event loop polls none: see ``overruns``."""
        return self._feed.missed

    @property
    def size(self) -> int:
        """Approximate size of the file in bytes."""
        return self._outbox.tell()

    @property
    def has_failed(self) -> bool:
        """Whether a write has failed, or had no thread for 10 s; the recording has ended then."""
        return self._failed.done()

    async def __aenter__(self) -> Self:
        """Create the file and start recording.

        Raises:
            TypeError: the hand is a blocking one.
            RecordingError: the file exists already, or cannot be created.
        """
        if self._caller is not None:
            raise TypeError("a blocking hand is recorded with 'with'")
        await self._begin()
        return self

    async def _begin(self) -> None:
        loop = asyncio.get_running_loop()
        self._failed = loop.create_future()
        self._over = asyncio.Event()
        opening = in_a_thread(lambda: FileIO(self.path, "x"))
        try:
            await wait_shielded(opening)
        except asyncio.CancelledError:
            if opening.exception() is None:
                opening.result().close()
                self.path.unlink(missing_ok=True)
            raise
        try:
            self._file = opening.result()
        except OSError as error:
            raise RecordingError(f"{self.path}: {error.strerror}") from error
        self._feed.start()
        self._is_open = True
        self._saving = loop.create_task(self._save_again_and_again(), name="robotiq_async recorder")

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the rest and close the file, also when cancelled.

        Raises:
            RecordingError: a write failed; it never replaces another exception.
        """
        ending = asyncio.ensure_future(self._end())
        await wait_shielded(ending)
        if error is None:
            ending.result()  # the error of a bug would be lost
            if self._failed.done():
                raise self._failed.result()

    def __enter__(self) -> Self:
        """Create the file and start recording a blocking hand.

        Raises:
            TypeError: the hand is for asyncio.
            RecordingError: the file exists already, or cannot be created.
        """
        if self._caller is None:
            raise TypeError("a hand for asyncio is recorded with 'async with'")
        self._caller.check_process()
        self._caller.wait(self._begin)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write the rest and close the file, as at the end of ``async with``.

        Raises:
            RecordingError: a write failed; it never replaces another exception.
        """
        assert self._caller is not None, "entered"
        self._caller.check_process()
        self._caller.wait(lambda: self.__aexit__(kind, error, trace))

    def mark(self, label: str, **values: str | float | bool | None) -> None:
        """Write a mark: everything from now on has this label, until the next mark.

        It never waits for the file. With a blocking hand it waits for a turn of the hand's event loop.

        Every row of a table has the label as of its poll; the values are with the events. ``mark("")`` ends
        the last one.

        Args:
            label: such as ``"grasp 7"``.
            **values: such as ``object="cup"``; text, finite numbers and truth values, also numpy's. A value
                None is left out, as the width of an empty grasp.

        Raises:
            TypeError: a label or a value of another type.
            ValueError: an infinite value, not a number, an int of more than 64 bits, or text with surrogates.
            RecordingError: the block is not entered or over, or the recording has joint states only.
        """
        if not self._is_open or self._joints_only:
            why = "joint states only" if self._joints_only else "not recording: use 'with' or 'async with'"
            raise RecordingError(f"{self.path}: {why}")
        if self._caller is None:
            self._feed.mark(label, values)
        else:
            self._caller.check_process()
            self._caller.tell(lambda: self._feed.mark(label, values))

    async def failure(self) -> RecordingError:
        """Wait until a write fails (a full disk, for example); everything saved before stays readable.

        With a blocking hand look at :attr:`has_failed`.
        """
        return await asyncio.shield(self._failed)

    def _make_format(self, *, ros2: bool) -> _Format:
        if is_table(self.path):
            return CsvFile(self._outbox.write)
        if _missing:
            raise ImportError(_missing)
        hand = self._hand
        return McapFile(self._outbox, name=hand.name, address=hand.address, ros2=ros2)

    def _take(self, message: Message) -> None:
        if self._failed.done():
            return
        self._format.take(message)
        self.recorded += message.topic is JOINTS_TOPIC  # the last of a poll

    # -- the disk --------------------------------------------------------------------------------------

    async def _save_again_and_again(self) -> None:
        while not (self._over.is_set() or self._failed.done()):
            self._format.flush()
            await self._save()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(FLUSH_S):
                    await self._over.wait()

    async def _end(self) -> None:
        self._is_open = False
        await self._feed.stop()
        self._over.set()
        try:
            with Limit(DISK_S) as limit:
                await self._saving
                if not self._failed.done():
                    self._format.finish()
                    await self._save()
                await in_a_thread(self._file.close)
            if limit.is_over:
                self._fail(f"the disk does not answer within {DISK_S:g} s")
        except NoThreadError as error:
            self._fail(str(error))
            self._file.close()  # no thread of the recorder uses it: the last one has ended
        except OSError as error:
            self._fail(error.strerror)

    async def _save(self) -> None:
        self._unsaved += self._outbox.take()
        data, polls = self._unsaved, self.recorded
        try:
            await in_a_thread(lambda: self._write(data))
            self.saved, self._unsaved, self._waits = polls, b"", 0.0
        except NoThreadError as error:  # the next flush tries again
            if not self._waits:
                Log(self._hand.name).warning("the recording waits for a thread: %s", error)
            self._waits += FLUSH_S
            if self._waits > DISK_S or self._over.is_set():
                self._fail(str(error))
        except OSError as error:
            if isinstance(error, FileNotFoundError):
                self.saved = 0
            self._fail(error.strerror)

    def _fail(self, why: str | None) -> None:
        if self._failed.done():
            return
        error = RecordingError(f"{self.path}: {why}")
        self._failed.set_result(error)
        if self._is_open:  # the block may last for hours; at its end the error is raised
            Log(self._hand.name).error("the recording has ended, the hand runs: %s", error)

    def _write(self, data: bytes) -> None:
        write_all(self._file.fileno(), data)
        os.fsync(self._file.fileno())
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise FileNotFoundError(errno.ENOENT, "the file was deleted")
