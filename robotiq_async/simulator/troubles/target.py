"""Where troubles and the simulator they happen to meet."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar, Protocol

if TYPE_CHECKING:
    from ..physics.gripper import SimulatedGripper
    from .corruption import ReplyPolicy
    from .trouble import Link


class Target(Protocol):
    """The simulator that troubles happen to; any server in ``server`` is one.

    Attributes:
        link: the kind of link it is on.
        gripper: the simulated gripper.
        policy: changes, delays or drops each reply that no trouble concerns.
    """

    link: ClassVar[Link]
    gripper: SimulatedGripper
    policy: ReplyPolicy

    @property
    def is_running(self) -> bool:
        """Whether it has been started and not stopped."""

    def cut(self, *, reset: bool = False) -> None:
        """Drop all connections."""

    def refuse(self) -> None:
        """Refuse new connections."""

    async def accept(self) -> None:
        """Accept connections again."""
