"""What a command says beside its output."""

from __future__ import annotations

import sys

from ...runtime.log import printable


def tell(words: str) -> None:
    """A line on stderr. Some of the words are others': of clients, of agents."""
    print("robotiq-async:", printable(words), file=sys.stderr, flush=True)
