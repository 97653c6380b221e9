"""Why a serial port cannot be opened, for a person."""

from __future__ import annotations

import errno
from typing import Final

MISSING: Final = "there is no such device; is it plugged in?"
FORBIDDEN: Final = "not allowed to open it; is this user in its group (ls -l; on Linux often dialout)?"
TAKEN: Final = "another program has opened it"
NO_PORT: Final = "it is no serial port"

_WHY: Final = {
    **dict.fromkeys((errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR), MISSING),
    **dict.fromkeys((errno.EACCES, errno.EPERM), FORBIDDEN),
    # pyserial locks the port: another that does so too finds it locked.
    **dict.fromkeys((errno.EBUSY, errno.EAGAIN), TAKEN),
    **dict.fromkeys((errno.ENOTTY, errno.EINVAL, errno.EISDIR), NO_PORT),
}


def why_no_port(error: OSError | None) -> str:
    """Why a serial port cannot be opened, from what pyserial has raised; None if that is not known."""
    if error is None:
        return "cannot open the serial port"
    # Of a port that it cannot configure pyserial gives no number; the error of termios, its context, has it.
    numbers = (error.errno, *getattr(error.__context__, "args", ()))
    return next(
        (_WHY[each] for each in numbers if isinstance(each, int) and each in _WHY),
        f"cannot open the serial port: {error}",
    )
