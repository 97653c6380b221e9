"""Addresses: one string says which gripper."""

from __future__ import annotations

import contextlib
import os
import socket
from dataclasses import dataclass
from ipaddress import IPv6Address
from typing import Final, Literal

TCP_PORT: Final = 502
"""The port of Modbus TCP, and the gripper's."""

FORMS: Final = (
    "tcp://HOST[:PORT] (or bare HOST or HOST:PORT), "
    "rtu:///dev/ttyUSB0 (a serial port; rtu://COM3 on Windows), sim://"
)


@dataclass(frozen=True, slots=True)
class Address:
    """A checked address.

    Attributes:
        kind: "tcp", "rtu" or "sim".
        host: host name or IP address (tcp), device of the serial port (rtu), empty (sim).
        port: TCP port; 0 for the others.
    """

    kind: Literal["tcp", "rtu", "sim"]
    host: str = ""
    port: int = 0

    @property
    def key(self) -> str:
        """What all addresses of one gripper have in common, as far as that is known without asking anybody.

        127.1 and localhost are 127.0.0.1, and the links to a serial port are that port.
        """
        host = self.host
        if self.kind == "rtu":
            host = os.path.realpath(host)
        elif self.kind == "tcp":
            host = "127.0.0.1" if host == "localhost" else host.removesuffix(".")
            with contextlib.suppress(OSError):
                host = socket.inet_ntoa(socket.inet_aton(host))
        return f"{self.kind}://{host}:{self.port}"

    def __str__(self) -> str:
        """The address in its full form."""
        if self.kind == "tcp":
            host = f"[{self.host}]" if ":" in self.host else self.host
            return f"tcp://{host}:{self.port}"
        return f"{self.kind}://{self.host}"


def parse_address(address: object) -> Address:
    """The address in a string.

    Raises:
        TypeError: not a string.
        ValueError: malformed; the message shows the accepted forms.
    """
    if not isinstance(address, str):
        raise TypeError(f"address must be a string, got {address!r}; accepted: {FORMS}")
    scheme, separator, rest = address.partition("://")
    if not separator:
        scheme, rest = "tcp", address
    if scheme == "sim" and not rest:
        return Address("sim")
    if scheme == "rtu" and rest.strip("/") and rest == rest.strip() and "\0" not in rest:
        return Address("rtu", rest)
    if scheme == "tcp":
        host, port = _host_and_port(rest)
        if host and port is not None:
            return Address("tcp", host, port)
    raise ValueError(f"malformed address {address!r}; accepted: {FORMS}")


def _host_and_port(text: str) -> tuple[str, int | None]:
    """Split HOST, HOST:PORT, [IPv6] or [IPv6]:PORT; the port is None where it is malformed."""
    if text.startswith("["):
        host, bracket, rest = text[1:].partition("]")
        try:
            IPv6Address(host)
        except ValueError:
            return "", None
        if not bracket:
            return "", None
        number, percent, zone = host.partition("%")
        host = number.lower() + percent + zone
        separator, port = rest[:1], rest[1:]
        if rest and separator != ":":
            return "", None
    else:
        host, separator, port = text.partition(":")
        if not set(host) <= _HOST_CHARACTERS or host.startswith((".", "-")):
            return "", None
        host = host.lower()
    if not separator:
        return host, TCP_PORT
    if not (port.isascii() and port.isdigit() and len(port) <= 5 and 1 <= int(port) <= 65535):
        return host, None
    return host, int(port)


_HOST_CHARACTERS: Final = frozenset("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789.-_")
