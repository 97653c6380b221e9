"""One spelling for all ways to write an address, without asking a name server."""

from __future__ import annotations

import contextlib
import os
import re
import socket
import stat
import sys
from ipaddress import IPv6Address
from typing import Final

from .address import Address, own_options

HERE: Final = "localhost"


def canonical_address(address: Address) -> str:
    """One spelling of an address: equal strings for equal places.

    Every spelling of this machine becomes localhost. A symbolic link to a serial port becomes that port. A
    socket is the same place with any protocol. The meaning of a tunnel's options is not known: with others it
    is another place.
    """
    host = _serial_port(address.host) if address.kind == "rtu" else _host(address.host)
    scheme = "tcp" if address.is_socket else address.scheme or address.kind
    return f"{scheme}://{host}:{address.port}{own_options(sorted(address.options))}"


def _host(host: str) -> str:
    """One spelling of a host. Names are not resolved."""
    if ":" in host:
        number, _, zone = host.partition("%")
        address = IPv6Address(number)
        if address.ipv4_mapped is None:
            if address.is_loopback or address.is_unspecified:
                return HERE
            # Only link-local addresses depend on an interface.
            return f"{address}%{_interface(zone)}" if address.is_link_local else str(address)
        host = str(address.ipv4_mapped)
    name = host.removesuffix(".")
    # Connecting to 0.0.0.0 or :: reaches this machine. Other addresses in 127.0.0.0/8 are other places.
    return HERE if name in (HERE, "127.0.0.1", "0.0.0.0") or name.endswith(f".{HERE}") else name


def _interface(zone: str) -> str:
    """The number of a network interface; its name as given if it does not exist."""
    with contextlib.suppress(OSError):
        return str(socket.if_nametoindex(zone))
    return str(int(zone)) if zone.isdecimal() else zone


def _serial_port(device: str) -> str:
    """One spelling of a serial port: the device number if it exists, else its path."""
    windows = re.fullmatch(r"(?:\\\\[.?]\\)?(com[0-9]+)", device, re.IGNORECASE)
    if windows is not None:
        return windows[1].upper()
    with contextlib.suppress(OSError):
        found = os.stat(device)
        if sys.platform != "win32" and stat.S_ISCHR(found.st_mode):
            return f"device {os.major(found.st_rdev)}:{os.minor(found.st_rdev)}"
    return os.path.realpath(device)
