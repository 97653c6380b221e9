"""Stage 0: this computer, and the adapter of a serial line."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Final

from ....link.serial_ports import USB_SERIAL, latency_file, latency_timer
from ....values.statistics import percentile
from ..bench import Bench
from ..catalogue import Figure

TIMERS: Final = 300
SLEEP_S: Final = 0.002
LATE_S: Final = 0.001
KEPT_MS: Final = 2


async def host(bench: Bench, folder: Path = USB_SERIAL) -> None:
    """Measure the timers, and read the latency timer of a serial adapter.

    Args:
        bench: has the address.
        folder: where the system tells of its adapters.
    """
    loop, late = asyncio.get_running_loop(), []
    for _ in range(TIMERS):
        due = loop.time() + SLEEP_S
        await asyncio.sleep(SLEEP_S)
        late.append(loop.time() - due)
    late.sort()
    p99 = percentile(late, 0.99)
    found = f"99 of 100 timers are at most {1000 * p99:.2f} ms late"
    figures: dict[str, Figure] = {
        "p50_ms": 1000 * percentile(late, 0.5),
        "p99_ms": 1000 * p99,
        "worst_ms": 1000 * late[-1],
    }
    if p99 < LATE_S:
        bench.as_assumed("host.timer", found, **figures)
    else:
        follows = "The times below are partly this computer's: let nothing else run on it."
        bench.differs("host.timer", found, follows, **figures)
    _adapter(bench, folder)


def _adapter(bench: Bench, folder: Path) -> None:
    if bench.address.kind != "rtu":
        bench.as_assumed("host.adapter", "there is none: the gripper is reached through a socket")
        return
    kept = latency_timer(bench.address.host, folder)
    if kept is None:
        bench.untold(
            "host.adapter", "the system does not say; only FTDI adapters on Linux have a timer to read"
        )
    elif kept <= KEPT_MS:
        bench.as_assumed("host.adapter", f"passes on what it hears after {kept} ms", latency_ms=kept)
    else:
        file = latency_file("PORT", folder)
        follows = (
            f"Every read waits for that: echo 1 | sudo tee {file}, with PORT as ttyUSB0 or what yours is."
        )
        bench.differs("host.adapter", f"passes on what it hears after {kept} ms", follows, latency_ms=kept)
