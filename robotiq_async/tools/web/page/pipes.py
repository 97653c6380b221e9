"""Pipes: the messages between the process of the page and the one that has the hands."""

from __future__ import annotations

import json
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from typing import Any, BinaryIO


class Pipes:
    """The two pipes to the process that has the hands; each message is a line of JSON."""

    def __init__(self) -> None:
        self._out: BinaryIO = os.fdopen(os.dup(1), "wb", buffering=0)
        os.dup2(2, 1)
        self._in = sys.stdin.buffer

    def say(self, message: dict[str, Any]) -> None:
        """Send a message; ignored if the other process has gone, because this one then ends, too."""
        with suppress(OSError):
            self._out.write(json.dumps(message).encode() + b"\n")

    def first_line(self) -> bytes:
        """The settings; empty if the pipe has ended."""
        return self._in.readline()

    def lines(self) -> Iterator[bytes]:
        """The following lines, to the end. Blocks."""
        return iter(self._in.readline, b"")
