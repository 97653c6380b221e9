"""How errors come to tell the name of their hand."""

from __future__ import annotations

import functools
import inspect
from collections.abc import Callable
from typing import Any, TypeVar, cast

from ..values.errors import RobotiqError

F = TypeVar("F", bound=Callable[..., Any])


def tells_its_hand(method: F) -> F:
    """Let what a method of a hand raises tell the name of the hand, if it was given one.

    Where errors leave the hand, and not where they are made: that is in many places, and those that decide
    know nothing of names.
    """
    if inspect.iscoroutinefunction(method):

        @functools.wraps(method)
        async def waiting(self: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
            try:
                return await method(self, *args, **kwargs)
            except RobotiqError as error:
                _name(error, self)
                raise

        return cast("F", waiting)

    @functools.wraps(method)
    def at_once(self: Any, *args: Any, **kwargs: Any) -> Any:  # noqa: ANN401
        try:
            return method(self, *args, **kwargs)
        except RobotiqError as error:
            _name(error, self)
            raise

    return cast("F", at_once)


def _name(error: RobotiqError, hand: Any) -> None:  # noqa: ANN401
    if given := hand._options.given_name:  # noqa: SLF001  # of the hand whose method this is
        error.hand = given
