"""A loop of 50 Hz with the blocking hand: close step by step, stop at the part, print its width.

    python demo/grasp_loop.py "sim://?model=2f85&physics=box:30x40x60,0.3"
    python demo/grasp_loop.py "rtu:///dev/ttyUSB0?model=2f85"

The same file for a simulated part and for a gripper. Not tried on real hardware yet: begin with nothing
between the fingers, and with a hand at the emergency stop. It asks before it moves a real one.
"""

from __future__ import annotations

import sys
import time
from typing import Final

from robotiq_async import Finger
from robotiq_async.sync import RobotiqHand

PERIOD_S: Final = 0.02
STEP: Final = 2
"""Counts a period: 100 counts a second."""
SPEED: Final = 64
FORCE: Final = 20


def main(address: str) -> None:
    """Grip once, and let go."""
    if not address.startswith("sim://") and input(f"the fingers of {address} will move; yes? ") != "yes":
        return
    with RobotiqHand(address, force=FORCE, speed=SPEED) as hand:
        hand.open()
        found = close_until_contact(hand)
        if found is None:
            print("nothing there")
        else:
            part = hand.part
            width = None if part is None else part.width_mm  # only a jaw has one, and it is nominal
            print(f"held at {found} counts" + (f": about {width:.0f} mm" if width is not None else ""))
        hand.open()


def close_until_contact(hand: RobotiqHand) -> int | None:
    """The position at which the fingers met something; None if they are closed."""
    position, tick = hand.status.position(Finger.A), time.monotonic()
    while position < 255:
        position = min(position + STEP, 255)
        hand.command(position=position)
        tick += PERIOD_S
        time.sleep(max(tick - time.monotonic(), 0.0))
        status = hand.status
        if status.contacts:
            hand.hold()
            return status.position(Finger.A)
    return None


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "sim://?model=2f85&physics=box:30x40x60,0.3")
