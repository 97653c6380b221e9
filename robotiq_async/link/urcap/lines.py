"""The lines of the URCap's text port, and their meaning in registers. No I/O: bytes in, a verdict out.

Robotiq's URCap on a UR controller serves TCP port 63352. ``GET POS`` is answered by ``POS 12`` and an end of
line, ``SET POS 255 GTO 1`` by ``ack`` without an end of line. No document of the vendor describes the port.
Clients that ran on hardware show this: the example of ur_rtde, with GELLO's after it, airo-robots, and the
URScript that the URCap adds to programs. The variables are the registers of a jaw by name, so the values
become the status registers that a serial line would carry. Some ports lack the variable of the motor current.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from ...values import registers as reg
from ...values.errors import ProtocolError
from ...values.registers import Echo, Registers
from ..outcome import Stray

HIGHEST: Final = {"ACT": 1, "GTO": 1, "PRE": 255, "OBJ": 3, "STA": 3, "FLT": 255, "POS": 255, "COU": 255}
"""The variables of a status, and the highest value of each. COU is the current, 10 mA a count (aist)."""
DIGITS: Final = 3
"""The most digits of a value; the URCap's own script reads PRE with leading zeros."""
ACKNOWLEDGED: Final = b"ack"
UNREADABLE: Final = "?"
"""The answer of the port for a value that it cannot read from the gripper: in an emergency stop of the arm,
or when the tool has no power (ur_rtde's client expects it)."""
_LINE_END: Final = b"\r\n"
_LINE_BYTES: Final = 16
"""More bytes than this are no line of this port."""


def question(name: str) -> bytes:
    """The line that requests a variable."""
    return f"GET {name}\n".encode()


def command(image: Sequence[int], activation: int | None) -> bytes:
    """The one line that sets the variables as an image of a jaw has them.

    No source says whether the URCap takes the variables of a line at once or one by one. So they stand in the
    order that is right for both: a variable that stops the fingers comes first, and one that starts them
    comes last, after position, speed and force.

    A motion is the line that clients send: position, speed, force, go. Activation and release are left out
    of it: a motion must not activate a gripper that another client has just reset. ACT 0 is in the line even
    if it was read: an activation that was not acknowledged may still be on its way, from this connection or
    one that was lost, and this line takes it back. ARD means nothing without ATR.

    Args:
        image: the eight request registers.
        activation: ACT as it was read last; None if it was not, or if ATR may be set.
    """
    act, gto, atr, ard = (field.read(image) for field in (reg.rACT, reg.rGTO, reg.rATR, reg.rARD))
    release = [("ARD", ard), ("ATR", atr)] if atr else [("ATR", atr)]
    is_motion = act == activation == 1 and not atr
    go = [("GTO", gto)]
    pairs = [
        *([] if is_motion else [("ACT", act)]),
        *([] if gto else go),
        *([] if is_motion else release),
        *((name, field[0].read(image)) for name, field in _MOTION),
        *(go if gto else []),
    ]
    return ("SET " + " ".join(f"{name} {value}" for name, value in pairs) + "\n").encode()


_MOTION: Final = (("SPE", reg.rSP), ("FOR", reg.rFR), ("POS", reg.rPR))


def midway(before: Echo, after: Echo) -> Echo | None:
    """The echo of a command that is taken half, where a URCap takes its variables one by one.

    None for a command that changes ACT, which shows as it is: half a reset looks like a power cut.

    Args:
        before: the echo of the image before.
        after: the echo of the command: ACT, GTO and the position.
    """
    (activation, go, position), (wanted, goes, target) = before, after
    if activation != wanted:
        return None
    return (activation, go, target) if goes else (activation, goes, position)


def choice(gripper: int) -> bytes:
    """The line that chooses one of several grippers for this connection."""
    return f"SET SID {gripper}\n".encode()


def value_in(received: bytes, name: str) -> int | str | None:
    """The value in the answer to the question for a variable, or UNREADABLE; None while it is not whole.

    Raises:
        ProtocolError: the bytes cannot become the answer.
    """
    text = without_ends(received)
    head, value = f"{name} ".encode(), text[len(name) + 1 :].strip()
    if text[: len(head)] != head[: len(text)] or len(text) > _LINE_BYTES:
        raise _misfit(received, name)
    is_unreadable = value == UNREADABLE.encode()
    if not (value.isdigit() or is_unreadable or not value):
        raise _misfit(received, name)
    if not text.endswith(b"\n"):
        return None
    if is_unreadable:
        return UNREADABLE
    if not 1 <= len(value) <= DIGITS or int(value) > HIGHEST[name]:
        raise _misfit(received, name)
    return int(value)


def is_acknowledged(received: bytes) -> bool:
    """Whether the bytes are the whole answer to a SET; False while they are not.

    Raises:
        ProtocolError: the bytes cannot become the answer.
    """
    text = received.strip(_LINE_END)
    if not ACKNOWLEDGED.startswith(text):
        raise ProtocolError(f"not an acknowledgement: {show(received)}")
    return text == ACKNOWLEDGED


def without_ends(received: bytes) -> bytes:
    """The bytes without empty lines at their beginning: some ``ack`` may end with an end of line."""
    return received.lstrip(_LINE_END)


def stray(received: bytes) -> Stray | None:
    """The outcome of bytes that answer nothing; None for empty lines."""
    text = without_ends(received)
    return Stray(ProtocolError(f"{len(text)} bytes without a question: {show(text)}")) if text else None


def status_registers(values: Mapping[str, int]) -> Registers:
    """The status registers of a jaw with these values of its variables; without COU the current reads 0."""
    first = values["ACT"] | values["GTO"] << 3 | values["STA"] << 4 | values["OBJ"] << 6
    echo, position = values["FLT"] << 8 | values["PRE"], values["POS"] << 8 | values.get("COU", 0)
    return (first << 8, echo, position, 0, 0, 0, 0, 0)


def _misfit(received: bytes, name: str) -> ProtocolError:
    return ProtocolError(f"not the answer to GET {name}: {show(received)}")


def show(received: bytes) -> str:
    """Bytes for a message, shortened."""
    return (
        repr(received)[1:]
        if len(received) <= 2 * _LINE_BYTES
        else f"{repr(received[: 2 * _LINE_BYTES])[1:]}..."
    )
