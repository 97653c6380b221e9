"""Random lives of a part that is held: whatever happens to the hand, nobody asks it to let go.

The part is a body (extra ``physics``): it falls if the fingers let it, whatever a status shows. Each call
asks the fingers to close, to press, to stay or to stop. ``python -m tests.adversity.held_part --lives 60``.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import logging
import random
import sys
from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Final

from robotiq_async import Finger, RobotiqError, RobotiqHand, State
from robotiq_async.simulator import Habits, Physics, SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.simulator.troubles.corruption import unchanged
from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, Model, model_of
from robotiq_async.values.request import Request
from robotiq_async.values.states import RUNNING
from tests.virtual import run

MODELS: Final = (TWO_FINGER_85, TWO_FINGER_140, HAND_E, THREE_FINGER)
"""The grippers that take turns."""
STEADY: Final = range(60, 91)
"""Forces of a 3-Finger. With more, the simulated fingers B and C push A back for ever, and the part creeps
down 15 mm in ten seconds; with less it slips as they press again. Both happen whatever a hand does."""
IN_A_JAW: Final = "box:30x40x60,0.3"
IN_A_HAND: Final = "box:60x60x60,0.3"
LIFTED_MM: Final = 60
FALLEN_MM: Final = 10
"""A part that is so much lower than it was lifted has slipped, or has been lost."""
PRESSES_N: Final = 2
CLOSED: Final = 255
WHAT: Final = (
    *("hold", "hold", "halt", "press", "press", "force", "cancel", "cancel", "timeout"),
    *("fault", "cut", "lost write", "keep", "keep"),
)
PAUSES_S: Final = (0.0, 0.005, 0.01, 0.02, 0.05, 0.1, 0.4)
CYCLES_S: Final = (0.005, 0.03, 0.1, 0.2)


@dataclass
class Life:
    """The fate of a part.

    Attributes:
        title: the gripper and its device cycle.
        physics: the bodies.
        events: what has happened, in words.
        is_lost: whether the part has slipped or fallen.
        loosened: requests that were less closed than those before, while a finger pressed.
    """

    title: str
    physics: Physics
    events: list[str] = field(default_factory=list)
    is_lost: bool = False
    loosened: list[tuple[str, int]] = field(default_factory=list)

    def holds(self) -> bool:
        return self.physics.grip_force > PRESSES_N

    @property
    def height_mm(self) -> float:
        part = self.physics.part
        assert part is not None
        return part[2]


class _Gripper(SimulatedGripper):
    """Takes note of the requests for fingers that press."""

    life: Life | None = None

    def write(self, address_offset: int, registers: Iterable[int]) -> None:
        before = Request.from_registers(self.request_registers, self.model)
        super().write(address_offset, tuple(registers))
        asked = Request.from_registers(self.request_registers, self.model)
        if self.life is not None and self.life.holds():
            for axis in self.model.axes:
                if asked.go and asked.position(axis) < before.position(axis):
                    self.life.loosened.append((axis.name or "", asked.position(axis)))


async def _lived(seed: int, steps: int, model: Model | None) -> Life:
    chance = random.Random(seed)
    model = model or chance.choice(MODELS)
    physics, cycle = Physics(IN_A_HAND if model is THREE_FINGER else IN_A_JAW), chance.choice(CYCLES_S)
    gripper = _Gripper(
        asyncio.get_running_loop().time, model=model, physics=physics, habits=Habits(activation_time=0)
    )
    life = Life(f"{model.name}, cycle {cycle:g} s", physics)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        grasp = await hand.grasp(speed=255, force=chance.choice((0, 60)))
        assert grasp, "the part is gripped"
        gripper.device_cycle = cycle
        physics.lift(LIFTED_MM)
        await asyncio.sleep(2 * LIFTED_MM / 100)
        height, gripper.life = life.height_mm, life
        for _ in range(steps):
            what, pause = chance.choice(WHAT), chance.choice(PAUSES_S)
            life.events.append(f"{what} {pause:g}")
            with contextlib.suppress(RobotiqError):
                await _happen(what, hand, server, chance)
            await asyncio.sleep(pause)
        server.policy = unchanged
        await asyncio.sleep(2.0)
        if hand.state is State.FAULT:
            life.events.append("a fault")
        life.is_lost = life.height_mm < height - FALLEN_MM
        gripper.life = None
    return life


async def _happen(what: str, hand: RobotiqHand, server: SimulatorServer, chance: random.Random) -> None:
    """One thing that happens; none of them lets go."""
    fingers = hand.model.mask(Finger.ABC)
    forces = STEADY if hand.model is THREE_FINGER else range(30, 256)
    force, while_s = chance.choice(forces), chance.choice(PAUSES_S)
    if what in ("halt", "fault", "keep"):
        await _until_gripped(hand, server.gripper, fingers)
    match what:
        case "hold":
            await hand.hold(fingers)
        case "halt":
            await hand.halt()
        case "press":
            hand.command(fingers, position=CLOSED, force=force)
        case "force":
            await hand.set_force(force, fingers)
        case "cancel":
            closing = asyncio.ensure_future(hand.move(CLOSED, fingers, force=force))
            await asyncio.sleep(while_s)
            closing.cancel()
            await asyncio.gather(closing, return_exceptions=True)
        case "timeout":
            await hand.move(CLOSED, fingers, force=force, timeout=while_s + 0.001)
        case "fault":
            async with server.fault_injector.making(Trouble("fault", 9)):
                await asyncio.sleep(while_s)
        case "cut":
            server.cut()
            await asyncio.sleep(while_s)
        case "lost write":
            hand.command(fingers, position=CLOSED, force=force)
            await asyncio.sleep(0.004)  # it has been written, and is acknowledged soon
            server.cut(reset=True)
        case "keep":
            await hand.stop(keep_grip=True)
            await hand.start(activate=False)


async def _until_gripped(hand: RobotiqHand, gripper: SimulatedGripper, fingers: Finger) -> None:
    """Wait for the contact: fingers that are halted while they press again let go, in this simulation.

    What was written before must act first. A stop that is to keep the grip halts them where that is in doubt.
    """
    await hand.wait_for_state(*RUNNING, State.FAULT, timeout=5)
    for _ in range(3):
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(1.0):
                while gripper.grips & fingers != fingers:  # noqa: ASYNC110  # there is no event to wait for
                    await asyncio.sleep(0.005)
        await asyncio.sleep(max(CYCLES_S))


def lived(seed: int, steps: int = 8, model: Model | None = None) -> Life:
    """A life by its number; without a model, of one of those that take turns."""

    async def main() -> Life:
        return await _lived(seed, steps, model)

    return run(main)


def main() -> None:
    """Live, and print the figures; exit with 1 if a part was lost."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--lives", type=int, default=60)
    parser.add_argument("--first", type=int, default=0, help="number of the first")
    parser.add_argument("--steps", type=int, default=8, help="things that happen in a life")
    parser.add_argument("--model", type=model_of, help="of the gripper; by default the jaws in turn")
    asked = parser.parse_args()
    logging.disable(logging.CRITICAL)
    bad = loose = 0
    for seed in range(asked.first, asked.first + asked.lives):
        life = lived(seed, asked.steps, asked.model)
        bad, loose = bad + life.is_lost, loose + bool(life.loosened)
        if life.is_lost or life.loosened:
            what = "part lost" if life.is_lost else "loosened"
            print(f"{seed}: {what}, {life.title}; {', '.join(life.events)}; {life.loosened}", flush=True)  # noqa: T201
    print(f"{asked.lives} lives: {bad} parts lost, requests loosened in {loose}")  # noqa: T201
    sys.exit(1 if bad else 0)


if __name__ == "__main__":
    main()
