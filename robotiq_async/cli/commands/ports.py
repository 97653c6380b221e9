"""``robotiq-async ports``."""

from __future__ import annotations

from contextlib import suppress
from typing import TYPE_CHECKING

from ...link import MISSING, names_of_adapters
from ...runtime import printable
from ...values import RobotiqError
from ..arguments import need
from ..failures import CommandError

if TYPE_CHECKING:
    from serial.tools.list_ports_common import ListPortInfo


def ports() -> None:
    """List the serial ports of this machine, each as the address of a gripper.

    Opens none of them. A USB adapter has a second address on Linux, which stays the same
    when it is plugged in elsewhere. Exits with 1 when there is no port.

    For example:

        robotiq-async ports
        robotiq-async doctor "rtu:///dev/ttyUSB0?model=2f85"
    """
    need("serial", "serial")
    found = _found()
    if not found:
        raise CommandError("this machine has no serial port: is the adapter plugged in?")
    steady = names_of_adapters()
    width = max(len(port.device) for port in found)
    for port in found:
        what = port.description if port.description not in (None, "n/a") else ""
        print(f"rtu://{port.device:<{width}}  {printable(what)}".rstrip())
        if port.device in steady:
            print(f"rtu://{steady[port.device]}")


def with_ports(error: RobotiqError) -> str:
    """The message of an error; if a serial port is missing, with the present ports."""
    message = str(error)
    if not message.endswith(MISSING):  # it is about something else, or names the adapters
        return message
    with suppress(ImportError, CommandError):  # the error in hand is the news
        if found := _found():
            return f"{message} These are: {', '.join(port.device for port in found)}"
    return message


def _found() -> list[ListPortInfo]:
    from serial.tools import list_ports

    try:
        return sorted(list_ports.comports(), key=lambda port: port.device)
    except Exception as error:  # drivers answer with anything
        raise CommandError(f"the serial ports of this machine cannot be listed: {error!r}") from error
