"""The process of the page. Reads its settings from the first line of standard input, then updates."""

from __future__ import annotations

import os
import signal
import ssl
import sys
from contextlib import suppress
from tempfile import TemporaryDirectory

from ....runtime import listen
from ..settings import PageSettings
from .pipes import Pipes


def main() -> int:
    """Serve until standard input ends; returns the exit code."""
    # Ctrl-C in a terminal is for the process that has the hands: it stops them, and then ends this one.
    for name in ("SIGINT", "SIGHUP", "SIGBREAK"):
        if hasattr(signal, name):
            signal.signal(getattr(signal, name), signal.SIG_IGN)
    if hasattr(os, "nice"):
        os.nice(5)  # the hand comes first
    _take_files()
    pipes = Pipes()
    line = pipes.first_line()
    if not line:
        return 1
    # NiceGUI can store data of its visitors. We do not use that, but it looks for the folder at once.
    with TemporaryDirectory(prefix="robotiq_async-", ignore_cleanup_errors=True) as folder:
        os.environ["NICEGUI_STORAGE_PATH"] = folder
        return _serve(PageSettings.read(line), pipes)


def _take_files() -> None:
    # A connection that has not shaken hands for https counts for no limit here, but has a file for 60 s.
    with suppress(ImportError, OSError, ValueError):
        import resource  # noqa: PLC0415  # not on Windows

        _, most = resource.getrlimit(resource.RLIMIT_NOFILE)
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, most))


def _serve(settings: PageSettings, pipes: Pipes) -> int:
    try:
        listening = listen(settings.host, settings.port)
    except OSError as error:
        pipes.say({"failed": f"{settings.host}:{settings.port}: {error.strerror or error}"})
        return 1
    try:
        if settings.certificate:
            ssl.create_default_context().load_cert_chain(settings.certificate, settings.key)
        from .serve import run  # noqa: PLC0415  # takes a second; errors come before

        run(settings, listening, pipes)
    except OSError as error:  # a certificate that cannot be read
        pipes.say({"failed": f"{settings.certificate or settings.host}: {error.strerror or error}"})
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
