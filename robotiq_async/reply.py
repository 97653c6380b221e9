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
        start: how the good reply begins: header, function code and what must follow it.
        size: bytes of the good reply, check sum included. (The check sum itself is left to pymodbus.)
        refusal: how an exception reply begins: header and function code.
        refusal_size: bytes of an exception reply.
    """

    start: bytes
    size: int
    refusal: bytes
    refusal_size: int

    def is_complete(self, frame: bytes) -> bool:
        """Whether the bytes so far are the whole answer; False while more must come.

        Raises:
            ProtocolError: the bytes can not become the answer, or the device refuses the request.
        """
        if _agree(frame, self.start):
            if len(frame) > self.size:
                raise ProtocolError(f"{len(frame) - self.size} bytes more than the answer: {_show(frame)}")
            return len(frame) == self.size
        if not _agree(frame, self.refusal):
            raise ProtocolError(f"not the answer: {_show(frame)}, expected {_show(self.start)}...")
        if len(frame) < self.refusal_size:
            return False
        function, code = self.refusal[-1] & 0x7F, frame[len(self.refusal)]
        raise ProtocolError(
            f"the gripper refuses function {function}: exception {code} ({_EXCEPTIONS.get(code, 'unknown')})"
        )


def expected_reply(request: bytes, *, serial: bool) -> Expected:
    """The reply that answers a request frame of function 3, 4 or 16."""
    at, checksum = (1, 2) if serial else (7, 0)
    function = request[at]
    if function == 16:
        # The echo of address and count.
        pdu, payload = request[at : at + 5], 0
    else:
        payload = 2 * int.from_bytes(request[at + 3 : at + 5], "big")
        pdu = bytes((function, payload))
    return Expected(
        start=_header(request, len(pdu) + payload, serial=serial) + pdu,
        size=at + len(pdu) + payload + checksum,
        refusal=_header(request, 2, serial=serial) + bytes((function | 0x80,)),
        refusal_size=at + 2 + checksum,
    )


def _header(request: bytes, pdu_size: int, *, serial: bool) -> bytes:
    """What stands before the function code of a reply: the unit, over TCP after the rest of the MBAP header.

    Transaction, protocol and unit are those of the request; the length counts from the unit on.
    """
    return request[:1] if serial else request[:4] + (pdu_size + 1).to_bytes(2, "big") + request[6:7]


def _show(frame: bytes) -> str:
    """Bytes for a message; what talks nonsense often talks a lot."""
    return frame.hex(" ") if len(frame) <= 32 else f"{frame[:32].hex(' ')}... ({len(frame)} bytes)"


def _agree(frame: bytes, start: bytes) -> bool:
    """Whether the bytes so far fit the beginning."""
    size = min(len(frame), len(start))
    return frame[:size] == start[:size]
