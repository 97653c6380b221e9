"""What all ways to write an address have in common, as far as that is known without asking anybody."""

from __future__ import annotations

import contextlib
import os
import re
import socket
import stat
from ipaddress import IPv6Address
from typing import Final

from .address import Address

HERE: Final = "localhost"


def canonical_address(address: Address) -> str:
    """Where an address leads, the same for all ways to write it.

    Whatever means this machine is localhost. The links to a serial port are that port, at this moment. A
    socket is the same place whatever is spoken there.
    """
    host = _serial_port(address.host) if address.kind == "rtu" else _host(address.host)
    return f"{'tcp' if address.is_socket else address.kind}://{host}:{address.port}"


def _host(host: str) -> str:
    """A host in one way to write it. Names are not looked up."""
    if ":" in host:
        number, _, zone = host.partition("%")
        address = IPv6Address(number)
        if address.ipv4_mapped is None:
            if address.is_loopback or address.is_unspecified:
                return HERE
            # Only these belong to an interface.
            return f"{address}%{_interface(zone)}" if address.is_link_local else str(address)
        host = str(address.ipv4_mapped)
    name = host.removesuffix(".")
    # Who connects to 0.0.0.0 or :: gets this machine. Other addresses in 127.0.0.0/8 are others.
    return HERE if name in (HERE, "127.0.0.1", "0.0.0.0") or name.endswith(f".{HERE}") else name


def _interface(zone: str) -> str:
    """The number of a network interface; what is written if there is no such interface."""
    with contextlib.suppress(OSError):
        return str(socket.if_nametoindex(zone))
    return str(int(zone)) if zone.isdecimal() else zone


def _serial_port(device: str) -> str:
    """A serial port in one way to write it: the number of a device that is there, else its path."""
    windows = re.fullmatch(r"(?:\\\\[.?]\\)?(com[0-9]+)", device, re.IGNORECASE)
    if windows is not None:
        return windows[1].upper()
    with contextlib.suppress(OSError):
        found = os.stat(device)
        if stat.S_ISCHR(found.st_mode):
            return f"device {os.major(found.st_rdev)}:{os.minor(found.st_rdev)}"
    return os.path.realpath(device)
