"""Records everything about a hand in an MCAP file. Needs the extra ``record`` (mcap).

    hand = RobotiqHand(address)
    async with Recorder(hand, "grasp.mcap"), hand:
        ...

In this order the start and the stop are in it too, and nothing that concerns the file delays the stop.

Four channels: ``/gripper/status`` (every poll), ``/gripper/command`` (every request that was written) and
``/gripper/event`` (transitions and faults) as JSON with a JSON Schema; ``/joint_states`` as ROS 2 encodes it.
Tools of ROS 2 refuse a file with channels that are not ROS's: ``ros2=True`` leaves them out.
What is recorded reaches the disk twice a second, from a thread: a program that is killed loses no more than
that, and ``robotiq-async recover`` makes its file whole.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
from io import FileIO
from pathlib import Path
from types import TracebackType
from typing import Any, Final, Self

try:
    from mcap.writer import CompressionType, Writer
except ModuleNotFoundError as error:
    from ..extras import install

    raise ImportError(f"recordings need mcap: {install('record')}") from error

from ..concurrency import in_a_thread, wait_shielded
from ..errors import RecordingError
from ..protocol import Hand
from ..version import __version__
from .feed import JOINTS, TOPICS, Feed, Message, Topic
from .raw_output import write_all

FLUSH_S: Final = 0.5
"""Seconds between two writes to the disk."""
DISK_S: Final = 10.0
"""How long the last write may take."""


class _Outbox:
    """What the MCAP writer writes to: keeps the bytes until a thread writes them to the disk."""

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
        """Nothing: the disk is a thread's business."""

    def take(self) -> bytes:
        data, self._waiting = b"".join(self._waiting), []
        return data


class Recorder:
    """Records a hand while a block runs. It only listens: the gripper is not touched, whatever fails.

    Attributes:
        path: the file.
        recorded: polls in it so far; the last half second of them may not have reached the disk.
        saved: polls that have; 0 once the file has been deleted. Of a write that was cut off none count.
    """

    def __init__(self, hand: Hand, path: Path | str, *, ros2: bool = False) -> None:
        """Prepare; opens nothing.

        Args:
            hand: started before or while it is recorded.
            path: a file that is not there yet.
            ros2: write the joint states alone, in the profile ``ros2``: a file that tools of ROS 2 open.
        """
        self.path = Path(path)
        self.recorded = 0
        self.saved = 0
        self._profile = "ros2" if ros2 else ""
        self._topics: tuple[Topic, ...] = (JOINTS,) if ros2 else TOPICS
        self._hand = hand
        self._feed = Feed(hand, self._take)
        self._outbox = _Outbox()
        self._file: FileIO
        self._writer: Any
        self._channels: dict[Topic, int] = {}
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
        """Whether something could not be written: nothing is recorded any more."""
        return self._failed.done()

    async def __aenter__(self) -> Self:
        """Create the file and start recording.

        Raises:
            RecordingError: the file is there already, or cannot be made.
        """
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
        self._begin()
        self._feed.start()
        self._saving = loop.create_task(self._save_again_and_again(), name="robotiq_async recorder")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write what is left and close the file, also when cancelled meanwhile.

        Raises:
            RecordingError: something could not be written; never in place of another exception.
        """
        await wait_shielded(asyncio.ensure_future(self._end()))
        if self._failed.done() and error is None:
            raise self._failed.result()

    async def failure(self) -> RecordingError:
        """Wait until the recording fails (a full disk, say); what was saved before stays readable."""
        return await asyncio.shield(self._failed)

    def _begin(self) -> None:
        self._writer = writer = Writer(self._outbox, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        writer.start(profile=self._profile, library=f"robotiq_async {__version__}")
        metadata = {
            "version": __version__,
            "name": self._hand.name,
            "address": self._hand.address,
            "note": "never run on real hardware",
        }
        writer.add_metadata("robotiq_async", metadata)
        for topic in self._topics:
            schema = writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
            self._channels[topic] = writer.register_channel(topic.name, topic.encoding, schema)

    def _take(self, message: Message) -> None:
        if self._failed.done() or message.topic not in self._channels:
            return
        channel, stamp = self._channels[message.topic], message.nanoseconds
        self._writer.add_message(channel, stamp, message.data, stamp, message.sequence & 0xFFFFFFFF)
        self.recorded += message.topic is JOINTS  # the last that is told of a poll

    # -- the disk --------------------------------------------------------------------------------------

    async def _save_again_and_again(self) -> None:
        while not (self._over.is_set() or self._failed.done()):
            self._writer.flush()
            await self._save()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(FLUSH_S):
                    await self._over.wait()

    async def _end(self) -> None:
        await self._feed.stop()
        self._over.set()
        try:
            async with asyncio.timeout(DISK_S):
                await self._saving
                if not self._failed.done():
                    self._writer.finish()
                    await self._save()
                await in_a_thread(self._file.close)
        except TimeoutError:
            self._fail(f"the disk does not answer within {DISK_S:g} s")
        except OSError as error:
            self._fail(error.strerror)

    async def _save(self) -> None:
        """Write what waits to the disk; a failure ends the recording."""
        data, polls = self._outbox.take(), self.recorded
        try:
            await in_a_thread(lambda: self._write(data))
            self.saved = polls
        except OSError as error:
            if isinstance(error, FileNotFoundError):
                self.saved = 0
            self._fail(error.strerror)

    def _fail(self, why: str | None) -> None:
        if not self._failed.done():
            self._failed.set_result(RecordingError(f"{self.path}: {why}"))

    def _write(self, data: bytes) -> None:
        write_all(self._file.fileno(), data)
        os.fsync(self._file.fileno())
        if os.fstat(self._file.fileno()).st_nlink == 0:
            raise FileNotFoundError(errno.ENOENT, "the file has been deleted")
