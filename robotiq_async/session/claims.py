"""Who owns which gripper in this process."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Gripper:
    """What is known of a gripper without asking it.

    Attributes:
        place: the same for all ways to write its address.
        unit: the unit id that was given; None where none was, or where there can be but one owner.
        hint: for people who meant two grippers.
    """

    place: str
    unit: int | None = None
    hint: str = field(default="", compare=False)

    def may_be(self, other: Gripper) -> bool:
        """Whether this may be the other one.

        Grippers in the field answer any unit id, so the ids tell two apart only where both were given:
        whoever does that says that there is a gateway.
        """
        units = {self.unit, other.unit}
        return self.place == other.place and (None in units or len(units) == 1)


@dataclass(slots=True, eq=False)
class _Claim(Generic[T]):
    gripper: Callable[[], Gripper]
    owner: T
    loop: asyncio.AbstractEventLoop


class Claims(Generic[T]):
    """Grippers and their owners. Threads may claim at once."""

    def __init__(self) -> None:
        """Begin with nothing claimed."""
        self._claiming = threading.Lock()
        self._claims: dict[T, _Claim[T]] = {}

    def claim(self, gripper: Callable[[], Gripper], owner: T, is_over: Callable[[T], bool]) -> T | None:
        """Take a gripper in the running loop; gives its owner instead if it has one.

        Args:
            gripper: tells which. Asked again when others claim: a serial port may be another by then.
            owner: who wants it.
            is_over: tells, of an owner in this loop, whether it has ended without a word.
        """
        here = asyncio.get_running_loop()
        with self._claiming:
            wanted = gripper()
            for each in list(self._claims.values()):
                if each.loop.is_closed() or (each.loop is here and is_over(each.owner)):
                    self.release(each.owner)
                elif each.gripper().may_be(wanted):
                    return each.owner
            self._claims[owner] = _Claim(gripper, owner, here)
        return None

    def release(self, owner: T) -> None:
        """Give back what somebody owns. Never waits: it may be called from anywhere."""
        self._claims.pop(owner, None)
