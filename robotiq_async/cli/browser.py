"""Opens a page in the browser of whoever sits at this machine."""

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

from ..runtime.concurrency import in_a_thread

OPEN_S: Final = 1.0
"""Some browsers are only done with opening a page when somebody closes them."""
DOOR: Final = '<!doctype html><meta charset="utf-8"><meta http-equiv="refresh" content="0; url={0}">'


@asynccontextmanager
async def opened(url: str, opener: Callable[[str], bool] = webbrowser.open) -> AsyncIterator[bool]:
    """Open a page while a block runs; whether a browser was started.

    Without a screen Python would start a browser in the terminal, which has other things to show.
    """
    file = _door(url) if _has_screen() else None
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


def _door(url: str) -> Path | None:
    """A file that leads to a page, and that only this user reads; None if the home folder takes none.

    What a browser is started with is there for every user of the machine to read, and the token of the page
    is no business of theirs. The file has a name that shows, and lies where the user's own do: browsers that
    come as a snap see neither hidden folders nor the temporary one.
    """
    try:
        descriptor, name = mkstemp(".html", "robotiq-async-", Path.home())
    except (OSError, RuntimeError):
        return None
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        file.write(DOOR.format(escape(url)))
    return Path(name)


def _has_screen() -> bool:
    if not sys.platform.startswith("linux"):
        return True
    return any(os.environ.get(name) for name in ("DISPLAY", "WAYLAND_DISPLAY"))
