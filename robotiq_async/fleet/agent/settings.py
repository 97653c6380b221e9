"""RestoredSettings: speeds and forces from before a restart of the agent, until the gripper has them."""

from __future__ import annotations

from collections.abc import Mapping

from ...hand.robotiq_hand import RobotiqHand
from ...values.errors import RobotiqError
from ...values.events import SentRequest
from ..wire.settings import Setting


class RestoredSettings:
    """Merged into each command, so that both are written in one image, until such an image is acknowledged.

    A restarted agent has its own speeds and forces: the next motion could be faster and stronger than the
    client asked for.
    """

    def __init__(self, hand: RobotiqHand) -> None:
        self._hand = hand
        self._missing: dict[Setting, int] = {}

    def restore(self, settings: Mapping[Setting, int]) -> None:
        has = self._hand.model.all_axes
        self._missing.update({each: value for each, value in settings.items() if each[0] in has})

    def merge(self, renewed: Mapping[Setting, int]) -> None:
        """Merge them into the command of this turn, which sets the renewed ones itself."""
        try:
            for (axis, what), value in self._missing.items():
                self._hand.command(axis, **{what: value})
        except RobotiqError:
            return  # the hand refuses the command, too
        self._missing.update(
            {setting: value for setting, value in renewed.items() if setting in self._missing}
        )

    def observe(self, what: object) -> None:
        # An acknowledged image that contains all of them has restored them.
        if self._missing and isinstance(what, SentRequest) and what.acknowledged:
            axes = dict(what.request.by_axis)
            if all(getattr(axes[axis], name) == value for (axis, name), value in self._missing.items()):
                self._missing.clear()
