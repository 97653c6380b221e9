"""OwnSettings: the speeds and forces of a client, for an agent that has lost its record of them."""

from __future__ import annotations

from collections.abc import Mapping

from ..wire.settings import Setting, settings_fields, settings_of
from ..wire.values import Fields


class OwnSettings:
    """The speeds and forces that were carried out, for an agent that has lost its record of them.

    The agent is their keeper. What may have been carried out is left out, and so is what it replaced.
    """

    def __init__(self) -> None:
        self._known: dict[Setting, tuple[int, int | None]] = {}
        """By setting: the number of the newest request that was begun, and the value if that is certain."""

    def note(self, number: int, asked: Mapping[Setting, int], begun: bool | None) -> None:
        for setting, value in settings_of(asked).items():
            if begun is not False and number > self._known.get(setting, (0, 0))[0]:
                self._known[setting] = number, value if begun else None

    @property
    def fields(self) -> Fields:
        return settings_fields({each: value for each, (_, value) in self._known.items() if value is not None})
