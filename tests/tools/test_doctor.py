"""The doctor finds each ailment of a connection, and reports it with its remedy."""

from __future__ import annotations

import asyncio
import contextlib
import random
import re
import socket
import threading
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.link.address import parse_address
from robotiq_async.simulator import (
    RtuOverTcpSimulatorServer,
    SerialSimulatorServer,
    SimulatedGripper,
    SimulatorServer,
    Trouble,
    parse_troubles,
)
from robotiq_async.tools.doctor import Finding, Level, examine
from robotiq_async.tools.doctor.answer import _advice_for_opening
from robotiq_async.tools.doctor.gripper import report_adapter
from robotiq_async.values.model import TWO_FINGER_85
from robotiq_async.values.request import AxisRequest, Request
from tests.patience import patience
from tests.serial_line import SerialLine, with_crc
from tests.virtual import run
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time  # names and serial lines run loops of their own, in real time
REACHED = ["name", "port", "Modbus", "unit id", "registers", "round trip", "rate"]
HEALTHY = [*REACHED, "model", "activation", "fault"]


async def findings(address: str, *, seconds: float = 30.0, **options: Any) -> dict[str, Finding]:
    found: list[Finding] = []
    async with asyncio.timeout(seconds):
        await examine(parse_address(address), found.append, **options)
    assert all(finding.advice for finding in found if finding.level is not Level.GOOD)
    return {finding.what: finding for finding in found}


async def helps(address: str, **options: Any) -> None:
    """A hand starts with the options that were advised."""
    async with asyncio.timeout(30):
        hand = RobotiqHand(address, **options)
        await hand.start(activate=False)
        await hand.stop(halt=False)


class Device(asyncio.Protocol):
    """Answers each request by a script."""

    def __init__(self, answer: Callable[[bytes], bytes]) -> None:
        self._answer = answer

    def connection_made(self, transport: Any) -> None:
        self._transport = transport

    def data_received(self, data: bytes) -> None:
        self._transport.write(self._answer(data))


@contextlib.asynccontextmanager
async def answering(answer: Callable[[bytes], bytes]) -> AsyncIterator[str]:
    """The address of a device that answers each request by a script."""
    server = await asyncio.get_running_loop().create_server(lambda: Device(answer), "127.0.0.1", 0)
    try:
        yield f"127.0.0.1:{server.sockets[0].getsockname()[1]}"
    finally:
        server.close()


def reply(request: bytes, pdu: bytes) -> bytes:
    return request[:4] + (len(pdu) + 1).to_bytes(2, "big") + request[6:7] + pdu


def registers_in(request: bytes, block: bytes) -> bytes:
    """The first registers of a block, as many as the request has."""
    size = 2 * request[11]
    return reply(request, bytes((request[7], size)) + block[:size])


@pytest.mark.parametrize(("server_of", "unit"), [(SimulatorServer, "2"), (RtuOverTcpSimulatorServer, "9")])
async def test_a_healthy_connection(server_of: type[SimulatorServer], unit: str) -> None:
    gripper = SimulatedGripper()
    async with server_of(gripper) as server:
        found = await findings(server.address)
        assert not gripper.writes
    assert list(found) == [*HEALTHY, "other clients"]
    assert {finding.level for finding in found.values()} == {Level.GOOD}
    assert (found["unit id"].found, found["activation"].found) == (unit, "not active")
    assert "no other client seen" in found["other clients"].found


@pytest.mark.parametrize(
    ("address", "model"),
    [
        ("sim://", "a 3-Finger"),
        (
            "sim://?model=hand-e",
            "a 2F-85 or a 2F-140 or a Hand-E; the registers do not say which: taken as a Hand-E",
        ),
    ],
)
async def test_a_simulated_one_too(address: str, model: str) -> None:
    found = await findings(address)
    assert list(found) == [*HEALTHY[2:], "other clients"]
    assert found["model"].found == model


def test_a_name_that_does_not_exist() -> None:
    found = asyncio.run(findings("nowhere.invalid"))
    assert list(found) == ["name"]
    assert found["name"].level is Level.BAD


def test_a_resolver_that_does_not_answer_does_not_keep_it(monkeypatch: pytest.MonkeyPatch) -> None:
    answer = threading.Event()
    monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: answer.wait(30) and [])
    began = time.monotonic()
    found = run(lambda: findings("gripper.example"))
    assert time.monotonic() - began < patience(5), "the loop's end waited for it"
    assert found["name"].found == "gripper.example cannot be resolved: no answer"
    answer.set()


def test_a_name_of_several_addresses(monkeypatch: pytest.MonkeyPatch) -> None:
    hosts = [(socket.AF_INET, socket.SOCK_STREAM, 6, "", (host, 0)) for host in ("127.0.0.2", "127.0.0.1")]

    async def look() -> dict[str, Finding]:
        async with SimulatorServer() as server:
            monkeypatch.setattr(socket, "getaddrinfo", lambda *_, **__: hosts)
            return await findings(f"gripper.example:{server.port}")

    found = asyncio.run(look())
    assert found["name"].found == "gripper.example is 127.0.0.2, 127.0.0.1"
    assert found["other clients"].level is Level.GOOD


async def test_nothing_listens() -> None:
    async with SimulatorServer() as server:
        address = server.address
    found = await findings(address)
    assert (found["name"].level, found["port"].level) == (Level.GOOD, Level.BAD)
    assert "right address and port" in found["port"].advice


STRANGERS: dict[str, tuple[Callable[[bytes], bytes], str, Level, str]] = {
    "no Modbus": (lambda _: b"HTTP/1.1 400 Bad\r\n\r\n", "Modbus", Level.BAD, "not this gripper"),
    "a gateway": (
        lambda request: reply(request, bytes((request[7] | 0x80, 11))),
        "Modbus",
        Level.BAD,
        "the gripper behind it does not",
    ),
    "zeros": (lambda request: registers_in(request, bytes(16)), "gripper", Level.BAD, "never activated"),
    "ones": (
        lambda request: registers_in(request, b"\xff" * 16),
        "gripper",
        Level.BAD,
        "Send it no commands",
    ),
}


@pytest.mark.parametrize("who", STRANGERS)
async def test_a_device_that_is_no_gripper(who: str) -> None:
    answer, what, level, advice = STRANGERS[who]
    async with answering(answer) as address:
        found = (await findings(address))[what]
    assert found.level is level
    assert advice in found.advice


def other_unit(request: bytes, unit: int) -> bytes:
    if request[6] != unit:
        return reply(request, bytes((request[7] | 0x80, 11)))
    return registers_in(request, bytes(16))


async def test_another_unit_id() -> None:
    async with answering(lambda request: other_unit(request, 9)) as address:
        found = await findings(address)
    assert found["unit id"].level is Level.DOUBT
    assert found["unit id"].advice == "Pass device_id=9, or --device-id 9."
    async with answering(lambda request: other_unit(request, 5)) as address:
        assert (await findings(address))["Modbus"].level is Level.BAD, "not one of those that are tried"
        assert (await findings(address, device_id=5))["unit id"].level is Level.GOOD


def registers_at(function: int, address: bytes) -> Callable[[bytes], bytes]:
    """A device that answers one function at one address."""

    def answer(request: bytes) -> bytes:
        if request[7] == function and request[8:10] == address:
            return registers_in(request, bytes((0, 0, 0, *(0, 6, 0) * 3, 0, 137, 0, 0)))
        return reply(request, bytes((request[7] | 0x80, 2)))

    return answer


@pytest.mark.parametrize(
    ("where", "options"),
    [
        (b"\x07\xd0", {"request_address": 1000, "status_address": 2000}),
        (b"\x00\x00", {"read_function": 3}),
        (b"\x07\xd0", {"request_address": 1000, "status_address": 2000, "read_function": 3}),
    ],
)
async def test_registers_elsewhere(where: bytes, options: dict[str, int]) -> None:
    async with answering(registers_at(options.get("read_function", 4), where)) as address:
        found = (await findings(address))["registers"]
        await helps(f"tcp://{address}", **options)
    assert found.level is Level.DOUBT
    words = ", ".join(f"{name}={value}" for name, value in options.items())
    assert found.advice.startswith(f"Pass {words}, or the options of these names.")
    assert ("may read the requests" in found.advice) is ("read_function" in options)


@pytest.mark.parametrize(
    ("late", "what", "advice", "timeout"),
    [
        (0.02, "rate", r"poll_interval=0\.03", 0.4),
        (0.45, "round trip", r"^Pass response_timeout=", 1.0),
        (0.6, "Modbus", r"^Pass response_timeout=1\.", 1.2),
        (0.6, "rate", r"No poll_interval is that long \(at most 0\.1 s\)", 1.2),
        (1.3, "Modbus", r"response_timeout=2\.[67];", 2.6),
    ],
)
async def test_replies_that_come_late(late: float, what: str, advice: str, timeout: float) -> None:
    async with SimulatorServer() as server:
        server.policy = lambda frame: [(late, frame)]
        found = await findings(server.address, seconds=60)
        await helps(server.address, response_timeout=timeout)
    assert re.search(advice, found[what].advice)
    assert "cable" not in found["Modbus"].advice, "slow replies are no lost ones"
    assert "link" not in found
    assert found["round trip"].level is found["rate"].level is found[what].level is Level.DOUBT
    assert found["Modbus"].found == (f"answers, after {late} s" if late > 0.5 else "answers")
    assert "unit id" in found, "of a slow one there is as much to say"


# -- serial lines ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("server_of", [SimulatorServer, RtuOverTcpSimulatorServer])
async def test_the_other_kind_of_frames(server_of: type[SimulatorServer]) -> None:
    async with server_of() as server:
        is_rtu = server.address.startswith("rtu+")
        other = server.address.removeprefix("rtu+") if is_rtu else f"rtu+{server.address}"
        found = (await findings(other, seconds=60))["Modbus"]
    assert found.level is Level.BAD
    assert f"write the address as {server.address}." in found.advice


async def test_a_line_that_loses_bytes() -> None:
    async with RtuOverTcpSimulatorServer() as server:
        damage = Trouble("wrong-checksum", every=0.5, at=0.1)
        plan = asyncio.create_task(server.fault_injector.run([damage], lambda _: None))
        found = await findings(server.address)
        plan.cancel()
        await asyncio.wait({plan})
    assert found["line"].level is Level.DOUBT
    assert "had to be repeated" in found["line"].found
    assert "link" not in found


@pytest.mark.parametrize(("kept", "level"), [(2, Level.GOOD), (3, Level.DOUBT)])
def test_how_long_an_adapter_keeps_what_it_hears(kept: int, level: Level, tmp_path: Path) -> None:
    (tmp_path / "ttyUSB7").mkdir()
    (tmp_path / "ttyUSB7" / "latency_timer").write_text(f"{kept}\n", encoding="ascii")
    found: list[Finding] = []
    report_adapter(parse_address("rtu:///dev/ttyUSB7"), found.append, tmp_path)
    (finding,) = found
    assert finding.level is level
    assert f"{kept} ms" in finding.found
    assert (f"tee {tmp_path}/ttyUSB7/latency_timer" in finding.advice) is (level is Level.DOUBT)
    report_adapter(parse_address("rtu:///dev/ttyS0"), found.append, tmp_path)
    assert found == [finding], "a port without an adapter"


@pytest.mark.parametrize(
    ("words", "answers"), [("drop", "answers"), ("wrong-function", "answers when asked 2 times")]
)
async def test_one_lost_reply_does_not_make_it_another_unit(words: str, answers: str) -> None:
    async with SimulatorServer() as server, server.fault_injector.making(Trouble(words)):
        found = await findings(server.address)
    assert found["unit id"] == Finding(Level.GOOD, "unit id", "2")
    assert found["Modbus"].found == answers


def echoing(answer: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    return lambda request: request + answer(request)


def status_of(request: bytes) -> bytes:
    """A reply of a gripper at rest to a read on a serial line."""
    size = 2 * request[5]
    block = bytes((0, 0, 0, *(0, 6, 0) * 3, 0, 137, 0, 0))
    return with_crc(bytes((request[0], request[1], size)) + block[:size])


def refusal_of(request: bytes, code: int) -> bytes:
    return with_crc(bytes((request[0], request[1] | 0x80, code)))


ON_A_LINE: dict[str, tuple[Callable[[bytes], bytes], str]] = {
    "silence": (lambda _: b"", "Nothing answers: check the gripper's power, A and B"),
    "echo alone": (echoing(lambda _: b""), "The line echoes what is sent, and nothing else answers"),
    "damage": (lambda request: status_of(request)[:-1] + b"\0", "Replies come damaged"),
    "another rate": (lambda _: bytes.fromhex("f8 00 e0 fe"), "another rate or parity"),
    "a gateway": (lambda request: refusal_of(request, 11), "the gripper behind it does not"),
    "a refusal": (lambda request: refusal_of(request, 2), "refuses to be read"),
    "7 bits": (lambda request: bytes(each & 0x7F for each in status_of(request)[1:]), "7 data bits"),
}


@pytest.mark.parametrize("fault", ON_A_LINE)
async def test_a_line_without_an_answer_gets_advice_for_lines(fault: str) -> None:
    answer, advice = ON_A_LINE[fault]
    async with answering(answer) as address:
        found = await findings(f"rtu+tcp://{address}", seconds=120)
    assert found["Modbus"].level is Level.BAD
    assert advice in found["Modbus"].advice
    assert "not this gripper" not in found["Modbus"].advice


@pytest.mark.parametrize(
    ("words", "level", "advice"),
    [
        ("silence", Level.BAD, "power, A and B (swapped?), its rate (?baud=) and unit id (--device-id)"),
        ("wrong-checksum for ever", Level.BAD, "check shield, ground, termination and length of the cable"),
        ("byte-before for ever", Level.BAD, "Bytes come that are no reply"),
        ("byte-after for ever", Level.BAD, "Bytes come that are no reply"),
        ("garbled", Level.BAD, "another rate or parity (?baud=, ?parity=) or 7 data bits"),
        ("seven-bits", Level.BAD, "7 data bits"),
        ("echo", Level.GOOD, ""),
        ("registers", Level.GOOD, ""),
        ("registers 2", Level.BAD, "Nothing answers"),
    ],
)
async def test_what_a_serial_line_does_is_no_other_device(words: str, level: Level, advice: str) -> None:
    (trouble,) = parse_troubles(words)
    gripper = SimulatedGripper(model=TWO_FINGER_85)
    async with (
        RtuOverTcpSimulatorServer(gripper, paced=False) as server,
        server.fault_injector.making(trouble),
    ):
        found = await findings(server.address, seconds=120)
    assert found["Modbus"].level is level
    assert advice in found["Modbus"].advice
    assert ("echo" in found) == (words == "echo")
    assert "not this gripper" not in found["Modbus"].advice
    assert "Pass" not in "".join(each.advice for each in found.values())


async def test_an_echo_on_the_line_is_told() -> None:
    async with answering(echoing(status_of)) as address:
        found = await findings(f"rtu+tcp://{address}", seconds=60)
    assert found["echo"].level is Level.GOOD
    assert found["Modbus"].found == "answers"


@pytest.mark.parametrize(
    ("server_of", "lost"),
    [
        *((SimulatorServer, lost) for lost in (1, 2, 3, 8)),
        *((RtuOverTcpSimulatorServer, lost) for lost in (1, 2, 5, 6, 8)),
    ],
)
async def test_a_line_that_loses_its_first_requests_needs_no_option(
    server_of: type[SimulatorServer], lost: int
) -> None:
    """Settings that answered after them were taken for the gripper's: read_function=4, request_address=0.

    The first and last attempts with the usual settings, and others; each asks twice.
    """
    left = [lost]

    def losing(frame: bytes) -> list[tuple[float, bytes]]:
        left[0] -= 1
        return [] if left[0] >= 0 else [(0.0, frame)]

    async with server_of(SimulatedGripper()) as server:
        server.policy = losing
        found = await findings(server.address, seconds=60)
    assert left[0] < 0
    assert [each.what for each in found.values() if "Pass" in each.advice] == []
    assert found["registers"].level is found["unit id"].level is Level.GOOD
    if lost == 1:
        assert found["Modbus"].level is Level.GOOD, "the first exchange is repeated"
        return
    assert found["Modbus"].level is Level.DOUBT
    assert "answers when asked" in found["Modbus"].found


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("changes", [True, False])
async def test_the_memory_of_another_device_is_no_gripper(seed: int, changes: bool) -> None:
    memory = random.Random(seed)
    block = memory.randbytes(16)

    def read(request: bytes) -> bytes:
        return registers_in(request, memory.randbytes(16) if changes else block)

    async with answering(read) as address:
        found = await findings(address)
    assert list(found) == ["name", "port", "Modbus", "gripper"], "of a state or a fault it knows nothing"
    assert found["gripper"].level is Level.BAD
    assert "that are 0 in a gripper" in found["gripper"].found
    assert "Send it no commands" in found["gripper"].advice


async def test_a_gripper_beside_other_memory_is_found() -> None:
    """A gateway with registers of its own at 0, and those of the gripper at 2000."""

    def read(request: bytes) -> bytes:
        is_gripper = request[8:10] == b"\x07\xd0"
        return registers_in(request, bytes(16) if is_gripper else bytes(range(100, 116)))

    async with answering(read) as address:
        found = await findings(address)
    assert found["registers"].found.startswith("status at 2000")


class Gateway:
    """Serves one client at a time: others wait, or it hangs up. It sees after 0.2 s that one has gone."""

    def __init__(self, *, waits: bool, busy: float = 0.0) -> None:
        self.waits = waits
        self.client: object = self if busy else None
        asyncio.get_running_loop().call_later(busy, self.let_go, self)

    def let_go(self, client: object) -> None:
        if self.client is client:
            self.client = None

    @contextlib.asynccontextmanager
    async def serving(self) -> AsyncIterator[str]:
        loop = asyncio.get_running_loop()
        server = await loop.create_server(lambda: _Client(self), "127.0.0.1", 0)
        try:
            yield f"127.0.0.1:{server.sockets[0].getsockname()[1]}"
        finally:
            server.close()


class _Client(Device):
    def __init__(self, gateway: Gateway) -> None:
        super().__init__(lambda request: registers_in(request, bytes(16)))
        self._gateway = gateway

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        if self._gateway.client is None:
            self._gateway.client = self
        elif not self._gateway.waits:
            transport.close()

    def data_received(self, data: bytes) -> None:
        if self._gateway.client is self:
            super().data_received(data)

    def connection_lost(self, _reason: object) -> None:
        asyncio.get_running_loop().call_later(0.2, self._gateway.let_go, self)


@pytest.mark.parametrize("waits", [True, False])
async def test_a_gateway_for_one_client_is_no_bad_cable_unless_another_client_has_it(waits: bool) -> None:
    """The examination itself is one client."""
    async with Gateway(waits=waits).serving() as address:
        found = await findings(address)
    assert found["Modbus"] == Finding(Level.GOOD, "Modbus", "answers")
    assert found["port"].level is Level.GOOD
    async with Gateway(waits=waits, busy=0.4).serving() as address:
        found = await findings(address)
    assert found["Modbus"].level is Level.DOUBT
    assert "one client at a time" in found["Modbus"].advice
    assert ("It closed the connection without an answer" in found["Modbus"].advice) is not waits


def test_an_extra_that_is_missing_is_no_question_of_cables() -> None:
    why = 'pip install "pyserial>=3.5" (the extra serial)'
    assert _advice_for_opening(parse_address("rtu:///dev/x"), why) == "Install it, and run doctor again."


@pytest.mark.parametrize(
    ("code", "level", "words"),
    [(7, Level.GOOD, "a hint"), (9, Level.DOUBT, "clear on its own"), (13, Level.BAD, "DROPS")],
)
async def test_a_fault(code: int, level: Level, words: str) -> None:
    gripper = SimulatedGripper()
    gripper.inject_fault(code)
    async with SimulatorServer(gripper) as server:
        found = await findings(server.address)
    assert found["fault"].level is level
    assert words in found["fault"].advice
    assert f"0x{code:02X}" in found["fault"].found


async def test_the_fault_of_a_controller_is_no_fault_of_the_gripper() -> None:
    gripper = SimulatedGripper(model=TWO_FINGER_85)
    gripper.controller_fault = 0x0C
    async with SimulatorServer(gripper) as server:
        found = await findings(server.address)
    assert found["controller"].level is Level.BAD
    assert found["controller"].found == "its controller reports: emergency stop (kFLT 0x0C)"
    assert "Look at the controller first" in found["controller"].advice
    assert found["fault"].level is Level.GOOD


async def test_a_gripper_that_has_lost_its_activation_and_keeps_ract() -> None:
    gripper = SimulatedGripper()
    gripper.strand()
    async with SimulatorServer(gripper) as server:
        found = (await findings(server.address))["activation"]
    assert found.level is Level.DOUBT
    assert "gACT is 1 and gIMC 0" in found.found
    assert "only a reset helps" in found.advice


async def test_another_client() -> None:
    gripper = SimulatedGripper()

    async def command() -> None:
        for position in range(256):
            axes = (AxisRequest(position, 0, 0),) * 4
            gripper.write(0, Request(activate=True, axes=axes).registers)
            await asyncio.sleep(0.1)

    async with SimulatorServer(gripper) as server:
        other = asyncio.create_task(command())
        found = await findings(server.address)
        other.cancel()
    assert found["other clients"].level is Level.DOUBT
    assert "stop one" in found["other clients"].advice


async def test_a_link_that_is_lost_in_the_middle() -> None:
    async with SimulatorServer() as server:

        def go_away() -> None:
            server.refuse()
            server.cut()

        asyncio.get_running_loop().call_later(1.0, go_away)
        found = await findings(server.address)
    assert found["link"].level is Level.BAD


async def test_a_line_that_is_lost_in_the_middle_drops_no_packets(monkeypatch: pytest.MonkeyPatch) -> None:
    line, loop = VirtualLine(monkeypatch), asyncio.get_running_loop()
    async with SerialSimulatorServer(line.FAR, SimulatedGripper(loop.time)) as server:
        loop.call_later(1.0, setattr, server, "policy", lambda frame: [(0.0, frame + b"\0")])
        found = (await findings(f"rtu://{line.near}", seconds=120))["link"]
    assert found.level is Level.BAD
    assert "1 bytes more than the answer" in found.found
    assert "shield, ground and termination" in found.advice
    assert not re.search("network|switch|client|packets", found.advice)


@pytest.mark.parametrize("what", ["slow", "pulled out", "read by another program"])
async def test_a_serial_port_is_no_network(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    line, loop = VirtualLine(monkeypatch), asyncio.get_running_loop()

    def lost(frame: bytes) -> list[tuple[float, bytes]]:
        line.pull()
        line.plug()
        return [(0.0, frame)]

    async with SerialSimulatorServer(line.FAR, SimulatedGripper(loop.time)) as server:
        match what:
            case "slow":
                server.policy = lambda frame: [(0.01, frame)]
            case "pulled out":
                loop.call_later(1.0, line.pull)
            case _:
                server.policy = lost
        found = await findings(f"rtu://{line.near}", seconds=120)
    finding = found[{"slow": "round trip", "pulled out": "link"}.get(what, "Modbus")]
    assert finding.level is not Level.GOOD
    assert ("poll_interval" if what == "slow" else "fuser -v") in finding.advice
    assert not re.search("network|switch|client|connection", finding.advice)


def test_a_serial_line(tmp_path: Path) -> None:
    async def look() -> dict[str, Finding]:
        with SerialLine(tmp_path) as line:
            async with SerialSimulatorServer(line.far):
                return await findings(f"rtu://{line.near}")

    found = asyncio.run(look())
    assert list(found) == [*HEALTHY[2:], "other clients"]
    assert found["unit id"].found == "9"
    found = asyncio.run(findings(f"rtu://{tmp_path}/nothing"))
    assert found["open"].level is Level.BAD
    assert "there is no such device" in found["open"].found
    assert found["open"].advice.startswith("robotiq-async ports lists the ports of this computer")
    assert "ls -l" not in found["open"].advice, "Windows has neither that nor /dev"
