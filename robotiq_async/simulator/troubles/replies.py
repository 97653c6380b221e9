"""Ready-made policies for the replies of a simulator."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotiq_async.values.checks import check_int, check_seconds

from .corruption import unchanged

if TYPE_CHECKING:
    from collections.abc import Callable

    from .target import Target


class Replies:
    """Gives a simulator a policy, in a word. There is one at a time: each call replaces the policy before.

    For several things that go wrong at once there are troubles.
    """

    def __init__(self, target: Target) -> None:
        """What a simulator is told by."""
        self._target = target

    def normal(self) -> None:
        """Send every reply at once and as it is."""
        self._target.policy = unchanged

    def delay(self, seconds: float) -> None:
        """Send every reply later; in real seconds, for they belong to the link and not to the gripper.

        Raises:
            TypeError: seconds is not a number.
            ValueError: seconds is negative or above 3600.
        """
        late = check_seconds("seconds", seconds, 0, 3600)
        self._target.policy = lambda frame: ((late, frame),)

    def drop(self, count: int = 1) -> None:
        """Lose the next replies; their requests are carried out.

        Raises:
            TypeError: count is not an int.
            ValueError: count is negative or above a million.
        """
        losses = iter(range(check_int("count", count, 0, 1_000_000)))
        self._target.policy = lambda frame: unchanged(frame) if next(losses, None) is None else ()

    def silence(self) -> None:
        """Lose every reply; connections stay open and requests are still carried out."""
        self._target.policy = lambda _: ()

    def mangle(self, change: Callable[[bytes], bytes]) -> None:
        """Pass the frame of every reply through a function."""
        self._target.policy = lambda frame: ((0.0, change(frame)),)
