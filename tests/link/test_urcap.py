"""UrcapTransport against a text port with the answers of the test, line by line."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import re
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import (
    JAW,
    ConnectFailedError,
    ConnectionLostError,
    ObjectStatus,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
    RobotiqHand,
    RobotiqStatus,
)
from robotiq_async.link.address import Address, parse_address
from robotiq_async.link.urcap import lines
from robotiq_async.link.urcap.transport import UrcapTransport
from robotiq_async.values.contradictions import contradiction
from robotiq_async.values.model import TWO_FINGER_85
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from tests.link.writing import write_image

pytestmark = pytest.mark.virtual_time

REPLIES = int(os.environ.get("REPLIES", "400"))
"""That are late or damaged."""
ALL = ["ACT", "GTO", "PRE", "ACT", "GTO", "OBJ", "STA", "FLT", "POS", "COU"]
"""The variables in a read of everything."""

Answer = Callable[[str], bytes | None]
"""Gets a line; gives the bytes of the answer, or None to close."""


def image(position: int, *, go: bool = True, activate: bool = True) -> Registers:
    axes = (AxisRequest(position, 50, 60),)
    return Request(activate=activate, go=go, axes=axes, model=TWO_FINGER_85).registers


def always(said: bytes | None) -> Answer:
    return lambda _: said


class Port:
    """A text port whose answers can be scripted; else it is a gripper that carries out requests at once."""

    def __init__(self) -> None:
        self.values = {"ACT": 1, "GTO": 0, "STA": 3, "OBJ": 3, "FLT": 0, "PRE": 7, "POS": 7, "COU": 2}
        self.answer: Answer = self.good
        self.lines: list[str] = []
        self.left_over = b""
        self.writers: list[asyncio.StreamWriter] = []

    def good(self, line: str) -> bytes | None:
        kind, *words = line.split()
        if kind == "GET":
            return f"{words[0]} {self.values[words[0]]}\n".encode()
        asked = dict(zip(words[::2], map(int, words[1::2]), strict=True))
        for name in ("ACT", "GTO"):
            self.values[name] = asked.get(name, self.values[name])
        self.values["PRE"] = asked.get("POS", self.values["PRE"])
        return b"ack"

    @property
    def asked(self) -> list[str]:
        """The variables that were read since the last look."""
        asked = [line.removeprefix("GET ") for line in self.lines]
        self.lines.clear()
        return asked

    async def serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.writers.append(writer)
        writer.write(self.left_over)
        with contextlib.suppress(ConnectionError):
            while line := (await reader.readline()).decode().strip():
                self.lines.append(line)
                said = self.answer(line)
                if said is None:
                    break
                writer.write(said)
        writer.close()


@asynccontextmanager
async def port() -> AsyncIterator[tuple[Port, Address]]:
    served = Port()
    server = await asyncio.start_server(served.serve, "127.0.0.1", 0)
    try:
        yield served, parse_address(f"urcap://127.0.0.1:{server.sockets[0].getsockname()[1]}?model=2f85")
    finally:
        for writer in served.writers:
            writer.close()
        server.close()
        for _ in range(5):
            await asyncio.sleep(0)


@asynccontextmanager
async def linked(gripper: int | None = None) -> AsyncIterator[tuple[UrcapTransport, Port]]:
    """A link that is open, at a port that is well-behaved so far."""
    async with port() as (served, address):
        link = UrcapTransport(address, gripper, connect_timeout=1.0, response_timeout=0.1)
        await link.open()
        try:
            yield link, served
        finally:
            await link.close()


async def status(link: UrcapTransport) -> RobotiqStatus:
    return RobotiqStatus(await link.read(), model=TWO_FINGER_85, has_current=False)


# -- a status ------------------------------------------------------------------------------------------------


async def test_the_variables_become_the_registers_of_a_jaw() -> None:
    async with linked() as (link, served):
        served.values |= {"ACT": 1, "GTO": 1, "STA": 3, "OBJ": 2, "FLT": 9, "PRE": 255, "POS": 120}
        shown = await status(link)
    assert (shown.activation_echo, shown.go_echo, shown.is_activated) == (True, True, True)
    assert shown.finger_status(JAW) is ObjectStatus.CONTACT_CLOSING
    assert (shown.requested_position(JAW), shown.position(JAW), int(shown.fault)) == (255, 120, 9)
    assert contradiction(TWO_FINGER_85, shown.registers) == ""


async def test_a_poll_asks_for_what_moves_and_for_the_rest_in_turn() -> None:
    async with linked() as (link, served):
        await link.read()
        assert served.asked == ["STA", "COU", *ALL], "the first one asks for everything"
        polls = []
        for _ in range(5):
            await link.read()
            polls.append(served.asked)
    assert [poll[:3] for poll in polls] == [["PRE", "OBJ", "POS"]] * 5, "the echo before the object status"
    assert [poll[3:] for poll in polls] == [[slow, "COU"] for slow in ("GTO", "STA", "FLT", "ACT", "GTO")]


@pytest.mark.parametrize(("name", "value"), [("GTO", 1), ("STA", 0), ("FLT", 14), ("ACT", 0)])
async def test_what_others_change_is_seen_within_four_polls(name: str, value: int) -> None:
    async with linked() as (link, served):
        before = await status(link)
        served.values[name] = value
        assert any([(await status(link)).registers != before.registers for _ in range(4)])


async def test_what_changes_together_is_seen_together() -> None:
    async with linked() as (link, served):
        before = await status(link)
        served.values |= {"GTO": 1, "STA": 0, "FLT": 14, "ACT": 0}
        shown = before
        while shown.registers == before.registers:
            shown = await status(link)
        assert (shown.activation_echo, shown.go_echo, shown.is_reset, int(shown.fault)) == (
            False,
            True,
            True,
            14,
        )


async def test_a_new_echo_is_read_with_everything_that_belongs_to_it() -> None:
    async with linked() as (link, served):
        await link.read()
        served.asked  # noqa: B018  # looked at
        served.values |= {"PRE": 200, "GTO": 1, "OBJ": 0}
        shown = await status(link)
        assert served.asked == ["PRE", "OBJ", "POS", "GTO", "COU", *ALL]
    assert shown.echo == (True, True, 200)
    assert shown.is_moving


@pytest.mark.parametrize("number", range(1, len(ALL) + 1))
async def test_echo_and_go_are_those_of_one_moment(number: int) -> None:
    """A SET that takes effect between two questions would else look like the request of another client."""
    async with linked() as (link, served):
        served.lines.clear()

        def changes_meanwhile(line: str) -> bytes | None:
            said = served.good(line)
            if len(served.lines) == number:
                served.values |= {"GTO": 1, "PRE": 255, "OBJ": 0}
            return said

        served.answer = changes_meanwhile
        first, *later = [await status(link) for _ in range(10)]
    assert first.echo in {(True, False, 7), (True, True, 255)}
    assert later[-1].echo == (True, True, 255)
    assert {each.echo for each in later} <= {(True, False, 7), (True, True, 255)}


async def test_a_go_that_never_stays_is_an_error() -> None:
    async with linked() as (link, served):

        def flips(line: str) -> bytes | None:
            served.values["GTO"] ^= 1
            return served.good(line)

        served.answer = flips
        with pytest.raises(ProtocolError, match="ACT and GTO change too often"):
            await link.read()
        assert not link.is_open


# -- a write -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("registers", "line"),
    [
        (image(255), "SET SPE 50 FOR 60 POS 255 GTO 1"),
        (image(80, go=False), "SET GTO 0 SPE 50 FOR 60 POS 80"),
        (image(0, go=False, activate=False), "SET ACT 0 GTO 0 ATR 0 SPE 50 FOR 60 POS 0"),
        ((0x3100, 0, 0, 0, 0, 0, 0, 0), "SET ACT 1 GTO 0 ARD 1 ATR 1 SPE 0 FOR 0 POS 0"),
    ],
)
async def test_an_image_is_one_line_in_which_a_stop_comes_first_and_a_go_last(
    registers: Registers, line: str
) -> None:
    async with linked() as (link, served):
        await link.read()
        served.lines.clear()
        assert await link.send(lambda: registers)
        assert served.lines == [line]


async def test_a_motion_does_not_activate_a_gripper_that_another_client_has_reset() -> None:
    async with linked() as (link, served):
        await link.read()
        served.values |= {"ACT": 0, "STA": 0}
        await write_image(link, image(255))
        assert served.values["ACT"] == 0
        assert not (await status(link)).activation_echo


async def test_a_release_is_taken_back_by_the_next_write() -> None:
    async with linked() as (link, served):
        await link.read()
        await write_image(link, (0x3100, 0, 0, 0, 0, 0, 0, 0))
        await link.read()
        await write_image(link, image(0, go=False))
        assert served.lines[-1] == "SET ACT 1 GTO 0 ATR 0 SPE 50 FOR 60 POS 0"
        await write_image(link, image(0, go=False))
        assert served.lines[-1] == "SET GTO 0 SPE 50 FOR 60 POS 0"


async def test_a_reset_is_in_the_line_although_the_gripper_shows_it() -> None:
    """An activation that seemed to be lost may act after this line, also one of a connection that is lost."""
    async with linked() as (link, served):
        served.values |= {"ACT": 0, "STA": 0}
        for _ in range(2):
            await link.read()
            await write_image(link, image(0, go=False, activate=False))
            assert served.lines[-1] == "SET ACT 0 GTO 0 ATR 0 SPE 50 FOR 60 POS 0"
            await link.close()
            await link.open()


async def test_a_status_after_a_reset_has_no_old_activation() -> None:
    """One that was thought lost acts before the reset does."""
    async with linked() as (link, served):
        served.values |= {"ACT": 0, "STA": 0}
        for _ in range(2):  # the next read would ask for STA, and not for ACT
            await link.read()
        served.answer = takes_nothing(served)
        await write_image(link, image(7, go=False, activate=False))
        served.values |= {"ACT": 1, "STA": 1}
        assert (await status(link)).activation_echo


async def test_what_was_not_read_yet_is_set() -> None:
    async with linked() as (link, served):
        await write_image(link, image(255))
        assert served.lines[-1] == "SET ACT 1 ATR 0 SPE 50 FOR 60 POS 255 GTO 1"


async def test_nothing_is_written_without_an_image() -> None:
    async with linked() as (link, served):
        served.lines.clear()
        assert not await link.send(lambda: None)
        assert served.lines == []


async def test_after_a_write_everything_is_read_until_the_echo_shows_it() -> None:
    async with linked() as (link, served):
        await link.read()
        served.answer = lambda line: b"ack" if line.startswith("SET") else served.good(line)
        await write_image(link, image(255))
        for _ in range(3):
            served.lines.clear()
            await link.read()
            assert served.asked == ALL
        served.good("SET GTO 1 POS 255")
        await link.read()
        served.lines.clear()
        await link.read()
        assert len(served.asked) == 5


async def test_a_stream_of_positions_goes_on_with_the_short_read() -> None:
    async with linked() as (link, served):
        await link.read()
        await write_image(link, image(100))
        await link.read()
        for position in (110, 120, 130):
            served.lines.clear()
            await write_image(link, image(position))
            assert (await status(link)).echo == (True, True, position)
            assert len(served.lines) == 1 + 5
        served.lines.clear()
        served.values["PRE"] = 7
        await link.read()
        assert served.asked[-len(ALL) :] == ALL, "a position that another client has written"


# -- a command that the URCap takes one variable after the other ---------------------------------------------

MOVE, HALT = image(200), image(120, go=False)
WAITED_S = 0.5
"""Seconds for which the rest of a command is waited for."""


def takes_nothing(served: Port) -> Answer:
    return lambda line: b"ack" if line.startswith("SET") else served.good(line)


@asynccontextmanager
async def taking(
    before: dict[str, int], written: Registers, taken: dict[str, int]
) -> AsyncIterator[tuple[UrcapTransport, Port]]:
    """A link that has read, then written something of which the gripper has taken a part."""
    async with linked() as (link, served):
        served.values |= before
        await link.read()
        served.answer = takes_nothing(served)
        await write_image(link, written)
        served.values |= taken
        yield link, served


HALVES = {
    "a go": ({"GTO": 0, "PRE": 7}, MOVE, {"PRE": 200}),
    "a halt": ({"GTO": 1, "PRE": 255}, HALT, {"GTO": 0}),
}


@pytest.mark.parametrize("what", HALVES)
async def test_a_command_that_is_taken_half_shows_as_the_image_before(what: str) -> None:
    async with taking(*HALVES[what]) as (link, served):
        before, written, _ = HALVES[what]
        served.values |= {"OBJ": 0, "POS": 99}
        shown = await status(link)
        assert shown.echo == (True, bool(before["GTO"]), before["PRE"])
        assert (shown.is_moving, shown.position(JAW)) == (before["GTO"] == 1, 99), "the rest as it is"
        asked = Request.from_registers(written, TWO_FINGER_85)
        served.values |= {"GTO": int(asked.go), "PRE": asked.position(JAW)}
        assert (await status(link)).echo == asked.echo


@pytest.mark.parametrize("what", HALVES)
async def test_what_stays_half_a_command_is_shown_in_the_end(what: str) -> None:
    async with taking(*HALVES[what]) as (link, served):
        hidden = await status(link)
        await asyncio.sleep(WAITED_S)
        shown = await status(link)
        assert shown.echo != hidden.echo
        assert shown.echo == (True, bool(served.values["GTO"]), served.values["PRE"])


async def test_a_command_of_a_lost_connection_may_be_taken_half() -> None:
    async with taking(*HALVES["a go"]) as (link, served):
        served.answer = always(None)
        with pytest.raises(ConnectionLostError):
            await link.read()
        served.answer = takes_nothing(served)
        await link.open()
        assert (await status(link)).echo == (True, False, 7)
        served.values["GTO"] = 1
        for _ in range(3):
            assert (await status(link)).echo in {(True, False, 7), (True, True, 200)}
        await asyncio.sleep(WAITED_S)
        assert (await status(link)).echo == (True, True, 200)


async def test_a_command_of_a_lost_connection_that_acts_late_shows_whole() -> None:
    async with taking({"GTO": 0, "PRE": 7}, MOVE, {}) as (link, served):
        await link.close()
        await link.open()
        for _ in range(2):  # the second of these asked for GTO
            await link.read()
        await asyncio.sleep(WAITED_S)
        served.values |= {"GTO": 1, "PRE": 200}
        assert (await status(link)).echo == (True, True, 200), "with the go that came with the position"


async def test_the_second_of_two_commands_is_taken_half() -> None:
    async with taking({"GTO": 0, "PRE": 7}, MOVE, {}) as (link, served):
        await write_image(link, HALT)
        served.values |= {"GTO": 0, "PRE": 200}
        assert (await status(link)).echo == (True, False, 7), "half of the first"
        served.values["GTO"] = 1
        assert (await status(link)).echo == (True, True, 200), "the first"
        served.values["GTO"] = 0
        assert (await status(link)).echo == (True, True, 200), "half of the second"
        served.values["PRE"] = 120
        assert (await status(link)).echo == (True, False, 120)
        served.values["PRE"] = 200
        assert (await status(link)).echo == (True, False, 200), "both are over: this is another client's"


@pytest.mark.parametrize("foreign", [{"PRE": 60}, {"PRE": 60, "GTO": 1}, {"ACT": 0}, {"ACT": 0, "PRE": 0}])
async def test_what_is_no_half_of_ours_shows_at_once(foreign: dict[str, int]) -> None:
    """Another client's SET, or a gripper that has lost its power."""
    async with taking({"GTO": 0, "PRE": 7}, MOVE, foreign) as (link, served):
        assert (await status(link)).echo == tuple(served.values[name] for name in ("ACT", "GTO", "PRE"))


@pytest.mark.parametrize(
    ("taken", "echo"), [({"ACT": 0}, (False, True, 255)), ({"GTO": 0}, (True, False, 255))]
)
async def test_while_a_reset_is_taken_everything_shows(taken: dict[str, int], echo: tuple[int, ...]) -> None:
    """Half of it looks like a gripper without power."""
    async with taking({"GTO": 1, "PRE": 255}, image(0, go=False, activate=False), taken) as (link, _):
        assert (await status(link)).echo == echo


@pytest.mark.parametrize("said", [b"ack\n", b"ack\r\n", b"\nack"])
async def test_an_acknowledgement_may_have_an_end_of_line(said: bytes) -> None:
    async with linked() as (link, served):
        served.answer = lambda line: said if line.startswith("SET") else served.good(line)
        await write_image(link, image(255))
        await link.read()
        served.writers[0].write(b"\n")
        await link.read()


# -- answers that are none -----------------------------------------------------------------------------------

DAMAGED = {
    "half a line": b"PRE 1",
    "nothing": b"",
    "no value": b"PRE\n",
    "an empty value": b"PRE \n",
    "no number": b"PRE x\n",
    "below the range": b"PRE -1\n",
    "above the range": b"PRE 256\n",
    "too long": b"PRE 0007\n",
    "endless": b"PRE " + b"1" * 500,
    "two values": b"PRE 7 7\n",
    "another variable": b"POS 7\n",
    "an acknowledgement": b"ack",
    "twice": b"PRE 7\nPRE 7\n",
    "one and a half": b"PRE 7\nPR",
    "bytes before": b"7\nPRE 7\n",
    "lower case": b"pre 7\n",
    "not text": b"\xff\xfe\x00\n",
    "a refusal": b"?",
}


@pytest.mark.parametrize("how", DAMAGED)
async def test_a_damaged_answer_ends_the_connection(how: str) -> None:
    async with linked() as (link, served):
        before = await status(link)
        served.answer = lambda line: DAMAGED[how] if line == "GET PRE" else served.good(line)
        with contextlib.suppress(RobotiqConnectionError):
            # The rest of an answer that comes after the whole one is met by the next question.
            assert (await status(link)).registers == before.registers
            await link.read()
        assert not link.is_open
        served.answer = served.good
        await link.open()
        assert (await status(link)).registers == before.registers


@pytest.mark.parametrize("said", [b"", b"ac", b"nak", b"acknowledged", b"POS 7\n", b"ackPOS 7\n"])
async def test_a_write_that_is_not_acknowledged_is_in_doubt_and_not_repeated(said: bytes) -> None:
    async with linked() as (link, served):
        served.lines.clear()
        served.answer = always(said)
        with pytest.raises(RobotiqConnectionError):
            await write_image(link, image(255))
        assert not link.is_open
        assert len(served.lines) == 1


async def test_a_time_out_names_the_question_and_what_came() -> None:
    async with linked() as (link, served):
        said = {"GET POS": b"POS 1", "GET COU": b""}
        served.answer = lambda line: said[line] if line in said else served.good(line)
        with pytest.raises(ResponseTimeoutError, match=r"half a line, 'POS 1', answers GET POS within 0.1 s"):
            await link.read()
        await link.open()
        served.answer = always(b"")
        with pytest.raises(ResponseTimeoutError, match=r"no answer to GET \w+ within 0.1 s"):
            await link.read()


async def test_a_whole_status_has_the_time_of_one_answer() -> None:
    """Nine answers of 40 ms each are no status of 0.1 s, although each of them is in time."""
    async with linked() as (link, served):

        def slowly(line: str) -> bytes:
            said, loop = served.good(line), asyncio.get_running_loop()
            assert said is not None
            loop.call_later(0.04 * len(served.lines), served.writers[0].write, said)
            return b""

        served.answer = slowly
        served.lines.clear()
        with pytest.raises(ResponseTimeoutError):
            await link.read()


async def test_the_end_of_a_connection() -> None:
    async with linked() as (link, served):
        served.answer = always(None)
        with pytest.raises(ConnectionLostError, match="closed the connection"):
            await link.read()
        assert not link.is_open


async def test_bytes_without_a_question_end_the_connection() -> None:
    async with linked() as (link, served):
        await link.read()
        served.writers[0].write(b"POS 99\n")
        await asyncio.sleep(0.01)
        with pytest.raises(ProtocolError, match=r"7 bytes without a question: 'POS 99\\n'"):
            await link.read()


async def test_a_cancelled_question_ends_the_connection() -> None:
    async with linked() as (link, served):
        served.answer = always(b"")
        reading = asyncio.ensure_future(link.read())
        await asyncio.sleep(0.01)
        reading.cancel()
        with pytest.raises(asyncio.CancelledError):
            await reading
        assert not link.is_open


# -- opening -------------------------------------------------------------------------------------------------


async def test_what_is_left_over_from_an_earlier_connection_is_noticed() -> None:
    async with port() as (served, address):
        link = UrcapTransport(address, connect_timeout=1.0, response_timeout=0.1)
        served.left_over = b"POS 99\n"
        with pytest.raises(ProtocolError, match="without a question"):
            await link.open()
        served.left_over = b""
        await link.open()
        await link.close()


@pytest.mark.parametrize("silent", ["FLT", "STA", "POS"])
async def test_a_new_connection_does_not_begin_with_the_question_that_was_open(silent: str) -> None:
    async with linked() as (link, served):
        served.answer = lambda line: b"" if line == f"GET {silent}" else served.good(line)
        with pytest.raises(ProtocolError, match=f"not the answer to GET {silent}: "):
            await link.read()
        served.answer = served.good
        served.lines.clear()
        await link.open()
        assert served.lines[0] == ("GET FLT" if silent == "STA" else "GET STA")


async def test_one_of_several_grippers_is_chosen() -> None:
    async with linked(gripper=2) as (link, served):
        assert served.lines == ["GET STA", "SET SID 2", "GET COU"]
        await link.read()


async def test_a_gripper_that_is_not_there_cannot_be_chosen() -> None:
    async with port() as (served, address):
        served.answer = lambda line: b"?" if "SID" in line else served.good(line)
        link = UrcapTransport(address, 3, connect_timeout=1.0, response_timeout=0.1)
        with pytest.raises(ConnectFailedError, match="the URCap does not choose gripper 3"):
            await link.open()
        assert not link.is_open


async def test_a_port_that_is_closed() -> None:
    async with port() as (_, address):
        pass
    with pytest.raises(ConnectFailedError, match="connection refused"):
        await UrcapTransport(address, connect_timeout=1.0, response_timeout=0.1).open()


async def test_a_link_that_is_closed_says_so() -> None:
    async with linked() as (link, _):
        await link.close()
        with pytest.raises(ConnectionLostError, match="not connected"):
            await link.read()
        with pytest.raises(ConnectionLostError, match="not connected"):
            await link.send(lambda: image(1))


# -- the address ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "host", "number"),
    [
        ("urcap://192.168.1.20?model=2f85", "192.168.1.20", 63352),
        ("urcap://192.168.1.20:5000?model=hand-e", "192.168.1.20", 5000),
        ("urcap://[::1]?model=2f140", "::1", 63352),
        ("URCAP://Arm.local", "arm.local", 63352),
    ],
)
def test_the_address(text: str, host: str, number: int) -> None:
    address = parse_address(text)
    assert (address.kind, address.host, address.port) == ("urcap", host, number)
    assert parse_address(str(address)) == address
    assert (address.is_rtu, address.is_socket) == (False, True)


@pytest.mark.parametrize(
    ("address", "options", "words"),
    [
        ("urcap://192.168.1.20", {}, "name it, as in urcap://192.168.1.20:63352.model=2f85"),
        ("urcap://192.168.1.20?model=3f", {}, "Robotiq's URCap has no 3-Finger"),
        ("urcap://192.168.1.20?model=2f85", {"read_function": 3}, "read_function is an option of Modbus"),
        ("urcap://192.168.1.20?model=2f85", {"write_function": 23}, "write_function is an option of Modbus"),
        ("urcap://192.168.1.20?model=2f85", {"status_address": 0}, "status_address is an option of Modbus"),
        ("urcap://192.168.1.20?model=2f85", {"device_id": 0}, "device_id must be in 1..247, got 0"),
        (
            "urcap://192.168.1.20?model=2f85&baud=9600",
            {},
            "baud, parity and stopbits are options of a serial",
        ),
    ],
)
def test_what_does_not_fit_is_refused(address: str, options: dict[str, int], words: str) -> None:
    with pytest.raises(ValueError, match=words):
        RobotiqHand(address, **options)  # type: ignore[arg-type]


def test_the_model_may_be_an_argument() -> None:
    assert RobotiqHand("urcap://192.168.1.20", model="hand-e").model.name == "hand-e"


# -- what can arrive -----------------------------------------------------------------------------------------

BYTES = st.one_of(
    st.binary(max_size=24),
    st.text(alphabet="POSREack 0123456789\r\n", max_size=16).map(str.encode),
    st.integers(-5, 300).map(lambda value: f"POS {value}\n".encode()),
)


@pytest.mark.parametrize(
    ("name", "highest"),
    [("ACT", 1), ("GTO", 1), ("PRE", 255), ("OBJ", 3), ("STA", 3), ("FLT", 255), ("POS", 255)],
)
def test_a_value_beyond_what_its_register_holds_is_a_misfit(name: str, highest: int) -> None:
    assert lines.value_in(f"{name} {highest}\n".encode(), name) == highest
    with pytest.raises(ProtocolError):
        lines.value_in(f"{name} {highest + 1}\n".encode(), name)


@given(BYTES)
def test_any_bytes_are_a_value_in_range_a_misfit_or_not_whole(received: bytes) -> None:
    try:
        value = lines.value_in(received, "POS")
    except ProtocolError:
        return
    text = received.lstrip(b"\r\n")
    if value is None:
        assert not text.endswith(b"\n")
        assert text[:4] == b"POS "[: len(text)]
    elif isinstance(value, str):
        assert value == lines.UNREADABLE
        assert re.fullmatch(rb"POS +\? *\r?\n[\r\n ]*", text)
    else:
        assert 0 <= value <= 255
        assert re.fullmatch(rb"POS +0{0,2}%d *\r?\n[\r\n ]*" % value, text)


@given(st.integers(0, 255), st.integers(0, 12))
def test_a_part_of_an_answer_is_never_a_value(value: int, cut: int) -> None:
    answer = f"POS {value}\n".encode()
    assert lines.value_in(answer, "POS") == value
    if cut < len(answer):
        assert lines.value_in(answer[:cut], "POS") is None


@given(BYTES)
def test_only_an_acknowledgement_is_one(received: bytes) -> None:
    try:
        said = lines.is_acknowledged(received)
    except ProtocolError:
        assert not b"ack".startswith(received.strip(b"\r\n"))
    else:
        assert said == (received.strip(b"\r\n") == b"ack")


async def test_no_answer_that_is_late_or_damaged_becomes_a_status() -> None:
    """As many as REPLIES. The gripper counts its questions in POS, so that a status has the time of its read.

    Late answers come to the connection that sent the request or, as through a proxy with one of its own,
    before the next answer.
    """
    chance = random.Random(7)
    async with linked() as (link, served):
        asked = hit = stale = taken = 0
        kept: list[bytes] = []

        def good(line: str) -> bytes:
            nonlocal asked
            asked += 1
            return f"POS {asked % 256}\n".encode() if line == "GET POS" else served.good(line) or b""

        def in_order(line: str) -> bytes:
            late, said = b"".join(kept), good(line)
            kept.clear()
            return late + said

        def troubled(line: str) -> bytes:
            nonlocal hit
            said = in_order(line)
            if chance.random() > 0.2:
                return said
            hit += 1
            match chance.randrange(6):
                case 0:
                    kept.append(said)
                    return b""
                case 1:
                    asyncio.get_running_loop().call_later(0.11, served.writers[-1].write, said)
                    return b""
                case 2:
                    return said[: chance.randrange(len(said))]
                case 3:
                    at = chance.randrange(len(said))
                    return said[:at] + bytes((chance.choice((0, 7, 65, 255)),)) + said[at + 1 :]
                case 4:
                    return said + said[: chance.randrange(1, len(said) + 1)]
            return said[chance.randrange(1, len(said)) :]

        served.answer = troubled
        while hit < REPLIES:
            before = asked
            with contextlib.suppress(RobotiqConnectionError):
                if link.is_open:
                    position = (await status(link)).position(JAW)
                    taken += 1
                    stale += (asked - position) % 256 >= asked - before
                else:
                    await link.open()
    assert stale == 0
    assert taken > REPLIES / 20, "a status needs up to ten good answers in a row"


# -- several questions in one write, the current, what cannot be read, and a SET that does not arrive --


async def test_a_status_is_one_write() -> None:
    async with linked() as (link, served):
        await link.read()
        loop, answers = asyncio.get_running_loop(), served.good

        def late(line: str) -> bytes:
            said = answers(line)
            assert said is not None
            loop.call_later(0.01 + len(served.lines) * 1e-6, served.writers[0].write, said)
            return b""

        served.answer = late
        for short in (True, False):
            served.values["FLT"] += not short
            served.lines.clear()
            began = loop.time()
            await link.read()
            await link.read()
            assert loop.time() - began < 0.045, "two or three round trips of 10 ms, and not ten or twenty"


async def test_the_current_is_10_ma_a_count() -> None:
    async with linked() as (link, served):
        served.values["COU"] = 15
        assert link.has_current
        assert RobotiqStatus(await link.read(), model=TWO_FINGER_85).current_ma(JAW) == 150


@pytest.mark.parametrize("said", [b"?", b"COU ?\n", b"nak\n", b""])
async def test_a_port_that_does_not_know_the_current_has_none(said: bytes) -> None:
    async with port() as (served, address):
        served.answer = lambda line: said if "COU" in line else served.good(line)
        link = UrcapTransport(address, connect_timeout=1.0, response_timeout=0.1)
        await link.open()
        assert not link.has_current
        assert (await status(link)).position(JAW) == 7
        await link.close()


@pytest.mark.parametrize("said", [b"", b"nak\n"])
async def test_an_answer_that_is_lost_does_not_hide_a_current_that_the_port_knew(said: bytes) -> None:
    """One answer lost in an opening, and the current was absent for as long as the connection lasted."""
    async with linked() as (link, served):
        await link.close()
        served.answer = lambda line: said if "COU" in line else served.good(line)
        await link.open()
        served.answer = served.good
        assert link.has_current
        assert RobotiqStatus(await link.read(), model=TWO_FINGER_85).current_ma(JAW) == 20


async def test_a_port_that_no_longer_knows_the_current_is_reached() -> None:
    async with linked() as (link, served):
        await link.close()
        served.answer = lambda line: b"" if "COU" in line else served.good(line)
        await link.open()
        with pytest.raises(RobotiqConnectionError, match="no answer to GET COU"):
            await link.read()
        await link.open()
        assert not link.has_current
        assert (await status(link)).position(JAW) == 7


@pytest.mark.parametrize("name", ["PRE", "POS", "FLT"])
async def test_a_gripper_that_the_urcap_does_not_reach_is_named_as_such(name: str) -> None:
    async with linked() as (link, served):
        served.answer = lambda line: f"{name} ?\n".encode() if line == f"GET {name}" else served.good(line)
        connections = len(served.writers)
        served.answer = lambda line: f"{name} ?\n".encode() if line == f"GET {name}" else served.good(line)
        for _ in range(3):
            with pytest.raises(
                ConnectionLostError, match=rf"cannot be read \({name} \?\): an emergency stop"
            ):
                await link.read()
        served.answer = served.good
        await link.open()
        await link.read()
        assert len(served.writers) == connections, "the connection stays"


@pytest.mark.parametrize("answers", range(1, len(ALL)))
async def test_an_emergency_stop_that_ends_in_the_middle_of_a_status_is_one(answers: int) -> None:
    """ACT and GTO are asked for twice: a later answer hid the one without a value, which ended the hand."""
    async with linked() as (link, served):
        served.lines.clear()

        def answer(line: str) -> bytes | None:
            return f"{line[4:]} ?\n".encode() if len(served.lines) <= answers else served.good(line)

        served.answer = answer
        with pytest.raises(ConnectionLostError, match=r"cannot be read \(ACT \?\)"):
            await link.read()


async def read_on(link: UrcapTransport) -> None:
    """Read until that fails."""
    while True:
        await link.read()
        await asyncio.sleep(0.005)


async def test_a_set_that_was_acknowledged_and_never_shows_is_lost_here() -> None:
    async with linked() as (link, served):
        await link.read()
        served.answer = lambda line: b"ack" if line.startswith("SET") else served.good(line)
        loop = asyncio.get_running_loop()
        await write_image(link, image(255))
        written = loop.time()
        with pytest.raises(
            ConnectionLostError, match="a SET was acknowledged, and its gripper has not shown it"
        ):
            await read_on(link)
        assert 0.4 <= loop.time() - written < 0.5, "before another client would be blamed"


async def test_another_client_that_overrides_a_set_is_another_client() -> None:
    async with linked() as (link, served):
        await link.read()
        served.answer = lambda line: b"ack" if line.startswith("SET") else served.good(line)
        await write_image(link, image(255))
        served.values["PRE"] = 80
        shown = await status(link)
        for _ in range(200):
            shown = await status(link)
            await asyncio.sleep(0.005)
        assert shown.requested_position(JAW) == 80
