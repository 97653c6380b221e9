"""A simulated gripper as a client before has left it, for tests that are not about the activation."""

from __future__ import annotations

import time
from typing import Any

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.wire.request import AxisRequest, Request

_ACTIVATION_S = 10.0
"""Simulated seconds that are more than enough for one."""


def active_gripper(speedup: float = 4.0, **options: Any) -> SimulatedGripper:
    """One that is active and open, without the second that this takes where motions can be watched.

    Its clock is the system's, put ahead by what was skipped.
    """
    ahead = 0.0
    gripper = SimulatedGripper(lambda: time.monotonic() + ahead, speedup=speedup, **options)
    axes = (AxisRequest(0, 255, 64),) * 3 + (AxisRequest(128, 255, 64),)
    gripper.write(0, Request(activate=True, axes=axes).registers)
    ahead = _ACTIVATION_S / speedup
    return gripper
