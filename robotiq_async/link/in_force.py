"""The image in force of a jaw that stands still: written again, it moves nothing. Pure.

A link tries function 23 with it (dialogue.py). It is the last image that this link wrote, if the jaw shows
it, and is stopped or has come to its target. A contact does not do: gOBJ may come some reads behind the echo,
so it may still be that from before the motion. The position tells whether gOBJ 3 is.

Before the first image it is made of the status. Then the jaw must be within 2 counts of its target
without a contact: it holds nothing, so speed and force do not matter until a command.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from ..values import registers as reg
from ..values.model import TOLERANCE, TWO_FINGER_85
from ..values.registers import Registers

AT_TARGET: Final = 3
"""gOBJ of a jaw that has come to its target and holds nothing."""
ACTIVE: Final = 3
"""gIMC of a jaw that is active."""
ECHOED: Final = 0x0900
"""The bits of the first register that a request and a status share: activation and go."""
_ECHOES: Final = ((reg.gACT, reg.rACT), (reg.gGTO, reg.rGTO), (reg.gPR[0], reg.rPR[0]))


def image_in_force(shown: Registers, written: Sequence[int] | None) -> Sequence[int]:
    """The image that may be written again, or empty.

    Args:
        shown: the newest status of a jaw; empty if there is none.
        written: the last image that was acknowledged; empty after one that was not, None before the first.
    """
    if not shown or reg.gFLT.read(shown):
        return ()
    target, position = reg.gPR[0].read(shown), reg.gPO[0].read(shown)
    is_at_target = reg.gOBJ.read(shown) == AT_TARGET
    if written is None:
        is_active = reg.gACT.read(shown) and reg.gIMC.read(shown) == ACTIVE
        is_still = is_active and is_at_target and abs(target - position) <= TOLERANCE
        return (shown[0] & ECHOED, target, 0, 0, 0, 0, 0, 0) if is_still else ()
    is_still = not reg.gGTO.read(shown) or (is_at_target and TWO_FINGER_85.has_reached(target, position))
    return written if is_still and written and shows(shown, written) and not reg.rATR.read(written) else ()


def shows(shown: Registers, image: Sequence[int]) -> bool:
    """Whether a status has the echo of an image, which it may have of an earlier one, too."""
    return all(echo.read(shown) == field.read(image) for echo, field in _ECHOES)
