"""A scripted device on a serial line in virtual time, and a transport that is open to it."""

from __future__ import annotations

from collections.abc import AsyncIterator
from dataclasses import replace

import pytest
import serial

from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.values.model import TWO_FINGER_85
from tests.link.scripted_device import Device, unopened
from tests.virtual_line import VirtualLine


@pytest.fixture
async def device(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Device]:
    """The device at the far end of a line, in virtual time."""
    VirtualLine(monkeypatch)
    device = Device(serial.serial_for_url(VirtualLine.FAR))
    yield device
    device.close()


@pytest.fixture
async def transport(device: Device) -> AsyncIterator[ModbusTransport]:
    """The transport at the near end, open."""
    transport = unopened(VirtualLine.NEAR)
    await transport.open()
    yield transport
    await transport.close()


@pytest.fixture
async def jaw(device: Device) -> AsyncIterator[ModbusTransport]:
    """A transport to a 2F-85 at the near end, not open; function 23 is not tried before it is used."""
    transport = unopened(VirtualLine.NEAR, replace(TWO_FINGER_85.rtu, is_sure=True))
    yield transport
    await transport.close()
