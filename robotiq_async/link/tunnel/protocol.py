"""The contract of a tunnel, and how the address of one leads to it.

An arm carries the serial line at its tool in its own protocol. Who knows that protocol writes a class of
three methods, and a link uses it as a serial line.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Protocol, runtime_checkable

from ...values.checks import repr_of
from ...values.frozen_mapping import FrozenMapping
from ..address import Address, entry_of


@runtime_checkable
class Tunnel(Protocol):
    """A way to one gripper that carries Modbus requests. Pass such an object instead of an address.

    One task makes all calls, one at a time. Blocking work belongs into a thread, and a call must not return
    before that has ended: ``await anyio.to_thread.run_sync(...)`` waits for it, also when it is cancelled.
    ``asyncio.to_thread`` does not, and would carry two requests at a time.
    """

    async def open(self) -> None:
        """Connect. Called again after :meth:`close`.

        It is cancelled after the hand's ``connect_timeout``.

        Raises:
            Exception: there is no way to the gripper; the hand has a ConnectFailedError then.
        """

    async def exchange(self, pdu: bytes) -> bytes:
        """Send a request exactly once, and return the reply to it.

        Both are a PDU of Modbus: function code and data, without unit id and checksum. An exception of the
        gripper is a reply like others; ``bytes((pdu[0] | 0x80, 1))`` is that to a function which cannot be
        carried. The call is cancelled some time after the hand's ``response_timeout``. A reply that comes
        later should be dropped, not returned for the next request.

        Args:
            pdu: a request of function 3, 4, 16 or 23, of 26 bytes at most.

        Raises:
            TimeoutError: the gripper does not answer, and the tunnel stays open; a read is repeated.
            ProtocolError: the reply is not the answer; as above.
            Exception: the tunnel is lost: the hand closes it and opens it again.
        """

    async def close(self) -> None:
        """Disconnect, within half a second; does nothing when closed."""


@dataclass(frozen=True, slots=True)
class TunnelPlace:
    """The parts of a tunnel's address, for the function that makes the tunnel.

    Attributes:
        host: name or IP address.
        port: after the host, or None.
        unit: unit id of the gripper, 1..247: ``device_id``, or the usual one.
        options: those after the question mark that are not for every gripper, as texts.
    """

    host: str
    port: int | None = None
    unit: int = 9
    options: Mapping[str, str] = field(default_factory=dict)

    def __post_init__(self) -> None:
        object.__setattr__(self, "options", FrozenMapping(self.options))


def tunnel_to(address: Address, unit: int) -> Tunnel:
    """The tunnel to an address, as the package that has its scheme makes it. It opens nothing.

    Raises:
        ValueError: the package cannot be loaded, or refuses the address.
    """
    found = entry_of(address.scheme)
    assert found is not None, "as the address was parsed"
    place = TunnelPlace(address.host, address.port or None, unit, dict(address.options))
    try:
        tunnel = found.load()(place)
    except Exception as error:
        why = str(error) if isinstance(error, ValueError) else repr(error)
        raise ValueError(f"{address}: {found.value} makes no tunnel: {why}") from error
    if not isinstance(tunnel, Tunnel):
        what = f"an object with open, exchange and close, got {repr_of(tunnel)}"
        raise ValueError(f"{address}: {found.value} must return {what}")
    return tunnel
