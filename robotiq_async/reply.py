"""Checks every byte of a reply against the request it should answer.

pymodbus takes a reply with a wrong function code or too few registers for a success, accepts transaction
id 0 for any request, and lets a lying byte count end in an unhandled exception. So each frame is looked
at before pymodbus sees it. No I/O here: bytes in, a verdict out.
"""

from __future__ import annotations

from dataclasses import dataclass

from .errors import ProtocolError

_EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    5: "acknowledge",
    6: "device busy",
    10: "gateway path unavailable",
    11: "gateway target does not respond",
}


@dataclass(frozen=True, slots=True)
class Expected:
    """The one reply that answers a request.

    Attributes:
        header: the bytes before the function code, as they must come: transaction, protocol, length and
            unit over TCP; the unit alone over a serial line. In the length field of TCP the length of the
            good reply stands.
        pdu: function code and what must follow it.
        size: bytes of the good reply, check sum included.
        tail: bytes of check sum at the end, which are not checked here.
    """

    header: bytes
    pdu: bytes
    size: int
    tail: int

    def is_complete(self, frame: bytes) -> bool:
        """Whether the bytes so far are the whole answer; False while more must come.

        Raises:
            ProtocolError: the bytes can not become the answer, or the device refuses the request.
        """
        start = len(self.header)
        function = self.pdu[0]
        if len(frame) > start and frame[start] == function | 0x80:
            return self._refused(frame, function)
        want = self.header + self.pdu
        got = frame[: len(want)]
        if got != want[: len(got)]:
            raise ProtocolError(f"not the answer: {frame.hex(' ')}, expected {want.hex(' ')}...")
        if len(frame) > self.size:
            raise ProtocolError(f"{len(frame) - self.size} bytes more than the answer: {frame.hex(' ')}")
        return len(frame) == self.size

    def _refused(self, frame: bytes, function: int) -> bool:
        """An exception reply: complete, it is an error; until then wait for the rest."""
        size = len(self.header) + 2 + self.tail
        if len(frame) < size:
            return False
        code = frame[len(self.header) + 1]
        raise ProtocolError(
            f"the gripper refuses function {function}: exception {code} ({_EXCEPTIONS.get(code, 'unknown')})"
        )


def expected_reply(request: bytes, *, serial: bool) -> Expected:
    """The reply that answers a request frame of function 3, 4 or 16."""
    start, tail = (1, 2) if serial else (7, 0)
    function = request[start]
    if function == 16:
        # The echo of address and count.
        pdu, size = request[start : start + 5], start + 5
    else:
        count = int.from_bytes(request[start + 3 : start + 5], "big")
        pdu, size = bytes((function, 2 * count)), start + 2 + 2 * count
    if serial:
        return Expected(request[:1], pdu, size + tail, tail)
    # MBAP: transaction and protocol as sent, length counted from the unit on, unit as sent.
    header = request[:4] + (size - 6).to_bytes(2, "big") + request[6:7]
    return Expected(header, pdu, size, tail)
