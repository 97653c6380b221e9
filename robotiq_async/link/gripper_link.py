"""The way to a gripper, its identity, and claims: no two hands of a process own the same one."""

from __future__ import annotations

import asyncio
import threading
from collections import OrderedDict
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Final, Generic, TypeVar

from ..runtime.logger import Log
from ..values.checks import repr_of
from ..values.model import THREE_FINGER, Model, model_of
from ..values.registers import RegisterMap
from .address import Address, parse_address
from .canonical import canonical_address
from .modbus import ModbusTransport
from .registers import check_urcap, registers_of
from .sim_transport import SimulatedTransport, named, new_gripper
from .transport import Link
from .tunnel.protocol import Tunnel, tunnel_to
from .urcap.transport import UrcapTransport

_BEHIND_GATEWAY: Final = " (two grippers behind one gateway: give each of the hands its device_id)"
_ON_ONE_LINE: Final = (
    " (two grippers on one serial line: give each of the hands its device_id, in one event loop)"
)
_TUNNEL: Final = " (two grippers behind one arm: give each of the hands its device_id)"
_BEHIND_URCAP: Final = " (two grippers behind one URCap: give each of the hands its device_id)"

MOST_LEFT: Final = 64
"""The most grippers whose last hands leave something for the next. Half a second after its end only the
contacts of a hand matter: they keep a grip when rGTO rises again."""

T = TypeVar("T")
L = TypeVar("L")


@dataclass(frozen=True, slots=True)
class Gripper:
    """Identity of a gripper before it is connected.

    Attributes:
        place: the same for all spellings of its address.
        unit: the given unit id; None without one, or if only one hand can own the place.
        hint: for the error message, in case two grippers were meant.
        is_on_line: whether the place is a serial line, whose connection one event loop must own.
    """

    place: str
    unit: int | None = None
    hint: str = field(default="", compare=False)
    is_on_line: bool = False

    def may_be(self, other: Gripper) -> bool:
        """Whether both may be the same gripper.

        Grippers answer any unit id, so ids count only if both were given: then there is a gateway.
        """
        units = {self.unit, other.unit}
        return self.place == other.place and (None in units or len(units) == 1)


@dataclass(frozen=True, slots=True)
class GripperLink:
    """The way to a gripper.

    Attributes:
        address: in its full form, as errors and the log show it.
        gripper: identifies the gripper at the time of the call: a serial port may have been plugged in since.
        make: makes a transport for one start of the hand, from ``connect_timeout`` and ``response_timeout``.
        is_slow: whether a status takes a good part of a poll interval: over a serial line, or in questions.
        model: of the gripper.
        stroke: path of the file with measured openings in the address, or None.
    """

    address: str
    gripper: Callable[[], Gripper]
    make: Callable[..., Link]
    is_slow: bool = False
    model: Model = THREE_FINGER
    stroke: str | None = None

    def why_not_beside(self, other: GripperLink) -> str:
        """The reason that one process cannot have hands for both; empty if it can."""
        own, theirs = self.gripper(), other.gripper()
        if own.may_be(theirs):
            return f"both may be one gripper{own.hint}"
        if own.place != theirs.place:
            return ""
        if own.is_on_line is not theirs.is_on_line:
            return "a socket has one protocol"
        is_alike = parse_address(self.address).line == parse_address(other.address).line
        return "" if is_alike else "a port has only one rate"


def gripper_link(
    address: object, registers: Mapping[str, object], name: str = "", model: object = None
) -> GripperLink:
    """The way to the gripper at an address. Opens nothing.

    Args:
        address: a string or a tunnel.
        registers: the options that :func:`registers_of` takes.
        name: of the hand, for the log; empty for the address.
        model: a Model or its name; None for the model of the address.
    """
    if isinstance(address, str):
        parsed = parse_address(address)
        names_unit = registers["device_id"] is not None
        parsed = with_model(parsed, model)
        if parsed.kind == "urcap":
            check_urcap(parsed, registers)
        make = {"urcap": _over_urcap, "tunnel": _through_a_tunnel}.get(parsed.kind, _over_modbus)
        return make(parsed, registers_of(parsed, **registers), names_unit, name)
    if isinstance(address, Tunnel):
        shown = Address("tunnel", f"<{type(address).__name__} at {id(address):#x}>")
        shown = with_model(shown, model)
        return _through(address, shown, registers_of(shown, **registers), name)
    raise TypeError(f"address must be a string or a Tunnel, got {repr_of(address)}")


def with_model(address: Address, model: object) -> Address:
    """An address with the model of its gripper; None leaves it as it is."""
    if model is None:
        return address
    found = model_of(model)
    if address.model not in (None, found):
        raise ValueError(f"model {found.name} contradicts the address {address}")
    return address if found is THREE_FINGER else replace(address, model=found)


def _over_modbus(address: Address, registers: RegisterMap, names_unit: bool, name: str) -> GripperLink:
    model = model_of(address.model)
    if address.kind == "sim":
        simulated = new_gripper(address.simulation, model)
        shown = named(simulated, address)
        make = partial(SimulatedTransport, simulated, registers)
        return GripperLink(shown, partial(Gripper, shown), make, model=model, stroke=address.stroke)
    # On a gateway each hand has its own connection. On a serial line, where replies carry no number, the
    # hands of an event loop share one.
    unit = registers.device_id if names_unit else None
    hint = _ON_ONE_LINE if address.is_rtu else _BEHIND_GATEWAY  # for users who meant two grippers
    shares_line = address.is_rtu and names_unit
    return GripperLink(
        str(address),
        lambda: Gripper(canonical_address(address), unit, hint, shares_line),
        partial(ModbusTransport, address, registers, shares_line=shares_line, log=Log(name or str(address))),
        address.is_rtu,
        model,
        stroke=address.stroke,
    )


def _through_a_tunnel(address: Address, registers: RegisterMap, names_unit: bool, name: str) -> GripperLink:
    # Made with the hand: it imports a package, for which a running loop would wait.
    tunnel = tunnel_to(address, registers.device_id)
    return _through(tunnel, address, registers, name, registers.device_id if names_unit else None)


def _through(
    tunnel: Tunnel, address: Address, registers: RegisterMap, name: str, unit: int | None = None
) -> GripperLink:
    return GripperLink(
        str(address),
        lambda: Gripper(canonical_address(address), unit, _TUNNEL),
        partial(ModbusTransport, address, registers, tunnel=tunnel, log=Log(name or str(address))),
        is_slow=True,
        model=model_of(address.model),
        stroke=address.stroke,
    )


def _over_urcap(address: Address, registers: RegisterMap, names_unit: bool, name: str) -> GripperLink:
    chosen = registers.device_id if names_unit else None
    return GripperLink(
        str(address),
        lambda: Gripper(canonical_address(address), chosen, _BEHIND_URCAP),
        partial(UrcapTransport, address, chosen, log=Log(name or str(address))),
        is_slow=True,
        model=model_of(address.model),
        stroke=address.stroke,
    )


@dataclass(slots=True, eq=False)
class _Claim(Generic[T]):
    gripper: Callable[[], Gripper]
    owner: T
    loop: asyncio.AbstractEventLoop


class Claims(Generic[T, L]):
    """Grippers with their owners, and the legacy of the last owner of each for the next. Thread-safe.

    The legacy of the last :data:`MOST_LEFT` grippers is kept.
    """

    def __init__(self) -> None:
        self._claiming = threading.Lock()
        self._claims: dict[T, _Claim[T]] = {}
        self._left: OrderedDict[Gripper, L] = OrderedDict()  # the newest last

    def claim(self, gripper: Callable[[], Gripper], owner: T, is_over: Callable[[T], bool]) -> T | None:
        """Claim a gripper for the running loop; return its present owner, or None.

        Args:
            gripper: identifies it; called again for each later claim, because a serial port may be renamed.
            owner: the new owner.
            is_over: whether an owner in this loop has ended without a release.
        """
        here = asyncio.get_running_loop()
        with self._claiming:
            wanted = gripper()
            for each in list(self._claims.values()):
                if each.loop.is_closed() or (each.loop is here and is_over(each.owner)):
                    self.release(each.owner)
                elif _conflict(each.gripper(), wanted, is_here=each.loop is here):
                    return each.owner
            self._claims[owner] = _Claim(gripper, owner, here)
        return None

    def release(self, owner: T, left: L | None = None) -> None:
        """Give up a claim, and leave something for the next owner. Takes no lock: any thread may call it."""
        claim = self._claims.pop(owner, None)
        if claim is not None and left is not None:
            gripper = claim.gripper()
            self._left[gripper] = left
            self._left.move_to_end(gripper)
            if len(self._left) > MOST_LEFT:
                self._left.popitem(last=False)

    def left(self, gripper: Gripper) -> L | None:
        """The legacy of the last owner of a gripper."""
        newest_first = reversed([*self._left.items()])
        return next((left for each, left in newest_first if each.may_be(gripper)), None)


def _conflict(owned: Gripper, wanted: Gripper, *, is_here: bool) -> bool:
    """Whether the hand of a gripper keeps another from a hand; ``is_here``: both are in one event loop."""
    is_line = owned.place == wanted.place and (owned.is_on_line or wanted.is_on_line)
    # A socket carries Modbus TCP or the frames of a serial line, not both.
    can_share = is_here and owned.is_on_line and wanted.is_on_line
    return owned.may_be(wanted) or (is_line and not can_share)
