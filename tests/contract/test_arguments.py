"""What is no argument is refused by name, value and range, and nothing is sent."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from robotiq_async import Finger
from tests.contract.bench import at_rest, bench, contract

Call = Callable[[Any], Any]
CALLS: dict[str, tuple[Call, str]] = {
    "move position": (lambda bad: lambda hand: hand.move(bad), "position"),
    "move fingers": (lambda bad: lambda hand: hand.move(3, bad), "fingers"),
    "move speed": (lambda bad: lambda hand: hand.move(3, speed=bad), "speed"),
    "move force": (lambda bad: lambda hand: hand.move(3, force=bad), "force"),
    "open fingers": (lambda bad: lambda hand: hand.open(bad), "fingers"),
    "close speed": (lambda bad: lambda hand: hand.close(speed=bad), "speed"),
    "grasp fingers": (lambda bad: lambda hand: hand.grasp(bad), "fingers"),
    "grasp at_least": (lambda bad: lambda hand: hand.grasp(at_least=bad), "at_least"),
    "grasp speed": (lambda bad: lambda hand: hand.grasp(speed=bad), "speed"),
    "grasp force": (lambda bad: lambda hand: hand.grasp(force=bad), "force"),
    "grip_events fingers": (lambda bad: lambda hand: hand.grip_events(bad), "fingers"),
    "grip_events slip": (lambda bad: lambda hand: hand.grip_events(slip=bad), "slip"),
    "set_position value": (lambda bad: lambda hand: hand.set_position(bad), "value"),
    "set_position fingers": (lambda bad: lambda hand: hand.set_position(3, bad), "fingers"),
    "set_speed value": (lambda bad: lambda hand: hand.set_speed(bad), "value"),
    "set_speed fingers": (lambda bad: lambda hand: hand.set_speed(3, bad), "fingers"),
    "set_force value": (lambda bad: lambda hand: hand.set_force(bad), "value"),
    "set_force fingers": (lambda bad: lambda hand: hand.set_force(3, bad), "fingers"),
    "hold fingers": (lambda bad: lambda hand: hand.hold(bad), "fingers"),
    "command fingers": (lambda bad: lambda hand: hand.command(bad, position=3), "fingers"),
    "command position": (lambda bad: lambda hand: hand.command(position=bad), "position"),
    "command speed": (lambda bad: lambda hand: hand.command(speed=bad), "speed"),
    "command force": (lambda bad: lambda hand: hand.command(force=bad), "force"),
}
ORDERS: dict[str, tuple[Call, tuple[str, ...]]] = {
    "move": (
        lambda bad: lambda hand: hand.move(bad.pop("position", 3), bad.pop("fingers", Finger.A), **bad),
        ("fingers", "position", "speed", "force", "timeout"),
    ),
    "close": (
        lambda bad: lambda hand: hand.close(bad.pop("fingers", Finger.A), **bad),
        ("fingers", "speed", "force", "timeout"),
    ),
    "grasp": (
        lambda bad: lambda hand: hand.grasp(bad.pop("fingers", Finger.A), **bad),
        ("fingers", "at_least", "speed", "force", "timeout"),
    ),
    "command": (
        lambda bad: lambda hand: hand.command(bad.pop("fingers", Finger.A), **bad),
        ("fingers", "position", "speed", "force"),
    ),
    "set_position": (
        lambda bad: lambda hand: hand.set_position(bad.pop("value", 3), bad.pop("fingers", Finger.A)),
        ("fingers", "value"),
    ),
}
"""The arguments of a call in the order in which they are checked."""
TIMEOUTS: dict[str, Call] = {
    "move": lambda bad: lambda hand: hand.move(3, timeout=bad),
    "grasp": lambda bad: lambda hand: hand.grasp(timeout=bad),
    "recover": lambda bad: lambda hand: hand.recover(timeout=bad),
    "wait_for_state": lambda bad: lambda hand: hand.wait_for_state(hand.state, timeout=bad),
}
WRONG_TYPES = [1.0, "3", True, b"3", [3], np.bool_(True), np.float64(3)]
WRONG_VALUES = [-1, 256, 10**400]


async def refused(where: str, make: Call, name: str, bad: object, kind: type[Exception]) -> None:
    """Have a call refused, before the start and after it."""
    async with bench(where) as here:
        hand: Any = here.make()
        with pytest.raises(kind, match=rf"{name} must be .*{re.escape(repr(bad)[:60])}"):
            await called(make(bad), hand)
        await hand.start()
        writes = here.writes
        with pytest.raises(kind, match=f"{name} must be"):
            await called(make(bad), hand)
        await asyncio.sleep(0.1)
        assert here.writes == writes
        await hand.stop()


async def called(call: Callable[[Any], Any], hand: Any) -> None:
    outcome = call(hand)
    if outcome is not None:
        await outcome


@contract
@pytest.mark.parametrize("what", CALLS)
async def test_the_wrong_type(where: str, what: str) -> None:
    make, name = CALLS[what]
    for bad in WRONG_TYPES:
        await refused(where, make, name, bad, TypeError)


@contract
@pytest.mark.parametrize("what", CALLS)
async def test_outside_the_range(where: str, what: str) -> None:
    make, name = CALLS[what]
    for bad in [*WRONG_VALUES, *((0, 16) if name == "fingers" else ())]:
        await refused(where, make, name, bad, ValueError)


@contract
@pytest.mark.parametrize("what", ORDERS)
async def test_of_several_wrong_arguments_the_first_is_named(where: str, what: str) -> None:
    make, order = ORDERS[what]
    async with bench(where) as here:
        hand: Any = here.make()
        for first in range(len(order)):
            with pytest.raises(ValueError, match=f"^{order[first]} must be"):
                await called(make(dict.fromkeys(order[first:], -1)), hand)


@contract
@pytest.mark.parametrize("what", TIMEOUTS)
async def test_timeouts(where: str, what: str) -> None:
    for value in (0, -1, float("nan"), float("inf"), 10**400):
        await refused(where, TIMEOUTS[what], "timeout", value, ValueError)
    for kind in ("1", True, np.bool_(True), np.complex64(1)):
        await refused(where, TIMEOUTS[what], "timeout", kind, TypeError)


@contract
async def test_a_command_that_says_nothing(where: str) -> None:
    async with bench(where) as here, here.make() as hand:
        with pytest.raises(ValueError, match="at least one of position, speed and force"):
            hand.command()


@contract
async def test_states(where: str) -> None:
    async with bench(where) as here, here.make() as hand:
        with pytest.raises(ValueError, match="states"):
            await hand.wait_for_state()
        with pytest.raises(TypeError, match="states must be State members, got 'FAULT'"):
            await hand.wait_for_state("FAULT")  # type: ignore[arg-type]


@contract
async def test_more_contacts_than_axes(where: str) -> None:
    for fingers, at_least in ((Finger.ABC, 4), (Finger.ABC, 0), (Finger.A, 2), (Finger.ALL, 5)):
        among = f"at_least must be in 1..{fingers.bit_count()}, got {at_least}"
        async with bench(where) as here, here.make() as hand:
            writes = here.writes
            with pytest.raises(ValueError, match=re.escape(among)):
                await hand.grasp(fingers, at_least=at_least)
            await asyncio.sleep(0.1)
            assert here.writes == writes


@contract
async def test_where_grip_events_begin(where: str) -> None:
    async with bench(where) as here, here.make() as hand:
        with pytest.raises(TypeError, match="since must be None or a RobotiqStatus, got 'now'"):
            hand.grip_events(since="now")  # type: ignore[arg-type]


@contract
async def test_buffers(where: str) -> None:
    async with bench(where) as here:
        hand = here.make()
        for opened in (hand.statuses, hand.requests):
            with pytest.raises(ValueError, match="buffer must be"):
                opened(0)
            with pytest.raises(TypeError, match="buffer must be"):
                opened("1")  # type: ignore[arg-type]


@contract
async def test_an_integer_mask_is_as_good_as_fingers(where: str) -> None:
    async with bench(where) as here, here.make() as hand:
        await hand.set_speed(5, 10)
        assert [axis.speed for axis in here.last_write.axes] == [128, 5, 128, 5]
        result = await hand.move(50, 1)
        assert set(result.outcomes) == {Finger.A}


@contract
async def test_integers_of_numpy_are_integers(where: str) -> None:
    async with bench(where) as here, here.make() as hand:
        abc: Any = np.int64(7)
        value: Any = np.uint8(90)
        seconds: Any = np.float32(30)
        result = await hand.move(value, abc, speed=value, force=value, timeout=seconds)
        assert set(result.outcomes) == {Finger.A, Finger.B, Finger.C}
        await hand.set_position(value, abc)
        await hand.set_speed(value, abc)
        await hand.set_force(value, abc)
        hand.command(abc, position=value, speed=value, force=value)
        await hand.hold(abc)
        assert await hand.wait_for_state(hand.state, timeout=seconds) is hand.state
        await at_rest(hand)
        for axis in here.last_write.axes[:3]:
            assert (axis.position, axis.speed, axis.force) == (90, 90, 90)
        assert hand.status.current(abc & 1) == hand.status.current(Finger.A)
        hand.statuses(value)
        hand.requests(value)
