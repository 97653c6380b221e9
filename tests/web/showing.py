"""The page of some hands, for a test."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator

from robotiq_async.hand import Hand
from robotiq_async.tools.actions import Operator
from robotiq_async.tools.web.server import PageServer
from robotiq_async.tools.web.settings import PageSettings


@contextlib.asynccontextmanager
async def shown(*hands: Hand, control: bool = True) -> AsyncIterator[PageServer]:
    """The page of some hands."""
    operators = [Operator(hand) for hand in hands] if control else []
    settings = PageSettings(port=0, control=control, addresses=tuple(hand.address for hand in hands))
    async with PageServer(hands, settings, operators=operators) as page:
        yield page
