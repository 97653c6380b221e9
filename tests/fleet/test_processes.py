"""Agent and clients as processes: what signals do to them, and cut networks."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import socket
import sys
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass
from pathlib import Path

import pytest

from robotiq_async import ConnectionLostError, Finger, State
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.fleet import cuts
from tests.grippers import ACTIVATION, OPENING

ROOT = Path(__file__).parents[2]
LIMIT_S = 8.0
"""For what takes a second or two: the machine does other things too."""


# -- processes ---------------------------------------------------------------------------------------------


@dataclass
class Program:
    """A process that says where it stands."""

    process: asyncio.subprocess.Process

    async def says(self, word: str) -> None:
        assert self.process.stdout is not None
        async with asyncio.timeout(2 * LIMIT_S):
            line = (await self.process.stdout.readline()).decode().strip()
        assert line == word

    def signal(self, number: signal.Signals) -> None:
        self.process.send_signal(number)

    async def ends(self) -> int:
        async with asyncio.timeout(LIMIT_S):
            return await self.process.wait()


@dataclass
class Site:
    """A gripper in this process, and programs around it.

    Attributes:
        endpoint: where the agent listens.
    """

    gripper: SimulatedGripper
    server: SimulatorServer
    endpoint: str
    programs: list[Program]

    async def start(self, *words: str) -> Program:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-m", "tests.fleet.programs", *words, cwd=ROOT, stdout=asyncio.subprocess.PIPE
        )
        program = Program(process)
        self.programs.append(program)
        return program

    async def start_agent(self) -> Program:
        agent = await self.start("agent", self.endpoint, self.server.address)
        await agent.says("ready")
        return agent

    async def start_router(self) -> Program:
        router = await self.start("router", self.endpoint)
        await router.says("ready")
        return router

    async def start_mover(self) -> Program:
        mover = await self.start("move", self.endpoint)
        await mover.says("moving")
        await self.until(lambda: self.gripper.is_moving)
        return mover

    def hand(self) -> RemoteHand:
        return RemoteHand(f"zenoh://lab/cell/left?connect={self.endpoint}")

    async def until(self, condition: Callable[[], bool]) -> float:
        """Wait until something is true; returns how long that took."""
        loop = asyncio.get_running_loop()
        began = loop.time()
        async with asyncio.timeout(LIMIT_S):
            while not condition():  # noqa: ASYNC110  # there is no event to wait for
                await asyncio.sleep(0.01)
        return loop.time() - began


@pytest.fixture
async def site() -> AsyncIterator[Site]:
    loop, jumped = asyncio.get_running_loop(), [0.0]
    gripper = SimulatedGripper(lambda: loop.time() + jumped[0], spread=False)
    for image in (ACTIVATION, OPENING):
        gripper.write(0, image)
        jumped[0] += 30
        gripper.status_registers()
    with contextlib.closing(socket.create_server(("127.0.0.1", 0))) as free:
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    async with SimulatorServer(gripper) as server:
        here = Site(gripper, server, endpoint, [])
        try:
            yield here
        finally:
            for program in here.programs:
                if program.process.returncode is None:
                    program.process.kill()
                await program.process.wait()
                program.process._transport.close()  # type: ignore[attr-defined]


async def test_a_client_is_frozen_and_goes_on(site: Site) -> None:
    await site.start_agent()
    mover = await site.start_mover()
    mover.signal(signal.SIGSTOP)
    assert await site.until(lambda: not site.gripper.is_moving) < 3
    stood = site.gripper.position(Finger.A)
    async with site.hand() as hand:
        await hand.halt()
    mover.signal(signal.SIGCONT)
    assert mover.process.stdout is not None
    told = (await mover.process.stdout.readline()).decode().strip()
    assert told in ("ControlLostError", "ConnectionLostError", "NoAnswerError")
    await mover.ends()
    assert site.gripper.position(Finger.A) == stood


async def test_an_agent_is_killed_and_the_next_one_holds(site: Site) -> None:
    agent = await site.start_agent()
    async with site.hand() as hand:
        moving = asyncio.ensure_future(hand.move(255, Finger.A, speed=0))
        await site.until(lambda: site.gripper.position(Finger.A) > 15)
        agent.signal(signal.SIGKILL)
        with pytest.raises(ConnectionLostError):
            async with asyncio.timeout(LIMIT_S):
                await moving
        assert site.gripper.is_moving
        await site.until(lambda: not hand.is_in_control)
        await site.start_agent()
        await site.until(lambda: not site.gripper.is_moving)
        assert site.gripper.position(Finger.A) < 250
        await site.until(lambda: hand.is_in_control)
        await hand.move(0, Finger.A, speed=255)


async def test_a_frozen_reader_holds_up_nobody(site: Site) -> None:
    await site.start_agent()
    reader = await site.start("read", site.endpoint)
    await reader.says("reading")
    loop = asyncio.get_running_loop()
    async with site.hand() as hand:
        reader.signal(signal.SIGSTOP)
        longest, before = 0.0, loop.time()
        ends = loop.time() + 3
        statuses = hand.statuses()
        while loop.time() < ends:
            async with asyncio.timeout(LIMIT_S):
                await anext(statuses)
            longest, before = max(longest, loop.time() - before), loop.time()
        assert longest < 1
        await hand.set_speed(200)
        reader.signal(signal.SIGCONT)
        await hand.set_speed(100)


async def test_a_router_is_killed_and_comes_back(site: Site) -> None:
    """Agent and client know the router and nothing of each other."""
    router = await site.start_router()
    await (await site.start("behind", site.endpoint, site.server.address)).says("ready")
    async with site.hand() as hand:
        moving = asyncio.ensure_future(hand.move(255, Finger.A, speed=0))
        await site.until(lambda: site.gripper.position(Finger.A) > 15)
        router.signal(signal.SIGKILL)
        assert await site.until(lambda: not site.gripper.is_moving) < 3
        with pytest.raises(ConnectionLostError):
            async with asyncio.timeout(LIMIT_S):
                await moving
        await site.until(lambda: hand.state is State.DISCONNECTED)
        assert not hand.is_in_control
        stood, writes = site.gripper.position(Finger.A), len(site.gripper.writes)
        await site.start_router()
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
