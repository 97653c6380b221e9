"""Serial ports: why one cannot be opened, and the names and the latency timer of USB adapters."""

from __future__ import annotations

import contextlib
import errno
import os
from pathlib import Path
from typing import Final

MISSING: Final = "there is no such device; is it plugged in?"
FORBIDDEN: Final = "not allowed to open it; is this user in its group (ls -l; on Linux often dialout)?"
TAKEN: Final = "another program has opened it"
NO_PORT: Final = "it is not a serial port"
GONE: Final = "the port is gone, or another program reads from it"

USB_SERIAL: Final = Path("/sys/bus/usb-serial/devices")  # where Linux has a folder for each USB adapter
BY_ID: Final = Path("/dev/serial/by-id")  # where Linux has a link to each USB adapter, by its name

_WHY: Final = {
    **dict.fromkeys((errno.ENOENT, errno.ENODEV, errno.ENXIO, errno.ENOTDIR), MISSING),
    **dict.fromkeys((errno.EACCES, errno.EPERM), FORBIDDEN),
    # pyserial locks the port: another that does so too finds it locked.
    **dict.fromkeys((errno.EBUSY, errno.EAGAIN), TAKEN),
    **dict.fromkeys((errno.ENOTTY, errno.EINVAL, errno.EISDIR), NO_PORT),
}
_ON_WINDOWS: Final = {"FileNotFoundError(": MISSING, "PermissionError(": TAKEN}
"""On Windows pyserial writes the system's error into its message, and gives no number. A port is opened for
one program alone, and the next program is denied access."""


def why_no_port(error: OSError | None, folder: Path = BY_ID) -> str:
    """Readable reason why a serial port cannot be opened. ``error`` is pyserial's, or None."""
    if error is None:
        return "cannot open the serial port"
    # For a port that it cannot configure, pyserial gives no number; its context, the error of termios, does.
    numbers = (error.errno, *getattr(error.__context__, "args", ()))
    known = [_WHY[each] for each in numbers if isinstance(each, int) and each in _WHY]
    if error.errno is None:
        known += [why for name, why in _ON_WINDOWS.items() if name in str(error)]
    why = known[0] if known else f"cannot open the serial port: {error}"
    adapters = names_of_adapters(folder) if why is MISSING else {}
    return f"{why} These are: {', '.join(sorted(adapters))}" if adapters else why


def names_of_adapters(folder: Path = BY_ID) -> dict[str, str]:
    """For the device of each plugged-in USB adapter, the path that names the adapter (Linux)."""
    with contextlib.suppress(OSError):
        return {os.path.realpath(path): str(path) for path in sorted(folder.iterdir())}
    return {}


def hasten(port: object) -> None:
    """Switch a USB adapter to low latency, where the system can do that.

    An FTDI adapter holds received bytes back for its latency timer, by default 16 ms, which triples the time
    of a read; in low-latency mode 1 ms (Linux). Other ports have no such mode.
    """
    with contextlib.suppress(AttributeError, NotImplementedError, OSError, ValueError):
        port.set_low_latency_mode(True)  # type: ignore[attr-defined]


def latency_timer(device: str, folder: Path = USB_SERIAL) -> int | None:
    """Milliseconds for which the adapter of a port holds received bytes back; None if unknown."""
    with contextlib.suppress(OSError, ValueError):
        return int(latency_file(device, folder).read_text())
    return None


def latency_file(device: str, folder: Path = USB_SERIAL) -> Path:
    """The file in which the latency timer of a port can be read and set."""
    return folder / os.path.basename(os.path.realpath(device)) / "latency_timer"
