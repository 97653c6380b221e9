"""Reads recordings back: whole ones, and what a killed recorder has left. Needs the extra ``record``."""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import Any

try:
    from mcap.exceptions import McapError
    from mcap.records import Channel, Footer, Message, Metadata, Schema
    from mcap.stream_reader import StreamReader
    from mcap.writer import Writer
except ModuleNotFoundError as error:
    raise ImportError("recordings need mcap: pip install 'robotiq-async[record]'") from error

from .recorder import RecordingError


@dataclass(frozen=True, slots=True)
class Entry:
    """One message of a recording.

    Attributes:
        topic: the channel's name.
        nanoseconds: since 1970.
        sequence: of a status; 0 for the others.
        data: the bytes.
        is_json: whether they are JSON.
    """

    topic: str
    nanoseconds: int
    sequence: int
    data: bytes
    is_json: bool

    @property
    def fields(self) -> dict[str, Any]:
        """What a JSON message says."""
        fields: dict[str, Any] = json.loads(self.data)
        return fields


@dataclass
class Recovered:
    """What :func:`recover` has found.

    Attributes:
        messages: so many messages were saved.
        is_whole: whether the file was whole to begin with.
    """

    messages: int = 0
    is_whole: bool = False


def read_recording(path: Path | str) -> Iterator[Entry]:
    """The messages of a recording in their order; of a broken one, those that are there.

    Raises:
        RecordingError: it cannot be read, or is no MCAP file.
    """
    channels: dict[int, Channel] = {}
    for record in _records(path):
        if isinstance(record, Channel):
            channels[record.id] = record
        elif isinstance(record, Message):
            channel = channels[record.channel_id]
            is_json = channel.message_encoding == "json"
            yield Entry(channel.topic, record.log_time, record.sequence, record.data, is_json)


def recover(path: Path | str, target: Path | str) -> Recovered:
    """Write what is in a broken recording into a whole one.

    Raises:
        RecordingError: it cannot be read or is no MCAP file, or the target is there already.
    """
    found = Recovered()
    records = _records(path)
    first = next(records)  # refuses what is no recording before there is a target
    try:
        with open(target, "xb") as file:
            writer = Writer(file)
            writer.start()
            numbers: dict[int, int] = {}
            schemas: dict[int, int] = {0: 0}
            for record in chain([first], records):
                if isinstance(record, Schema) and record.id not in schemas:
                    schemas[record.id] = writer.register_schema(record.name, record.encoding, record.data)
                elif isinstance(record, Channel) and record.id not in numbers:
                    number = writer.register_channel(
                        record.topic, record.message_encoding, schemas[record.schema_id], record.metadata
                    )
                    numbers[record.id] = number
                elif isinstance(record, Message):
                    number = numbers[record.channel_id]
                    writer.add_message(
                        number, record.log_time, record.data, record.publish_time, record.sequence
                    )
                    found.messages += 1
                elif isinstance(record, Metadata):
                    writer.add_metadata(record.name, record.metadata)
                elif isinstance(record, Footer):
                    found.is_whole = True
            writer.finish()  # type: ignore[no-untyped-call]
    except FileExistsError as error:
        raise RecordingError(f"{target}: {error.strerror}") from error
    except OSError as error:
        Path(target).unlink(missing_ok=True)  # half of it looks like the whole
        raise RecordingError(f"{target}: {error.strerror}") from error
    return found


def _records(path: Path | str) -> Iterator[object]:
    """The records of a file up to its end, or to where it breaks off."""
    try:
        with open(path, "rb") as file:
            reader = StreamReader(file, validate_crcs=True, record_size_limit=64 * 2**20)
            records = iter(reader.records)
            try:
                yield next(records)
            except (McapError, StopIteration, EOFError, ValueError, struct.error) as error:
                raise RecordingError(f"{path}: not an MCAP file") from error
            # A killed recorder leaves a file that ends anywhere, and damaged bytes may raise anything.
            with suppress(Exception):
                yield from records
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error
