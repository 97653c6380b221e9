"""Arms that own the serial line of a gripper, each with its own protocol; and the tunnels of the page."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import struct
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path
from typing import Any, Final, Self

import pytest

from robotiq_async import Tunnel, TunnelPlace
from robotiq_async.link.address import TUNNELS, parse_address
from robotiq_async.simulator import RtuOverTcpSimulatorServer, SimulatedGripper
from robotiq_async.values.model import TWO_FINGER_85
from tests.docs.pages import DOCS, blocks, read
from tests.grippers import activate_beforehand
from tests.installed import install
from tests.link.scripted_device import request_size
from tests.serial_line import with_crc

PAGE: Final = DOCS / "how-to" / "tunnels.md"
LISTENS_S: Final = 0.15
"""How long an arm listens for the answer to a request of its own."""


def tunnel_of(name: str, *arguments: Any, **options: Any) -> Tunnel:
    """A tunnel of the page, by the name of its class."""
    (code,) = (each.text for each in blocks(read(PAGE), "python") if f"class {name}:" in each.text)
    names: dict[str, Any] = {}
    exec(code, names)
    made = names[name](*arguments, **options)
    assert isinstance(made, Tunnel)
    return made


class ToolLine:
    """The serial line at the tool of an arm, which is a socket to a simulated gripper here."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._writer: asyncio.StreamWriter | None = None
        self._reader: asyncio.StreamReader

    async def write(self, data: bytes) -> None:
        if self._writer is None or self._reader.at_eof() or self._writer.is_closing():
            self.close()
            with contextlib.suppress(OSError):
                self._reader, self._writer = await asyncio.open_connection("127.0.0.1", self._port)
        if self._writer is not None:
            self._writer.write(data)

    async def read(self, seconds: float) -> bytes:
        """The bytes that have come; none if none come in that time."""
        try:
            async with asyncio.timeout(seconds):
                while self._writer is not None:
                    with contextlib.suppress(OSError):
                        if data := await self._reader.read(256):
                            return data
                    await asyncio.sleep(seconds)
        except TimeoutError:
            pass
        return b""

    def close(self) -> None:
        writer, self._writer = self._writer, None
        if writer is not None:
            writer.close()


class Arm:
    """The controller of an arm, with a server for its clients.

    Attributes:
        port: of the server.
        delay: seconds that each call takes besides.
        has_power: whether the tool has; without, the line is dead.
    """

    port = 0

    def __init__(self, line: ToolLine, delay: float = 0.0) -> None:
        self.delay, self.has_power = delay, True
        self._line = line
        self._clients: set[asyncio.StreamWriter] = set()
        self._server: asyncio.Server
        self._turn = asyncio.Lock()

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        self.port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        self.drop_clients()
        self._line.close()

    def drop_clients(self) -> None:
        """Restart the server: what is connected is not any more."""
        for each in [*self._clients]:
            each.close()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._clients.add(writer)
        with contextlib.suppress(OSError, EOFError):
            while True:
                asked = await self.hear(reader)
                async with self._turn:  # a master asks one thing at a time
                    await asyncio.sleep(self.delay)
                    said = await self.answer(asked)
                writer.write(said)
        self._clients.discard(writer)
        writer.close()

    async def hear(self, reader: asyncio.StreamReader) -> bytes:
        """The next request of a client."""
        raise NotImplementedError

    async def answer(self, asked: bytes) -> bytes:
        raise NotImplementedError

    async def ask(self, unit: int, pdu: bytes) -> bytes:
        """Be the master of the line: the PDU of the reply; empty if there is none, or a damaged one."""
        if not self.has_power:
            await asyncio.sleep(LISTENS_S)
            return b""
        await self._line.read(0.0)  # what an answer that was late has left
        await self._line.write(with_crc(bytes((unit,)) + pdu))
        heard = b""
        while len(heard) < 5 or len(heard) < length_of(heard):
            more = await self._line.read(LISTENS_S)
            if not more:
                return b""
            heard += more
        is_whole = heard == with_crc(heard[:-2]) and heard[0] == unit
        return heard[1:-2] if is_whole else b""


def length_of(frame: bytes) -> int:
    """Of a reply, by its first bytes."""
    return 5 if frame[1] & 0x80 else 8 if frame[1] == 16 else 5 + frame[2]


class XArmController(Arm):
    """UFACTORY's: Modbus TCP with protocol 2, and a register for the tool's line."""

    HEADER: Final = struct.Struct(">HHH")

    async def hear(self, reader: asyncio.StreamReader) -> bytes:
        head = await reader.readexactly(self.HEADER.size)
        return head + await reader.readexactly(self.HEADER.unpack(head)[2])

    async def answer(self, asked: bytes) -> bytes:
        number, protocol, _ = self.HEADER.unpack_from(asked)
        assert (protocol, asked[6:8]) == (2, b"\x7c\x09"), "the tool's line of the first host"
        reply = await self.ask(asked[8], asked[9:])
        state = 0 if reply else 0x08
        body = bytes((0x7C, state, 9, asked[8])) + reply
        return self.HEADER.pack(number, 2, len(body)) + body


class DobotController(Arm):
    """Dobot's: calls as text, which read and write registers; the arm is the master."""

    async def hear(self, reader: asyncio.StreamReader) -> bytes:
        return await reader.readuntil(b")")

    async def answer(self, asked: bytes) -> bytes:
        call = asked.decode()
        found = re.fullmatch(r"(\w+)\(\d+,(\d+),(\d+),(?:\{([\d,]+)\},)?U16\)", call)
        assert found is not None, call
        at, count = int(found[2]), int(found[3])
        values: tuple[int, ...] = ()
        if found[1] == "GetHoldRegs":
            reply = await self.ask(9, struct.pack(">BHH", 3, at, count))
            if reply[:2] == bytes((3, 2 * count)):
                values = struct.unpack_from(f">{count}H", reply, 2)
        else:
            words = [int(each) for each in found[4].split(",")]
            reply = await self.ask(9, struct.pack(f">BHHB{count}H", 16, at, count, 2 * count, *words))
        code = 0 if reply and not reply[0] & 0x80 else -1
        return f"{code},{{{','.join(map(str, values))}}},{call};".encode()


class DoosanController(Arm):
    """Doosan's: a program of the arm that writes and reads raw bytes, a line of JSON for each."""

    async def hear(self, reader: asyncio.StreamReader) -> bytes:
        return await reader.readuntil(b"\n")

    async def answer(self, asked: bytes) -> bytes:
        call = json.loads(asked)
        said = {"number": call["number"]}
        if "write" in call:
            await self._line.read(0.0)
            if self.has_power:
                await self._line.write(bytes.fromhex(call["write"]))
        else:
            said["read"] = (await self._line.read(call["read"])).hex()
        return json.dumps(said).encode() + b"\n"


class SocketController(Arm):
    """No arm: frames of the serial line on a socket, with as much work for each as the arms have."""

    async def hear(self, reader: asyncio.StreamReader) -> bytes:
        frame = await reader.readexactly(8)
        while len(frame) < request_size(frame):
            frame += await reader.readexactly(request_size(frame) - len(frame))
        return frame

    async def answer(self, asked: bytes) -> bytes:
        reply = await self.ask(asked[0], asked[1:-2])
        return with_crc(asked[:1] + reply) if reply else b""


CONTROLLERS: Final[dict[str, type[Arm]]] = {
    "XArm": XArmController,
    "Dobot": DobotController,
    "Doosan": DoosanController,
}
"""The arms, by the classes of their tunnels."""


@asynccontextmanager
async def arm_with_jaw(
    name: str, delay: float = 0.0, device_id: int = 9, gripper: SimulatedGripper | None = None
) -> AsyncIterator[tuple[Arm, RtuOverTcpSimulatorServer, Tunnel]]:
    """An arm with a jaw at its tool, and the tunnel to it; the jaw is active unless one is given."""
    if gripper is None:
        gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85, spread=False)
        await activate_beforehand(gripper)
    async with RtuOverTcpSimulatorServer(gripper, device_id=device_id) as server:
        line = ToolLine(parse_address(server.address).port)
        async with CONTROLLERS[name](line, delay) as there:
            yield there, server, tunnel_of(name, "127.0.0.1", there.port)


# -- the package that gives them schemes ---------------------------------------------------------------------


def install_schemes(patch: pytest.MonkeyPatch, folder: Path) -> None:
    """Install ``xarm://``, ``dobot://`` and ``doosan://``."""
    install(
        patch, folder, "arms", TUNNELS, **{name.lower(): f"tests.arms:{name.lower()}" for name in CONTROLLERS}
    )


def xarm(place: TunnelPlace) -> Tunnel:
    assert place.port is not None
    return tunnel_of("XArm", place.host, place.port, place.unit)


def dobot(place: TunnelPlace) -> Tunnel:
    assert place.port is not None
    return tunnel_of("Dobot", place.host, place.port)


def doosan(place: TunnelPlace) -> Tunnel:
    assert place.port is not None
    return tunnel_of("Doosan", place.host, place.port, place.unit)
