"""Claims: no two hands of a process may own the same gripper."""

from __future__ import annotations

import asyncio
import threading
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Generic, TypeVar

T = TypeVar("T")


@dataclass(frozen=True, slots=True)
class Gripper:
    """What identifies a gripper before it is connected.

    Attributes:
        place: the same for all spellings of its address.
        unit: the unit id that was given; None if none was, or if only one hand can own the place.
        hint: for the error message, in case two grippers were meant.
    """

    place: str
    unit: int | None = None
    hint: str = field(default="", compare=False)

    def may_be(self, other: Gripper) -> bool:
        """Whether both may be the same gripper.

        Grippers answer any unit id, so ids count only if both were given: then there is a gateway.
        """
        units = {self.unit, other.unit}
        return self.place == other.place and (None in units or len(units) == 1)


@dataclass(slots=True, eq=False)
class _Claim(Generic[T]):
    gripper: Callable[[], Gripper]
    owner: T
    loop: asyncio.AbstractEventLoop


class Claims(Generic[T]):
    """Grippers and their owners. Thread-safe."""

    def __init__(self) -> None:
        self._claiming = threading.Lock()
        self._claims: dict[T, _Claim[T]] = {}

    def claim(self, gripper: Callable[[], Gripper], owner: T, is_over: Callable[[T], bool]) -> T | None:
        """Claim a gripper for the running loop; return its present owner if it has one.

        Args:
            gripper: identifies it; called anew for each later claim, because a serial port may be renamed.
            owner: the new owner.
            is_over: whether an owner in this loop has ended without a release.
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
        """Give up a claim. Takes no lock: any thread may call it."""
        self._claims.pop(owner, None)
