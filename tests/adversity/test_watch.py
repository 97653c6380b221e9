"""The watches of the soak run: they tell of a replay and of an old status, and of nothing like them."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest
from pymodbus.framer import FramerRTU

from robotiq_async import JAW, Finger, RobotiqStatus
from robotiq_async.link.frames import CHECKSUM, expected_reply
from robotiq_async.simulator import Trouble
from robotiq_async.simulator.troubles.corruption import Reply, seven_bits
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85
from robotiq_async.values.request import AxisRequest, Request
from tests.adversity.watch import WriteWatch
from tests.adversity.world import UrcapServer, World, started
from tests.virtual import inside, until

FIRST, SECOND = "SPE 10 FOR 1 POS 100", "SPE 11 FOR 1 POS 200"


class Scene:
    """A jaw at a text port that is at the position of FIRST, and on its way to that of SECOND."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._watch = WriteWatch(TWO_FINGER_85)

    async def say(self, asked: str) -> None:
        """Send a motion from a connection of its own, and wait until it is under way or over."""
        assert isinstance(self._world.server, UrcapServer)
        _, writer = await asyncio.open_connection("127.0.0.1", self._world.server.port)
        writer.write(f"SET {asked} GTO 1\n".encode())
        goal = int(asked.split()[-1])
        await until(lambda: abs(self._world.gripper.target(JAW) - goal) < 3)
        await asyncio.sleep(0.05)
        writer.close()

    def told(self) -> list[str]:
        return [*self._watch.check(self._world)]


@asynccontextmanager
async def on_the_way(spacing: float) -> AsyncIterator[Scene]:
    async with started("urcap", model=TWO_FINGER_85) as world, AsyncExitStack() as stack:
        await world.hand.stop(halt=False)
        scene = Scene(world)
        await scene.say(FIRST)
        await until(lambda: not world.gripper.is_moving)
        if spacing:
            trouble = Trouble("one-by-one", spacing)
            await stack.enter_async_context(world.server.fault_injector.making(trouble))
        await scene.say(SECOND)
        yield scene


@pytest.mark.parametrize("spacing", [0.0, 0.01])
@inside(on_the_way, "spacing")
async def test_a_command_that_comes_back_is_told(here: Scene) -> None:
    assert here.told() == []
    await here.say(FIRST)
    again, after = here.told()
    assert "asked again for what it was before: AxisRequest(position=100, speed=10, force=1)" in again
    assert after.startswith("after\n")


@pytest.mark.parametrize("spacing", [0.0, 0.01])
@inside(on_the_way, "spacing")
async def test_a_hold_where_the_jaw_has_stood_is_no_replay(here: Scene) -> None:
    """Half of the command before it asked for the same, if its variables were taken one by one."""
    await here.say("SPE 11 FOR 1 POS 100")
    assert here.told() == []


@asynccontextmanager
async def setting_off() -> AsyncIterator[tuple[World, WriteWatch, Request]]:
    """Finger B leaves the place where it stood, with settings that it got there; no hand has seen it move."""
    async with started(model=THREE_FINGER) as world:
        await world.hand.stop(halt=False)
        gripper, watch = world.gripper, WriteWatch(THREE_FINGER)
        axes = [AxisRequest(gripper.position(axis), 254, 2) for axis in THREE_FINGER.axes]
        stands = Request(activate=True, go=True, axes=tuple(axes))
        gripper.write(0, stands.registers)
        gripper.status_registers()
        gripper.write(0, stands.with_positions({Finger.B: 200}).registers)
        await until(lambda: gripper.position(Finger.B) > axes[1].position + 5)
        yield world, watch, stands


@inside(setting_off)
async def test_a_hold_where_a_finger_was_last_seen_is_no_replay(
    here: tuple[World, WriteWatch, Request],
) -> None:
    world, watch, stands = here
    world.gripper.write(0, stands.registers)
    assert [*watch.check(world)] == []


@inside(setting_off)
async def test_the_same_request_after_the_finger_was_seen_elsewhere_is_told(
    here: tuple[World, WriteWatch, Request],
) -> None:
    world, watch, stands = here
    world.gripper.status_registers()
    world.gripper.write(0, stands.registers)
    again, _ = watch.check(world)
    assert "Finger.B" in again


@pytest.mark.parametrize("link", ["tcp", "rtu", "urcap"])
def test_a_status_of_before_is_told_with_what_was_said(link: str, monkeypatch: pytest.MonkeyPatch) -> None:
    @inside(started, "link", "monkeypatch", model=TWO_FINGER_85)
    async def tell(here: World) -> None:
        await here.hand.move(100)
        here.check_no_stale_status()
        old, new = here.statuses[-5], here.statuses[-1]
        here.statuses[-1] = RobotiqStatus(old.registers, new.timestamp, new.sequence, old.model)
        with pytest.raises(AssertionError, match=r"answers an older request: asked again|is not \{") as told:
            here.check_no_stale_status()
        sent = b"".join(each.to_bytes(2, "big") for each in new.registers[:3]).hex(" ")
        assert (f"POS {new.position(JAW)}" if link == "urcap" else sent) in str(told.value)

    tell(link=link, monkeypatch=monkeypatch)


@inside(started, model=THREE_FINGER)
async def test_no_status_keeps_its_checksum_without_its_highest_bits(here: World) -> None:
    """It had the number of a status of 128 before, and a soak took it for that."""
    await here.hand.move(96, Finger.ALL)
    reads, passed = expected_reply(b"\x09\x03\x07\xd0\x00\x08", checksum=CHECKSUM), 0
    for _ in range(300):
        body = b"\x09\x03\x10" + b"".join(each.to_bytes(2, "big") for each in here.gripper.status_registers())
        frame = body + FramerRTU.compute_CRC(body).to_bytes(CHECKSUM, "big")
        ((_, sent),) = seven_bits(Reply(frame, serial=True), 0)
        passed += sent != frame and isinstance(reads.verdict(sent), bytes)
    assert not passed
