"""``robotiq-async ports``."""

from __future__ import annotations

from ...link.serial_ports import names_of_adapters
from ...runtime.log import printable
from ..arguments import need
from ..failures import CommandError


def ports() -> None:
    """List the serial ports of this machine, each as the address of a gripper.

    Opens none of them. A USB adapter has a second address on Linux, which stays the same
    when it is plugged in elsewhere. Exits with 1 when there is no port.

    For example:

        robotiq-async ports
        robotiq-async doctor "rtu:///dev/ttyUSB0?model=2f85"
    """
    need("serial", "serial")
    from serial.tools import list_ports

    found = sorted(list_ports.comports(), key=lambda port: port.device)
    if not found:
        raise CommandError("this machine has no serial port: is the adapter plugged in?")
    steady = names_of_adapters()
    width = max(len(port.device) for port in found)
    for port in found:
        what = port.description if port.description not in (None, "n/a") else ""
        print(f"rtu://{port.device:<{width}}  {printable(what)}".rstrip())
        if port.device in steady:
            print(f"rtu://{steady[port.device]}")
