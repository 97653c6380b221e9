"""Serves the page with NiceGUI and uvicorn, until the other process closes the pipe."""

from __future__ import annotations

import asyncio
import socket
import threading
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from typing import Final

import uvicorn
from fastapi import FastAPI
from nicegui import ui
from uvicorn.protocols.http.h11_impl import H11Protocol

from ..settings import PageSettings
from .access import Access
from .guard import Guard
from .mirror import PageMirror
from .pages import register
from .pipes import Pipes

BEAT_S: Final = 0.25
HEAD_S: Final = 5.0  # seconds for the head of the first request of a connection
MOST_CONNECTIONS: Final = 200
"""Connections at a time: half of the usual limit of files, and enough for thirty browsers."""
MESSAGE_MAX: Final = 65_536
"""Limit of a websocket message in bytes."""


class _PageConnection(H11Protocol):
    """A connection that has to send a request soon. Strangers must not keep browsers away.

    If there are too many, the oldest without a request is closed: a browser sends its request at once.
    """

    since = 0.0

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]  # as in the base
        super().connection_made(transport)
        self.since = self.loop.time()
        if len(self.connections) > MOST_CONNECTIONS:
            silent = [
                each for each in self.connections if isinstance(each, _PageConnection) and each.is_silent
            ]
            min(silent, key=lambda each: each.since, default=self).transport.abort()
        self.loop.call_later(HEAD_S, self._close_if_silent)

    @property
    def is_silent(self) -> bool:
        return self.cycle is None and not self.transport.is_closing()

    def _close_if_silent(self) -> None:
        if self.is_silent and self in self.connections:  # else it is another protocol's, or lost
            self.transport.abort()


class _UvicornServer(uvicorn.Server):
    """A server that leaves signals alone, and reports when it serves."""

    def __init__(self, config: uvicorn.Config) -> None:
        super().__init__(config)
        self.serving = asyncio.Event()

    @contextmanager
    def capture_signals(self) -> Iterator[None]:
        yield

    def end(self) -> None:
        # At once: do not wait until every browser has closed its page.
        self.should_exit = self.force_exit = True

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await super().startup(sockets)
        self.serving.set()


def run(settings: PageSettings, listening: socket.socket, pipes: Pipes) -> None:
    """Serve the page until the pipe ends.

    Raises:
        OSError: a certificate that cannot be used.
    """
    mirror = PageMirror(
        settings.addresses,
        control=settings.control,
        say=pipes.say,
        speed=settings.speed,
        force=settings.force,
    )
    port = listening.getsockname()[1]
    config = uvicorn.Config(
        Guard(_application(settings, mirror), Access(settings, port)),
        http=_PageConnection,  # h11: httptools accepts any number of headers
        proxy_headers=False,
        log_level="critical",
        access_log=False,
        server_header=False,
        timeout_graceful_shutdown=1,
        ws_max_size=MESSAGE_MAX,
        ssl_certfile=settings.certificate or None,
        ssl_keyfile=settings.key or None,
    )
    config.load()
    asyncio.run(_serve(config, listening, mirror, pipes))


def _application(settings: PageSettings, mirror: PageMirror) -> FastAPI:
    app = FastAPI(docs_url=None, redoc_url=None, openapi_url=None)
    register(mirror)
    ui.run_with(
        app,
        mount_path=settings.folder,
        title="Robotiq gripper",
        dark=None,
        show_welcome_message=False,
        binding_refresh_interval=None,
    )
    return app


async def _serve(config: uvicorn.Config, listening: socket.socket, mirror: PageMirror, pipes: Pipes) -> None:
    server, loop = _UvicornServer(config), asyncio.get_running_loop()
    threading.Thread(target=_hear, args=(pipes, mirror, loop, server), daemon=True).start()
    beating = loop.create_task(_beat(mirror, server, pipes, listening.getsockname()[1]))
    await server.serve(sockets=[listening])
    beating.cancel()


async def _beat(mirror: PageMirror, server: _UvicornServer, pipes: Pipes, port: int) -> None:
    await server.serving.wait()
    pipes.say({"serving": port})
    while True:
        await asyncio.sleep(BEAT_S)
        mirror.beat()


def _hear(pipes: Pipes, mirror: PageMirror, loop: asyncio.AbstractEventLoop, server: _UvicornServer) -> None:
    # In a thread: not every system can wait for a pipe in an event loop.
    with suppress(RuntimeError):  # the loop has been closed
        for line in pipes.lines():
            loop.call_soon_threadsafe(mirror.hear, line)
        loop.call_soon_threadsafe(server.end)
