"""An operator beside a flood: what it gets done, the time of a halt, and whether its lease lasts.

``python -m tests.fleet.flood [SECONDS] [KIND...]``. A gripper, its agent, an operator and a flooder, each a
process. Blocks of BLOCK_S take turns: the flood goes to another agent of this machine, to the operator's own,
to nobody. The machine has the same work with another agent and with its own: their ratio is what the flood
takes from the operator. The ratio to nobody also has what the flooder and its target take of the two cores,
which on another host they would not.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
import tempfile
import time
from asyncio.subprocess import PIPE, Process
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

from robotiq_async import Finger, RobotiqError, RobotiqHand
from robotiq_async.cli.keys.issuing import issue, make_authority
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.agent.records import file_records
from robotiq_async.fleet.keys.access import Role
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.network.configuration import agent_configuration, client_configuration
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentCall
from robotiq_async.simulator import SimulatorServer
from tests.fleet.cuts import ROOT
from tests.fleet.lab import LEFT
from tests.fleet.programs import say
from tests.fleet.sessions import free_port
from tests.grippers import active_gripper

FLOOD: Final = "tests.fleet.flood"
BLOCK_S: Final = 2.0
GOALS: Final = ("another", "its own", "nobody")
"""Agents that are flooded, in turn."""
HALT_EVERY_S: Final = 0.1
TICK_S: Final = 0.01
WAIT_S: Final = 0.3
"""For which a flooder waits for an answer, which it does not read."""
KINDS: Final[dict[str, tuple[bool, int, Callable[[int], str], dict[str, Any]]]] = {
    # with keys, rate, key, arguments
    "nothing": (False, 0, lambda _: LEFT.question("nobody"), {}),
    "reader with a key, 1,500/s": (True, 1500, lambda _: LEFT.question("read:alice"), {}),
    "reader with a key, 6,000/s": (True, 6000, lambda _: LEFT.question("read:alice"), {}),
    "strangers, 1,500/s": (False, 1500, lambda number: LEFT.question(f"x{number}"), {}),
    "strangers, 6,000/s": (False, 6000, lambda number: LEFT.question(f"x{number}"), {}),
    "lease requests, 1,500/s": (False, 1500, lambda _: LEFT.key("lease"), {"what": "acquire", "label": "x"}),
    "refused commands, 1,500/s": (False, 1500, lambda _: LEFT.key("cmd", "set_speed"), {"value": 3}),
}


def goal(at: float, begun: float) -> str:
    """The agent that is flooded at a time."""
    return GOALS[int((at - begun) / BLOCK_S) % len(GOALS)]


async def gripper() -> None:
    async with SimulatorServer(active_gripper(speedup=20.0, spread=False)) as server:
        say(server.address)
        await asyncio.Event().wait()


async def agent(endpoint: str, address: str, keys: str) -> None:
    folder = Path(keys) / "agent-cell" if keys else None
    bus = await open_bus(agent_configuration("lab", "cell", ["left"], [endpoint], keys=folder), endpoint)
    served = Agent("lab", "cell", {"left": RobotiqHand(address)}, bus, records=file_records())
    await served.run(lambda: say("ready"))


async def operator(endpoint: str, keys: str, begun: str, seconds: str) -> None:
    """Sets speeds one after the other, and halts now and then; prints its calls."""
    route = f"connect={endpoint}" + (f"&keys={keys}/operate-bob" if keys else "")
    calls: list[tuple[float, str, float, str]] = []
    start, until = float(begun), float(begun) + float(seconds)
    lost = 0

    async def call(what: str, work: Any) -> None:
        at = time.monotonic()
        try:
            await work
            outcome = "done"
        except RobotiqError as error:
            outcome = type(error).__name__
        calls.append((at - start, what, time.monotonic() - at, outcome))

    async with RemoteHand(f"{LEFT}?{route}") as hand:
        say("ready")
        await asyncio.sleep(max(0.0, start - time.monotonic()))

        async def halts() -> None:
            while time.monotonic() < until:
                await call("halt", hand.halt())
                await asyncio.sleep(HALT_EVERY_S)

        halting, number = asyncio.create_task(halts()), 0
        while time.monotonic() < until:
            number += 1
            if not hand.is_in_control:
                lost += 1
                await call("acquire", hand.acquire())
            await call("set_speed", hand.set_speed(number % 256, Finger.A))
        await halting
    say(json.dumps({"calls": calls, "lost": lost}))


async def flooder(endpoint: str, other: str, keys: str, kind: str, begun: str, seconds: str) -> None:
    _, rate, key, arguments = KINDS[kind]
    folder = Path(keys) / "read-alice" if keys else None
    buses = [await open_bus(client_configuration([each], keys=folder), each) for each in (other, endpoint)]
    of_goal = dict(zip(GOALS, buses, strict=False))
    start, until, sent, due = float(begun), float(begun) + float(seconds), 0, 0.0
    say("ready")
    while (now := time.monotonic()) < until:
        bus = of_goal.get(goal(now, start))
        if bus is not None and now > start:
            due += rate * TICK_S
            for _ in range(int(due)):
                sent += 1
                call = AgentCall(LEFT.base, f"x{sent}", number=sent, arguments=arguments)
                bus.ask(key(sent), call.pack(), timeout=WAIT_S, urgency=Urgency.COMMAND)
            due -= int(due)
        await asyncio.sleep(max(0.0, now + TICK_S - time.monotonic()))
    for bus in buses:
        await bus.close()
    say(json.dumps({"sent": sent}))


async def started(role: str, *words: str, **environment: str) -> tuple[Process, str]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", FLOOD, role, *words),
        cwd=ROOT,
        env=os.environ | environment,
        stdout=PIPE,
    )
    assert process.stdout is not None
    return process, (await process.stdout.readline()).decode().strip()


def make_keys(folder: Path) -> None:
    make_authority(folder)
    for name, role in (("alice", Role.READ), ("bob", Role.OPERATE), ("cell", Role.AGENT)):
        issue(folder, name, role)


async def flood(kind: str, seconds: float) -> dict[str, Any]:
    has_keys = KINDS[kind][0]
    turn = BLOCK_S * len(GOALS)
    seconds = turn * max(1, round(seconds / turn))  # so that each goal has as many blocks
    endpoint, other = [f"{'tls' if has_keys else 'tcp'}/127.0.0.1:{free_port()}" for _ in range(2)]
    running: list[Process] = []
    with tempfile.TemporaryDirectory() as folder:
        keys = f"{folder}/keys" if has_keys else ""
        if keys:
            make_keys(Path(keys))
        try:
            for each in (endpoint, other):
                one, address = await started("gripper")
                state = f"{folder}/{each.rpartition(':')[2]}"
                served, _ = await started("agent", each, address, keys, STATE_DIRECTORY=state)
                running += [one, served]
            times = (str(time.monotonic() + 12.0), str(seconds))
            asking, _ = await started("operator", endpoint, keys, *times)
            flooding, _ = await started("flooder", endpoint, other, keys, kind, *times)
            running += [asking, flooding]
            said = json.loads((await asking.communicate())[0].splitlines()[-1])
            sent = json.loads((await flooding.communicate())[0].splitlines()[-1])["sent"]
        finally:
            for process in running:
                if process.returncode is None:
                    process.kill()
                    await process.wait()
    return {"kind": kind, "asked/s": round(sent / seconds * len(GOALS) / 2), **judged(said)}


def judged(said: dict[str, Any]) -> dict[str, Any]:
    found: dict[str, Any] = {"leases lost": said["lost"]}
    done: dict[str, int] = {}
    for where in GOALS:
        those = [call for call in said["calls"] if goal(call[0], 0.0) == where]
        found[f"outcomes, {where}"] = dict(Counter(outcome for *_, outcome in those))
        for what in ("set_speed", "halt"):
            took = sorted(seconds for _, name, seconds, _ in those if name == what) or [0.0]
            p50, p99 = (round(1000 * took[int(len(took) * share)], 1) for share in (0.5, 0.99))
            most = round(1000 * took[-1], 1)
            found[f"{what}, {where}: calls, p50, p99, max ms"] = (len(took), p50, p99, most)
        done[where] = sum(name == "set_speed" for _, name, *_ in those)
    shares = {where: round(done["its own"] / done[where], 2) for where in ("another", "nobody")}
    return {**found, "share of that with another, with nobody": [*shares.values()]}


ROLES = {"gripper": gripper, "agent": agent, "operator": operator, "flooder": flooder}

if __name__ == "__main__":
    given = sys.argv[1:]
    if given and given[0] in ROLES:
        asyncio.run(ROLES[given[0]](*given[1:]))  # type: ignore[operator]
    else:
        for chosen in given[1:] or KINDS:
            say(json.dumps(asyncio.run(flood(chosen, float((given or ["60"])[0])))))
