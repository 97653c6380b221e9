"""Reading recordings that others have made, or broken, on purpose or not."""

from __future__ import annotations

import functools
import json
import tracemalloc
import zlib
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import lz4.frame  # type: ignore[import-untyped]
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.records import Channel, Chunk, Header, McapRecord, Message, Schema

from robotiq_async.tools.errors import RecordingError
from robotiq_async.tools.recording.recordings import LARGEST, read_recording, recover

MAGIC = b"\x89MCAP0\r\n"
EVENT = {"timestamp": 1.0, "kind": "state", "target": "RESET"}
CHANNEL = Channel(id=1, topic="/gripper/event", message_encoding="json", metadata={}, schema_id=0)
BOMB = 2**27
"""Bytes that a small chunk becomes."""


def message(data: bytes, channel: int = 1, at: int = 10**18) -> Message:
    return Message(channel_id=channel, log_time=at, data=data, publish_time=at, sequence=0)


def encoded(*records: McapRecord) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]


def chunk(data: bytes, compression: str, size: int) -> Chunk:
    return Chunk(compression, data, 10**18, 10**18, 0, size)


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "it.mcap"


def write(file: Path, *records: McapRecord) -> None:
    """A file that breaks off after these records."""
    file.write_bytes(MAGIC + encoded(Header(profile="", library=""), *records))


def readers(file: Path) -> list[Callable[[], object]]:
    return [lambda: list(read_recording(file)), lambda: recover(file, file.with_name("whole.mcap"))]


# -- bombs -------------------------------------------------------------------------------------------------


def zstd_bomb(*, tells: bool) -> bytes:
    """BOMB zeros, compressed; with its real size in the frame, or with none."""
    compressor = zstandard.ZstdCompressor().compressobj(size=BOMB if tells else -1)
    blocks = [compressor.compress(bytes(2**20)) for _ in range(BOMB // 2**20)]
    return b"".join(blocks) + compressor.flush()


def lz4_bomb() -> bytes:
    with lz4.frame.LZ4FrameCompressor() as compressor:
        blocks = [compressor.begin()]
        blocks += [compressor.compress(bytes(2**20)) for _ in range(BOMB // 2**20)]
        return b"".join(blocks) + bytes(compressor.flush())


@contextmanager
def little_memory() -> Iterator[None]:
    assert BOMB > 4 * LARGEST
    tracemalloc.start()
    try:
        yield
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak < 4 * LARGEST


BOMBS: dict[str, Callable[[], tuple[str, bytes]]] = {
    "zstd": functools.cache(lambda: ("zstd", zstd_bomb(tells=True))),
    "zstd without a size": functools.cache(lambda: ("zstd", zstd_bomb(tells=False))),
    "lz4": functools.cache(lambda: ("lz4", lz4_bomb())),
}


@pytest.mark.parametrize("kind", BOMBS)
@pytest.mark.parametrize("declared", [BOMB, 1000, LARGEST, 2**63])
@pytest.mark.parametrize("reader", [0, 1])
def test_a_chunk_that_would_fill_the_memory_is_refused(
    file: Path, kind: str, declared: int, reader: int
) -> None:
    compression, data = BOMBS[kind]()
    write(file, CHANNEL, message(json.dumps(EVENT).encode()), chunk(data, compression, declared))
    with little_memory(), pytest.raises(RecordingError, match=r"it\.mcap: a chunk .* bytes") as caught:
        readers(file)[reader]()
    assert "\n" not in str(caught.value)


def test_messages_before_a_decompression_bomb_are_read_and_saved(file: Path) -> None:
    write(file, CHANNEL, message(json.dumps(EVENT).encode()), chunk(b"", "zstd", 2**63))
    entries = read_recording(file)
    assert next(entries).fields == EVENT
    with pytest.raises(RecordingError):
        next(entries)
    whole = file.with_name("whole.mcap")
    with pytest.raises(RecordingError, match=r"chunk .*; the messages before it are in .*whole\.mcap"):
        recover(file, whole)
    assert [entry.fields for entry in read_recording(whole)] == [EVENT]


@pytest.mark.parametrize("compression", ["", "zstd", "lz4"])
def test_chunks_of_other_writers_are_read(file: Path, compression: str) -> None:
    inner = encoded(CHANNEL, *(message(json.dumps(EVENT).encode()) for _ in range(3)))
    pack = {"": bytes, "zstd": zstandard.compress, "lz4": lz4.frame.compress}[compression]
    whole = chunk(pack(inner), compression, len(inner))
    whole.uncompressed_crc = zlib.crc32(inner)
    write(file, whole)
    assert [entry.fields for entry in read_recording(file)] == [EVENT] * 3


def test_an_unknown_compression_is_named(file: Path) -> None:
    write(file, chunk(b"x", "rar\x1b[31m", 1))
    with pytest.raises(RecordingError, match=r"compressed as 'rar\\x1b\[31m'"):
        list(read_recording(file))


def test_a_record_that_lies_about_its_length_takes_no_memory(file: Path) -> None:
    head = MAGIC + encoded(Header(profile="", library=""))
    with file.open("wb") as stream:
        # A chunk of 60 bytes, whose data claim to be the rest of the file.
        stream.write(head + b"\x06" + (60).to_bytes(8, "little") + bytes(28) + bytes(4))
        stream.write((BOMB).to_bytes(8, "little"))
        stream.truncate(BOMB)
    with little_memory():
        assert list(read_recording(file)) == []


# -- what does not fit together ----------------------------------------------------------------------------


def test_a_channel_without_a_schema(file: Path) -> None:
    write(file, Channel(1, "/gripper/event", "json", {}, schema_id=9), message(b"{}"))
    assert len(list(read_recording(file))) == 1
    with pytest.raises(RecordingError, match=r"it\.mcap: there is no schema 9"):
        recover(file, file.with_name("whole.mcap"))


DEEP = b"[" * 200_000 + b"]" * 200_000
NOT_OURS = {
    "no JSON": b"{",
    "not UTF-8": b'{"kind": "\xff"}',
    "deeply nested": DEEP,
    "a number of many digits": b'{"kind": ' + b"9" * 10_000 + b"}",
    "a list": b"[]",
    "null": b"null",
}


@pytest.mark.parametrize("what", NOT_OURS)
def test_a_message_that_is_no_json_object_is_refused_in_one_line(file: Path, what: str) -> None:
    write(file, CHANNEL, message(NOT_OURS[what]))
    (entry,) = read_recording(file)
    with pytest.raises(RecordingError, match=r"it\.mcap: a message on '/gripper/event'") as caught:
        _ = entry.fields
    assert len(str(caught.value)) < 300
    assert "\n" not in str(caught.value)


def test_schemas_are_kept(file: Path) -> None:
    schema = Schema(id=3, name="n", encoding="jsonschema", data=b"{}")
    write(file, schema, Channel(1, "/gripper/event", "json", {}, schema_id=3), message(b"{}"))
    recover(file, file.with_name("whole.mcap"))
    again = file.with_name("again.mcap")
    recover(file.with_name("whole.mcap"), again)
    assert len(list(read_recording(again))) == 1
