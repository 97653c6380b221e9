"""Opens a page in the browser of whoever sits at this machine."""

from __future__ import annotations

import os
import sys
import webbrowser

from ..concurrency import in_a_thread


async def open_page(url: str) -> bool:
    """Open a page if there is a screen; whether a browser was started.

    Without a screen Python would start a browser in the terminal, which has other things to show.
    """
    screens = (os.environ.get("DISPLAY"), os.environ.get("WAYLAND_DISPLAY"))
    if sys.platform.startswith("linux") and not any(screens):
        return False
    return await in_a_thread(lambda: webbrowser.open(url))
