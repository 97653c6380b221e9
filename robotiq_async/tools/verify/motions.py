"""Motions that several stages make, and the stop of the fingers."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Final

from ...values import AxisRequest, Finger, Request, RobotiqConnectionError, RobotiqStatus
from .catalogue import EndError
from .recorded_link import RecordedLink
from .watch import ANYWHERE, StageWatch, describe

MARGIN: Final = 4  # counts by which an axis may leave its path: it may stop 2 off its request (manual)
ASIDE: Final = 3  # counts by which the position of a resting axis may change
ACTIVATION_S: Final = 60.0  # a longer activation is taken back: drivers wait for 25 to 30 s


def in_place(status: RobotiqStatus, *, speed: int = 0, force: int = 0) -> Request:
    """The image that requests the present position of every axis, usually with the least force."""
    axes = tuple(AxisRequest(status.position(axis), speed, force) for axis in status.model.axes)
    return Request(activate=True, mode=status.mode, axes=axes, model=status.model)


def as_found(status: RobotiqStatus) -> Request:
    """The image nearest to the one in force, with rGTO = 0: speeds and forces cannot be read back."""
    axes = tuple(AxisRequest(status.requested_position(axis)) for axis in status.model.axes)
    return Request(activate=status.activation_echo, mode=status.mode, axes=axes, model=status.model)


def motion_envelope(status: RobotiqStatus, targets: Mapping[Finger, int]) -> dict[Finger, tuple[int, int]]:
    """The envelope of a motion from a status to targets; the other axes stay."""
    envelope = {}
    for axis in status.model.axes:
        now = status.position(axis)
        target = targets.get(axis, now)
        beside = MARGIN if axis in targets else ASIDE
        envelope[axis] = (min(now, target) - beside, max(now, target) + beside)
    return envelope


def resting_envelope(status: RobotiqStatus, moving: Sequence[Finger]) -> dict[Finger, tuple[int, int]]:
    """The envelope of the axes that are not in ``moving``: they stay."""
    return {
        axis: (status.position(axis) - ASIDE, status.position(axis) + ASIDE)
        for axis in status.model.axes
        if axis not in moving
    }


def are_near(status: RobotiqStatus, targets: Mapping[Finger, int], counts: int) -> bool:
    """Whether axes are within so many counts of their targets."""
    return all(abs(status.position(axis) - target) <= counts for axis, target in targets.items())


async def reset(watch: StageWatch) -> None:
    """Clear rACT and wait for its echo. The fingers stay where they are."""
    watch.need_active(False)
    await watch.write(Request(model=watch.model))
    if await watch.until(lambda status: not status.activation_echo and status.is_reset, 2.0) is None:
        raise EndError("inactive", "rACT = 0 was acknowledged, but the gripper does not show it")


async def activate(watch: StageWatch) -> float:
    """Reset and activate: all fingers move. Returns the seconds that the activation took."""
    watch.confine(ANYWHERE)
    await reset(watch)
    began = await watch.write(Request(activate=True, model=watch.model))
    if await watch.until(lambda status: status.is_activated, ACTIVATION_S) is None:
        shown = f": the gripper is {describe(watch.last)}" if watch.last else ""
        raise EndError("time", f"the activation did not finish within {ACTIVATION_S:g} s{shown}")
    watch.need_active(True)
    return asyncio.get_running_loop().time() - began


async def go(
    watch: StageWatch, image: Request, targets: Mapping[Finger, int], seconds: float
) -> RobotiqStatus | None:
    """Send axes to targets and wait until they rest there; None if they do not in time."""
    assert watch.last is not None
    watch.confine(motion_envelope(watch.last, targets))
    await watch.write(replace(image, go=True).with_positions(targets))
    return await watch.until(lambda status: are_near(status, targets, MARGIN), seconds) and (
        await watch.until_still(2.0)
    )


PAUSES_S: Final = (0.02, 0.05, 0.1, 0.25, 0.5)
"""Seconds between tries: at first twice the manual's time between writes, in case one was forgotten;
at last more than the slowest known device takes to follow."""
UNREACHED: Final = "THE FINGERS MAY STILL MOVE: {}. Press the emergency stop, or cut the power."
REACHED: Final = "The gripper answers again, and shows rGTO = 0."


async def stop_fingers(
    link: RecordedLink, image: Request, alarm: Callable[[str], object]
) -> RobotiqStatus | None:
    """Write an image with rGTO = 0 until the gripper echoes it. Run it shielded.

    Args:
        link: to the gripper; opened again if it was lost.
        image: the one that was written last; rATR is cleared as well.
        alarm: takes a text for the person when the gripper cannot be reached, and when it answers again; must
            not block.

    Returns:
        The status with the echo; None if no echo came.
    """
    stop = replace(image, go=False, release=False)
    has_alarmed = False
    for apart in PAUSES_S:
        try:
            if not link.is_open:
                await link.open()
            await link.write(stop)
            status = await link.read()
            if not status.go_echo and (stop.activate or not status.activation_echo):
                if has_alarmed:
                    alarm(REACHED)
                return status
        except RobotiqConnectionError:
            if not has_alarmed:
                has_alarmed = True
                alarm(UNREACHED.format("rGTO = 0 could not be sent"))
        await asyncio.sleep(apart)
    if not has_alarmed:
        alarm(UNREACHED.format("the gripper does not show rGTO = 0"))
    return None
