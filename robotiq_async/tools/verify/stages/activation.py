"""Stage 3: the activation. All fingers move."""

from __future__ import annotations

from typing import Final

from ....session.options import ACTIVATION_TIMEOUT_S
from ....values.enums import ObjectStatus
from ..bench import Bench
from ..motions import ACTIVATION_S, activate

SECONDS: Final = ACTIVATION_S + 20
USUAL_S: Final = 20.0
ROOM: Final = 1.5
"""An activation_timeout is so many times what an activation took."""


async def activation(bench: Bench) -> None:
    """Reset and activate, and look at what is shown after it."""
    watch = bench.watch(SECONDS)
    took = await activate(watch)
    status = await watch.pass_by(1.0)
    found = f"{took:.1f} s"
    if took <= USUAL_S:
        bench.as_assumed("activation.time", found, seconds=took)
    else:
        wanted = round(ROOM * took)
        options = {"activation_timeout": wanted} if wanted > ACTIVATION_TIMEOUT_S else {}
        waits = options.get("activation_timeout", ACTIVATION_TIMEOUT_S)
        follows = f"A hand waits {waits:g} s; others may wait less."
        bench.differs("activation.time", found, follows, options, seconds=took)
    words = f"registers {status.registers[0]:04X} {status.registers[1]:04X}"
    if not status.go_echo and all(
        status.finger_status(axis) is ObjectStatus.IN_MOTION for axis in status.model.axes
    ):
        bench.as_assumed("activation.words", words)
    else:
        follows = (
            "Nothing is to be set: a hand believes no gDT before it has asked for a position. Report this."
        )
        bench.differs("activation.words", words, follows)
    bench.is_active = True
