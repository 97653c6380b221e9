"""Speeds and forces that a client had asked of a former run of the agent, until the gripper has them."""

from __future__ import annotations

from collections.abc import Mapping

from ...hand.robotiq_hand import RobotiqHand
from ...values.enums import AXES
from ...values.errors import RobotiqError
from ...values.events import SentRequest
from ..wire.settings import Setting


class OwedSettings:
    """Asked of the hand with each command, so that both leave in one image, until one is acknowledged."""

    def __init__(self, hand: RobotiqHand) -> None:
        """None."""
        self._hand = hand
        self._owed: dict[Setting, int] = {}

    def owe(self, settings: Mapping[Setting, int]) -> None:
        """A client has given them."""
        self._owed.update(settings)

    def give(self, renewed: Mapping[Setting, int]) -> None:
        """A command follows in this turn, and sets some of them anew."""
        try:
            for (axis, what), value in self._owed.items():
                self._hand.command(axis, **{what: value})
        except RobotiqError:
            return  # it does not take the command either
        self._owed.update({setting: value for setting, value in renewed.items() if setting in self._owed})

    def hear(self, what: object) -> None:
        """The hand has written something, perhaps."""
        if self._owed and isinstance(what, SentRequest) and what.acknowledged:
            axes = dict(zip(AXES, what.request.axes, strict=True))
            if all(getattr(axes[axis], name) == value for (axis, name), value in self._owed.items()):
                self._owed.clear()
