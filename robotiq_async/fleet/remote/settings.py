"""Speed and force as this client has asked for them, for an agent that does not know them."""

from __future__ import annotations

from ..wire.envelope import Call
from ..wire.settings import Setting, settings_fields, settings_of
from ..wire.values import Fields


class Settings:
    """What each axis was asked for last.

    Speed and force have no echo. An agent that was started anew has its own, and a client that held the lease
    meanwhile may have set others: the next motion would be faster and stronger than its program asked for. So
    all of it is given with each request for the lease.
    """

    def __init__(self) -> None:
        self._asked: dict[Setting, tuple[int, int]] = {}
        """The number of the request, and the value."""

    def note(self, verb: str, call: Call) -> None:
        """A request was carried out, or may have been."""
        for setting, value in settings_of(verb.removeprefix("cmd/"), call.arguments).items():
            self._asked[setting] = max(self._asked.get(setting, (0, 0)), (call.number, value))

    @property
    def fields(self) -> Fields:
        """What to give."""
        return settings_fields({setting: value for setting, (_, value) in self._asked.items()})
