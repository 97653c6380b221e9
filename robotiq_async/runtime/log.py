"""The library's logger: it never fails, and its messages are one line each and tell which hand it is.

A handler of the application that raises (a full disk, a closed stream) must not end the task that owns the
link, or keep it from stopping the fingers. Some of the words are others': a gripper's, or of clients on the
network. They neither begin a line that looks like one of ours nor steer a terminal.
"""

from __future__ import annotations

import logging
import sys
import traceback
from typing import Any, Final


class Log(logging.LoggerAdapter[logging.Logger]):
    """What is logged about one hand: its messages begin with the name of it, and its records have it.

    Attributes:
        hand: the name; empty for what is about no hand in particular. Every record has it as ``hand``.
    """

    def __init__(self, hand: str = "") -> None:
        """Log about a hand."""
        super().__init__(logging.getLogger("robotiq_async"), {"hand": hand})
        self.hand = hand

    def log(self, level: int, msg: object, *args: object, **kwargs: Any) -> None:  # noqa: ANN401  # as the base class has it
        """Log; what goes wrong with that is shown as the logging module shows it."""
        if not self.isEnabledFor(level):
            return
        if self.hand:
            # As an argument: a name may hold a percent sign.
            msg, args = f"%s: {msg}", (self.hand, *args)
        try:
            super().log(level, msg, *args, **{"stacklevel": 2} | kwargs)
        except Exception:  # noqa: BLE001  # whatever a handler raises
            if logging.raiseExceptions and sys.stderr is not None:
                traceback.print_exc()


def printable(text: str) -> str:
    """A text of others with what steers a terminal written out, as Python does it."""
    return text if text.isprintable() else "".join(map(_printable, text))


def _printable(character: str) -> str:
    return character if character.isprintable() else ascii(character)[1:-1]


def _in_one_line(record: logging.LogRecord) -> bool:
    """A filter that lets everything pass, in one line."""
    message = record.getMessage()
    if not message.isprintable():
        record.msg, record.args = printable(message), None
    return True


log: Final = Log()
"""For what is about no hand in particular."""
logging.getLogger("robotiq_async").addFilter(_in_one_line)
