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
import contextlib
import json
import os
import time
from collections.abc import Callable
from pathlib import Path
from types import TracebackType
from typing import Any, BinaryIO, Final, Self

from mcap.writer import CompressionType, Writer

from .enums import Fault
from .errors import RobotiqError
from .hand import RobotiqHand
from .jointstate import SCHEMA, SCHEMA_NAME, JointStateEncoder
from .kinematics import joint_angles, joint_velocities
from .payloads import (
    SCHEMAS,
    Fields,
    command_fields,
    efforts,
    fault_fields,
    status_fields,
    transition_fields,
)
from .status import RobotiqStatus
from .streams import SentRequest, Stream, Transition
from .version import __version__

FLUSH_S: Final = 0.5
"""Between two writes to the disk."""
BUFFER: Final = 100_000
"""Statuses that wait for a loop that is held up: minutes."""
VELOCITY_S: Final = 0.05
"""Joint velocities are taken over this time: a count is half a degree."""


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
        self._hand = hand
        self._outbox = _Outbox()
        self._encoder = JointStateEncoder()
        self._file: BinaryIO
        self._writer: Any
        self._channels: dict[str, int] = {}
        self._before: list[RobotiqStatus] = []
        self._fault = Fault.NONE
        self._epoch = 0.0
        self._statuses: Stream[RobotiqStatus]
        self._listened: list[tuple[Stream[Any], Callable[[Any], None]]] = []
        self._tasks: list[asyncio.Task[None]] = []
        self._failed: asyncio.Future[RecordingError]

    @property
    def missed(self) -> int:
        """Statuses that were lost because the event loop was held up for minutes."""
        return self._statuses.missed

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
        # Statuses carry the loop's clock; files are stamped with the world's.
        self._epoch = time.time() - loop.time()
        self._begin()
        self._statuses = self._hand.statuses(BUFFER)
        self._listened = [
            (self._statuses, self._take_status),
            (self._hand.requests(), self._take_request),
            (self._hand.transitions(), self._take_transition),
        ]
        listening = [self._listen(stream, take) for stream, take in self._listened]
        self._tasks = [
            loop.create_task(each, name="robotiq_async recorder")
            for each in (*listening, self._save_again_and_again())
        ]
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Write what is left and close the file.

        Raises:
            RecordingError: something could not be written; never in place of another exception.
        """
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        self._drain()
        if not self._failed.done():
            self._writer.finish()
            await self._save()
        await asyncio.to_thread(self._file.close)
        if self._failed.done() and error is None:
            raise self._failed.result()

    async def failure(self) -> RecordingError:
        """Wait until the recording fails (a full disk, say); what was saved before stays readable."""
        return await asyncio.shield(self._failed)

    # -- the file --------------------------------------------------------------------------------------

    def _begin(self) -> None:
        self._writer = writer = Writer(self._outbox, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        writer.start(profile="", library=f"robotiq_async {__version__}")
        metadata = {
            "version": __version__,
            "address": self._hand.address,
            "note": "never run on real hardware",
        }
        writer.add_metadata("robotiq_async", metadata)
        for name, schema in SCHEMAS.items():
            number = writer.register_schema(f"gripper.{name}", "jsonschema", json.dumps(schema).encode())
            self._channels[name] = writer.register_channel(f"/gripper/{name}", "json", number)
        number = writer.register_schema(SCHEMA_NAME, "ros2msg", SCHEMA.encode())
        self._channels["joints"] = writer.register_channel("/joint_states", "cdr", number)

    def _add(self, channel: str, timestamp: float, data: bytes, sequence: int = 0) -> None:
        stamp = self._nanoseconds(timestamp)
        self._writer.add_message(self._channels[channel], stamp, data, stamp, sequence & 0xFFFFFFFF)

    def _add_json(self, channel: str, timestamp: float, fields: Fields, sequence: int = 0) -> None:
        text = json.dumps(fields, separators=(",", ":"))
        self._add(channel, timestamp, text.encode(), sequence)

    def _nanoseconds(self, timestamp: float) -> int:
        return round((timestamp + self._epoch) * 1e9)

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

    # -- what is recorded ------------------------------------------------------------------------------

    async def _listen(self, stream: Stream[Any], take: Callable[[Any], None]) -> None:
        with contextlib.suppress(RobotiqError):  # the hand gave up; its transitions tell
            async for item in stream:
                if self._failed.done():
                    return
                take(item)

    def _drain(self) -> None:
        """What was published before the end of the block, and not seen yet."""
        for stream, take in self._listened:
            while not self._failed.done() and (item := stream.take_nowait()) is not None:
                take(item)

    def _take_status(self, status: RobotiqStatus) -> None:
        self.recorded += 1
        self._add_json("status", status.timestamp, status_fields(status), status.sequence)
        self._take_joints(status)
        if status.fault != self._fault:
            self._fault = status.fault
            self._add_json("event", status.timestamp, fault_fields(status.fault))

    def _take_joints(self, status: RobotiqStatus) -> None:
        while len(self._before) > 1 and status.timestamp - self._before[1].timestamp >= VELOCITY_S:
            del self._before[0]
        self._before.append(status)
        angles, seconds = joint_angles(status), status.timestamp - self._before[0].timestamp
        velocities = joint_velocities(self._before[0], status) if seconds else (0.0,) * len(angles)
        data = self._encoder.encode(self._nanoseconds(status.timestamp), angles, velocities, efforts(status))
        self._add("joints", status.timestamp, data, status.sequence)

    def _take_request(self, sent: SentRequest) -> None:
        self._add_json("command", sent.timestamp, command_fields(sent))

    def _take_transition(self, transition: Transition) -> None:
        self._add_json("event", transition.timestamp, transition_fields(transition))
