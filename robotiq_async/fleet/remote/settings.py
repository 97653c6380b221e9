"""What a client has asked of speeds and forces: they have no echo, and an agent started anew forgets them."""

from __future__ import annotations

from dataclasses import dataclass

from ..wire.envelope import Call
from ..wire.settings import Setting, settings_fields, settings_of
from ..wire.values import Fields


@dataclass(frozen=True, slots=True)
class _Asked:
    value: int
    number: int
    """Of the request."""
    run: int
    """Of the agent, that knows it."""


class Settings:
    """The newest of each axis."""

    def __init__(self) -> None:
        """None."""
        self._asked: dict[Setting, _Asked] = {}

    def note(self, verb: str, call: Call) -> None:
        """A request was carried out, or may have been."""
        for setting, value in settings_of(verb.removeprefix("cmd/"), call.arguments).items():
            before = self._asked.get(setting)
            if before is None or before.number < call.number:
                self._asked[setting] = _Asked(value, call.number, call.epoch)

    def unknown_to(self, run: int) -> Fields:
        """Those that a run of the agent has not been given."""
        unknown = {setting: each.value for setting, each in self._asked.items() if each.run != run}
        return settings_fields(unknown)

    def given_to(self, run: int, number: int) -> None:
        """A run of the agent was given all that were asked before the request of a number."""
        for setting, each in self._asked.items():
            if each.number < number:
                self._asked[setting] = _Asked(each.value, each.number, run)
