"""The colours of the axes, the same on the page, in plots, in the monitor and in three dimensions.

Each has a contrast of 3 and more with white and with the dark page, as lines and areas need. Text needs 4.5,
which no colour has with both: names stand in the colour of the text, beside a patch of these.
"""

from __future__ import annotations

from types import MappingProxyType
from typing import Final

from ...values import Finger

AXIS_COLORS: Final = MappingProxyType(
    {Finger.A: "#2f7ae5", Finger.B: "#1d9150", Finger.C: "#c96a06", Finger.SCISSOR: "#a04ff0"}
)
