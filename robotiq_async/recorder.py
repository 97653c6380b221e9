"""Records everything about a hand in an MCAP file. Needs the extra ``record`` (mcap).

    async with RobotiqHand(address) as hand, Recorder(hand, "grasp.mcap"):
        ...

Four channels: ``/gripper/status`` (every poll), ``/gripper/command`` (every request that was written) and
``/gripper/event`` (transitions and faults) as JSON with a JSON Schema; ``/joint_states`` as ROS 2 encodes it.
What is recorded reaches the disk twice a second, from a thread: a program that is killed loses no more than
that, and ``robotiq-async recover`` makes its file whole.
"""

from __future__ import annotations

import asyncio
import os
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Final, Self

from mcap.writer import CompressionType, Writer

from .errors import RobotiqError
from .feed import STATUS, TOPICS, Feed, Message, Topic
from .hand import RobotiqHand
from .version import __version__

FLUSH_S: Final = 0.5
"""Between two writes to the disk."""


class RecordingError(RobotiqError):
    """A recording could not be written, or read."""


class _Outbox:
    """What the MCAP writer writes to: keeps the bytes until they are taken to the disk."""

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
        recorded: statuses in it so far.
    """

    def __init__(self, hand: RobotiqHand, path: Path | str) -> None:
        """Prepare; opens nothing.

        Args:
            hand: started before or while it is recorded.
            path: a file that is not there yet.
        """
        self.path = Path(path)
        self.recorded = 0
        self._address = hand.address
        self._feed = Feed(hand, self._take)
        self._outbox = _Outbox()
        self._file: BinaryIO
        self._writer: Any
        self._channels: dict[Topic, int] = {}
        self._saving: asyncio.Task[None]
        self._failed: asyncio.Future[RecordingError]

    @property
    def missed(self) -> int:
        """Statuses that were lost because the event loop was held up for minutes."""
        return self._feed.missed

    @property
    def size(self) -> int:
        """Bytes of the file, about."""
        return self._outbox.tell()

    async def __aenter__(self) -> Self:
        """Open the file and begin.

        Raises:
            RecordingError: the file is there already, or cannot be made.
        """
        loop = asyncio.get_running_loop()
        self._failed = loop.create_future()
        try:
            self._file = await asyncio.to_thread(open, self.path, "xb")
        except OSError as error:
            raise RecordingError(f"{self.path}: {error.strerror}") from error
        self._begin()
        self._feed.begin()
        self._saving = loop.create_task(self._save_again_and_again(), name="robotiq_async recorder")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write what is left and close the file.

        Raises:
            RecordingError: something could not be written; never in place of another exception.
        """
        self._saving.cancel()
        await asyncio.gather(self._saving, return_exceptions=True)
        await self._feed.end()
        if not self._failed.done():
            self._writer.finish()
            await self._save()
        await asyncio.to_thread(self._file.close)
        if self._failed.done() and error is None:
            raise self._failed.result()

    async def failure(self) -> RecordingError:
        """Wait until the recording fails (a full disk, say); what was saved before stays readable."""
        return await asyncio.shield(self._failed)

    def _begin(self) -> None:
        self._writer = writer = Writer(self._outbox, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        writer.start(profile="", library=f"robotiq_async {__version__}")
        metadata = {"version": __version__, "address": self._address, "note": "never run on real hardware"}
        writer.add_metadata("robotiq_async", metadata)
        for topic in TOPICS:
            schema = writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
            self._channels[topic] = writer.register_channel(topic.name, topic.encoding, schema)

    def _take(self, message: Message) -> None:
        if self._failed.done():
            return
        channel, stamp = self._channels[message.topic], message.nanoseconds
        self._writer.add_message(channel, stamp, message.data, stamp, message.sequence & 0xFFFFFFFF)
        self.recorded += message.topic is STATUS

    async def _save_again_and_again(self) -> None:
        while not self._failed.done():
            await asyncio.sleep(FLUSH_S)
            self._writer.flush()
            await self._save()

    async def _save(self) -> None:
        """Take to the disk what waits; a failure ends the recording."""
        data = self._outbox.take()
        try:
            await asyncio.shield(asyncio.to_thread(self._write, data))
        except OSError as error:
            if not self._failed.done():
                self._failed.set_result(RecordingError(f"{self.path}: {error.strerror}"))

    def _write(self, data: bytes) -> None:
        self._file.write(data)
        self._file.flush()
        os.fsync(self._file.fileno())
