"""A recording as MCAP. Needs the extra ``record`` (mcap)."""

from __future__ import annotations

from typing import Any, Final, Protocol

try:
    from mcap.writer import CompressionType, Writer
except ModuleNotFoundError as error:
    from ...runtime.extras import install

    raise ImportError(f"recordings need mcap: {install('record')}") from error

from ...runtime.version import __version__
from .feed import JOINTS, TOPICS, Message, Topic

NOTE: Final = "never run on real hardware"


class Output(Protocol):
    """The part of a file that the MCAP writer needs."""

    def write(self, data: bytes) -> int:
        """Take bytes."""

    def tell(self) -> int:
        """Number of bytes so far."""

    def flush(self) -> None:
        """May do nothing."""


class McapFile:
    """Encodes messages as MCAP."""

    def __init__(self, output: Output, *, name: str, address: str, ros2: bool = False) -> None:
        """Write the header.

        Args:
            output: receives the bytes.
            name: of the hand.
            address: of the hand.
            ros2: write joint states only, in the profile ``ros2``.
        """
        self._writer: Any = Writer(output, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._writer.start(profile="ros2" if ros2 else "", library=f"robotiq_async {__version__}")
        about = {"version": __version__, "name": name, "address": address, "note": NOTE}
        self._writer.add_metadata("robotiq_async", about)
        self._channels = {topic: self._channel(topic) for topic in ((JOINTS,) if ros2 else TOPICS)}

    def _channel(self, topic: Topic) -> int:
        schema = self._writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
        channel: int = self._writer.register_channel(topic.name, topic.encoding, schema)
        return channel

    def take(self, message: Message) -> None:
        """Add a message; other topics are ignored."""
        if message.topic in self._channels:
            channel, stamp = self._channels[message.topic], message.nanoseconds
            self._writer.add_message(channel, stamp, message.data, stamp, message.sequence & 0xFFFFFFFF)

    def flush(self) -> None:
        """Hand out the bytes so far, so that a file that ends there can be recovered."""
        self._writer.flush()

    def finish(self) -> None:
        """Write the footer."""
        self._writer.finish()
