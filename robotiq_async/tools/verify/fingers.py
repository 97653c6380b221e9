"""Stopping the fingers: rGTO = 0 first, then a read, and again until it shows."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from ...values.errors import RobotiqConnectionError
from ...values.request import Request
from ...values.status import RobotiqStatus
from .recorded_link import RecordedLink

APART_S: Final = (0.02, 0.05, 0.1, 0.25, 0.5)
"""From one try to the next: first twice what the manual wants between writes, for one that was forgotten; at
last more than the slowest device in reach takes to follow."""
UNREACHED: Final = "THE FINGERS MAY STILL MOVE: {}. Press the emergency stop, or cut the power."


async def stop_fingers(
    link: RecordedLink, image: Request, alarm: Callable[[str], object]
) -> RobotiqStatus | None:
    """Write an image with rGTO = 0 until the gripper echoes it. Run it shielded.

    Args:
        link: to the gripper; opened again if it was lost.
        image: the one that was written last; rATR is cleared as well.
        alarm: is called, once, with words for the person when the gripper cannot be reached; must not block.

    Returns:
        The status that shows it; None if there was none.
    """
    stop = replace(image, go=False, release=False)
    has_alarmed = False
    for apart in APART_S:
        try:
            if not link.is_open:
                await link.open()
            await link.write(stop)
            status = await link.read()
            if not status.go_echo and (stop.activate or not status.activation_echo):
                return status
        except RobotiqConnectionError:
            if not has_alarmed:
                has_alarmed = True
                alarm(UNREACHED.format("rGTO = 0 could not be sent"))
        await asyncio.sleep(apart)
    if not has_alarmed:
        alarm(UNREACHED.format("the gripper does not show rGTO = 0"))
    return None
