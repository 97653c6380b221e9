"""Hands at sim:// addresses, that bring their gripper along."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
import os
from collections.abc import Iterator

import pytest

from robotiq_async import (
    ConnectFailedError,
    Finger,
    RobotiqHand,
    State,
)
from tests.patience import patience


@pytest.fixture(params=[0, 1])
def few_files(request: pytest.FixtureRequest) -> Iterator[None]:
    """This process can open no more files, or one more."""
    resource = pytest.importorskip("resource")
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, limits[1]))
    opened = []
    try:
        with contextlib.suppress(OSError):
            while True:
                opened.append(os.open(os.devnull, os.O_RDONLY))
        for _ in range(request.param):
            os.close(opened.pop())
        yield
    finally:
        for each in opened:
            os.close(each)
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)


@pytest.mark.virtual_time
async def test_sim_address_runs_over_real_modbus_tcp() -> None:
    hand = RobotiqHand("sim://")
    await hand.start(activate=False)
    assert hand.state is State.RESET
    await hand.stop()
    other = RobotiqHand("sim://")
    await asyncio.gather(hand.start(activate=False), other.start(activate=False))
    await asyncio.gather(hand.stop(), other.stop())


@pytest.mark.virtual_time
async def test_without_an_address_the_first_start_warns_that_the_gripper_is_simulated(
    caplog: pytest.LogCaptureFixture,
) -> None:
    caplog.set_level(logging.WARNING)
    unnamed, named = RobotiqHand(), RobotiqHand("sim://")
    for hand, warnings in ((unnamed, 1), (unnamed, 0), (named, 0)):
        caplog.clear()
        await hand.start(activate=False)
        await hand.stop()
        said = [each.getMessage() for each in caplog.records if each.levelno == logging.WARNING]
        assert len(said) == warnings
        assert all("no address was given: the gripper is simulated" in text for text in said)


async def test_an_address_may_say_how_fast_its_gripper_is_and_what_is_in_its_way() -> None:
    async with RobotiqHand("sim://?speedup=50&object=150") as hand:
        result = await hand.close(speed=255)
        assert result.contacts == Finger.ABC
        assert result.duration < patience(1)
        for axis in (Finger.A, Finger.B, Finger.C):
            assert result.positions[axis] == pytest.approx(150, abs=5)
        assert hand.address.startswith("sim://?speedup=50&object=150#")


async def test_without_a_free_descriptor_a_simulated_gripper_says_so(few_files: None) -> None:
    hand = RobotiqHand("sim://")
    # From Python 3.13 on asyncio keeps the reason to itself when there is none for its first socket.
    reason = r"cannot connect to .*: .*(Too many open files|could not bind)"
    with pytest.raises(ConnectFailedError, match=reason) as caught:
        await hand.start()
    assert caught.value.address
    assert hand.state is State.SHUTDOWN


def test_a_link_that_is_not_open_yet_can_be_asked_for_all_it_promises() -> None:
    """isinstance() of a protocol reads the properties, in an order that changes with each process."""
    link = RobotiqHand("sim://").options.make_transport()
    assert link.asked_at == -math.inf
    assert not link.is_open
