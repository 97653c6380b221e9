"""Another client of the gripper, before the hand comes and beside it."""

from __future__ import annotations

from collections.abc import Mapping

from robotiq_async.values.enums import Finger, State
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from tests.control.scan import Scan


def image(
    positions: Mapping[Finger, int], *, go: bool = True, individual: bool = True, speed: int = 255
) -> tuple[int, ...]:
    """An image of another client."""
    return Request(
        activate=True,
        go=go,
        individual_fingers=individual,
        individual_scissor=individual,
        axes=tuple(AxisRequest(positions.get(axis, 0), speed, 100) for axis in THREE_FINGER.axes),
    ).registers


def asked(position: int, speed: int = 128) -> tuple[AxisRequest, ...]:
    return (AxisRequest(position, speed, 64),) * 3 + (AxisRequest(137, speed, 64),)


def going_to(position: int, speed: int = 128) -> tuple[int, ...]:
    """The image with which another client moves the fingers."""
    return Request(activate=True, go=True, axes=asked(position, speed)).registers


def used_by_another(device_cycle: float = 0.005, speed: int = 128) -> Scan:
    """A gripper that is active when the hand comes."""
    scan = Scan(device_cycle=device_cycle, speed=speed)
    scan.gripper.write(0, Request(activate=True).registers)
    scan.now += 10
    return scan


def activated_by_another() -> Scan:
    """A gripper that another client has activated with register 0 alone; the hand has not come yet."""
    scan = Scan()
    scan.gripper.write(0, [0x0100])
    scan.now += 10
    return scan


def moved_by_another() -> Scan:
    """The hand has adopted a gripper whose fingers are on their way for another client."""
    scan = activated_by_another()
    scan.gripper.write(0, going_to(200, speed=0))
    scan.now += 0.5
    scan.connect(activate=False)
    scan.run(0.5)
    return scan


def reset_and_activated_by_another(scan: Scan) -> None:
    """Register 0 alone, as a pendant writes it: the others keep their content."""
    scan.gripper.write(0, [0x0000])
    scan.run(0.05)
    scan.gripper.write(0, [0x0100])
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
