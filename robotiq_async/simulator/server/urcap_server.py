"""UrcapSimulatorServer: a simulated jaw behind the text port of Robotiq's URCap."""

from __future__ import annotations

import asyncio
from collections import deque
from typing import TYPE_CHECKING, ClassVar, Final

from robotiq_async.values import registers as reg
from robotiq_async.values.checks import check_int
from robotiq_async.values.model import TWO_FINGER_85
from robotiq_async.values.registers import RTU_REGISTERS

from ..physics.driven_axis import PhysicsError
from ..physics.gripper import SimulatedGripper
from ..troubles.like_hardware import own_habits
from .framing import BadFrameError, Frame
from .responder import Responder
from .tcp_server import SimulatorServer

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from robotiq_async.values.registers import Field

    from ..troubles.trouble import TroubleLink
    from ..troubles.troubled_link import TroubledLink

UNREADABLE: Final = "?"
"""The value of a variable that the controller cannot read, as in an emergency stop (ur_rtde's client)."""
REFUSED: Final = b"?"
"""The answer to a line that is not understood. Made up: no source has the URCap's."""
ACKNOWLEDGED: Final = b"ack"
LONGEST_LINE: Final = 256

_STATUS_FIELDS: Final = {
    "ACT": reg.gACT,
    "GTO": reg.gGTO,
    "STA": reg.gIMC,
    "OBJ": reg.gOBJ,
    "FLT": reg.gFLT,
    "PRE": reg.gPR[0],
    "POS": reg.gPO[0],
    "COU": reg.gCU[0],
}
"""Names that a GET reads from the status; two also name a value of a request. COU is the current in 10 mA."""
_REQUEST_FIELDS: Final = {
    "ACT": reg.rACT,
    "GTO": reg.rGTO,
    "ATR": reg.rATR,
    "ARD": reg.rARD,
    "POS": reg.rPR[0],
    "SPE": reg.rSP[0],
    "FOR": reg.rFR[0],
}
"""Names that a SET writes."""
_WRITTEN_WORDS: Final = 3
_BARE: Final = 1
"""The unit, which lines do not have, of a question without an end of line."""
_PADDED: Final = {"FLT": 2, "PRE": 3}
"""Digits that a value is shown with (a session with a real gripper, and the vendor's script)."""
_ABOUT: Final = {
    "DRI": "RUNNING",
    "VER": "DCU-2.0.0",
    "FWV": "0",
    "SNU": "0",
    "NCY": "0",
    "MOD": "0",
    "MSC": "0",
    "VST": "0",
}
"""Names that describe gripper and driver: state and version of the driver, version of the firmware, serial
number, cycles. All values but DRI and VER are made up; no source explains the last three."""


_VARIABLES: Final = frozenset({"SID", *_STATUS_FIELDS, *_REQUEST_FIELDS, *_ABOUT})


class _UnknownLineError(Exception):
    """A line that is not understood."""


class UrcapResponder(Responder):
    """Answers the lines of the text port."""

    def __init__(
        self,
        gripper: SimulatedGripper,
        troubles: TroubledLink,
        functions: Collection[int],
        unit: int | None,
    ) -> None:
        super().__init__(gripper, troubles, functions, unit)
        self._waiting: deque[tuple[Field, int]] = deque()
        """Variables that were set and are not taken yet."""
        self._taking: asyncio.TimerHandle | None = None
        """The timer of the next of them."""

    def take(self, inbox: bytearray) -> Frame | None:
        """Cut the next line out of the bytes that have arrived."""
        end = inbox.find(b"\n")
        if end < 0:
            if len(inbox) > LONGEST_LINE:
                raise BadFrameError(inbox[:16].hex(" "))
            return self._bare(inbox)
        line = bytes(inbox[:end])
        del inbox[: end + 1]
        return Frame(0, 0, line)

    def _bare(self, inbox: bytearray) -> Frame | None:
        """Cut out a question without an end of line."""
        words = bytes(inbox).split(b" ")
        if len(words) != 2 or words[0] != b"GET" or words[1].decode("ascii", "replace") not in _VARIABLES:
            return None
        line = bytes(inbox)
        inbox.clear()
        return Frame(_BARE, 0, line)

    def answer(self, frame: Frame) -> bytes:
        """Carry out a line; return the answer."""
        if frame.unit == _BARE:
            return self._shown(frame.pdu.decode("ascii").split()[1]).encode()
        match frame.pdu.decode("ascii", "replace").split():
            case ["GET", name]:
                return self._get(name)
            case ["SET", *words] if words and not len(words) % 2:
                return self._set(words[::2], words[1::2])
        return REFUSED

    def _is_meant(self, unit: int) -> bool:  # noqa: ARG002  # lines have none
        return True

    def _get(self, name: str) -> bytes:
        return f"{name} {self._shown(name)}\n".encode() if name in _VARIABLES else REFUSED

    def _shown(self, name: str) -> str:
        """The value of a variable as it is shown."""
        if name == "SID":
            return f"[{self._unit or 0}]"
        if name in _ABOUT:
            return _ABOUT[name]
        if self.troubles.is_unreadable:
            return UNREADABLE
        if name in _STATUS_FIELDS:
            value = _STATUS_FIELDS[name].read(self.gripper.status_registers())
        else:
            value = _REQUEST_FIELDS[name].read(self.gripper.request_registers)
        return f"{value:0{_PADDED.get(name, 1)}}"

    def close(self) -> None:
        super().close()
        self._take_no_more()

    def _set(self, names: list[str], values: list[str]) -> bytes:
        try:
            pairs = [self._checked(name, value) for name, value in zip(names, values, strict=True)]
        except _UnknownLineError:
            return REFUSED
        changes = [(field, number) for field, number in pairs if field is not None]
        if changes and self.troubles.loses_set():
            return ACKNOWLEDGED
        if changes and not self._waiting and not self.troubles.set_spacing:
            self._take(changes)
        elif changes:
            self._waiting += changes
            if self._taking is None:
                self._take_later()
        return ACKNOWLEDGED

    def _checked(self, name: str, value: str) -> tuple[Field | None, int]:
        """The field that a variable sets, and its value; SID sets none."""
        field = _REQUEST_FIELDS.get(name)
        if not (value.isascii() and value.isdigit() and len(value) <= 3):
            raise _UnknownLineError
        number = int(value)
        is_value = field is not None and number < 1 << field.width
        if not (number == self._unit if name == "SID" else is_value):
            raise _UnknownLineError
        return field, number

    def _take(self, changes: Iterable[tuple[Field, int]]) -> None:
        image = list(self.gripper.request_registers)
        for field, number in changes:
            field.write(image, number)
        self.gripper.write(0, image[:_WRITTEN_WORDS])

    # -- one by one ------------------------------------------------------------------------------------------

    def _take_later(self) -> None:
        spacing = self.troubles.set_spacing
        self._taking = asyncio.get_running_loop().call_later(spacing, self._take_next)

    def _take_next(self) -> None:
        self._taking = None
        if not self.gripper.is_powered:
            self._take_no_more()
            return
        try:
            self._take([self._waiting.popleft()])
        except PhysicsError as error:
            self.fail(error)
            return
        if self._waiting:
            self._take_later()

    def _take_no_more(self) -> None:
        self._waiting.clear()
        if self._taking is not None:
            self._taking.cancel()
            self._taking = None


class UrcapSimulatorServer(SimulatorServer):
    """Serves a simulated jaw as Robotiq's URCap on a UR controller does, to any number of clients.

    A line is ``GET NAME`` or ``SET NAME VALUE NAME VALUE ...``. The answer to a GET ends with an end of line,
    and the ``ack`` of a SET does not, as clients that ran on hardware expect. Several lines may come in one
    write. A ``GET NAME`` without an end of line is answered by the bare value, as the vendor's script has it;
    so is the beginning of a longer line that comes in pieces, if it is a GET. All variables of a SET act
    at once, unless the trouble ``one-by-one`` spaces them: then the ``ack`` comes before the first.
    Other lines are answered by a question mark. With the trouble ``lost-set`` a SET is acknowledged and does
    not reach the gripper; with ``unreadable`` each variable of the gripper reads as a question mark, and a
    SET still reaches it: no source says whether it does.
    """

    link: ClassVar[TroubleLink] = "urcap"
    _responds: ClassVar[type[Responder]] = UrcapResponder

    def __init__(
        self,
        gripper: SimulatedGripper | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        device_id: int = RTU_REGISTERS.device_id,
    ) -> None:
        """A server that is not started; needs no running loop.

        Args:
            gripper: the device that answers; None for a new 2F-85.
            host: address to listen on.
            port: TCP port, 0 for any free one; the URCap's is 63352.
            device_id: the only gripper that can be chosen (SID).

        Raises:
            TypeError: port or device_id is not an int.
            ValueError: port is outside 0..65535, device_id outside 1..247, or the gripper is a 3-Finger.
        """
        jaw = gripper or SimulatedGripper(model=TWO_FINGER_85, habits=own_habits(TWO_FINGER_85))
        if len(jaw.model.axes) > 1:
            raise ValueError(f"a URCap has a 2F-85, 2F-140 or Hand-E, got a {jaw.model.title}")
        super().__init__(jaw, host=host, port=port, device_id=check_int("device_id", device_id, 1, 247))

    @property
    def address(self) -> str:
        """The address for :class:`~robotiq_async.RobotiqHand`."""
        return f"urcap://{self._host}:{self._port}{self._query}"
