"""Resolves host names, and explains why a host cannot be reached.

The event loop's own look-up uses threads that ``asyncio.run`` waits for at its end. A resolver that does not
answer keeps such a thread for ten seconds and more, long after the caller has given up.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from ipaddress import ip_address

from .concurrency import in_a_thread


async def addresses_of(host: str, port: int) -> list[str]:
    """The numeric addresses of a host, in the order in which to try them.

    It can take as long as the resolver: limit its time.

    Raises:
        OSError: the name cannot be resolved.
        UnicodeError: not a host name.
    """
    with contextlib.suppress(ValueError):
        ip_address(host)
        return [host]
    found = await in_a_thread(lambda: socket.getaddrinfo(host, port, type=socket.SOCK_STREAM))
    return list(dict.fromkeys(str(each[4][0]) for each in found))


def why_unreachable(error: OSError | None) -> str:
    """Readable reason for a failed connection. ``error`` is from the last attempt, or None."""
    match error.errno if error is not None else None:
        case errno.ECONNREFUSED:
            return "connection refused: nothing listens there"
        case errno.EHOSTUNREACH:
            return "host unreachable: no such address answers in its network"
        case errno.ENETUNREACH:
            return "network unreachable: this computer has no way to it"
        case None:
            return f"connection refused or host unreachable: {error or 'no reason is known'}"
        case number:
            return os.strerror(number)


def why_no_socket() -> str:
    """Readable reason why this program cannot create a socket; empty if it can."""
    try:
        socket.socket().close()
    except OSError as error:
        return error.strerror or str(error)
    return ""
