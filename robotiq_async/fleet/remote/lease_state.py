"""The client's view of the lease, and of its settings. It may be late: the agent is the keeper of both."""

from __future__ import annotations

import getpass
import os
import socket
from collections.abc import Mapping
from typing import Final

from ..errors import ControlLostError
from ..wire.settings import Setting, settings_fields, settings_of
from ..wire.values import Fields

OVERRULING: Final = ("taken", "halted", "held", "restarted")
"""Reasons after which people decide which client commands: only an explicit acquire() gets the lease."""


class ClientLease:
    """The client's side of the lease in one run.

    A client must not get a lease back by itself that people have given to another client, or that it has
    released.

    Attributes:
        is_held: whether the client holds it.
        returns: whether the client tries to get it back by itself when it is lost: by silence, or as the
            agent was restarted. Not while two agents serve the gripper: the lease may be from the wrong
            agent.
        is_over: whether the run ends. A lease that is granted now is not renewed, and expires.
        number: of the lease that the client holds, or held last.
        run: the run of the agent that gave the number.
        lost: why the client lost control; None while it is in control, and if it never was.
    """

    def __init__(self, name: str) -> None:
        self.is_held: bool = False
        self.returns: bool = False
        self.is_over: bool = False
        self.number: int = 0
        self.run: int = 0
        self.lost: ControlLostError | None = None
        self._name = name

    @property
    def seeks(self) -> bool:
        """Whether it is lost, and the client tries to get it back."""
        return self.returns and not self.is_held

    def grant(self, number: int, run: int) -> None:
        self.number, self.run = number, run
        if not self.is_over:
            self.is_held = self.returns = True
            self.lost = None

    def lose(self, reason: str, why: str) -> bool:
        """The lease has ended; returns whether it was held until now."""
        if not self.is_held:
            return False
        self.is_held = False
        self.returns = self.returns and reason not in (*OVERRULING, "released")
        self.lost = ControlLostError(f"lost control of {self._name}: {why}", reason)
        return True

    def refuse(self, error: ControlLostError) -> None:
        """The agent refused to give the lease back, because another client was first or intervened."""
        if self.seeks:
            self.returns = False
            self.lost = error

    def release(self) -> None:
        """Give up the lease, or the attempts to get it."""
        self.lose("released", "it was released")
        self.returns = False

    def doubt(self) -> None:
        """A second agent was seen."""
        self.returns = False

    def end(self) -> None:
        self.is_over = True
        self.is_held = self.returns = False

    def check(self) -> None:
        """Refuse a command without the lease.

        Raises:
            ControlLostError: always a new one, so that no traceback grows.
        """
        if not self.is_held:
            if self.lost is None:
                raise ControlLostError("this hand only reads: acquire() the lease first", "released")
            raise ControlLostError(str(self.lost), self.lost.reason)


class OwnSettings:
    """The speeds and forces that were carried out, for an agent that has lost its record of them.

    The agent is their keeper. A value of unknown outcome is left out, and so is the one before it.
    """

    def __init__(self) -> None:
        self._known: dict[Setting, tuple[int, int | None]] = {}
        """By setting: the number of the newest request that was begun, and the value if that is certain."""

    def note(self, number: int, settings: Mapping[Setting, int], begun: bool | None) -> None:
        for setting, value in settings_of(settings).items():
            if begun is not False and number > self._known.get(setting, (0, 0))[0]:
                self._known[setting] = number, value if begun else None

    @property
    def fields(self) -> Fields:
        return settings_fields({each: value for each, (_, value) in self._known.items() if value is not None})


def own_label() -> str:
    """The name of this client for people: user, host, process."""
    try:
        user = getpass.getuser()
    except (OSError, KeyError):
        user = "unknown"
    return f"{user}@{socket.gethostname()}:{os.getpid()}"
