"""A simulated gripper in a process of its own, as a gripper is a machine of its own.

Much of what a client of ROS calls keeps the interpreter to itself while it waits: with three such clients on
a busy machine, other threads of the process stood still for up to 0.36 s, and a node believes in a link for
0.4 s. No ROS is imported here.
"""

from __future__ import annotations

import asyncio
import multiprocessing
from inspect import isawaitable
from multiprocessing.connection import Connection
from operator import attrgetter
from typing import Any, Final, Self

from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import Model, model_of
from robotiq_async.values.request import Request
from tests.ros2.live.processes import PATIENCE_S

SPAWN: Final = multiprocessing.get_context("spawn")  # a fork would take over what ROS has open


class Simulator:
    """A simulated gripper behind Modbus TCP."""

    def __init__(self, *, speedup: float = 4.0, model: str = "3f") -> None:
        self._pipe, self._theirs = SPAWN.Pipe()
        self._child = SPAWN.Process(target=_run, args=(self._theirs, speedup, model), daemon=True)

    def __enter__(self) -> Self:
        self._child.start()
        self._theirs.close()  # or its end would not be the end of the pipe
        self.address = str(self._answer())
        return self

    def __exit__(self, *_: object) -> None:
        self._pipe.close()
        self._child.join(PATIENCE_S)
        assert self._child.exitcode == 0, "the simulator has failed, and said why"
        self._child.close()

    @property
    def request(self) -> Request:
        """The last request to it."""
        return Request.from_registers(self.read("request_registers"))

    def do(self, method: str, *arguments: Any, **named: Any) -> Any:
        """Call a method of the gripper."""
        return self._ask(f"gripper.{method}", arguments, named)

    def read(self, attribute: str) -> Any:
        """The present value of an attribute of the gripper."""
        return self._ask(f"gripper.{attribute}")

    def lose_link(self) -> None:
        self._ask("refuse", ())
        self._ask("cut", ())

    def find_link(self) -> None:
        self._ask("accept", ())

    def _ask(self, what: str, arguments: Any = None, named: Any = None) -> Any:
        """An attribute of the server, and with arguments what a call of it gives."""
        self._pipe.send((what, arguments, named or {}))
        return self._answer()

    def _answer(self) -> Any:
        assert self._pipe.poll(PATIENCE_S), "the simulator does not answer"
        return self._pipe.recv()


# -- in its process ----------------------------------------------------------------------------------------


def _run(pipe: Connection, speedup: float, model: str) -> None:
    asyncio.run(_serve(pipe, speedup, model_of(model)))


async def _serve(pipe: Connection, speedup: float, model: Model) -> None:
    """Do what comes through the pipe, until the other end is closed."""
    gripper = SimulatedGripper(speedup=speedup, device_cycle=0.005 * speedup, spread=False, model=model)
    async with SimulatorServer(gripper) as server:
        pipe.send(server.address)
        while True:
            try:
                what, arguments, named = await asyncio.to_thread(pipe.recv)
            except EOFError:
                return
            found = attrgetter(what)(server)
            if arguments is not None:
                found = found(*arguments, **named)
            pipe.send(await found if isawaitable(found) else found)
