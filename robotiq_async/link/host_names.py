"""What the name of a host stands for, and why nobody can be reached.

The event loop's own look-up runs in threads that ``asyncio.run`` waits for at its end, and a resolver that
does not answer keeps one for ten seconds and more, long after whoever asked has given up.
"""

from __future__ import annotations

import contextlib
import errno
import os
import socket
from ipaddress import ip_address

from ..runtime.concurrency import in_a_thread


async def addresses_of(host: str, port: int) -> list[str]:
    """The numeric addresses of a host, in the order in which they are to be tried.

    It ends when the resolver does, or when it is cancelled: bound it.

    Raises:
        OSError: it cannot be resolved.
        UnicodeError: it can be no name.
    """
    with contextlib.suppress(ValueError):
        ip_address(host)
        return [host]
    found = await in_a_thread(lambda: socket.getaddrinfo(host, port, type=socket.SOCK_STREAM))
    return list(dict.fromkeys(str(each[4][0]) for each in found))


def why_unreachable(error: OSError | None) -> str:
    """Why there is no connection to a host, from the last attempt; None if nothing is known of it."""
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
    """Why no socket can be made in this program; empty when one can."""
    try:
        socket.socket().close()
    except OSError as error:
        return error.strerror or str(error)
    return ""
