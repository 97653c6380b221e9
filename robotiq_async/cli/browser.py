"""Opens a page in the browser of this machine."""

from __future__ import annotations

import asyncio
import os
import sys
import webbrowser
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from html import escape
from pathlib import Path
from tempfile import mkstemp
from typing import Final

from ..runtime import in_a_thread

OPEN_S: Final = 1.0
"""Maximum wait for the browser: some return only when they are closed."""
REDIRECT: Final = '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={0}">'


@asynccontextmanager
async def opened(url: str, opener: Callable[[str], bool] = webbrowser.open) -> AsyncIterator[bool]:
    """Open a page during a block; yields whether a browser was started.

    Without a screen it opens nothing: Python would start a text browser in this terminal.
    """
    file = _redirect_file(url) if _has_screen() else None
    if file is None:
        yield False
        return
    try:
        opening = in_a_thread(lambda: opener(file.as_uri()))
        await asyncio.wait({opening}, timeout=OPEN_S)
        yield not opening.done() or (opening.exception() is None and opening.result())
    finally:
        with suppress(OSError):
            file.unlink()


def _redirect_file(url: str) -> Path | None:
    # The URL contains the token, and every user of the machine can read the arguments of a process. The file
    # is in the home folder, not hidden: browsers in a snap see neither hidden folders nor the temporary one.
    try:
        descriptor, name = mkstemp(".html", "robotiq-async-", Path.home())
    except (OSError, RuntimeError):
        return None
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        file.write(REDIRECT.format(escape(url)))
    return Path(name)


def _has_screen() -> bool:
    if not sys.platform.startswith("linux"):
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
