"""Messages of a command beside its output."""

from __future__ import annotations

import sys

from ...runtime.log import printable


def tell(words: str) -> None:
    """Print a line on stderr. Makes text of clients and agents printable."""
    print("robotiq-async:", printable(words), file=sys.stderr, flush=True)
