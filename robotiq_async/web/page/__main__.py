"""The process of the page: its settings come as the first line, then what is newest, until the end."""

from __future__ import annotations

import os
import signal
import socket
import sys
from contextlib import suppress
from tempfile import mkdtemp

from ..settings import PageSettings
from .pipes import Pipes


def main() -> int:
    """Serve until standard input ends; returns the exit code."""
    # A Ctrl-C in a terminal is for the process that has the hands: it ends this one when it has stopped them.
    for name in ("SIGINT", "SIGHUP"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(5)  # the hand comes first
    # NiceGUI remembers visitors in files, if it is asked to; it is not, but it looks for them at once.
    os.environ["NICEGUI_STORAGE_PATH"] = mkdtemp(prefix="robotiq_async-")
    pipes = Pipes()
    line = pipes.first_line()
    if not line:
        return 1
    settings = PageSettings.read(line)
    try:
        listening = _listen(settings)
    except OSError as error:
        pipes.say({"failed": f"{settings.host}:{settings.port}: {error.strerror or error}"})
        return 1
    try:
        from .serve import run  # noqa: PLC0415  # a second, which a port that is taken need not wait for

        run(settings, listening, pipes)
    except OSError as error:  # a certificate that cannot be read
        pipes.say({"failed": f"{settings.certificate or settings.host}: {error.strerror or error}"})
        return 1
    finally:
        with suppress(OSError):
            os.rmdir(os.environ["NICEGUI_STORAGE_PATH"])
    return 0


def _listen(settings: PageSettings) -> socket.socket:
    family, kind, _, _, address = socket.getaddrinfo(
        settings.host, settings.port, type=socket.SOCK_STREAM, flags=socket.AI_PASSIVE
    )[0]
    listening = socket.socket(family, kind)
    try:
        if os.name == "posix":  # elsewhere it would let two servers have one port
            listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listening.bind(address)
        listening.listen(64)
    except OSError:
        listening.close()
        raise
    return listening


if __name__ == "__main__":
    sys.exit(main())
