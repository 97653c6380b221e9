"""A slider whose value belongs to the browser."""

from __future__ import annotations

from nicegui import ui


class Slider(ui.slider):
    """Keeps its value in the browser: an answer of the server would move it back during a drag."""

    LOOPBACK = False
