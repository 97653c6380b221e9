"""Makes troubles happen to one simulator, one at a time or by a plan."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable, Iterable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

from robotiq_async.request import AxisRequest, Request

from .damage import Parts, Reply
from .trouble import KINDS, Trouble

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from .endpoint import SimulatorEndpoint

_SHUT = ("refuse", "power-cut")
"""While one of these lasts nobody is let in."""
_DEAF = ("silence", "accept-silence")


@dataclass(slots=True, eq=False)
class Ongoing:
    """A trouble that has begun.

    Attributes:
        trouble: what it is.
        hits: requests and replies it has met so far.
        undo: what ends it, beside forgetting it.
    """

    trouble: Trouble
    hits: int = 0
    undo: Callable[[], Awaitable[None]] | None = None


class Adversary:
    """Whatever goes wrong with one simulator. Troubles may overlap.

    Of those that are about the same reply the oldest acts.
    """

    def __init__(self, endpoint: SimulatorEndpoint) -> None:
        """No trouble."""
        self._endpoint = endpoint
        self._ongoing: list[Ongoing] = []

    @property
    def ongoing(self) -> tuple[Ongoing, ...]:
        """The troubles that last, oldest first."""
        return tuple(self._ongoing)

    def check(self, troubles: Iterable[Trouble]) -> None:
        """See whether troubles fit this kind of link.

        Raises:
            ValueError: one of them does not.
        """
        for trouble in troubles:
            if KINDS[trouble.kind].link not in (None, self._endpoint.link):
                raise ValueError(f"{trouble.kind} does not fit a simulator on {self._endpoint.link}")

    async def begin(self, trouble: Trouble) -> Ongoing:
        """Let a trouble begin now, whenever its plan would. :meth:`end` ends it.

        Raises:
            ValueError: it does not fit this kind of link.
            RuntimeError: it is about connections, and the server is not running.
        """
        self.check([trouble])
        ongoing = Ongoing(trouble)
        ongoing.undo = self._do(trouble)
        kind = KINDS[trouble.kind]
        if kind.damage is not None or kind.lasts == math.inf:
            self._ongoing.append(ongoing)
        return ongoing

    async def end(self, ongoing: Ongoing) -> None:
        """End a trouble; one that is over already stays over."""
        if ongoing in self._ongoing:
            self._ongoing.remove(ongoing)
            if ongoing.undo is not None:
                await ongoing.undo()

    @asynccontextmanager
    async def making(self, trouble: Trouble) -> AsyncIterator[Ongoing]:
        """``async with``: a trouble that lasts as long as the block."""
        ongoing = await self.begin(trouble)
        try:
            yield ongoing
        finally:
            await self.end(ongoing)

    async def run(self, plan: Sequence[Trouble], tell: Callable[[Trouble], object] = lambda _: None) -> None:
        """Carry out a plan. Returns after the last trouble has ended; cancelled, it ends them all.

        Args:
            plan: troubles, each at its own time from now on, in real seconds.
            tell: called with each trouble as it begins.

        Raises:
            ValueError: a trouble does not fit this kind of link; nothing has begun then.
            OSError: somebody else took the port while new connections were refused.
        """
        self.check(plan)
        try:
            async with asyncio.TaskGroup() as group:
                for trouble in plan:
                    group.create_task(self._play(trouble, tell), name=f"trouble: {trouble}")
        except ExceptionGroup as errors:
            raise errors.exceptions[0] from None

    async def _play(self, trouble: Trouble, tell: Callable[[Trouble], object]) -> None:
        await asyncio.sleep(trouble.at)
        while True:
            tell(trouble)
            ongoing = await self.begin(trouble)
            if trouble.duration > 0:
                try:
                    await asyncio.sleep(min(trouble.duration, 1e9))
                finally:
                    await self.end(ongoing)
            if trouble.every is None:
                return
            await asyncio.sleep(trouble.every - trouble.duration)
            await self.end(ongoing)  # what was for once and has met nothing

    # What the endpoint asks.

    def hears(self) -> bool:
        """Whether the request that came in is heard."""
        return self._first(lambda each: each.kind in _DEAF) is None

    def damage(self, frame: bytes) -> Parts | None:
        """What is sent in place of a reply; None if nothing is wrong with it."""
        reply = Reply(frame, self._endpoint.link == "rtu")
        write = reply.is_to_a_write
        trouble = self._first(lambda each: KINDS[each.kind].damage is not None and each.is_about(write=write))
        damage = None if trouble is None else KINDS[trouble.kind].damage
        return None if trouble is None or damage is None else damage(reply, trouble.amount)

    def _first(self, fits: Callable[[Trouble], bool]) -> Trouble | None:
        """The oldest trouble that fits; it has met one more, and is over if it was for once."""
        for ongoing in self._ongoing:
            if fits(ongoing.trouble):
                ongoing.hits += 1
                if ongoing.trouble.duration == 0:
                    self._ongoing.remove(ongoing)
                return ongoing.trouble
        return None

    # What begins and ends.

    def _do(self, trouble: Trouble) -> Callable[[], Awaitable[None]] | None:
        """Carry out what happens at the beginning; returns what is to be done at the end."""
        endpoint, gripper, amount = self._endpoint, self._endpoint.gripper, trouble.amount
        match trouble.kind:
            case "close":
                endpoint.cut()
            case "reset" | "accept-silence":
                endpoint.cut(reset=True)
            case "refuse" | "power-cut":
                endpoint.refuse()
                endpoint.cut(reset=True)
                if trouble.kind == "power-cut":
                    gripper.power_off()
                return self._let_in
            case "foreign":
                image = Request.from_registers(gripper.request_registers)
                axes = tuple(AxisRequest(int(amount), axis.speed, axis.force) for axis in image.axes)
                image = replace(image, individual_fingers=True, individual_scissor=True)
                gripper.write(0, replace(image, go=True, axes=axes).registers)
            case "slow-device":
                cycle, gripper.device_cycle = gripper.device_cycle, amount * gripper.speedup
                return self._later(lambda: setattr(gripper, "device_cycle", cycle))
            case "interference":
                gripper.interfere()
                return self._later(gripper.clear_faults)
            case "fault":
                gripper.inject_fault(int(amount))
                return self._later(gripper.clear_faults)
            case "release":
                gripper.emergency_release()
        return None

    @staticmethod
    def _later(call: Callable[[], object]) -> Callable[[], Awaitable[None]]:
        async def undo() -> None:
            call()

        return undo

    async def _let_in(self) -> None:
        """The power is back, connections are accepted again, unless another trouble forbids it."""
        kinds = [each.trouble.kind for each in self._ongoing]
        if "power-cut" not in kinds:
            self._endpoint.gripper.power_on()
        if not any(kind in _SHUT for kind in kinds) and self._endpoint.is_running:
            await self._endpoint.accept()
