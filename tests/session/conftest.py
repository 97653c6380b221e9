"""A run that has had its first contact with an active gripper; and a session at one, with its wire."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest

from robotiq_async.session.session import Session
from tests.fake_transport import Wire
from tests.session.polled import Polled, polled
from tests.session.sessions import Run, running


@pytest.fixture
async def here() -> AsyncIterator[Polled]:
    async with polled() as here:
        yield here


@pytest.fixture
async def run_and_session() -> AsyncIterator[tuple[Run, Session]]:
    async with running() as both:
        yield both


@pytest.fixture
def session(run_and_session: tuple[Run, Session]) -> Session:
    return run_and_session[1]


@pytest.fixture
def wire(run_and_session: tuple[Run, Session]) -> Wire:
    return run_and_session[0].wire
