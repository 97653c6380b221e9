"""Asking until there is an answer, for what must be heard: halts."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, Final, TypeVar

from ...runtime.clock import now
from ...values.errors import AgentError, NotAllowedError, ProtocolError
from .requests import NoAnswerError

HALT_S: Final = 2.0
"""How long a halt is asked for, in seconds."""
ATTEMPT_S: Final = 0.3
"""From one attempt to the next."""
AGAIN_S: Final = 0.05
"""The same, when none is under way: it ended at once, as nobody was there."""
_NO_ANSWER: Final = (NoAnswerError, NotAllowedError, AgentError, ProtocolError)
"""None, or one to something else: the next attempt may get through."""
T = TypeVar("T")


async def until_answered(attempt: Callable[[float], Awaitable[T]], limit: float) -> T:
    """Make one attempt after the other, and return what the first one that succeeds returns.

    The earlier ones go on: on a slow link every answer may take longer than the time between two attempts.

    Args:
        attempt: asks once; takes the seconds that are left.
        limit: seconds.

    Raises:
        RobotiqError: what the agent answered; or, when the time is over, why there was no answer.
    """
    begun, deadline = now(), now() + limit
    under_way: set[asyncio.Future[T]] = set()
    failure: Exception | None = None
    try:
        while begun < deadline:
            under_way.add(asyncio.ensure_future(attempt(deadline - begun)))
            due = min(deadline, begun + ATTEMPT_S)
            while under_way and now() < due:
                done, under_way = await asyncio.wait(
                    under_way, timeout=due - now(), return_when=asyncio.FIRST_COMPLETED
                )
                for each in done:
                    each.exception()  # seen: of two that end in the same turn one may say enough
                for each in done:
                    try:
                        return each.result()
                    except _NO_ANSWER as error:
                        failure = error
            if not under_way:
                await asyncio.sleep(max(0.0, min(begun + AGAIN_S, deadline) - now()))
            begun = now()
        return await _last(under_way, failure)
    finally:
        for each in under_way:
            each.cancel()
        await _ended(under_way)


async def _last(under_way: set[asyncio.Future[T]], failure: Exception | None) -> T:
    """What those that are under way at the end come to: their time is over too."""
    for each in await asyncio.gather(*under_way, return_exceptions=True):
        if not isinstance(each, BaseException):
            return each
        if isinstance(each, Exception):
            failure = each
    raise failure or NoAnswerError("no answer in time")


async def _ended(futures: set[asyncio.Future[Any]]) -> None:
    await asyncio.gather(*futures, return_exceptions=True)
