"""A simulated gripper behind Modbus RTU, on a serial line or behind a serial server; the time of bytes."""

# Theory of operation
#
# A pseudo terminal or a socket carries bytes at once; a line at 115200 baud does not. SerialConnection delays
# them in both directions, each byte behind the bytes before it, by the times of WireTime:
#
#   in    data_received -> time of the last byte and the silence after it -> _hear -> a request is answered
#   out   pass_on -> time of the last byte at the client -> _put
#
# A line cannot make a client wait. So too many bytes are lost: of requests beyond MOST_UNREAD, of replies
# beyond MOST_UNSENT.
#
# A frame has no mark at its end but the pause. Bytes after more than LONGEST_PAUSE_S begin a frame, and so
# does a whole request after more than FRAME_GAP_S; an incomplete frame before them is dropped. So a frame
# that is cut off costs itself and at most one request. Without pacing (reply_silence None) only the delays
# are left out.

from __future__ import annotations

import asyncio
import importlib.util
import math
from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, ClassVar, Final

from pymodbus.transport.serialtransport import create_serial_connection

from robotiq_async.values.checks import check_flag, check_int
from robotiq_async.values.registers import RTU_REGISTERS

from ..functions import RTU_FUNCTIONS
from .connection import MOST_UNREAD, Connection
from .endpoint import SimulatorEndpoint
from .framing import BROADCAST, Frame, begins_with_frame, rtu_reply, take_rtu
from .responder import ModbusResponder, Responder
from .tcp_server import SimulatorServer

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ..physics.gripper import SimulatedGripper
    from ..troubles.trouble import TroubleLink


BAUD: Final = 115200
BYTE_S: Final = 10 / BAUD
"""8N1: a start bit, eight data bits and a stop bit, 86.8 us."""
REPLY_SILENCE_S: Final = 3.5 * BYTE_S + 0.0005
"""Seconds from the last byte of a request to the first of the reply: the 3.5 characters that end a frame in
Modbus RTU (Modbus over Serial Line, 2.5.1.1) and half a millisecond for the reply. No gripper was measured:
the vendor names 4 ms, at best 250 exchanges a second, for a function 23 whose bytes take 2.6 ms. The 1.75 ms
that the standard recommends above 19200 baud would not fit into that."""
FRAME_GAP_S: Final = 0.00175
"""A pause of this length may be the end of a frame: the longest that the standard knows at this rate."""
LATE_TIMER_S: Final = 0.0015
"""A timer of the loop comes up to a millisecond late, for epoll rounds its time-outs up."""

LONGEST_PAUSE_S: Final = 0.02
"""Longest pause of a frame on its way to this program, which does not see the wire: a USB adapter keeps bytes
for up to 16 ms (the usual latency timer), and a writer of half a frame to a pseudo terminal was kept from the
other half for 1.9 ms (4000 frames on a busy machine). A client that gets no answer waits longer
before its next request, so no more than one request is lost with a frame that was cut off."""

MOST_UNSENT: Final = 4096
"""The most unread bytes on the line; further replies are lost."""


class RtuResponder(ModbusResponder):
    """Answers the frames of Modbus RTU to one unit, and carries out broadcasts."""

    _unit: int

    def take(self, inbox: bytearray) -> Frame | None:
        return take_rtu(inbox, self._unit)

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        """The parts to send for a reply; none for an exception, and none to a broadcast."""
        is_exception = bool(reply[1] & 0x80)
        return () if is_exception or reply[0] == BROADCAST else super().deliver(reply)

    def _is_meant(self, unit: int) -> bool:
        return unit in (BROADCAST, self._unit)

    def _reply(self, frame: Frame, pdu: bytes) -> bytes:
        return rtu_reply(frame, pdu)


class _RtuEndpoint(SimulatorEndpoint):
    """The common part of servers for RTU frames, over any carrier.

    Attributes:
        paced: whether bytes take their time, of connections to come.
        reply_silence: seconds from a request to the first byte of its reply, of connections to come.
        device_id: the unit id of the gripper.
        others: the servers of the other grippers at this line, by unit id, each with separate troubles.
    """

    functions: ClassVar[frozenset[int]] = RTU_FUNCTIONS
    _responds: ClassVar[type[Responder]] = RtuResponder
    paced: bool
    device_id: int
    reply_silence = REPLY_SILENCE_S
    others: Mapping[int, LineNeighbour] = MappingProxyType({})

    async def start(self) -> None:
        """Begin to answer, the others at the line as well.

        Raises:
            RuntimeError: it is running already.
            OSError: the address or the serial port cannot be opened.
        """
        for each in self.others.values():
            await each.start()
        await super().start()

    async def stop(self) -> None:
        """Drop all connections and stop listening, the others at the line as well."""
        await super().stop()
        for each in self.others.values():
            await each.stop()

    def _share(self, others: Mapping[int, SimulatedGripper]) -> None:
        units = [check_int("a unit id of others", unit, 1, 247) for unit in others]
        if self.device_id in units:
            raise ValueError(f"each gripper at a line needs a different unit id, got {self.device_id} twice")
        self.others = {unit: LineNeighbour(self, others[unit], unit) for unit in units}

    def _connection(self) -> asyncio.Protocol:
        ends = [each._end() for each in (self, *self.others.values())]  # noqa: SLF001  # of the same kind
        return LineEnd(ends) if self.others else ends[0]

    def _end(self) -> SerialConnection:
        return SerialConnection(self._responder, self.reply_silence if self.paced else None, self.device_id)


class LineNeighbour(_RtuEndpoint):
    """Another gripper at the line of a server, which opens and closes the line for both."""

    def __init__(self, server: _RtuEndpoint, gripper: SimulatedGripper, device_id: int) -> None:
        self.link = server.link  # type: ignore[misc]  # its server's
        super().__init__(gripper, device_id)
        self.device_id = device_id
        self.paced: bool = server.paced
        self._server = server

    @property
    def address(self) -> str:
        """The address of the line."""
        return self._server.address

    async def _open(self) -> None:
        """The server opens the line."""

    def _close(self) -> None:
        """The server closes it."""


class LineEnd(asyncio.Protocol):
    """The end of a line at which several grippers are: all hear the client, and each hears the others."""

    def __init__(self, ends: list[SerialConnection]) -> None:
        self._ends = ends
        for end in ends:
            end.share([each for each in ends if each is not end])

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        for each in self._ends:
            each.connection_made(transport)

    def data_received(self, data: bytes) -> None:
        for each in self._ends:
            each.data_received(data)

    def connection_lost(self, exc: Exception | None) -> None:
        for each in self._ends:
            each.connection_lost(exc)

    def pause_writing(self) -> None:
        for each in self._ends:
            each.pause_writing()

    def resume_writing(self) -> None:
        for each in self._ends:
            each.resume_writing()


class SerialSimulatorServer(_RtuEndpoint):
    """Serves a simulated gripper over Modbus RTU at 115200 baud, 8N1.

    Bytes take their time at that rate, both ways, and a reply begins 0.8 ms after its request
    (:attr:`reply_silence`): a read of 8 registers takes 3.3 ms, a write 3.7 ms. Timers make that longer by up
    to a millisecond, and never shorter.

    Serves the functions of :class:`~robotiq_async.simulator.SimulatorServer`, and FC23, which writes before
    it reads. The RTU gripper has no exception replies (manual 2014, p. 59), so a bad request gets no answer.
    Broadcasts (unit 0) are carried out and not answered, requests to other units are left to them, as Modbus
    has it; no source covers a real gripper's answer to a broadcast.
    """

    link: ClassVar[TroubleLink] = "rtu"

    def __init__(
        self,
        port: str,
        gripper: SimulatedGripper | None = None,
        *,
        device_id: int = RTU_REGISTERS.device_id,
        paced: bool = True,
        others: Mapping[int, SimulatedGripper] = MappingProxyType({}),
    ) -> None:
        """A server that is not started; needs no running loop.

        Args:
            port: the serial port, such as ``/dev/ttyUSB0``, or one end of a pseudo terminal.
            gripper: the device that answers; None for a new one.
            device_id: the unit id of the gripper.
            paced: whether bytes take their time. False for a real serial port, which takes it itself, and for
                programs that cannot wait.
            others: more grippers at this line, by unit id; each hears the requests and answers of the others.

        Raises:
            TypeError: device_id is not an int, or paced is not a bool.
            ValueError: device_id is outside 1..247, or another gripper has it.
        """
        self.device_id: int = check_int("device_id", device_id, 1, 247)
        super().__init__(gripper, self.device_id)
        self._port = port
        self.paced: bool = check_flag("paced", paced)
        self._share(others)

    @property
    def port(self) -> str:
        """The serial port."""
        return self._port

    @property
    def address(self) -> str:
        """The serial port as an address. A client needs the other end of the line, not this one."""
        return f"rtu://{self._port}{self._query}"

    async def start(self) -> None:
        """Begin to answer.

        Raises:
            ImportError: pyserial is not installed.
            RuntimeError: it is running already.
            OSError: the serial port cannot be opened.
        """
        if importlib.util.find_spec("serial") is None:
            from robotiq_async.runtime.extras import install  # noqa: PLC0415  # nothing else needs it

            raise ImportError(f"a serial line needs pyserial: {install('serial')}")
        await super().start()

    def _close(self) -> None:
        """Nothing to close but the one connection."""

    async def _open(self) -> None:
        loop, line = asyncio.get_running_loop(), {"bytesize": 8, "parity": "N", "stopbits": 1}
        await create_serial_connection(loop, self._connection, self._port, baudrate=BAUD, **line)
        # The transport watches the line from the next turn of the loop on and calls the connection one turn
        # later; closing it earlier would fail.
        await asyncio.sleep(0)
        await asyncio.sleep(0)


class RtuOverTcpSimulatorServer(_RtuEndpoint, SimulatorServer):
    """Serves a simulated gripper as a serial server does, or an arm's tool port: RTU frames in a TCP socket.

    It serves the functions of :class:`~robotiq_async.simulator.SerialSimulatorServer`, at the speed of the
    line behind. Requests sent without waiting are lost if the line cannot take them.
    """

    link: ClassVar[TroubleLink] = "rtu+tcp"

    def __init__(
        self,
        gripper: SimulatedGripper | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        device_id: int = RTU_REGISTERS.device_id,
        paced: bool = True,
        others: Mapping[int, SimulatedGripper] = MappingProxyType({}),
    ) -> None:
        """A server that is not started; needs no running loop.

        Args:
            gripper: the device that answers; None for a new one.
            host: address to listen on.
            port: TCP port, 0 for any free one.
            device_id: the unit id of the gripper.
            paced: whether bytes take the time that they take on the line.
            others: more grippers at this line, by unit id; each hears the requests and answers of the others.

        Raises:
            TypeError: port or device_id is not an int, or paced is not a bool.
            ValueError: port is outside 0..65535, device_id outside 1..247, or another gripper has it.
        """
        self.device_id: int = check_int("device_id", device_id, 1, 247)
        super().__init__(gripper, host=host, port=port, device_id=self.device_id)
        self.paced: bool = check_flag("paced", paced)
        self._share(others)

    @property
    def address(self) -> str:
        """The address for :class:`~robotiq_async.RobotiqHand`."""
        return f"rtu+{super().address}"


class WireTime:
    """Times of arrival of bytes, in each direction. Keeps no clock.

    A request is whole once its last byte has come and the silence after it has passed; then the reply
    begins. Times are counted from that moment and not from the timer that stood for it, which is late by a
    bit: such delays would add up, exchange after exchange.
    """

    def __init__(self, reply_silence: float = REPLY_SILENCE_S) -> None:
        self._reply_silence = reply_silence
        self._heard_until = 0.0
        self._answers_from = 0.0
        self._sent_until = 0.0

    def unheard(self, now: float) -> float:
        """Bytes that are still on their way to the gripper."""
        return (self._heard_until - now) / BYTE_S

    def unsent(self, now: float) -> float:
        """Bytes that are still on their way from the gripper."""
        return (self._sent_until - now) / BYTE_S

    def hears(self, now: float, size: int) -> tuple[float, float]:
        """The time when bytes for the gripper have come and the silence has passed; the pause before them."""
        pause = max(0.0, now - self._heard_until)
        self._heard_until = max(now, self._heard_until) + size * BYTE_S
        return self._heard_until + self._reply_silence, pause

    def heard(self, when: float) -> None:
        self._answers_from = when

    def sends(self, now: float, size: int) -> float:
        """The time at which bytes that the gripper sends now arrive at the client."""
        begins = self._answers_from if now - self._answers_from < LATE_TIMER_S else now
        self._sent_until = max(begins, self._sent_until) + size * BYTE_S
        return self._sent_until


class SerialConnection(Connection):
    """The other end of a serial line, which has no connections, no packets and no flow control."""

    def __init__(self, responder: Responder, reply_silence: float | None, unit: int) -> None:
        """Make a connection with the time of its bytes; None if bytes take no time."""
        super().__init__(responder)
        self._others: list[SerialConnection] = []
        """The ends of other grippers at the same place of the line."""
        self._unit = unit
        self._line = responder.troubles
        self._wire = None if reply_silence is None else WireTime(reply_silence)
        self._heard_at = 0.0
        self._sent_at = -math.inf
        """The time at which the last bytes of a reply were put on the line."""
        self._unsent = 0
        """Bytes sent since the line had taken all of them."""

    def share(self, others: list[SerialConnection]) -> None:
        """The line has more ends at this place."""
        self._others = others

    def data_received(self, data: bytes) -> None:
        """Take bytes from the line, once they have come; more than it can carry for long is lost."""
        now = self._loop.time()
        if self._line.echoes:
            self._put(data)
        if not self._inbox and now - self._sent_at < self._line.strict_silence:
            return
        if self._wire is None:
            pause, self._heard_at = now - self._heard_at, now
            self._hear(data, pause)
        elif self._wire.unheard(now) < MOST_UNREAD:
            due, pause = self._wire.hears(now, len(data))
            self._loop.call_at(due, self._hear_late, due, data, pause)

    def _hear_late(self, due: float, data: bytes, pause: float) -> None:
        assert self._wire is not None, "bytes take time"
        self._wire.heard(due)
        if self.is_active():
            self._hear(data, pause)

    def _hear(self, data: bytes, pause: float) -> None:
        """Take bytes that have come; bytes of a frame that was cut off before them are dropped."""
        self._answer_next()  # complete frames are answered, even if their turn has not come
        if not self._goes_on and _begins_anew(pause, data, self._unit):
            self._inbox.clear()
        super().data_received(data)

    def overhear(self, part: bytes) -> None:
        """Take bytes that another gripper has put on the line; they have come already."""
        if self.is_active():
            pause, self._heard_at = self._loop.time() - self._heard_at, self._loop.time()
            self._hear(part, pause)

    def pass_on(self, part: bytes) -> None:
        """Send bytes; a reader has them when the last one has arrived."""
        now = self._loop.time()
        if self._wire is None:
            self._put(part)
        elif part and self._wire.unsent(now) < MOST_UNSENT:
            self._loop.call_at(self._wire.sends(now, len(part)), self._put, part)

    def _put(self, part: bytes) -> None:
        """Put bytes on the line, unless too many are unread."""
        if self.is_active() and not self.transport.get_write_buffer_size():
            self._unsent = 0
        if self._unsent + len(part) <= MOST_UNSENT:
            self._unsent += len(part)
            self._sent_at = self._loop.time()
            super().pass_on(part)
            for each in self._others:
                each.overhear(part)

    def _regulate(self) -> None:
        """Drop requests that come faster than the answers: a serial line cannot make a client wait."""
        if len(self._inbox) > MOST_UNREAD:
            self._inbox.clear()


def _begins_anew(pause: float, data: bytes, unit: int) -> bool:
    """Whether bytes begin a frame and do not continue one: the pause before them decides.

    In between, when it may be the line or the machine that paused, a whole request is a beginning: by
    chance the rest of a frame has its checksum once in 65,536 times.
    """
    return pause > LONGEST_PAUSE_S or (pause > FRAME_GAP_S and begins_with_frame(data, unit))
