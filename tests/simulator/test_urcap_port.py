"""The text port of a URCap, as a session with a real gripper and the vendor's script show it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

from robotiq_async.simulator import SimulatedGripper, Trouble, UrcapSimulatorServer
from robotiq_async.values.model import TWO_FINGER_85
from tests.grippers import activate_beforehand

pytestmark = pytest.mark.virtual_time


class Port:
    """A client with bytes and nothing else.

    Attributes:
        server: the server that it talks to.
    """

    def __init__(
        self, server: UrcapSimulatorServer, reader: asyncio.StreamReader, writer: asyncio.StreamWriter
    ) -> None:
        self.server = server
        self._reader, self._writer = reader, writer

    async def asks(self, *parts: bytes) -> bytes:
        """Send parts, and take what is answered within a moment."""
        for part in parts:
            self._writer.write(part)
            await asyncio.sleep(0.01)
        return await self._reader.read(1000)


@pytest.fixture
async def port() -> AsyncIterator[Port]:
    jaw = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85, spread=False)
    async with UrcapSimulatorServer(jaw) as server:
        await activate_beforehand(jaw)
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)
        yield Port(server, reader, writer)
        writer.close()
        await writer.wait_closed()


@pytest.mark.parametrize(
    ("asked", "answer"),
    [
        (b"GET PRE\n", b"PRE 000\n"),
        (b"GET POS\n", b"POS 3\n"),
        (b"GET FLT\n", b"FLT 00\n"),
        (b"GET SID\n", b"SID [9]\n"),
        (b"GET COU\n", b"COU 0\n"),
        (b"GET STA\n", b"STA 3\n"),
        (b"GET VER\n", b"VER DCU-2.0.0\n"),
        (b"GET DRI\n", b"DRI RUNNING\n"),
        *(
            (b"GET %s\n" % name, b"%s 0\n" % name)
            for name in (b"SNU", b"FWV", b"NCY", b"MOD", b"MSC", b"VST")
        ),
        (b"GET XYZ\n", b"?"),
    ],
)
async def test_variables_as_they_are_shown(port: Port, asked: bytes, answer: bytes) -> None:
    assert await port.asks(asked) == answer


async def test_questions_in_one_write(port: Port) -> None:
    assert await port.asks(b"GET ACT\nGET POS\nGET NCY\n") == b"ACT 1\nPOS 3\nNCY 0\n"


async def test_a_question_without_an_end_of_line_is_answered_by_the_bare_value(port: Port) -> None:
    assert await port.asks(b"GET POS") == b"3"
    assert await port.asks(b"SET POS 77 GTO 1\n") == b"ack"
    assert await port.asks(b"GET PRE") == b"077"
    assert await port.asks(b"GET P", b"RE\n") == b"PRE 077\n", "no variable has the name P"


async def test_the_current_of_a_motion(port: Port) -> None:
    await port.asks(b"SET POS 255 SPE 255 FOR 0 GTO 1\n")
    await asyncio.sleep(0.2)
    name, value = (await port.asks(b"GET COU\n")).split()
    assert name == b"COU"
    assert 5 < int(value) < 30


async def test_what_a_controller_cannot_read_is_a_question_mark(port: Port) -> None:
    async with port.server.fault_injector.making(Trouble("unreadable")):
        assert await port.asks(b"GET POS\nGET PRE\nGET COU\nGET FOR\n") == b"POS ?\nPRE ?\nCOU ?\nFOR ?\n"
        assert await port.asks(b"GET FLT") == b"?"
        assert await port.asks(b"GET DRI\nGET SID\n") == b"DRI RUNNING\nSID [9]\n", "these it knows"
        assert await port.asks(b"SET POS 77 GTO 1\n") == b"ack"
    assert await port.asks(b"GET PRE\n") == b"PRE 077\n"


async def test_a_set_is_lost_behind_its_acknowledgement(port: Port) -> None:
    await port.server.fault_injector.begin(Trouble("lost-set", lasts=0))
    assert await port.asks(b"SET SID 9\n") == b"ack", "the controller itself takes it"
    assert await port.asks(b"SET POS 77 GTO 1\n") == b"ack"
    assert await port.asks(b"GET PRE\nGET GTO\n") == b"PRE 000\nGTO 1\n"
    assert await port.asks(b"SET POS 78 GTO 1\n") == b"ack", "it was one"
    assert await port.asks(b"GET PRE\n") == b"PRE 078\n"
