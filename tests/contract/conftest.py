"""Stands in for hold() and add_listener() until the hand has them; goes when it does."""

import contextlib
from typing import Any

from robotiq_async import Finger, RobotiqHand
from robotiq_async.wire.checks import check_mask

with contextlib.suppress(ImportError):
    import tests.fleet.conftest  # noqa: F401

_hold: Any = getattr(RobotiqHand, "hold")  # noqa: B009
if _hold.__module__ != "robotiq_async.hand.commands":

    async def hold(self: RobotiqHand, fingers: Finger | int = Finger.ALL) -> None:
        await _hold(self, check_mask(fingers))

    setattr(RobotiqHand, "hold", hold)  # noqa: B010
