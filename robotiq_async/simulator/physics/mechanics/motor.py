"""What the motor of an axis draws, in counts of 10 mA.

Published are the frames of the manual's worked grasp: at full speed A, B and C close with 0x0F, 0x10 and 0x0F
and open with 0x0B, 0x0E and 0x0B; at rest they draw nothing, be they open or holding something with full
force, for they lock themselves.

The rest is made up to fit: what a slower motion draws, the scissor (taken for finger A), and the peak of a
contact. Of the peak the manual says that the force fixes the highest current of a motion, and the thesis
(figures 13 to 15, without numbers) that it grows with the force, at once on something rigid and bit by bit in
foam.
"""

from __future__ import annotations

from typing import Final, NamedTuple

_SHARE_OF_FRICTION: Final = 0.5
# Above what the fastest motion draws, or it would stop itself; three fingers at once stay within the 1.5 A
# that the manual lets the whole gripper take.
_WEAKEST_PEAK: Final = 20
_STRONGEST_PEAK: Final = 50


class Motor(NamedTuple):
    """The motor of one axis.

    Attributes:
        closing: current while closing at full speed.
        opening: current while opening at full speed.
    """

    closing: int
    opening: int

    def running(self, share: float, *, closing: bool) -> float:
        """Current in free motion, at a share of the full speed."""
        full = self.closing if closing else self.opening
        return full * (_SHARE_OF_FRICTION + (1 - _SHARE_OF_FRICTION) * share)


MOTORS: Final = (Motor(15, 11), Motor(16, 14), Motor(15, 11), Motor(15, 11))
"""Of A, B, C and the scissor."""


def peak(force: int) -> float:
    """What a motor draws when its axis stops at something: the most that the force, 0..255, lets it draw."""
    return _WEAKEST_PEAK + (_STRONGEST_PEAK - _WEAKEST_PEAK) * force / 255
