"""The library's logger: never raises, one line a message, each beginning with the name of the hand.

A handler of the application that raises (a full disk, a closed stream) must not end the task that owns the
link or keep it from stopping the fingers. Messages can contain text from grippers and network clients: such
text can neither forge a line of the log nor send control sequences to a terminal.
"""

from __future__ import annotations

import logging
import sys
import traceback
from typing import Any, Final


class Log(logging.LoggerAdapter[logging.Logger]):
    """The log of one hand. Each message begins with its name; each record has it as attribute ``hand``.

    Attributes:
        hand: the name; empty for messages about no particular hand.
    """

    def __init__(self, hand: str = "") -> None:
        super().__init__(logging.getLogger("robotiq_async"), {"hand": hand})
        self.hand = hand

    def log(self, level: int, msg: object, *args: object, **kwargs: Any) -> None:  # noqa: ANN401  # as the base class has it
        """Log a message; print an error of a handler to stderr, as the logging module does."""
        if not self.isEnabledFor(level):
            return
        if self.hand:
            # As an argument, because a name can contain a percent sign.
            msg, args = f"%s: {msg}", (self.hand, *args)
        try:
            super().log(level, msg, *args, **{"stacklevel": 2} | kwargs)
        except Exception:  # noqa: BLE001  # a handler may raise anything
            if logging.raiseExceptions and sys.stderr is not None:
                traceback.print_exc()


def printable(text: str) -> str:
    """The text with control characters written as Python escapes."""
    return text if text.isprintable() else "".join(map(_printable, text))


def _printable(character: str) -> str:
    return character if character.isprintable() else ascii(character)[1:-1]


def _in_one_line(record: logging.LogRecord) -> bool:
    """A logging filter that passes every record and turns its message into one line."""
    message = record.getMessage()
    if not message.isprintable():
        record.msg, record.args = printable(message), None
    return True


log: Final = Log()  # for messages about no particular hand
logging.getLogger("robotiq_async").addFilter(_in_one_line)
