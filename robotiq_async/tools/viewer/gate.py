"""Stands before a websocket server that asks nobody where they come from, and asks.

A page of any site can make a browser open a websocket to this machine; the browser says so in ``Origin``,
and a server that does not look lets it in. Here a connection is looked at first, and passed on only when it
has no origin (programs have none) or one that was named. The server behind listens where no page looks for
it: on Linux at a random address out of 127.0.0.0/8, anywhere else at a free port of 127.0.0.1.

Everything happens in threads: the loop that polls copies no bytes.
"""

from __future__ import annotations

import random
import socket
import sys
import threading
from collections.abc import Callable, Collection
from contextlib import suppress
from ipaddress import ip_address
from time import monotonic
from typing import Final

HEAD_S: Final = 10.0
"""How long a client may take to say what it wants, all in all."""
HEAD_MAX: Final = 16_384
CONNECTIONS: Final = 64
CHUNK: Final = 65_536
TOLD: Final = 32
"""Origins that are told of: a page may try again and again, and others as many names as it likes."""
REFUSED: Final = b"HTTP/1.1 403 Forbidden\r\nContent-Length: 0\r\nConnection: close\r\n\r\n"


def is_loopback(host: str) -> bool:
    """Whether only programs on this machine reach what listens there."""
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return host.lower() == "localhost"


def hidden_address() -> str:
    """An address of this machine that nobody guesses, where the system has more than one."""
    if not sys.platform.startswith("linux"):
        return "127.0.0.1"
    secret = random.SystemRandom()
    return f"127.{secret.randint(1, 254)}.{secret.randint(1, 254)}.{secret.randint(1, 254)}"


class Gate:
    """Lets connections through to a server.

    Attributes:
        port: where it listens.
    """

    def __init__(
        self,
        host: str,
        port: int,
        behind: tuple[str, int],
        *,
        origins: Collection[str],
        refused: Callable[[str], object],
        left: Callable[[], object],
        head_s: float = HEAD_S,
    ) -> None:
        """Listen, and let through from now on.

        Args:
            host: the interface.
            port: 0 takes a free one.
            behind: address of the server.
            origins: pages of these sites may connect.
            refused: is called, in a thread, with an origin that was refused; once for each.
            left: is called, in a thread, when somebody who was let through has left.
            head_s: how long a client may take to say what it wants.

        Raises:
            OSError: the port is taken, or there is no such interface.
        """
        self._behind = behind
        self._origins = {origin.lower().rstrip("/") for origin in origins}
        self._refused = refused
        self._left = left
        self._head_s = head_s
        self._lock = threading.Lock()
        self._sockets: set[socket.socket] = set()
        self._told: set[str] = set()
        self._slots = threading.BoundedSemaphore(CONNECTIONS)
        self._listening = listen(host, port)
        self.port = int(self._listening.getsockname()[1])
        threading.Thread(target=self._accept, name="robotiq_async gate", daemon=True).start()

    def stop(self) -> None:
        """Close the port and every connection, also those that nobody has accepted yet."""
        with suppress(OSError):
            self._listening.setblocking(False)
            while True:
                self._listening.accept()[0].close()
        _close(self._listening)
        with self._lock:
            sockets, self._sockets = self._sockets, set()
        for each in sockets:
            _close(each)

    def _accept(self) -> None:
        while True:
            try:
                client, _ = self._listening.accept()
            except OSError:
                return
            if not self._slots.acquire(blocking=False):
                client.close()
                continue
            self._keep(client)
            threading.Thread(target=self._serve, args=(client,), daemon=True).start()

    def _serve(self, client: socket.socket) -> None:
        try:
            with suppress(OSError):
                head = _head(client, self._head_s)
                if head is not None and self._may_pass(head):
                    client.settimeout(None)
                    self._pass_on(client, head)
                elif head is not None:
                    client.sendall(REFUSED)
        finally:
            self._forget(client)
            self._slots.release()

    def _may_pass(self, head: bytes) -> bool:
        # Anything else could be followed by a second request, which nobody looks at.
        if [value.lower() for value in _values(head, b"upgrade")] != ["websocket"]:
            return False
        origins = _values(head, b"origin")
        if not origins:
            return True
        if len(origins) == 1 and origins[0].lower() in self._origins:
            return True
        self._tell(", ".join(origins))
        return False

    def _tell(self, origin: str) -> None:
        with self._lock:
            is_new = origin not in self._told and len(self._told) < TOLD
            self._told |= {origin} if is_new else set()
        if is_new:
            self._refused(origin)

    def _pass_on(self, client: socket.socket, head: bytes) -> None:
        server = socket.create_connection(self._behind, HEAD_S)
        server.settimeout(None)
        for each in (client, server):
            each.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._keep(server)
        try:
            server.sendall(head)
            back = threading.Thread(target=_copy, args=(server, client), daemon=True)
            back.start()
            _copy(client, server)
            back.join()
        finally:
            self._forget(server)
            self._left()

    def _keep(self, each: socket.socket) -> None:
        with self._lock:
            self._sockets.add(each)

    def _forget(self, each: socket.socket) -> None:
        with self._lock:
            self._sockets.discard(each)
        _close(each)


def listen(host: str, port: int) -> socket.socket:
    """A socket that listens; nobody else may have the port.

    Raises:
        OSError: the port is taken, or there is no such interface.
    """
    family, kind, _, _, address = socket.getaddrinfo(
        host, port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listening = socket.socket(family, kind)
    try:
        if sys.platform != "win32":  # there it would let two servers have one port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(16)
    except OSError:
        listening.close()
        raise
    return listening


def _head(client: socket.socket, within: float) -> bytes | None:
    """What comes up to the empty line, and what has come after it; None if it never comes."""
    received, until = b"", monotonic() + within
    while b"\r\n\r\n" not in received:
        client.settimeout(max(until - monotonic(), 0.001))
        chunk = client.recv(4096)
        if not chunk or len(received) > HEAD_MAX:
            return None
        received += chunk
    return received


def _values(head: bytes, name: bytes) -> list[str]:
    """The values of a header. A line that is folded belongs to no header: nobody folds lines any more."""
    lines = head.partition(b"\r\n\r\n")[0].replace(b"\r", b"\n").split(b"\n")[1:]
    pairs = (line.partition(b":") for line in lines)
    return [value.strip().decode("latin-1") for key, _, value in pairs if key.strip().lower() == name]


def _copy(source: socket.socket, target: socket.socket) -> None:
    """All that comes, until one of the two ends; then both are."""
    with suppress(OSError):
        while chunk := source.recv(CHUNK):
            target.sendall(chunk)
    for each in (source, target):
        with suppress(OSError):
            each.shutdown(socket.SHUT_RDWR)


def _close(each: socket.socket) -> None:
    """Also when a thread waits in it."""
    with suppress(OSError):
        each.shutdown(socket.SHUT_RDWR)
    each.close()
