"""Output below Python's buffers: at its end the interpreter would wait for whoever writes to one of those."""

from __future__ import annotations

import os


def write_all(descriptor: int, data: bytes) -> None:
    """Write all of it. Blocks for as long as the other side takes: call it in a thread.

    Raises:
        OSError: it cannot be written.
    """
    left = memoryview(data)
    while left:
        left = left[os.write(descriptor, left) :]
