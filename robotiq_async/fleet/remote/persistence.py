"""until_answered: repeats a request that must get through, a halt, until it is answered."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any, Final, TypeVar

from ...runtime.clock import now
from ...values.errors import AgentError, NotAllowedError, ProtocolError
from .requests import NoAnswerError

HALT_S: Final = 2.0
"""Seconds for which a halt is repeated."""
ATTEMPT_S: Final = 0.3
"""Seconds from one attempt to the next."""
RETRY_S: Final = 0.05
"""The same after an attempt that failed at once, as no agent was reached."""
_RETRIED: Final = (NoAnswerError, NotAllowedError, AgentError, ProtocolError)
"""No answer, or one to another request: the next attempt may get through."""
T = TypeVar("T")


async def until_answered(attempt: Callable[[float], Awaitable[T]], limit: float) -> T:
    """Repeat an attempt; return the result of the first that succeeds.

    Earlier attempts stay open: on a slow link an answer may take longer than the time between two attempts.

    Args:
        attempt: asks once; its argument is the seconds that are left.
        limit: seconds.

    Raises:
        NotAllowedError: access was denied, and no attempt succeeded.
        RobotiqError: the agent's answer; after the time limit, why there was none.
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
                    each.exception()  # retrieved, or asyncio would log the error of a second one in this turn
                for each in done:
                    try:
                        return each.result()
                    except _RETRIED as error:
                        failure = _more_telling(failure, error)
            if not under_way:
                await asyncio.sleep(max(0.0, min(begun + RETRY_S, deadline) - now()))
            begun = now()
        return await _last(under_way, failure)
    finally:
        for each in under_way:
            each.cancel()
        await _ended(under_way)


async def _last(under_way: set[asyncio.Future[T]], failure: Exception | None) -> T:
    # The time of the attempts that are still open is over as well.
    for each in await asyncio.gather(*under_way, return_exceptions=True):
        if not isinstance(each, BaseException):
            return each
        if isinstance(each, Exception):
            failure = _more_telling(failure, each)
    raise failure or NoAnswerError("no answer in time")


def _more_telling(failure: Exception | None, later: Exception) -> Exception:
    # The last attempt has little time, so it may end without an answer where all before it were denied.
    return failure if isinstance(failure, NotAllowedError) and isinstance(later, NoAnswerError) else later


async def _ended(futures: set[asyncio.Future[Any]]) -> None:
    await asyncio.gather(*futures, return_exceptions=True)
