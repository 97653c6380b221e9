"""Parts of any hand: its calls and their checks, options, streams, waits, statistics."""

from .backend import Backend
from .base import Hand
from .options import (
    ACTIVATION_TIMEOUT_S,
    LATE_POLLS,
    LONGEST_RESPONSE_S,
    LONGEST_SPACING_S,
    POLL_INTERVAL_S,
    RESPONSE_TIMEOUT_S,
    HandOptions,
    Option,
    Place,
    ReconnectPolicy,
    offered,
    units_of,
    usual_write_spacing,
)
from .statistics import Counters, Statistics, percentile
from .streams import Channel, Channels, Listeners, Stream
from .waiting import StateWaiters

__all__ = ["Backend", "Hand"]
__all__ += ["ACTIVATION_TIMEOUT_S", "LATE_POLLS", "LONGEST_RESPONSE_S", "LONGEST_SPACING_S"]
__all__ += ["POLL_INTERVAL_S", "RESPONSE_TIMEOUT_S", "HandOptions", "Option", "Place"]
__all__ += ["ReconnectPolicy", "offered", "units_of", "usual_write_spacing"]
__all__ += ["Counters", "Statistics", "percentile"]
__all__ += ["Channel", "Channels", "Listeners", "Stream"]
__all__ += ["StateWaiters"]
