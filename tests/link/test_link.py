"""ModbusTransport against a server that answers with the bytes of the test.

The frames are made by hand here: neither pymodbus nor our own code takes part on this side.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
import os
import signal
import socket
import threading
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from itertools import count

import pytest

from robotiq_async import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
    RobotiqHand,
)
from robotiq_async.link.address import parse_address
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.values.registers import TCP_REGISTERS
from tests.link.writing import write_image
from tests.patience import patience

STATUS = bytes(range(16))
REGISTERS = tuple(int.from_bytes(STATUS[n : n + 2], "big") for n in range(0, 16, 2))
IMAGE = (0x0900, 0x0C00, 0, 0, 0, 0, 0, 0)

Answer = Callable[[bytes], list[bytes] | None]
"""Gets a request frame; gives the pieces to send, each in a segment of its own; None closes."""


def good(request: bytes, status: bytes = STATUS) -> bytes:
    """The right answer to a request of function 4 or 16."""
    size = 2 * request[11]
    pdu = bytes((4, size)) + status[:size] if request[7] == 4 else request[7:12]
    return request[:4] + (len(pdu) + 1).to_bytes(2, "big") + request[6:7] + pdu


class Scripted:
    """A Modbus TCP server whose answers are scripted."""

    def __init__(self) -> None:
        self.answer: Answer = lambda request: [good(request)]
        self.requests: list[bytes] = []
        self.asked = asyncio.Event()
        self.connections = 0
        self.writers: list[asyncio.StreamWriter] = []
        self.left_over = b""
        """Bytes that a client gets before its first request."""

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.connections += 1
        self.writers.append(writer)
        writer.write(self.left_over)
        with contextlib.suppress(ConnectionError, asyncio.IncompleteReadError):
            while True:
                header = await reader.readexactly(6)
                request = header + await reader.readexactly(int.from_bytes(header[4:6], "big"))
                self.requests.append(request)
                self.asked.set()
                pieces = self.answer(request)
                if pieces is None:
                    break
                for piece in pieces:
                    writer.write(piece)
                    await writer.drain()
                    await asyncio.sleep(0)
                    await asyncio.sleep(0)
        writer.close()


@asynccontextmanager
async def linked(answer: Answer | None = None) -> AsyncIterator[tuple[ModbusTransport, Scripted]]:
    """A transport that is open, at a server that was well-behaved while it was opened."""
    scripted = Scripted()
    server = await asyncio.start_server(scripted.serve, "127.0.0.1", 0)
    port = server.sockets[0].getsockname()[1]
    transport = ModbusTransport(
        parse_address(f"127.0.0.1:{port}"), TCP_REGISTERS, connect_timeout=1.0, response_timeout=0.1
    )
    await transport.open()
    scripted.requests.clear()
    scripted.asked.clear()
    scripted.answer = answer or scripted.answer
    try:
        yield transport, scripted
    finally:
        await transport.close()
        for writer in scripted.writers:
            writer.close()
        server.close()
        for _ in range(5):
            await asyncio.sleep(0)


async def test_a_read_and_a_write() -> None:
    async with linked() as (transport, scripted):
        assert await transport.read() == REGISTERS
        await write_image(transport, IMAGE)
        assert transport.is_open
    read, write = scripted.requests
    assert read[6:] == bytes.fromhex("02 04 0000 0008")
    assert write[6:] == bytes.fromhex("02 10 0000 0008 10 0900 0c00") + bytes(12)


async def test_a_reply_in_pieces_is_a_reply() -> None:
    async with linked(lambda request: [good(request)[n : n + 1] for n in range(25)]) as (transport, _):
        assert await transport.read() == REGISTERS


def put(reply: bytes, at: int, value: bytes) -> bytes:
    return reply[:at] + value + reply[at + len(value) :]


WRONG: dict[str, Callable[[bytes], bytes]] = {
    "transaction": lambda reply: put(reply, 0, b"\x7f\x7f"),
    "transaction 0": lambda reply: put(reply, 0, b"\0\0"),
    "protocol": lambda reply: put(reply, 2, b"\0\1"),
    "unit": lambda reply: put(reply, 6, b"\x63"),
    "function": lambda reply: put(reply, 7, b"\x03"),
    "unknown function": lambda reply: put(reply, 7, b"\x63"),
    "length": lambda reply: put(reply, 4, b"\0\7"),
    "short, and consistent": lambda reply: reply[:4] + b"\0\5" + reply[6:8] + b"\2" + reply[9:11],
    "long, and consistent": lambda reply: reply[:4] + b"\0\x15" + reply[6:8] + b"\x12" + reply[9:] + b"\0\0",
    "byte count": lambda reply: put(reply, 8, b"\x08"),
    "byte count beyond the frame": lambda reply: put(reply, 8, b"\xff"),
    "two in one segment": lambda reply: reply * 2,
    "one byte more": lambda reply: reply + b"\0",
    "an exception": lambda reply: reply[:4] + b"\0\3" + reply[6:7] + bytes((reply[7] | 0x80, 2)),
    "garbage": lambda _: b"GET / HTTP/1.1\r\n\r\n",
}


@pytest.mark.parametrize("what", WRONG)
async def test_a_wrong_reply_to_a_read_is_never_taken(what: str, caplog: pytest.LogCaptureFixture) -> None:
    async with linked(lambda request: [WRONG[what](good(request))]) as (transport, scripted):
        with pytest.raises(ProtocolError) as caught:
            await transport.read()
        assert not transport.is_open
        if what == "an exception":
            assert "illegal data address" in str(caught.value)
        scripted.answer = lambda request: [good(request)]
        await transport.open()
        assert await transport.read() == REGISTERS
        assert scripted.connections == 2
    assert not [record for record in caplog.records if record.levelno >= logging.WARNING]


@pytest.mark.parametrize("at", range(12))
async def test_a_wrong_echo_of_a_write_is_never_taken(at: int) -> None:
    def corrupt(request: bytes) -> list[bytes]:
        reply = good(request)
        return [put(reply, at, bytes((reply[at] ^ 0x21,)))]

    async with linked(corrupt) as (transport, scripted):
        with pytest.raises(ProtocolError):
            await write_image(transport, IMAGE)
        assert not transport.is_open
        assert len(scripted.requests) == 1


@pytest.mark.parametrize("size", [0, 1, 7, 24])
async def test_half_a_reply_is_a_timeout(size: int) -> None:
    async with linked(lambda request: [good(request)[:size]]) as (transport, _):
        with pytest.raises(ResponseTimeoutError) as caught:
            await transport.read()
        assert isinstance(caught.value, TimeoutError)
        assert not transport.is_open


async def test_a_closed_connection_ends_the_request_at_once() -> None:
    async with linked(lambda _: None) as (transport, _):
        loop = asyncio.get_running_loop()
        began = loop.time()
        with pytest.raises(ConnectionLostError):
            await transport.read()
        assert loop.time() - began < patience(0.05)
        with pytest.raises(ConnectionLostError):
            await transport.read()


async def test_an_unanswered_write_is_sent_once() -> None:
    async with linked(lambda _: []) as (transport, scripted):
        with pytest.raises(ResponseTimeoutError):
            await write_image(transport, IMAGE)
        scripted.answer = lambda request: [good(request)]
        await transport.open()
        await transport.read()
        assert [request[7] for request in scripted.requests] == [16, 4, 4]


async def test_bytes_without_a_request_break_the_link() -> None:
    async with linked() as (transport, scripted):
        assert await transport.read() == REGISTERS
        scripted.writers[-1].write(good(scripted.requests[-1]))
        for _ in range(20):
            await asyncio.sleep(0)
        with pytest.raises(ProtocolError, match="without a request"):
            await transport.read()
        assert not transport.is_open


async def opened_and_read(transport: ModbusTransport) -> tuple[int, ...]:
    await transport.open()
    return await transport.read()


@pytest.mark.parametrize("number", [0, 1, 2, 65000])
async def test_a_reply_from_before_the_connection_is_never_taken(number: int) -> None:
    """It is on its way as the connection opens, and waits in the socket when the first request is sent."""
    async with linked() as (transport, scripted):
        old = number.to_bytes(2, "big") + bytes.fromhex("0000 0013 02 04 10") + bytes(16)
        scripted.left_over = old
        with pytest.raises(ProtocolError, match="without a request"):
            await opened_and_read(transport)
        assert not transport.is_open
        assert scripted.requests == [], "what is asked on such a connection would be left over as well"
        scripted.left_over = b""
        await transport.open()
        assert await transport.read() == REGISTERS


async def test_a_late_reply_that_comes_after_the_first_request_is_never_taken() -> None:
    late: list[bytes] = []

    def one_behind(request: bytes) -> list[bytes]:
        late.append(good(request))
        return late[-2:-1]

    async with linked(one_behind) as (transport, _):
        with pytest.raises(ResponseTimeoutError):
            await transport.read()
        for _ in range(20):
            with pytest.raises(ProtocolError, match="not the answer"):
                await transport.open()
        assert len(late) == 21


@pytest.mark.parametrize("late", [1, 2, 5])
async def test_a_late_reply_that_a_gateway_numbers_anew_is_never_taken(late: int) -> None:
    """Behind a gateway to a serial line, whose replies carry no number, is a slow device.

    The gateway takes the late reply for the answer to its next request.
    """
    asked: list[bytes] = []
    kept: list[bytes] = []

    def gateway(request: bytes) -> list[bytes]:
        asked.append(request)
        kept.append(good(request, len(asked).to_bytes(2, "big") * 8)[4:])
        return [request[:4] + kept.pop(0)] if len(kept) > late else []

    async with linked(gateway) as (transport, _):
        with pytest.raises(ResponseTimeoutError):
            await transport.read()
        for _ in range(20):
            with pytest.raises(RobotiqConnectionError):
                await transport.open()
        late = 0
        kept.clear()
        await transport.open()
        assert await transport.read() == (len(asked),) * 8


def numbers(scripted: Scripted) -> list[int]:
    return [int.from_bytes(request[:2], "big") for request in scripted.requests]


async def test_no_transaction_number_comes_twice_over_all_connections() -> None:
    async with linked() as (transport, scripted):
        for _ in range(5):
            for _ in range(3):
                await transport.read()
                await write_image(transport, IMAGE)
            await transport.open()
        used = numbers(scripted)
        assert len(set(used)) == len(used) == 35
        assert 0 not in used, "pymodbus takes a reply numbered 0 for an answer to anything"


async def test_transaction_numbers_begin_anywhere() -> None:
    """Or what another program has left over would be taken for an answer to this one."""
    firsts = set()
    for _ in range(4):
        async with linked() as (transport, scripted):
            await transport.read()
            firsts.add(numbers(scripted)[0])
    assert len(firsts) > 1


async def test_after_the_last_transaction_number_comes_the_first() -> None:
    async with linked() as (transport, scripted):
        transport._numbers = count(0xFFFE)  # type: ignore[misc]
        for _ in range(3):
            assert await transport.read() == REGISTERS
        assert numbers(scripted) == [0xFFFF, 1, 2]


async def test_a_cancelled_request_spoils_the_link() -> None:
    async with linked(lambda _: []) as (transport, scripted):
        reading = asyncio.create_task(transport.read())
        await scripted.asked.wait()
        reading.cancel()
        with pytest.raises(asyncio.CancelledError):
            await reading
        assert not transport.is_open


async def test_a_closed_transport_says_so_and_closes_twice() -> None:
    async with linked() as (transport, _):
        await transport.close()
        await transport.close()
        with pytest.raises(ConnectionLostError):
            await transport.read()
        with pytest.raises(ConnectionLostError):
            await write_image(transport, IMAGE)


async def test_opening_again_leaves_no_old_connection() -> None:
    async with linked() as (transport, scripted):
        await transport.open()
        async with asyncio.timeout(patience(1.0)):
            await scripted.writers[0].wait_closed()
        assert await transport.read() == REGISTERS
        assert scripted.connections == 2


@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
async def test_a_forked_process_does_not_keep_the_connection() -> None:
    """A worker of a ProcessPoolExecutor has a copy of the socket, and outlives the connection."""
    async with linked() as (transport, scripted):
        child = os.fork()
        if child == 0:
            signal.pause()
            os._exit(0)
        try:
            await transport.close()
            async with asyncio.timeout(patience(5.0)):
                await scripted.writers[0].wait_closed()
        finally:
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)  # noqa: ASYNC222  # it was killed


# -- names -------------------------------------------------------------------------------------------------


@pytest.fixture
def resolved(monkeypatch: pytest.MonkeyPatch) -> Callable[..., None]:
    """Makes the system resolve every name to these addresses."""

    def resolve(*addresses: str) -> None:
        def getaddrinfo(_: str, port: int, *__: object, **___: object) -> list[object]:
            families = {True: socket.AF_INET6, False: socket.AF_INET}
            kind = socket.SOCK_STREAM
            return [(families[":" in each], kind, 6, "", (each, port)) for each in addresses]

        monkeypatch.setattr(socket, "getaddrinfo", getaddrinfo)

    return resolve


def to_the_host(transport: ModbusTransport) -> ModbusTransport:
    """A transport to the same port, by a name."""
    address = f"gripper.example:{transport.dialogues.line.address.port}"
    return ModbusTransport(parse_address(address), TCP_REGISTERS, connect_timeout=1.0, response_timeout=0.1)


@pytest.mark.parametrize("others", [[], ["127.0.0.2"], ["::1"], ["127.0.0.2", "::1", "127.0.0.3"]])
async def test_the_first_address_of_a_name_that_can_be_reached(
    resolved: Callable[..., None], others: list[str]
) -> None:
    async with linked() as (transport, _):
        resolved(*others, "127.0.0.1")
        named = to_the_host(transport)
        await named.open()
        assert await named.read() == REGISTERS
        await named.close()


async def test_an_address_that_does_not_answer_leaves_time_for_others(resolved: Callable[..., None]) -> None:
    """Its queue of connections is full, so it does not even refuse."""
    async with linked() as (transport, _):
        with contextlib.ExitStack() as sockets:
            silent = sockets.enter_context(socket.socket())
            silent.bind(("127.0.0.2", transport.dialogues.line.address.port))
            silent.listen(0)
            for _ in range(3):
                waiting = sockets.enter_context(socket.socket())
                waiting.setblocking(False)
                waiting.connect_ex(silent.getsockname())
            resolved("127.0.0.2", "127.0.0.1")
            named = to_the_host(transport)
            await named.open()
            assert await named.read() == REGISTERS
            await named.close()


async def test_no_address_of_a_name_can_be_reached(resolved: Callable[..., None]) -> None:
    async with linked() as (transport, _):
        resolved("127.0.0.2", "127.0.0.3")
        with pytest.raises(
            ConnectFailedError, match=r"gripper\.example:\d+: connection refused: nothing listens"
        ):
            await to_the_host(transport).open()


async def test_an_unknown_host_name_is_reported() -> None:
    address = parse_address("nowhere.invalid")
    transport = ModbusTransport(address, TCP_REGISTERS, connect_timeout=5.0, response_timeout=0.1)
    with pytest.raises(ConnectFailedError, match=r"nowhere\.invalid:502: the name cannot be resolved: \w"):
        await transport.open()


async def test_a_host_name_without_a_thread_to_resolve_it_in_is_a_failed_try(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def start(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", start)
    address = parse_address("gripper.example")
    transport = ModbusTransport(address, TCP_REGISTERS, connect_timeout=5.0, response_timeout=0.1)
    with pytest.raises(ConnectFailedError, match="the name cannot be resolved: can't start new thread"):
        await transport.open()


@pytest.mark.parametrize(
    ("number", "why"),
    [
        (errno.ECONNREFUSED, "connection refused: nothing listens there"),
        (errno.EHOSTUNREACH, "host unreachable"),
        (errno.ENETUNREACH, "network unreachable"),
        (errno.EACCES, "Permission denied"),
    ],
)
async def test_each_way_not_to_reach_a_host_has_its_own_sentence(
    number: int, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async def refuse(*_: object, **__: object) -> None:
        raise OSError(number, "Connect call failed")

    transport = ModbusTransport(
        parse_address("192.0.2.1"), TCP_REGISTERS, connect_timeout=5.0, response_timeout=0.1
    )
    monkeypatch.setattr(asyncio.get_running_loop(), "create_connection", refuse)
    with pytest.raises(ConnectFailedError, match=f"^cannot connect to tcp://192.0.2.1:502: {why}"):
        await transport.open()


def test_a_resolver_that_does_not_answer_holds_up_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = threading.Event()
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: answer.wait(20) and [])

    async def use() -> None:
        hand = RobotiqHand("gripper.example", connect_timeout=0.1)
        with pytest.raises(ConnectFailedError, match=r"gripper\.example:502: no connection within 0\.1 s"):
            await hand.start()
        await hand.stop()

    began = time.monotonic()
    asyncio.run(use())
    assert time.monotonic() - began < patience(5)
    answer.set()


# -- more than was requested -------------------------------------------------------------------------------

REPLY = good(bytes.fromhex("0001 0000 0006 02 04 0000 0008"))
BURSTS = [*(count * REPLY for count in (2, 11, 100, 1000)), *(bytes(size) for size in (517, 5000, 300_000))]
"""pymodbus drops what it cannot keep, silently, and continues."""
bursts = pytest.mark.parametrize("burst", BURSTS, ids=len)


@bursts
@pytest.mark.parametrize("begins_well", [True, False])
async def test_a_burst_is_no_answer_and_no_silence(burst: bytes, begins_well: bool) -> None:
    async with linked(lambda request: [(good(request) if begins_well else b"") + burst]) as (transport, _):
        began = time.monotonic()
        with pytest.raises(ProtocolError) as caught:
            await transport.read()
        assert time.monotonic() - began < patience(0.09), "in less than the timeout"
        assert len(str(caught.value)) < 300
        assert not transport.is_open


@bursts
async def test_a_burst_between_two_requests_or_before_the_first_spoils_the_link(burst: bytes) -> None:
    async with linked() as (transport, scripted):
        assert await transport.read() == REGISTERS
        scripted.writers[-1].write(burst)
        await scripted.writers[-1].drain()
        for _ in range(20):
            await asyncio.sleep(0)
        with pytest.raises(ProtocolError, match="without a request") as caught:
            await transport.read()
        assert len(str(caught.value)) < 300
        scripted.requests.clear()
        scripted.left_over = burst
        with pytest.raises(ProtocolError, match="without a request"):
            await transport.open()
        assert scripted.requests == []
