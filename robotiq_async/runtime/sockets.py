"""Listening sockets, and the test whether a host is this machine."""

from __future__ import annotations

import socket
import sys
from ipaddress import ip_address


def is_loopback(host: str) -> bool:
    """Whether only programs on this machine reach a socket that listens on this host."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def listen(host: str, port: int) -> socket.socket:
    """A listening socket that no other program shares; port 0 takes a free one."""
    family, kind, _, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listening = socket.socket(family, kind)
    try:
        if sys.platform != "win32":  # there it would let two servers share a port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(16)
    except OSError:
        listening.close()
        raise
    return listening
