"""Parts of any hand: its calls and their checks, options, streams, waits, statistics."""

from .base import Hand

__all__ = ["Hand"]
