"""Cost and speed of the node, beside the hand alone: the figures of docs/decisions/ros2.md.

    .venv-ros2/jazzy/bin/python -m tests.ros2.live.figures

Takes about two minutes. The gripper is a simulated one at its usual speed.
"""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable
from pathlib import Path
from statistics import median
from typing import Final

from tests.ros2.live.bench import ABORTED, CANCELED, Client, Goal, active
from tests.ros2.live.processes import Process, isolate, node
from tests.ros2.live.simulated import Simulator

SECONDS: Final = 10.0
"""Seconds over which CPU time and polls are counted."""
TICK: Final = os.sysconf("SC_CLK_TCK")
ALONE: Final = """
import asyncio, sys
from robotiq_async import RobotiqHand
async def main():
    hand = RobotiqHand(sys.argv[1])
    await hand.start(activate=False)
    print("connected")
    await asyncio.sleep(float(sys.argv[2]))
    it = hand.statistics
    print(f"{it.polls} polls, {it.overruns} missed, p99 {it.period_p99 * 1e3:.1f} ms")
    await hand.stop(halt=False)
asyncio.run(main())
"""


def print_figures(what: str, seconds: list[float]) -> None:
    """A line of a table."""
    figures = f"p50 {median(seconds) * 1e3:.1f} ms, max {max(seconds) * 1e3:.1f} ms"
    print(f"{what} (n={len(seconds)}): {figures}", flush=True)  # noqa: T201


def timed(work: Callable[[], object]) -> float:
    began = time.perf_counter()
    work()
    return time.perf_counter() - began


# -- latencies ----------------------------------------------------------------------------------------------


def under_way(client: Client) -> Goal:
    """Open the fingers, then close them; returns while they close."""
    client.move(0.0).ends()
    goal = client.move(2.8)
    goal.feedback.wait(lambda it: it.state.position[-3] > 0.2, new=False)
    return goal


def accepted(client: Client) -> float:
    began = time.perf_counter()
    goal = client.move(0.3)
    seconds = time.perf_counter() - began
    goal.ends()
    return seconds


def latencies(address: str) -> None:
    with active(address) as (process, client):
        print_figures("goal to accepted", [accepted(client) for _ in range(100)])
        print_figures(
            "the same, while another one is under way", [timed(lambda: client.move(0.3)) for _ in range(100)]
        )
        ended = []
        for _ in range(20):
            goal = under_way(client)
            began = time.perf_counter()
            goal.cancel()
            assert goal.ends()[0] == CANCELED
            ended.append(time.perf_counter() - began)
        print_figures("cancel to CANCELED, which says that the hold was acknowledged", ended)
        halts = []
        for _ in range(20):
            under_way(client)
            halts.append(timed(lambda: client.call("halt")))
        print_figures("halt of moving fingers to its answer", halts)
        goal = under_way(client)
        began = time.perf_counter()
        process.send(signal.SIGINT)
        assert goal.ends()[0] == ABORTED
        aborted = time.perf_counter() - began
        process.ends()
        end = time.perf_counter() - began
        print(f"Ctrl-C to ABORTED: {aborted * 1e3:.0f} ms; to exit: {end * 1e3:.0f} ms", flush=True)  # noqa: T201


def stillness() -> None:
    """Seconds from the cancel until the gripper acts on the hold, by its clock, which is this process's."""
    held = []
    with Simulator(speedup=1.0) as simulator, active(simulator.address) as (_, client):
        for _ in range(20):
            goal = under_way(client)
            began = time.monotonic()
            goal.cancel()
            goal.ends()
            held.append(simulator.read("writes")[-1].time - began + 0.005)
    print_figures("cancel to still, by the gripper's clock (its cycle of 5 ms included)", held)


# -- what it costs ------------------------------------------------------------------------------------------


def cpu(pid: int) -> float:
    """Seconds of CPU that a process has taken."""
    fields = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / TICK


def share(process: Process) -> str:
    before = cpu(process.pid)
    time.sleep(SECONDS)
    return f"{(cpu(process.pid) - before) / SECONDS * 100:.1f} % of a core"


def alone(address: str) -> None:
    with Process("-c", ALONE, address, str(SECONDS + 2)) as process:
        process.prints("connected")
        cost = share(process)
        print(f"hand alone: {cost}; {process.prints('polls, ').strip()}", flush=True)  # noqa: T201


def with_node(address: str, rate: float, what: str, meanwhile: str = "") -> None:
    with node(address=address, autostart=True, publish_rate=rate) as process, Client() as client:
        process.prints("commands are taken")
        states, diagnostics = client.joint_states(), client.diagnostics()
        states.wait()
        hammering = Process("-m", "tests.ros2.live.client", *meanwhile.split()) if meanwhile else None
        if hammering:
            hammering.prints("begun")
        before, first = {it.key: it.value for it in diagnostics.wait().status[0].values}, len(states.messages)
        cost = share(process)
        link = {it.key: it.value for it in diagnostics.wait().status[0].values}
        polls = int(link["polls"]) - int(before["polls"])
        overruns = int(link["overruns"]) - int(before["overruns"])
        rate = (len(states.messages) - first) / SECONDS
        polling = f"{polls} polls, {overruns} missed, p99 {link['period p99 [ms]']} ms"
        print(f"{what}: {cost}; {polling}; {rate:.0f} joint states a second", flush=True)  # noqa: T201
        if hammering:
            hammering.__exit__()


def main() -> None:
    """Print all figures."""
    isolate()
    print(f"load before: {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores", flush=True)  # noqa: T201
    stillness()
    with Simulator(speedup=1.0) as simulator:
        address = simulator.address
        latencies(address)
        alone(address)
        with_node(address, 1.0, "node, joint states at 1 Hz")
        with_node(address, 50.0, "node, joint states at 50 Hz")
        with_node(address, 200.0, "node, joint states at 200 Hz")
        with_node(
            address,
            50.0,
            "the same at 50 Hz, while a client calls halt without a pause",
            "hammer halt 100000",
        )
    print(f"load after: {os.getloadavg()[0]:.1f}", flush=True)  # noqa: T201


if __name__ == "__main__":
    main()
