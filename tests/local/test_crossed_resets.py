"""Another client resets the gripper as the hand writes: the activation that follows is taken back.

The image of any command has rACT set. If the reset acts just before it, rACT rises, and all fingers go to
their stops beside the person who has just reset them.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections import deque
from collections.abc import Awaitable, Callable

import pytest

from robotiq_async import Finger, InvalidStateError, NotActivatedError, RobotiqError, RobotiqHand, State
from robotiq_async.values.registers import Registers
from tests.fake_transport import Wire
from tests.grippers import activate_beforehand
from tests.virtual import until

pytestmark = pytest.mark.virtual_time

A, B = Finger.A, Finger.B
AXES = (A, B, Finger.C, Finger.SCISSOR)
SPEEDUP = 4.0
"""Of the gripper. Its reset is crossed within a poll, and that lasts as long as ever."""
FASTEST = 112 * SPEEDUP
"""Counts a second of an activation."""
BEFORE_S = 0.1
"""Seconds of polls before the reset."""


async def at_every_status(hand: RobotiqHand) -> None:
    """A control loop."""
    position = 100
    async for _ in hand.statuses():
        position = 300 - position
        hand.command(A, position=position)


async def cancelled(hand: RobotiqHand) -> None:
    moving = asyncio.create_task(hand.move(255, A, speed=0))
    await asyncio.sleep(BEFORE_S)
    moving.cancel()
    await asyncio.wait({moving})


CALLS: dict[str, Callable[[RobotiqHand], Awaitable[object]]] = {
    "a control loop": at_every_status,
    "set_position": lambda hand: hand.set_position(40, A),
    "hold": lambda hand: hand.hold(A),
    "move": lambda hand: hand.move(40, A),
    "a cancelled move": cancelled,
}


def quick(device_cycle: float = 0.005) -> Wire:
    """A gripper that needs so long until a write acts, and moves fast."""
    return Wire(speedup=SPEEDUP, device_cycle=SPEEDUP * device_cycle)


async def active(wire: Wire) -> tuple[Wire, RobotiqHand]:
    """A gripper whose finger A moves, and a hand."""
    await activate_beforehand(wire.gripper)
    hand = RobotiqHand(wire)
    await hand.start()
    await hand.set_speed(0)
    await hand.set_position(255, A)
    await until(lambda: wire.gripper.position(A) > 20)
    return wire, hand


def travels(wire: Wire) -> list[float]:
    return [wire.gripper.travel(axis) for axis in AXES]


async def crossed(
    wire: Wire, hand: RobotiqHand, call: str, offset: float, later: float = 0.0
) -> asyncio.Task[object]:
    """Another client resets the gripper at a moment of a poll, and the call comes at once."""
    await asyncio.sleep(later)
    calling = asyncio.ensure_future(CALLS[call](hand)) if call.startswith("a ") else None
    await asyncio.sleep(BEFORE_S - 0.003)
    await anext(hand.statuses())
    await asyncio.sleep(offset)
    wire.gripper.write(0, [0])
    return asyncio.ensure_future(CALLS[call](hand)) if calling is None else calling


@pytest.mark.parametrize(
    ("device_cycle", "offset"), [(0.005, 0.0), (0.005, 0.001), (0.005, 0.002), (0.005, 0.004), (0.2, 0.002)]
)
@pytest.mark.parametrize("call", CALLS)
async def test_the_gripper_stays_reset(call: str, device_cycle: float, offset: float) -> None:
    wire, hand = await active(quick(device_cycle))
    calling = await crossed(wire, hand, call, offset)
    before = travels(wire)
    await asyncio.sleep(0.25 + 3 * device_cycle)
    assert hand.state is State.RESET
    assert not wire.gripper.request_registers[0] & 0x0100
    # Ten counts prove that it moves; a device cycle each for that and for the reset, and some polls.
    most = 10 + FASTEST * (2 * device_cycle + 0.06)
    assert max(now - then for now, then in zip(travels(wire), before, strict=True)) < most
    error = (await asyncio.gather(calling, return_exceptions=True))[0]
    if isinstance(error, InvalidStateError):  # a control loop is in time to see the activation begin
        assert call == "a control loop"
        assert error.state is State.WF_ACTIVATION
    else:
        assert error is None or isinstance(error, NotActivatedError)
    with pytest.raises(NotActivatedError):
        hand.command(A, position=0)
    await hand.stop()


class Trailing(Wire):
    """gIMC trails the echo by some reads."""

    def __init__(self, reads: int) -> None:
        super().__init__(speedup=SPEEDUP, device_cycle=SPEEDUP * 0.005)
        self._before: deque[int] = deque(maxlen=reads + 1)

    def shown(self) -> Registers:
        first, *others = super().shown()
        self._before.append(first & 0x3000)
        return (first & ~0x3000 | self._before[0], *others)


@pytest.mark.parametrize("offset", [0.0, 0.001, 0.002, 0.004])
@pytest.mark.parametrize("reads", [1, 3])
@pytest.mark.parametrize("later", [0.0, 0.003])
async def test_it_is_noticed_although_the_reset_shows_late(later: float, reads: int, offset: float) -> None:
    """While gIMC is still 3, gACT is 0 and 1 again: no poll sees the reset, or a single one does."""
    wire, hand = await active(Trailing(reads))
    calling = await crossed(wire, hand, "a control loop", offset, later)
    await asyncio.sleep(0.4)
    assert hand.state is State.RESET
    assert not wire.gripper.is_moving
    await asyncio.gather(calling, return_exceptions=True)
    await hand.stop()


@pytest.mark.parametrize("pause", [0.0, 0.005, 0.02, 0.3])
@pytest.mark.parametrize("device_cycle", [0.005, 0.2])
async def test_a_stop_meanwhile_leaves_nothing_moving(device_cycle: float, pause: float) -> None:
    """Clearing rGTO ends no activation: the fingers went to their stops after the hand had ended."""
    wire, hand = await active(quick(device_cycle))
    calling = await crossed(wire, hand, "set_position", 0.002)
    await asyncio.sleep(pause)
    await hand.stop()
    before = travels(wire)
    await asyncio.sleep(20 / SPEEDUP)
    assert travels(wire) == before
    await asyncio.gather(calling, return_exceptions=True)


@pytest.mark.parametrize("stop", [False, True])
async def test_closed_fingers_do_not_open(stop: bool) -> None:
    """An activation closes them first: they did not move for two seconds."""
    wire, hand = await active(quick())
    await hand.close(speed=255)
    calling = await crossed(wire, hand, "set_position", 0.002)
    await asyncio.sleep(1 / SPEEDUP)
    if stop:
        await hand.stop()
    await asyncio.sleep(4 / SPEEDUP)
    assert wire.gripper.position(B) > 200
    assert not wire.gripper.is_moving
    await asyncio.gather(calling, return_exceptions=True)
    await hand.stop()


async def test_it_is_logged_and_can_be_activated_again(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.WARNING, logger="robotiq_async")
    wire, hand = await active(quick())
    calling = await crossed(wire, hand, "set_position", 0.002)
    await calling
    await asyncio.sleep(1 / SPEEDUP)
    assert hand.state is State.RESET
    assert "the gripper was reset as it was commanded" in caplog.text
    await hand.recover()
    await hand.move(40, A)
    await hand.stop()


@pytest.mark.parametrize("pause", [0.01, 0.05, 0.3])
async def test_a_client_that_resets_and_activates_it_is_left_alone(pause: float) -> None:
    wire, hand = await active(quick())
    await hand.set_position(100, A)
    await asyncio.sleep(0.1)
    wire.gripper.write(0, [0x0000])
    await asyncio.sleep(pause)
    wire.gripper.write(0, [0x0100])
    await asyncio.sleep(1.5)
    assert hand.state is State.RUNNING_IDLE
    await hand.stop()


async def test_an_emergency_stop_beside_a_control_loop_resets_nothing() -> None:
    """A reset would drop the part, and the gripper shows what it shows while it activates."""
    wire, hand = await active(quick())
    looping = asyncio.create_task(at_every_status(hand))
    await asyncio.sleep(0.3)
    wire.gripper.emergency_stop()
    await asyncio.sleep(2)
    assert hand.state is State.WF_ACTIVATION
    assert all(image.activate for image in wire.written)
    with contextlib.suppress(RobotiqError):
        await looping
    await hand.stop()
