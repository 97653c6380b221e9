"""Operators press HALT at random beside a loop that grasps for ever: nothing moves until one permits it.

The true motion of the simulated gripper is the judge. An hour of virtual
time: ``python -m tests.tools.test_operators 3600 2``.
"""

from __future__ import annotations

import asyncio
import random
import sys
from contextlib import suppress

from robotiq_async import Finger, ReconnectPolicy, RobotiqError, RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.actions import ACTIONS, Operator
from tests.grippers import activate_beforehand
from tests.virtual import run, virtual

ACTS_S = 0.3
"""Until a halt has acted: the device cycle, twice, and a second write."""
CALLS = ("grasp", "open", "activate", "recover", "command", "force")


async def grasps_for_ever(hand: RobotiqHand, chance: random.Random) -> None:
    """A program that catches everything and tries again at once, by every call that may move."""
    while True:
        with suppress(RobotiqError):
            match chance.choice(CALLS):
                case "grasp":
                    await hand.grasp(speed=chance.randrange(256))
                case "command":
                    hand.command(position=chance.randrange(256))
                case "force":
                    await hand.set_force(chance.randrange(256))
                case name:
                    await getattr(hand, name)()
        await asyncio.sleep(chance.choice((0.0, 0.01, 0.3)))


async def troubles(server: SimulatorServer, chance: random.Random) -> None:
    """The link is lost, the gripper is reset by another client, loses its power, gets a part or a fault."""
    gripper = server.gripper
    while True:
        await asyncio.sleep(chance.uniform(1, 20))
        match chance.randrange(5):
            case 0:
                server.cut(reset=True)
            case 1:
                gripper.power_cycle()
            case 2:
                gripper.write(0, [0] * 8)
            case 3:
                gripper.place_object(Finger.ABC, chance.randrange(30, 230))
            case 4:
                gripper.inject_fault(chance.choice((0x09, 0x0E)))
                await asyncio.sleep(chance.uniform(0, 1))
                gripper.clear_faults()


async def halted_at_random(seconds: float, seed: int) -> tuple[int, int]:
    """Returns the number of halts, and of those during which anything moved."""
    chance, loop = random.Random(seed), asyncio.get_running_loop()
    gripper = SimulatedGripper(loop.time, speedup=3, spread=False, device_cycle=0.03)
    halts = moved = 0
    policy = ReconnectPolicy(activate=True)
    async with SimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        async with RobotiqHand(server.address, poll_interval=0.02, reconnect=policy) as hand:
            person = Operator(hand, who="a person")
            beside = [
                loop.create_task(grasps_for_ever(hand, chance)),
                loop.create_task(grasps_for_ever(hand, chance)),
                loop.create_task(troubles(server, chance)),
            ]
            end = loop.time() + seconds
            while loop.time() < end:
                await asyncio.sleep(chance.uniform(0, 3))
                reached = False
                while not reached:  # as a person does, who sees that it could not be delivered
                    with suppress(RobotiqError):
                        await person.act(ACTIONS["halt"])
                        reached = True
                    await asyncio.sleep(ACTS_S)
                halts += 1
                before = [gripper.travel(axis) for axis in gripper.model.axes]
                await asyncio.sleep(chance.uniform(0, 6))
                moved += [gripper.travel(axis) for axis in gripper.model.axes] != before
                await person.act(ACTIONS["permit"])
            for task in beside:
                task.cancel()
            await asyncio.gather(*beside, return_exceptions=True)
    return halts, moved


@virtual
async def test_nothing_moves_between_a_halt_and_a_permit() -> None:
    halts, moved = await halted_at_random(60, seed=1)
    assert halts > 5
    assert moved == 0


if __name__ == "__main__":
    halts, moved = run(lambda: halted_at_random(float(sys.argv[1]), seed=int(sys.argv[2])))
    sys.stdout.write(f"{halts} halts, {moved} with motion after them\n")
