"""Makes troubles happen to one simulator, one at a time or by a plan."""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from robotiq_async.wire.request import AxisRequest, Request

from .corruption import Corruption, Parts, Reply, delay
from .trouble import KINDS, Trouble

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from ..server.endpoint import SimulatorEndpoint

_SHUT = ("refuse", "power-cut")
"""While one of these lasts nobody is let in."""
_DEAF = ("silence", "accept-silence")


@dataclass(slots=True, eq=False)
class Ongoing:
    """A trouble that has begun.

    Attributes:
        trouble: what it is.
        hits: requests and replies it has met so far.
        over: set when it has ended.
    """

    trouble: Trouble
    hits: int = 0
    over: asyncio.Event = field(default_factory=asyncio.Event)


class FaultInjector:
    """Whatever goes wrong with one simulator. Troubles may overlap.

    Of those that are about the same reply the oldest acts.
    """

    def __init__(self, endpoint: SimulatorEndpoint) -> None:
        """No trouble."""
        self._endpoint = endpoint
        self._ongoing: list[Ongoing] = []
        self._device_cycle = endpoint.gripper.device_cycle
        """What the gripper has when nothing makes it slow."""
        self._idle: asyncio.TimerHandle | None = None
        """When the gripper loses its activation unless a request comes before."""

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
        ongoing, kind = Ongoing(trouble), KINDS[trouble.kind]
        self._do(trouble)
        if kind.corruption is not None or kind.lasts == math.inf:
            self._ongoing.append(ongoing)
            if trouble.kind == "idle-reset":
                self._await_request()
        else:
            ongoing.over.set()
        return ongoing

    async def end(self, ongoing: Ongoing) -> None:
        """End a trouble; one that is over already stays over. What it did is undone also when cancelled."""
        if ongoing not in self._ongoing:
            return
        self._forget(ongoing)
        undoing = asyncio.ensure_future(self._undo(ongoing.trouble))
        try:
            await asyncio.shield(undoing)
        except asyncio.CancelledError:
            await undoing
            raise

    @contextlib.asynccontextmanager
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
        """One trouble of a plan, from its beginning to its end, again and again if it comes again."""
        loop, lasts = asyncio.get_running_loop(), trouble.duration or trouble.every
        await asyncio.sleep(trouble.at)
        while True:
            began = loop.time()
            tell(trouble)
            ongoing = await self.begin(trouble)
            try:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(None if lasts == math.inf else lasts):
                        await ongoing.over.wait()
            finally:
                await self.end(ongoing)
            if trouble.every is None:
                return
            await asyncio.sleep(began + trouble.every - loop.time())

    # What the endpoint asks.

    @property
    def is_multiplexed(self) -> bool:
        """Whether clients share a connection to the gripper that outlives theirs."""
        return "multiplexer" in self._kinds

    def hears(self) -> bool:
        """Whether the request that came in is heard."""
        heard = self._first(lambda each: each.kind in _DEAF) is None
        if heard:
            self._await_request()
        return heard

    def corrupt(self, frame: bytes) -> Parts | None:
        """What is sent in place of a reply; None if nothing is wrong with it. A refusal is left as it is."""
        reply = Reply(frame, self._endpoint.link == "rtu")
        if reply.is_exception:
            return None
        write = reply.is_to_a_write
        trouble = self._first(lambda each: _corruption_of(each) is not None and each.is_about(write=write))
        corruption = None if trouble is None else _corruption_of(trouble)
        return None if trouble is None or corruption is None else corruption(reply, trouble.amount)

    def _first(self, fits: Callable[[Trouble], bool]) -> Trouble | None:
        """The oldest trouble that fits; it has met one more, and is over if it was for once."""
        for ongoing in self._ongoing:
            if fits(ongoing.trouble):
                ongoing.hits += 1
                if ongoing.trouble.duration == 0:
                    self._forget(ongoing)
                return ongoing.trouble
        return None

    def _forget(self, ongoing: Ongoing) -> None:
        self._ongoing.remove(ongoing)
        ongoing.over.set()

    # What begins and ends.

    def _do(self, trouble: Trouble) -> None:
        """What happens at the beginning."""
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
            case "foreign":
                image = Request.from_registers(gripper.request_registers)
                axes = tuple(AxisRequest(int(amount), axis.speed, axis.force) for axis in image.axes)
                image = replace(image, individual_fingers=True, individual_scissor=True)
                gripper.write(0, replace(image, go=True, axes=axes).registers)
            case "slow-device":
                if "slow-device" not in self._kinds:
                    self._device_cycle = gripper.device_cycle
                gripper.device_cycle = amount * gripper.speedup
            case "interference":
                gripper.interfere()
            case "fault":
                gripper.inject_fault(int(amount))
            case "release":
                gripper.emergency_release()

    async def _undo(self, trouble: Trouble) -> None:
        """What happens at the end; the troubles that go on keep their effect."""
        endpoint, gripper = self._endpoint, self._endpoint.gripper
        match trouble.kind:
            case "refuse" | "power-cut":
                if "power-cut" not in self._kinds:
                    gripper.power_on()
                if not any(kind in _SHUT for kind in self._kinds) and endpoint.is_running:
                    await endpoint.accept()
            case "slow-device":
                slow = [each.trouble.amount for each in self._ongoing if each.trouble.kind == "slow-device"]
                gripper.device_cycle = slow[-1] * gripper.speedup if slow else self._device_cycle
            case "idle-reset":
                self._await_request()
            case "interference" | "fault":
                gripper.clear_faults()
                for each in self._ongoing:
                    if each.trouble.kind in ("interference", "fault"):
                        self._do(each.trouble)

    def _await_request(self) -> None:
        """Begin to wait for the next request, as long as the least patient trouble says."""
        if self._idle is not None:
            self._idle.cancel()
        waits = [each.trouble.amount for each in self._ongoing if each.trouble.kind == "idle-reset"]
        self._idle = asyncio.get_running_loop().call_later(min(waits), self._reset) if waits else None

    def _reset(self) -> None:
        """The gripper loses its activation, and keeps its power."""
        gripper = self._endpoint.gripper
        if gripper.is_powered:
            gripper.power_off()
            gripper.power_on()

    @property
    def _kinds(self) -> list[str]:
        return [each.trouble.kind for each in self._ongoing]


def _corruption_of(trouble: Trouble) -> Corruption | None:
    """What a trouble does to a reply; a multiplexer is late, and that is not all it does."""
    return delay if trouble.kind == "multiplexer" else KINDS[trouble.kind].corruption
