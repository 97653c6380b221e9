"""Output that bypasses Python's buffers: at exit the interpreter would wait for a thread that uses one."""

from __future__ import annotations

import os


def write_all(descriptor: int, data: bytes) -> None:
    """Write all of the data. Blocks until the other side has taken it: call it in a thread.

    Raises:
        OSError: it cannot be written.
    """
    left = memoryview(data)
    while left:
        left = left[os.write(descriptor, left) :]
