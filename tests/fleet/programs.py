"""Programs for tests that need processes: an agent, and clients.

``python -m tests.fleet.programs agent|served|move|read|compare ARGUMENTS``; each says on standard output
where it stands, one word a line.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import signal
import sys
from collections.abc import Callable, Coroutine
from typing import Any

from robotiq_async import Finger, RobotiqError, RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.agent.records import file_records
from robotiq_async.fleet.network.configuration import (
    agent_configuration,
    client_configuration,
    session_configuration,
)
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.hands.options import POLL_INTERVAL_S
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.request import AxisRequest, Request

NAMES = ("left", "right")
POLL_S = 0.02
"""Of a hand in a process: its polls are half of what the process costs."""
B_STANDS = {"left": 0, "right": 100}
OWN = {"left": Finger.A, "right": Finger.C}
"""The finger that is commanded."""
STRANGER = {"left": Finger.C, "right": Finger.A}
"""The finger that only a command for the other gripper moves."""


def say(*words: object) -> None:
    sys.stdout.write(" ".join(map(str, words)) + "\n")
    sys.stdout.flush()


async def agent(endpoint: str, *addresses: str, router: str = "", poll_interval: float = POLL_S) -> None:
    """Serve grippers until SIGTERM, where clients come in or by a router."""
    hands = {
        name: RobotiqHand(address, poll_interval=poll_interval)
        for name, address in zip(NAMES, addresses, strict=False)
    }
    listen, connect = ([], [router]) if router else ([endpoint], [])
    bus = await open_bus(agent_configuration("lab", "cell", hands, listen, connect, insecure=True), endpoint)
    served = Agent("lab", "cell", hands, bus, records=file_records())
    serving = asyncio.ensure_future(served.run(lambda: say("ready")))
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, serving.cancel)
    try:
        with contextlib.suppress(asyncio.CancelledError):
            await serving
    finally:
        await bus.close()
    say("ended")


async def behind(endpoint: str, *addresses: str) -> None:
    """An agent behind a router."""
    await agent("", *addresses, router=endpoint)


async def router(endpoint: str) -> None:
    """A router, which is a session in that mode, until it is killed."""
    bus = await open_bus(session_configuration([endpoint], []) | {"mode": "router"}, endpoint)
    say("ready")
    await asyncio.Event().wait()
    await bus.close()


async def served(endpoint: str) -> None:
    """An agent with two grippers of its own; finger B stands elsewhere at each. It prints the motions."""
    loop, jumped = asyncio.get_running_loop(), [0.0]
    async with contextlib.AsyncExitStack() as stack:
        grippers = {}
        for name in NAMES:
            gripper = SimulatedGripper(lambda: loop.time() + jumped[0], spread=False)
            for go, at in ((False, 0), (True, 0), (True, B_STANDS[name])):
                axes = tuple(
                    AxisRequest(at if axis == 1 else 128 * (axis == 3), 255, 64) for axis in range(4)
                )
                gripper.write(0, Request(activate=True, go=go, axes=axes).registers)
                jumped[0] += 30
                gripper.status_registers()
            grippers[name] = gripper
        servers = [await stack.enter_async_context(SimulatorServer(each)) for each in grippers.values()]
        before = {name: grippers[name].travel(STRANGER[name]) for name in NAMES}
        await agent(endpoint, *(server.address for server in servers), poll_interval=POLL_INTERVAL_S)
        moved = {name: grippers[name].travel(STRANGER[name]) - before[name] for name in NAMES}
        writes = {name: len(grippers[name].writes) for name in NAMES}
    say(json.dumps({"moved by the wrong client": moved, "writes": writes}))


def address(name: str, endpoint: str) -> str:
    return f"zenoh://lab/cell/{name}?connect={endpoint}&insecure=1"


async def move(endpoint: str) -> None:
    """Move left slowly, and print the outcome."""
    async with RemoteHand(address("left", endpoint)) as hand:
        moving = asyncio.ensure_future(hand.move(255, Finger.A, speed=0))
        while not hand.is_moving:  # noqa: ASYNC110  # seen in the statuses, which are awaited nowhere here
            await asyncio.sleep(0.01)
        say("moving")
        try:
            await moving
        except RobotiqError as error:
            say(type(error).__name__)
        else:
            say("done")


async def read(endpoint: str) -> None:
    """Read statuses of left."""
    async with RemoteHand(address("left", endpoint), control=False) as hand:
        say("reading")
        async for _ in hand.statuses():
            pass


async def compare(endpoint: str) -> None:
    """Command both grippers, each a finger of its own, and compare what is heard with what can be."""
    heard, wrong, commanded = dict.fromkeys(NAMES, 0), 0, 0
    bus = await open_bus(client_configuration([endpoint], insecure=True), endpoint)
    hands = {name: RemoteHand(address(name, endpoint), bus=bus) for name in NAMES}
    ended = asyncio.Event()
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, ended.set)

    async def read(name: str) -> None:
        nonlocal wrong
        async for status in hands[name].statuses(10_000):
            heard[name] += 1
            wrong += abs(status.position(Finger.B) - max(B_STANDS[name], 6)) > 2

    async def command(name: str) -> None:
        nonlocal commanded
        at = 0
        while not ended.is_set():
            at = 40 - at
            with contextlib.suppress(RobotiqError):
                hands[name].command(OWN[name], position=20 + at)
                commanded += 1
            await asyncio.sleep(0.02)

    async with asyncio.TaskGroup() as group:
        for hand in hands.values():
            await hand.start()
        tasks = [group.create_task(work(name)) for name in NAMES for work in (read, command)]
        say("ready")
        await ended.wait()
        for hand in hands.values():
            await hand.stop()
        for task in tasks:
            task.cancel()
    misrouted = sum(hand._remote.session.mirror.misrouted for hand in hands.values() if hand._remote.session)
    await bus.close()
    say(json.dumps({"heard": heard, "wrong": wrong, "commanded": commanded, "misrouted": misrouted}))


PROGRAMS: dict[str, Callable[..., Coroutine[Any, Any, None]]] = {
    "agent": agent,
    "behind": behind,
    "router": router,
    "served": served,
    "compare": compare,
    "move": move,
    "read": read,
}

if __name__ == "__main__":
    asyncio.run(PROGRAMS[sys.argv[1]](*sys.argv[2:]))
