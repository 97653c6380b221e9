"""Agent and clients as processes: what signals do to them, and cut networks."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import socket
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field

import pytest

from robotiq_async import ConnectionLostError, Finger, RobotiqError, State
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.fleet import cuts
from tests.forked import ROOT, forking
from tests.grippers import active_gripper
from tests.patience import patience

PROGRAMS = "tests.fleet.programs"
IMPORTED = (PROGRAMS, "zenoh", "anyio._backends._asyncio")
LIMIT_S = 8.0
"""Seconds for work that takes one or two: the machine does other things too."""


# -- processes ---------------------------------------------------------------------------------------------


async def said(process: Process) -> str:
    """The next line of a program: its progress."""
    assert process.stdout is not None
    async with asyncio.timeout(patience(2 * LIMIT_S)):
        return (await process.stdout.readline()).decode().strip()


@dataclass
class Site:
    """A gripper in this process, and programs around it.

    Attributes:
        endpoint: where the agent listens.
    """

    gripper: SimulatedGripper
    server: SimulatorServer
    endpoint: str
    programs: list[Process] = field(default_factory=list)

    async def start(self, name: str, *words: str, says: str = "ready") -> Process:
        """Start a program of tests/fleet/programs.py, and wait for its first word."""
        words = ("-m", PROGRAMS, name, self.endpoint, *words)
        with forking(IMPORTED):
            process = await asyncio.create_subprocess_exec(
                sys.executable, *words, cwd=ROOT, env=os.environ, stdin=DEVNULL, stdout=PIPE, stderr=2
            )
        self.programs.append(process)
        assert await said(process) == says
        return process

    async def start_agent(self, name: str = "agent") -> Process:
        return await self.start(name, self.server.address)

    def hand(self) -> RemoteHand:
        return RemoteHand(f"zenoh://lab/cell/left?connect={self.endpoint}")

    async def until(self, condition: Callable[[], bool]) -> float:
        """Wait until something is true; returns how long that took."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        async with asyncio.timeout(patience(LIMIT_S)):
            while not condition():  # noqa: ASYNC110  # there is no event to wait for
                await asyncio.sleep(0.01)
        return loop.time() - began


@pytest.fixture
async def site() -> AsyncIterator[Site]:
    gripper = active_gripper(1.0, spread=False)
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as free:
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    async with SimulatorServer(gripper) as server:
        here = Site(gripper, server, endpoint)
        try:
            yield here
        finally:
            for process in here.programs:
                if process.returncode is None:
                    process.kill()
                await process.wait()
                process._transport.close()  # type: ignore[attr-defined]


async def test_a_client_is_frozen_and_goes_on(site: Site) -> None:
    await site.start_agent()
    mover = await site.start("move", says="moving")
    await site.until(lambda: site.gripper.is_moving)
    mover.send_signal(signal.SIGSTOP)
    assert await site.until(lambda: not site.gripper.is_moving) < patience(3)
    stood = site.gripper.position(Finger.A)
    async with site.hand() as hand:
        await hand.halt()
    mover.send_signal(signal.SIGCONT)
    assert await said(mover) in ("ControlLostError", "ConnectionLostError", "NoAnswerError")
    async with asyncio.timeout(patience(LIMIT_S)):
        await mover.wait()
    assert site.gripper.position(Finger.A) == stood


async def test_a_stop_beside_a_halt_ends_in_its_time_although_the_agent_is_frozen(site: Site) -> None:
    """It waited for the halt, for the release and for the end of the session: 3.3 s."""
    agent = await site.start_agent()
    hand = site.hand()
    await hand.start()
    agent.send_signal(signal.SIGSTOP)
    halting = asyncio.ensure_future(hand.halt())
    await asyncio.sleep(0)
    began = asyncio.get_running_loop().time()
    await hand.stop()
    assert asyncio.get_running_loop().time() - began < patience(2)
    with pytest.raises(RobotiqError):
        await halting
    agent.send_signal(signal.SIGCONT)


async def test_an_agent_is_killed_and_the_next_one_holds(site: Site) -> None:
    agent = await site.start_agent()
    async with site.hand() as hand:
        moving = asyncio.ensure_future(hand.move(255, Finger.A, speed=0))
        await site.until(lambda: site.gripper.position(Finger.A) > 15)
        agent.send_signal(signal.SIGKILL)
        with pytest.raises(ConnectionLostError):
            async with asyncio.timeout(patience(LIMIT_S)):
                await moving
        assert site.gripper.is_moving
        await site.until(lambda: not hand.is_in_control)
        await site.start_agent()
        await site.until(lambda: not site.gripper.is_moving)
        assert site.gripper.position(Finger.A) < 250
        await site.until(lambda: hand.is_in_control)
        await hand.move(0, Finger.A, speed=255)


async def test_a_frozen_reader_delays_no_other(site: Site) -> None:
    await site.start_agent()
    reader = await site.start("read", says="reading")
    loop = asyncio.get_running_loop()
    async with site.hand() as hand:
        reader.send_signal(signal.SIGSTOP)
        longest, before = 0.0, loop.time()
        ends = loop.time() + 3
        statuses = hand.statuses()
        while loop.time() < ends:
            async with asyncio.timeout(patience(LIMIT_S)):
                await anext(statuses)
            longest, before = max(longest, loop.time() - before), loop.time()
        assert longest < 1
        await hand.set_speed(200)
        reader.send_signal(signal.SIGCONT)
        await hand.set_speed(100)


async def test_a_router_is_killed_and_comes_back(site: Site) -> None:
    """Agent and client know the router and nothing of each other."""
    router = await site.start("router")
    await site.start_agent("behind")
    async with site.hand() as hand:
        moving = asyncio.ensure_future(hand.move(255, Finger.A, speed=0))
        await site.until(lambda: site.gripper.position(Finger.A) > 15)
        router.send_signal(signal.SIGKILL)
        assert await site.until(lambda: not site.gripper.is_moving) < patience(3)
        with pytest.raises(ConnectionLostError):
            async with asyncio.timeout(patience(LIMIT_S)):
                await moving
        await site.until(lambda: hand.state is State.DISCONNECTED)
        assert not hand.is_in_control
        stood, writes = site.gripper.position(Finger.A), len(site.gripper.writes)
        await site.start("router")
        await site.until(lambda: hand.is_in_control)
        sequence = hand.status.sequence
        await site.until(lambda: hand.status.sequence > sequence + 20)
        assert hand.state is State.RUNNING_IDLE
        assert (site.gripper.position(Finger.A), len(site.gripper.writes)) == (stood, writes)
        await hand.move(0, Finger.A, speed=255)


# -- namespaces --------------------------------------------------------------------------------------------


@pytest.mark.skipif(bool(cuts.missing()), reason=cuts.missing() or "here it can")
async def test_nothing_comes_to_the_wrong_gripper() -> None:
    try:
        came = await cuts.marathon(3)
    except RuntimeError as error:
        pytest.skip(f"no network namespaces or no nftables here: {error}")
    assert came["wrong"] == 0
    assert came["moved by the wrong client"] == {"left": 0, "right": 0}
    assert min(came["heard"].values()) > 100
    assert min(came["writes"].values()) > 20
