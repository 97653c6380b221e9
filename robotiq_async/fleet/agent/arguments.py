"""Reading the arguments of a request, which a client may have malformed."""

from __future__ import annotations

from contextlib import suppress
from typing import Final

from ...runtime.log import printable
from ...values.enums import NO_AXES, Finger
from ..wire.envelope import Call
from ..wire.values import Fields

LABEL_MAX: Final = 200
"""Characters of a label that are shown."""


def label_of(call: Call) -> str:
    """What a client calls itself, safe to show to others."""
    return printable(str(call.arguments.get("label", "unknown client"))[:LABEL_MAX])


def axes_of(name: str, arguments: Fields) -> Finger:
    """The axes that a command addresses; all of them by default."""
    masks = arguments.get("axes", {}) if name == "command" else [arguments.get("fingers", 15)]
    axes = NO_AXES
    for mask in masks:
        with suppress(TypeError, ValueError):
            axes |= Finger(int(mask) & 15)
    return axes
