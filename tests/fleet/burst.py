"""Bursts of requests over zenoh, on a machine that is kept busy.

``python -m tests.fleet.burst [HANDS [TIMES [BUSY]]]``: an agent with simulated grippers in a process of its
own, one client, and as many processes that only compute; each hand is asked for a move, all in one turn,
again and again. It says how the calls ended, and how long the longest was open. ``taskset -c 0`` makes it
hard.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import sys
from collections import Counter
from typing import Any

from robotiq_async import Finger, RobotiqError, RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.network.configuration import agent_configuration, client_configuration
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.simulator import SimulatorServer
from tests.fleet.sessions import free_port
from tests.grippers import active_gripper

PATIENCE_S = 20.0


async def serve(endpoint: str, hands: str) -> None:
    """Serve so many grippers until killed."""
    async with contextlib.AsyncExitStack() as stack:
        served = {}
        for number in range(int(hands)):
            server = await stack.enter_async_context(SimulatorServer(active_gripper(spread=False)))
            served[f"hand-{number}"] = RobotiqHand(server.address, poll_interval=0.1)
        bus = await open_bus(agent_configuration("lab", "cell", [endpoint]), endpoint)
        agent = Agent("lab", "cell", served, bus)
        await agent.run(lambda: print("ready", flush=True))  # noqa: T201


async def burst(hands: int, times: int, busy: int) -> dict[str, Any]:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    words = ("-m", "tests.fleet.burst", "serve", endpoint, str(hands))
    served = await asyncio.create_subprocess_exec(sys.executable, *words, stdout=asyncio.subprocess.PIPE)
    others = [
        await asyncio.create_subprocess_exec(sys.executable, "-c", "while True: pass") for _ in range(busy)
    ]
    ended: Counter[str] = Counter()
    longest = 0.0
    try:
        assert served.stdout is not None
        await served.stdout.readline()
        bus = await open_bus(client_configuration([endpoint]), endpoint)
        clients = [RemoteHand(f"zenoh://lab/cell/hand-{each}", bus=bus) for each in range(hands)]
        for hand in clients:
            await hand.start()

        async def move(hand: RemoteHand, to: int) -> None:
            nonlocal longest
            begun = asyncio.get_running_loop().time()
            try:
                async with asyncio.timeout(PATIENCE_S):
                    await hand.move(to, Finger.A, speed=255)
            except TimeoutError:
                ended["STILL OPEN"] += 1
            except RobotiqError as error:
                ended[f"{type(error).__name__} {getattr(error, 'reason', '')}"] += 1
                with contextlib.suppress(RobotiqError):
                    await hand.acquire()
            else:
                ended["done"] += 1
            longest = max(longest, asyncio.get_running_loop().time() - begun)

        for number in range(times):
            await asyncio.gather(*(move(hand, 20 + 10 * (number % 2)) for hand in clients))
        await asyncio.gather(*(hand.stop() for hand in clients))
        await bus.close()
    finally:
        for process in (served, *others):
            process.kill()
            await process.wait()
    return {"hands": hands, "times": times, "busy": busy, "ended": ended, "longest": round(longest, 2)}


if __name__ == "__main__":
    if sys.argv[1:2] == ["serve"]:
        asyncio.run(serve(*sys.argv[2:]))
    else:
        defaults = [64, 100, 2]
        given = [int(word) for word in sys.argv[1:]]
        print(json.dumps(asyncio.run(burst(*given, *defaults[len(given) :]))))  # noqa: T201
