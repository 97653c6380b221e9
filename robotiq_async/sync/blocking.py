"""What a blocking hand is made of."""

from __future__ import annotations

from abc import ABC, abstractmethod
from types import TracebackType
from typing import Generic, Self, TypeVar

from ..hand.robotiq_hand import RobotiqHand as AsyncRobotiqHand
from .caller import Caller

T = TypeVar("T")


class Blocking(Generic[T]):
    """Something whose calls go to an event loop in another thread, and wait there for the caller."""

    def __init__(self, inner: T, caller: Caller) -> None:
        """Keep what is called, and who makes the calls."""
        self._inside = inner
        self._caller = caller

    @property
    def _inner(self) -> T:
        self._caller.check_process()
        return self._inside

    def __repr__(self) -> str:
        """That of what is called."""
        return repr(self._inside)


class BlockingHand(Blocking[AsyncRobotiqHand], ABC):
    """A hand that is started and stopped by ``with``."""

    def __enter__(self) -> Self:
        """Start, with activation. See :meth:`start` for what it raises."""
        try:
            self.start()
        except Exception:
            raise
        except BaseException:  # Ctrl-C, perhaps at a moment when it had started: __exit__ is not called then
            self.stop()
            raise
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop, also when the block failed or was interrupted."""
        self.stop()

    @abstractmethod
    def start(self) -> None:
        """Begin."""

    @abstractmethod
    def stop(self) -> None:
        """End."""
