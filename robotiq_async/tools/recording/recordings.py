"""Recordings as MCAP: written, and read, complete or truncated. Needs the extra ``record``.

A file that is read may be malicious: no length field is trusted, and chunks are unpacked up to a limit.
"""

from __future__ import annotations

import json
import reprlib
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path
from typing import IO, Any, Final, Protocol, TypeVar

try:
    import zstandard
    from lz4.frame import LZ4FrameDecompressor  # type: ignore[import-untyped]
    from mcap.records import Channel, Chunk, Footer, Header, McapRecord, Message, Metadata, Schema
    from mcap.stream_reader import StreamReader, breakup_chunk
    from mcap.writer import CompressionType, Writer
except ModuleNotFoundError as error:
    from ...runtime import install

    raise ImportError(f"recordings need mcap: {install('record')}") from error

from ...runtime import __version__, log
from ..errors import RecordingError
from .feed import JOINTS_TOPIC, TOPICS, Topic
from .feed import Message as FeedMessage

NOTE: Final = "never run on real hardware"
LARGEST: Final = 16 * 2**20
"""Limit of a record and of an unpacked chunk in bytes; MCAP writers make chunks of a sixteenth of it."""
NOT_OURS: Final = (LookupError, TypeError, ValueError, AttributeError, OverflowError)
"""Errors of reading a message with other fields, or with fields of another type."""
BROKEN: Final = (
    "%s ends too early, after %d messages: its program was killed or still writes it, or it is damaged; "
    "robotiq-async recover makes a complete file of these messages"
)

T = TypeVar("T")


# -- writing ---------------------------------------------------------------------------------------------


class Output(Protocol):
    """The part of a file that the MCAP writer needs."""

    def write(self, data: bytes) -> int: ...

    def tell(self) -> int: ...

    def flush(self) -> None: ...


class McapFile:
    """Encodes messages as MCAP."""

    def __init__(self, output: Output, *, name: str, address: str, ros2: bool = False) -> None:
        """Write the header; with ``ros2`` joint states only follow, in the profile ``ros2``."""
        self._writer: Any = Writer(output, compression=CompressionType.ZSTD)  # type: ignore[arg-type]
        self._writer.start(profile="ros2" if ros2 else "", library=f"robotiq_async {__version__}")
        about = {"version": __version__, "name": name, "address": address, "note": NOTE}
        self._writer.add_metadata("robotiq_async", about)
        self._channels = {topic: self._channel(topic) for topic in ((JOINTS_TOPIC,) if ros2 else TOPICS)}

    def _channel(self, topic: Topic) -> int:
        schema = self._writer.register_schema(topic.schema_name, topic.schema_encoding, topic.schema)
        channel: int = self._writer.register_channel(topic.name, topic.encoding, schema)
        return channel

    def take(self, message: FeedMessage) -> None:
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


# -- reading ---------------------------------------------------------------------------------------------


@dataclass(frozen=True, slots=True)
class RecordedMessage:
    """One message of a recording."""

    topic: str  # the channel's name
    nanoseconds: int  # since 1970
    sequence: int  # the number of the status; commands and events are counted from 1
    data: bytes
    is_json: bool  # whether the channel is declared as JSON
    path: str = field(default="", compare=False)  # the file

    @property
    def fields(self) -> dict[str, Any]:
        """The fields of a JSON message.

        Raises:
            RecordingError: it is not a JSON object.
        """
        try:
            fields = json.loads(self.data)
        except (ValueError, RecursionError) as error:
            raise self._refused(f"is not JSON: {error}") from None
        if not isinstance(fields, dict):
            raise self._refused("is not a JSON object")
        return fields

    def read(self, what: Callable[[dict[str, Any]], T]) -> T:
        """Apply a function to the fields.

        Raises:
            RecordingError: they do not have a recorder's format.
        """
        fields = self.fields
        try:
            return what(fields)
        except KeyError as error:
            why = f"was not made by this version of robotiq_async: it has no {error!s:.80}"
            raise self._refused(why) from error
        except NOT_OURS as error:
            raise self._refused("was not written by robotiq_async") from error

    def _refused(self, why: str) -> RecordingError:
        return RecordingError(f"{self.path}: a message on {reprlib.repr(self.topic)} {why}")


@dataclass(frozen=True)
class Recovered:
    """The outcome of :func:`recover`.

    Attributes:
        messages: number of messages saved.
        is_whole: whether the file was complete already.
    """

    messages: int = 0
    is_whole: bool = False


def read_recording(path: Path | str) -> Iterator[RecordedMessage]:
    """Iterate over the messages of a recording. A truncated recording ends with a warning.

    Raises:
        RecordingError: it cannot be read, is not an MCAP file, or does not have a recorder's format: a chunk
            that would fill the memory, a message without a channel.
    """
    channels: _Known[Channel] = _Known(path, "channel")
    count, is_whole = 0, False
    for record in _records(path):
        if isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            channel, count = channels[record.channel_id], count + 1
            is_json = channel.message_encoding == "json"
            yield RecordedMessage(
                channel.topic, record.log_time, record.sequence, record.data, is_json, str(path)
            )
        elif isinstance(record, Footer):
            is_whole = True
    if not is_whole:
        log.warning(BROKEN, path, count)


def recover(path: Path | str, target: Path | str) -> Recovered:
    """Copy the readable part of a truncated recording into a complete one.

    Raises:
        RecordingError: as :func:`read_recording`; the target then has the messages before the damage. Also if
            the target exists already.
    """
    messages, is_whole = 0, False
    records = _records(path)
    header = next(records)  # raises for other files, before the target exists
    assert isinstance(header, Header)
    refused: RecordingError | None = None
    try:
        with open(target, "xb") as file:
            writer = Writer(file)
            writer.start(header.profile, header.library)
            try:
                for record in _copied(records, writer, path):
                    messages += isinstance(record, Message)
                    is_whole |= isinstance(record, Footer)
            except RecordingError as error:
                refused = error
            writer.finish()  # type: ignore[no-untyped-call]
    except FileExistsError as error:
        raise RecordingError(f"{target}: {error.strerror}") from error
    except OSError as error:
        Path(target).unlink(missing_ok=True)  # a part would look complete
        raise RecordingError(f"{target}: {error.strerror}") from error
    if refused is not None:
        raise RecordingError(f"{refused}; the messages before it are in {target}") from refused
    return Recovered(messages, is_whole)


def _copied(records: Iterator[McapRecord], writer: Writer, path: Path | str) -> Iterator[McapRecord]:
    schemas: _Known[int] = _Known(path, "schema")
    schemas[0] = 0
    channels: _Known[int] = _Known(path, "channel")
    for record in records:
        if isinstance(record, Schema) and record.id not in schemas:
            schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
        elif isinstance(record, Channel) and record.id not in channels:
            schema = schemas[record.schema_id]
            channels[record.id] = writer.register_channel(
                record.topic, record.message_encoding, schema, record.metadata
            )
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            writer.add_message(channel, record.log_time, record.data, record.publish_time, record.sequence)
        elif isinstance(record, Metadata):
            writer.add_metadata(record.name, record.metadata)
        yield record


class _Known(dict[int, T]):
    """Schemas or channels by id; a reference to a missing one is an error."""

    def __init__(self, path: Path | str, kind: str) -> None:
        super().__init__()
        self._path = path
        self._kind = kind

    def __missing__(self, number: int) -> T:
        raise RecordingError(f"{self._path}: there is no {self._kind} {number}, to which it refers")


# -- records -----------------------------------------------------------------------------------------------


def _records(path: Path | str) -> Iterator[McapRecord]:
    try:
        with open(path, "rb") as file:
            reader = StreamReader(
                _Bounded(file),  # type: ignore[arg-type]
                emit_chunks=True,
                validate_crcs=True,
                record_size_limit=LARGEST,
            )
            records = iter(reader.records)
            header = None
            with suppress(Exception):  # damaged bytes may raise anything
                header = next(records)
            if not isinstance(header, Header):
                raise RecordingError(f"{path}: not an MCAP file")
            try:
                for record in chain([header], records):
                    yield from _unpacked(path, record)
            except RecordingError:
                raise
            except Exception:  # noqa: BLE001  # damaged bytes may raise anything
                return  # the file of a killed recorder ends anywhere
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error


class _Bounded:
    """A file that never reads more than a record may have."""

    def __init__(self, file: IO[bytes]) -> None:
        self._file = file

    def read(self, size: int) -> bytes:
        if size > LARGEST:
            raise ValueError(f"{size} bytes are not a record")
        return self._file.read(size)


def _unpacked(path: Path | str, record: McapRecord) -> list[McapRecord]:
    """The records of a chunk, or the record itself."""
    if not isinstance(record, Chunk):
        return [record]
    size = record.uncompressed_size
    if size > LARGEST:
        raise RecordingError(
            f"{path}: a chunk of {size} bytes, more than {LARGEST}: not written by robotiq_async"
        )
    match record.compression:
        case "":
            data = record.data
        case "zstd":
            # The frame's own size and window size cannot be trusted either.
            unpacking = zstandard.ZstdDecompressor(max_window_size=LARGEST)
            data = unpacking.stream_reader(record.data).read(size + 1)
        case "lz4":
            data = LZ4FrameDecompressor().decompress(record.data, max_length=size + 1)
        case other:
            raise RecordingError(
                f"{path}: a chunk is compressed as {reprlib.repr(other)}, which is not supported"
            )
    if len(data) > size:
        raise RecordingError(
            f"{path}: a chunk has more than the {size} bytes that it claims: not written by robotiq_async"
        )
    if len(data) < size:
        raise ValueError(f"{len(data)} bytes of {size}")
    return breakup_chunk(replace(record, compression="", data=data), validate_crc=True)
