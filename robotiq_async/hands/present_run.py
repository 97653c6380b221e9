"""Parts of any kind of hand: a run, from a start to the next stop, and a name for the errors of calls."""

from __future__ import annotations

import asyncio
from typing import NoReturn, Protocol

from ..values.errors import RobotiqError, of_hand


class PresentRun(Protocol):
    """The present run of a hand, from a start to the next stop."""

    @property
    def is_over(self) -> bool:
        """Whether the run has ended, or is ending."""

    def check_running(self) -> None:
        """Raise NotStartedError, or the error that ended the link, if the run has ended."""

    @property
    def loop(self) -> asyncio.AbstractEventLoop:
        """The event loop that it runs in."""


class NamesErrors:
    """Puts the name of a hand, if it has one, into every RobotiqError that leaves a block.

    The errors are made in many places, most of which know no names.
    """

    def __init__(self, name: str) -> None:
        self._name = name

    def __enter__(self) -> None:
        """Nothing to prepare: one object serves any number of calls at a time."""

    def __exit__(self, kind: object, error: BaseException | None, trace: object) -> None:
        if self._name and isinstance(error, RobotiqError):
            of_hand(error, self._name)


def refuse_copy(hand: object) -> NoReturn:
    """Refuse to pickle or copy a hand.

    Raises:
        TypeError: always.
    """
    raise TypeError(
        f"a {type(hand).__name__} cannot be pickled or copied: it owns the connection to its gripper. "
        "Make one where it is used, from its address, and stop this one first"
    )


def refuse_with(hand: object) -> None:
    """Refuse ``with`` on an async hand, and name its replacement.

    Raises:
        TypeError: always.
    """
    kind = type(hand).__name__
    instead = "; for 'with' use robotiq_async.sync.RobotiqHand" if kind == "RobotiqHand" else ""
    raise TypeError(f"a {kind} is used with 'async with'{instead}")
