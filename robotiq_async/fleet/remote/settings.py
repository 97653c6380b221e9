"""Settings: speeds and forces that this client asked for, to restore them after a restart of the agent."""

from __future__ import annotations

from ..wire.envelope import Call
from ..wire.settings import Setting, settings_fields, settings_of
from ..wire.values import Fields


class Settings:
    """The last speed and force of each axis.

    They have no echo in the status. A restarted agent has its own, and a client that held the lease meanwhile
    may have set others: the next motion could be faster and stronger than the program asked for. So all of
    them are sent with each request for the lease.
    """

    def __init__(self) -> None:
        self._asked: dict[Setting, tuple[int, int]] = {}
        """By setting: the number of the request, and the value."""

    def note(self, verb: str, call: Call) -> None:
        """Remember the settings of a request that was carried out, or may have been."""
        for setting, value in settings_of(verb.removeprefix("cmd/"), call.arguments).items():
            self._asked[setting] = max(self._asked.get(setting, (0, 0)), (call.number, value))

    @property
    def fields(self) -> Fields:
        return settings_fields({setting: value for setting, (_, value) in self._asked.items()})
