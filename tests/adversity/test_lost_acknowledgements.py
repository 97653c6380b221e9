"""A write that was carried out, but not acknowledged, on a slow gripper, and the call that follows.

The gripper takes up to 0.2 s until it follows a write, and shows nothing of it before. Its connection ends in
place of the acknowledgement, so the next call comes while an image may still act that no status shows. What
is promised is judged by what the fingers do, and by what they grip. Wires and models take turns; with
``LOST=all`` in the environment all of them are tried.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Awaitable, Callable, Iterable
from contextlib import suppress
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any, Final, NamedTuple

import pytest

from robotiq_async import Finger, ReconnectPolicy, RobotiqError, State
from robotiq_async.simulator import Trouble
from robotiq_async.simulator.troubles import corruption
from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, Model
from robotiq_async.values.request import Request
from tests.adversity.world import World, world
from tests.virtual import run

A: Final = Finger.A
TARGET: Final = 200
CLOSED: Final = 255
SETTLES_S: Final = 0.6
"""After a call the hand may have to write again, and what it has written shows."""
LATER_S: Final = 1.5
"""A request that was left on its way has moved a finger by then."""
LOOK_S: Final = 0.03

CYCLES_S: Final = (0.05, 0.1, 0.2)
COMBINATIONS: Final[tuple[tuple[str, Model], ...]] = (
    ("tcp", THREE_FINGER),
    ("urcap", TWO_FINGER_85),
    ("rtu", THREE_FINGER),
    ("tcp", HAND_E),
)


@dataclass
class Cell:
    """A gripper, a hand, and what has been seen of both.

    Attributes:
        world: all there is.
        cycle: seconds until the gripper follows a write.
        holds: the axes that hold a part.
        lost: set when the write has come and its acknowledgement is lost.
        doubts: moments at which a finger moved and ``hand.is_moving`` was False.
    """

    world: World
    cycle: float
    holds: Finger
    lost: asyncio.Event = field(default_factory=asyncio.Event)
    doubts: list[float] = field(default_factory=list)

    def lose_the_next_acknowledgement(self) -> None:
        """The reply to the next write is lost, and the connection with it; on a serial line it is damaged."""
        server, usual = self.world.server, self.world.server.policy

        def policy(frame: bytes) -> Iterable[tuple[float, bytes]] | None:
            reply = corruption.reply_on(server.link, frame)
            if not reply.is_to_a_write:
                return usual(frame)
            server.policy = usual
            self.lost.set()
            return corruption.wrong_checksum(reply, 0) if server.link == "rtu" else None

        server.policy = policy

    async def watch_is_moving(self) -> None:
        """Look at what is_moving says of fingers that move, until cancelled."""
        while True:
            with suppress(RobotiqError):
                if self._is_on_its_way() and not self.world.hand.is_moving:
                    self.doubts.append(self.world.loop.time())
            await asyncio.sleep(LOOK_S)

    def _is_on_its_way(self) -> bool:
        """Whether a finger moves: not over the last counts to its request, where a late gDT shows rest."""
        gripper = self.world.gripper
        is_there = (
            axis in gripper.holds or gripper.model.has_reached(gripper.target(axis), gripper.position(axis))
            for axis in gripper.model.axes
        )
        return gripper.is_moving and not all(is_there)

    async def until_back(self) -> None:
        """Wait for the link, if the hand has one."""
        with suppress(RobotiqError):
            await self.world.hand.wait_for_state(
                State.RUNNING_IDLE, State.RUNNING_CC, State.RESET, State.WF_ACTIVATION, State.FAULT, timeout=5
            )

    def images(self, since: int) -> list[Request]:
        """The images that the gripper got, from a number of writes on."""
        gripper = self.world.gripper
        return [Request.from_registers(each.registers, gripper.model) for each in gripper.images[since:]]


# -- the write ---------------------------------------------------------------------------------------------

Call = Callable[[World], Awaitable[Any]]


class Write(NamedTuple):
    """A call whose write is lost.

    Attributes:
        call: the call.
        moves: whether A is on its way when it comes.
        is_active: whether the gripper is active when it comes.
    """

    call: Call
    moves: bool = True
    is_active: bool = True


WRITES: Final = {
    "activation": Write(lambda world: world.hand.activate(), moves=False, is_active=False),
    "reset": Write(lambda world: world.hand.reset()),
    "motion": Write(lambda world: world.hand.move(TARGET, A, speed=0), moves=False),
    "press": Write(lambda world: world.hand.move(CLOSED, world.holds, force=200), moves=False),
    "hold": Write(lambda world: world.hand.hold(A)),
    "halt": Write(lambda world: world.hand.halt()),
    "stop": Write(lambda world: world.hand.stop()),
}


async def ready(cell: Cell, write: Write, name: str) -> None:
    """Bring the hand to where the write comes."""
    here = cell.world
    if write.is_active:
        await here.activate_beforehand()
        await here.hand.start()
        if cell.holds:
            here.gripper.place_object(cell.holds, 100)
            await here.hand.close(cell.holds, speed=255, force=50)
            assert here.gripper.grips == cell.holds
    else:
        await here.hand.start(activate=False)
    await here.server.fault_injector.begin(Trouble("slow-device", cell.cycle))
    if write.moves:
        await here.hand.set_speed(0, A)
        here.hand.command(A, position=TARGET)
        await here.until_moving()
        await asyncio.sleep(cell.cycle + 0.2)


# -- what follows ------------------------------------------------------------------------------------------


async def stop(cell: Cell) -> None:
    await cell.world.hand.stop()


async def halt(cell: Cell) -> None:
    await cell.world.hand.halt()


async def hold(cell: Cell) -> None:
    await cell.world.hand.hold()


async def reset(cell: Cell) -> None:
    await cell.world.hand.reset()


async def start(cell: Cell) -> None:
    """A start after an end without a stop, as of a program that is replaced; it moves another finger."""
    hand = cell.world.hand
    if hand.state is not State.SHUTDOWN:
        await hand.stop(halt=False)
    await hand.start(activate=False)
    if cell.world.gripper.model is THREE_FINGER:
        hand.command(Finger.SCISSOR, position=100)
    else:
        hand.command(force=77)


async def foreign(cell: Cell) -> None:
    """Another client sends every axis somewhere, under whatever the gripper was told before."""
    await cell.world.server.fault_injector.begin(Trouble("foreign", 128))


async def cancel(cell: Cell) -> None:
    """The call has been cancelled as its write was lost."""


NEXT: Final[dict[str, Callable[[Cell], Awaitable[None]]]] = {
    each.__name__: each for each in (stop, halt, hold, reset, start, foreign, cancel)
}


def stands(write: str, then: str) -> bool:
    """Whether nothing may move once the second call has returned, and acts."""
    if then in ("stop", "halt", "reset"):
        return True
    if then == "foreign":
        return False
    if then == "hold":
        return write != "activation"  # it moves on: there is nothing to hold in one
    return write not in ("activation", "motion") or (write, then) == ("motion", "cancel")


async def try_cell(link: str, model: Model, write: str, cycle: float, then: str) -> None:
    """Let it happen.

    Raises:
        AssertionError: a promise was broken.
    """
    with pytest.MonkeyPatch.context() as patch:
        options = {"reconnect": ReconnectPolicy(first_delay=0.001)}
        async with world(link, monkeypatch=patch, model=model, speedup=1.0, **options) as here:
            is_alone = len(model.axes) == 1
            holds = here.holds if write == "press" or not is_alone else Finger(0)
            cell, asked = Cell(here, cycle, holds), WRITES[write]
            await ready(cell, asked, write)
            watching = asyncio.ensure_future(cell.watch_is_moving())
            cell.lose_the_next_acknowledgement()
            writes = len(here.gripper.images)
            calling = asyncio.ensure_future(asked.call(here))
            await cell.lost.wait()
            if then == "cancel":
                calling.cancel()
            await asyncio.gather(calling, return_exceptions=True)
            if then != "stop":
                await cell.until_back()
            await judge(cell, write, then, writes)
            watching.cancel()


async def judge(cell: Cell, write: str, then: str, writes: int) -> None:
    """The second call comes; see what the fingers do."""
    here = cell.world
    gripper, hand = here.gripper, here.hand
    before = here.travels()
    is_refused = False
    try:
        await NEXT[then](cell)
    except RobotiqError:
        is_refused = True  # it says that it was not done
    await asyncio.sleep(cell.cycle + SETTLES_S)
    if stands(write, then) and not is_refused:
        place = gripper.position(A)
        await here.nothing_moves_for(LATER_S)
        assert gripper.position(A) == place
    else:
        await asyncio.sleep(LATER_S)
    if then not in ("foreign", "stop") and write != "stop":
        assert not cell.doubts, f"a finger moved and is_moving was False, {len(cell.doubts)} times"
    after = here.travels()
    if write != "activation" and then != "foreign":
        moved = {axis: after[axis] - before[axis] for axis in after if axis in cell.holds}
        assert not any(moved.values()), f"what holds a part has moved: {moved}"
    if write not in ("activation", "reset") and then not in ("foreign", "reset"):
        check_grips(cell, write, then, writes)
    if write != "activation":
        check_nothing_is_activated(cell, writes)
    if hand.state is not State.SHUTDOWN:
        await hand.stop()
        await asyncio.sleep(cell.cycle + SETTLES_S)
        await here.nothing_moves_for(LATER_S)


def check_grips(cell: Cell, write: str, then: str, writes: int) -> None:
    """No request is loosened, and the part is held."""
    images = cell.images(writes)
    # With rGTO clear a finger keeps its part by itself; the first motion after it asks the others to stay.
    if then == "start" and not all(image.go for image in images):
        return
    for axis in cell.world.gripper.model.axes:
        if axis in cell.holds:
            assert {image.position(axis) for image in images} == {CLOSED}, f"the grip of {axis!r} is loosened"
    # Fingers that press again, and are halted as they do, let go in the simulation.
    if write != "press" or then not in ("stop", "halt"):
        assert cell.world.gripper.holds & cell.holds == cell.holds, "the grip is gone"


def check_nothing_is_activated(cell: Cell, writes: int) -> None:
    """No image sets rACT after one that had cleared it."""
    for one, another in pairwise(cell.images(writes - 1)):
        assert one.activate or not another.activate, "rACT has risen"


def tried() -> list[tuple[str, Model, str, float, str]]:
    """The cells of the grid; wires and models take turns, or all of them are tried."""
    cells = []
    for at_write, write in enumerate(WRITES):
        for at_cycle, cycle in enumerate(CYCLES_S):
            for at_next, then in enumerate(NEXT):
                turn = (at_write + at_cycle + at_next) % len(COMBINATIONS)
                chosen = COMBINATIONS if os.environ.get("LOST") == "all" else COMBINATIONS[turn : turn + 1]
                cells += [(link, model, write, cycle, then) for link, model in chosen]
    return cells


@pytest.mark.parametrize(("link", "model", "write", "cycle", "then"), tried(), ids=str)
def test_what_follows_a_lost_acknowledgement(
    link: str, model: Model, write: str, cycle: float, then: str
) -> None:
    run(lambda: try_cell(link, model, write, cycle, then))
