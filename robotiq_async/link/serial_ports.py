"""Serial ports: why one cannot be opened, for a person, and how long its adapter keeps what it has heard."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from typing import Final

MISSING: Final = "there is no such device; is it plugged in?"
FORBIDDEN: Final = "not allowed to open it; is this user in its group (ls -l; on Linux often dialout)?"
TAKEN: Final = "another program has opened it"
NO_PORT: Final = "it is no serial port"

USB_SERIAL: Final = Path("/sys/bus/usb-serial/devices")
"""Where Linux has a folder for each USB adapter."""

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


def hasten(port: object) -> None:
    """Have a USB adapter pass on what it hears at once, where it can be told so.

    An FTDI adapter keeps what it has heard for its latency timer, 16 ms unless told otherwise, which
    triples the time of a read; in low-latency mode that is 1 ms (Linux). Other ports know no such mode.

    Args:
        port: pyserial's.
    """
    with contextlib.suppress(AttributeError, NotImplementedError, OSError, ValueError):
        port.set_low_latency_mode(True)  # type: ignore[attr-defined]


def latency_timer(device: str, folder: Path = USB_SERIAL) -> int | None:
    """Milliseconds for which the adapter of a port keeps what it has heard; None where none is known.

    Args:
        device: the port, or a link to it.
        folder: where the system tells of its adapters.
    """
    with contextlib.suppress(OSError, ValueError):
        return int(latency_file(device, folder).read_text())
    return None


def latency_file(device: str, folder: Path = USB_SERIAL) -> Path:
    """Where the latency timer of a port can be read and set."""
    return folder / os.path.basename(os.path.realpath(device)) / "latency_timer"
