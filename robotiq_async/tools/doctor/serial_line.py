"""A serial line: the latency timer of its adapter, and lost bytes."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from ...link.address import Address
from ...link.modbus import ModbusTransport
from ...link.serial_ports import USB_SERIAL, latency_file, latency_timer
from ...link.transport import Link
from .findings import Finding, Level, Report

LATENCY_MS: Final = 2
"""An adapter that keeps bytes for longer delays every read; a hand sets 1 ms."""


def report_adapter(address: Address, report: Report, folder: Path = USB_SERIAL) -> None:
    """Report the latency timer of the USB adapter, if it has one. The port is open.

    Args:
        address: of the port.
        report: called with the finding.
        folder: of the system's USB serial devices.
    """
    kept = latency_timer(address.host, folder)
    if kept is None:
        return
    found = f"passes on received bytes after {kept} ms"
    if kept <= LATENCY_MS:
        report(Finding(Level.GOOD, "adapter", found))
    else:
        file = latency_file(address.host, folder)
        advice = (
            f"This program may not change that: echo 1 | sudo tee {file}, or permanently a udev rule: "
            'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1".'
        )
        report(Finding(Level.DOUBT, "adapter", f"{found}, which delays every read", advice))


def report_damage(link: Link, reads: int, report: Report) -> None:
    """Report reads that had to be repeated."""
    repeats = link.repeats if isinstance(link, ModbusTransport) else 0
    if repeats:
        found = f"{repeats} of {reads} reads had to be repeated: answers get lost or damaged"
        advice = "Look at cable, shield, ground and termination; now and then is usual with USB adapters."
        report(Finding(Level.DOUBT, "line", found, advice))
