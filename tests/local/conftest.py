"""A run that has had its first contact with an active gripper; a session at one; a quick gripper."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest

from robotiq_async.local.session import Session
from robotiq_async.simulator import SimulatedGripper
from tests.conftest import Clock
from tests.fake_transport import Wire
from tests.local.polled import Polled, polled
from tests.local.sessions import Run, running


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


@pytest.fixture
async def gripper(clock: Clock) -> SimulatedGripper:
    """Twenty-five times as fast as life, behind real Modbus TCP."""
    return SimulatedGripper(clock, speedup=25)
