"""What becomes of a reply on its way back to the client."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from robotiq_async.wire.checks import check_int, check_seconds

ReplyPolicy = Callable[[bytes], Iterable[tuple[float, bytes]] | None]
"""Takes the frame of one reply; gives what to send instead, as (delay in seconds, bytes), or None to hang up.

An empty answer loses the reply. The request behind the reply has been carried out already.
"""


class Replies:
    """The misbehaviour of a simulator, switched on and off while it runs. It is a :data:`ReplyPolicy`.

    Delays are real seconds: they belong to the link, not to the gripper.
    """

    def __init__(self) -> None:
        """Every reply at once and as it is."""
        self.normal()

    def normal(self) -> None:
        """Every reply at once and as it is, from now on."""
        self._delay = 0.0
        self._drops = 0
        self._silent = False
        self._change: Callable[[bytes], bytes] = bytes

    def delay(self, seconds: float) -> None:
        """Send every reply later; 0 for at once.

        Raises:
            TypeError: seconds is not a number.
            ValueError: seconds is negative or above 3600.
        """
        self._delay = check_seconds("seconds", seconds, 0, 3600)

    def drop(self, count: int = 1) -> None:
        """Lose the next replies.

        Raises:
            TypeError: count is not an int.
            ValueError: count is negative or above a million.
        """
        self._drops = check_int("count", count, 0, 1_000_000)

    def silence(self) -> None:
        """Lose every reply; connections stay open and requests are still carried out."""
        self._silent = True

    def mangle(self, change: Callable[[bytes], bytes]) -> None:
        """Pass the frame of every reply through a function."""
        self._change = change

    def __call__(self, frame: bytes) -> Iterable[tuple[float, bytes]]:
        """Decide on one reply."""
        if self._silent:
            return ()
        if self._drops:
            self._drops -= 1
            return ()
        return ((self._delay, self._change(frame)),)
