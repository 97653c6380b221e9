"""A slider whose value is the browser's."""

from __future__ import annotations

from nicegui import ui


class Slider(ui.slider):
    """Keeps its value in the browser: an answer of the server would set back one that has moved on."""

    LOOPBACK = False
