"""An agent and a client in two network namespaces, whose link is cut again and again around its lease.

``python -m tests.fleet.cuts [CUTS]`` as root on Linux with ip and nft. Two grippers, a finger of each is
commanded without end; afterwards no status and no command may have come to the wrong one. There is no other
way to have zenoh deliver under wrong keys: a proxy between the two does not.
"""

from __future__ import annotations

import asyncio
import contextlib
import json
import os
import random
import shutil
import signal
import sys
from asyncio.subprocess import Process
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[2]
AGENT, CLIENT = "10.213.7.1", "10.213.7.2"
ENDPOINT = f"tcp/{AGENT}:7447"
LIMIT_S = 20.0
PROGRAMS = "tests.fleet.programs"
WAYS = (("input",), ("output",), ("input", "output"))


def missing() -> str:
    """The reason why this cannot be tried here; empty if it can."""
    if not hasattr(os, "geteuid") or os.geteuid() != 0:
        return "network namespaces take root"
    lacking = [tool for tool in ("ip", "nft") if shutil.which(tool) is None]
    return f"{' and '.join(lacking)} not found" if lacking else ""


async def run(*words: str) -> None:
    """Run a command that must succeed.

    Raises:
        RuntimeError: it did not.
    """
    process = await asyncio.create_subprocess_exec(*words, stderr=asyncio.subprocess.PIPE)
    _, said = await process.communicate()
    if process.returncode:
        raise RuntimeError(f"{' '.join(words)}: {said.decode().strip()}")


class Namespaces:
    """Two of them and a cable."""

    def __init__(self) -> None:
        self.agent, self.client = f"rq{os.getpid()}a", f"rq{os.getpid()}c"
        self.running: list[Process] = []

    @contextlib.asynccontextmanager
    async def made(self) -> AsyncIterator[None]:
        try:
            for name in (self.agent, self.client):
                await run("ip", "netns", "add", name)
            await run(
                "ip", "link", "add", "rq", "netns", self.agent,
                "type", "veth", "peer", "name", "rq", "netns", self.client,
            )  # fmt: skip
            for name, number in ((self.agent, AGENT), (self.client, CLIENT)):
                await run("ip", "-n", name, "addr", "add", f"{number}/24", "dev", "rq")
                for device in ("lo", "rq"):
                    await run("ip", "-n", name, "link", "set", device, "up")
            yield
        finally:
            for process in self.running:
                await kill(process)
            for name in (self.agent, self.client):
                with contextlib.suppress(RuntimeError):
                    await run("ip", "netns", "del", name)

    @contextlib.asynccontextmanager
    async def dropping(self, *ways: str, share: int = 100) -> AsyncIterator[None]:
        """Drop what comes in at the client ("input"), what it sends ("output"), or so many percent of it."""
        for way in ways:
            chance = [] if share == 100 else ["numgen", "random", "mod", "100", "<", str(share)]
            await self._nft("add", "table", "inet", "rq")
            hook = f"{{ type filter hook {way} priority 0 ; }}"
            await self._nft("add", "chain", "inet", "rq", way, hook)
            await self._nft("add", "rule", "inet", "rq", way, *chance, "drop")
        yield
        await self._nft("delete", "table", "inet", "rq")

    async def _nft(self, *words: str) -> None:
        await run("ip", "netns", "exec", self.client, "nft", *words)

    async def start(self, where: str, *words: str, **environment: str) -> tuple[Process, str]:
        """Start a module of tests/fleet in one of them; returns it with its first line."""
        process = await asyncio.create_subprocess_exec(
            *("ip", "netns", "exec", where, sys.executable, "-m", *words),
            cwd=ROOT,
            env=os.environ | environment,
            stdout=asyncio.subprocess.PIPE,
        )
        self.running.append(process)
        assert process.stdout is not None
        async with asyncio.timeout(LIMIT_S):
            return process, (await process.stdout.readline()).decode().strip()


async def kill(process: Process) -> None:
    if process.returncode is None:
        process.kill()
        await process.wait()


async def report(process: Process) -> Any:
    """The report of a program at its end."""
    process.send_signal(signal.SIGTERM)
    async with asyncio.timeout(LIMIT_S):
        said, _ = await process.communicate()
    return json.loads(said.splitlines()[-1])


async def marathon(cuts: int, seed: int = 1) -> dict[str, Any]:
    """Cut one direction or both, and lose a share of all for a while; returns what came of it."""
    chance, namespaces = random.Random(seed), Namespaces()
    async with namespaces.made():
        agent, _ = await namespaces.start(namespaces.agent, PROGRAMS, "served", ENDPOINT)
        client, _ = await namespaces.start(namespaces.client, PROGRAMS, "compare", ENDPOINT)
        for number in range(cuts):
            async with namespaces.dropping(*WAYS[number % 3]):
                await asyncio.sleep(chance.uniform(0.3, 1.3))
            await asyncio.sleep(chance.uniform(0.2, 0.8))
        for share in (5, 20, 50):
            async with namespaces.dropping("input", share=share):
                await asyncio.sleep(1.5)
        await asyncio.sleep(2)
        return {"cuts": cuts, **await report(client), **await report(agent)}


if __name__ == "__main__":
    sys.stdout.write(
        (missing() or json.dumps(asyncio.run(marathon(int((sys.argv[1:] or ["40"])[0]))))) + "\n"
    )
