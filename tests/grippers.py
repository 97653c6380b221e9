"""Simulated grippers, active and open as a client before has left them; waiting for what a gripper does."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from typing import Any, Final

from robotiq_async import RobotiqHand, RobotiqStatus, State
from robotiq_async.hands import Hand
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.values import registers as reg
from robotiq_async.values.enums import ObjectStatus
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from tests.patience import patience

_OPEN: Final = (AxisRequest(0, 255, 64),) * 3 + (AxisRequest(128, 255, 64),)
ACTIVATION: Final = Request(activate=True, axes=_OPEN).registers
OPENING: Final = Request(activate=True, go=True, axes=_OPEN).registers
_ACTIVATION_S: Final = 10.0
"""Simulated seconds that are more than enough for one."""
_SPACING_S: Final = 1.0
"""More than any gripper needs from one write to the next."""


def active_gripper(speedup: float = 4.0, **options: Any) -> SimulatedGripper:
    """One that is active and open, without the second that this takes where motions can be watched.

    Its clock is the system's, put ahead by what was skipped.
    """
    ahead = 0.0
    gripper = SimulatedGripper(lambda: time.monotonic() + ahead, speedup=speedup, **options)
    gripper.write(0, ACTIVATION)
    ahead = _ACTIVATION_S / speedup
    return gripper


async def activate_beforehand(gripper: SimulatedGripper) -> None:
    """Leave a gripper active and open, as another client would; in a virtual loop that takes no time.

    But bodies take some: every simulated second is 500 of their steps.
    """
    axes = _OPEN[: len(gripper.model.axes)]
    for go in (False, True):
        gripper.write(0, Request(activate=True, go=go, axes=axes, model=gripper.model).registers)
        await asyncio.sleep(max(_ACTIVATION_S / gripper.speedup, _SPACING_S))


async def until(condition: Callable[[], bool], within: float = 20.0) -> None:
    """Look again and again: a gripper, a file and another process send no events.

    The limit is worked out again when it is over, for the load may come while this waits.
    """
    time_now = asyncio.get_running_loop().time
    began = time_now()
    while not condition():
        if (waited := time_now() - began) > within and waited > patience(within):
            raise TimeoutError(f"not within {waited:.0f} s")
        await asyncio.sleep(0.005)


async def shows(hand: Hand, wanted: Callable[[RobotiqStatus], bool]) -> RobotiqStatus:
    """Wait for a status."""
    async with asyncio.timeout(patience(60)):
        async for status in hand.statuses():
            if wanted(status):
                return status
    raise AssertionError("the hand has ended")


async def lose_link(server: SimulatorServer, hand: Hand) -> None:
    """Take the link away, and let no connection in; wait until the hand notices."""
    server.refuse()
    server.cut()
    await hand.wait_for_state(State.DISCONNECTED)


async def until_moving(server: SimulatorServer | SerialSimulatorServer, hand: RobotiqHand) -> None:
    async for _ in hand.statuses():
        if server.gripper.is_moving:
            return


class Restless(SimulatedGripper):
    """Its scissor is always in motion, if it is to be believed."""

    def status_registers(self) -> Registers:
        block = list(super().status_registers())
        reg.gDT[3].write(block, ObjectStatus.IN_MOTION)
        return tuple(block)
