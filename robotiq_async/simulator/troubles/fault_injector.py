"""Makes troubles happen to one simulator, one at a time or by a plan."""

# Theory of operation
#
# A trouble is over as soon as it has begun (an event), or lasts in the TroubledLink until end(), or until its
# first hit if it is for once. It acts in one of three ways:
#
#   on demand   the TroubledLink decides on requests and replies
#   on state    _do() changes the gripper or the server, and _undo() restores it. Troubles of one kind overlap
#               in any order, so the troubles that last are applied again
#   on habits   the gripper's own habits are kept from the first such trouble on, and restored at its end
#
# end() completes its work even when cancelled, and run() ends every trouble of its plan, also after an error
# or a cancellation.

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any

from robotiq_async.values.enums import Finger
from robotiq_async.values.request import AxisRequest, Request

from .trouble import KINDS, Trouble
from .troubled_link import Ongoing, TroubledLink, TroubledServer

if TYPE_CHECKING:
    from collections.abc import AsyncIterator


class FaultInjector:
    """Makes troubles happen to one simulator. Troubles may overlap."""

    def __init__(self, server: TroubledServer, link: TroubledLink) -> None:
        """``link`` has the troubles that last."""
        self._server = server
        self._link = link
        self._device_cycle = server.gripper.device_cycle
        """The gripper's own device cycle, without a trouble."""
        self._habits = server.gripper.habits
        """The gripper's own habits, without a trouble."""

    @property
    def ongoing(self) -> tuple[Ongoing, ...]:
        """The troubles that last, oldest first."""
        return self._link.ongoing

    def check(self, troubles: Iterable[Trouble]) -> None:
        """Check that troubles fit this kind of link, and this gripper.

        Raises:
            ValueError: one of them does not.
        """
        for trouble in troubles:
            if not KINDS[trouble.kind].fits(self._server.link):
                raise ValueError(f"{trouble.kind} does not fit a simulator on {self._server.link}")
            model = self._server.gripper.model
            if trouble.kind == "interference" and Finger.SCISSOR not in model.all_axes:
                raise ValueError(f"interference does not fit a {model}: it has no scissor")
            if trouble.kind == "controller-fault" and model.has_modes:
                raise ValueError(f"controller-fault does not fit a {model}: it has no kFLT")

    async def begin(self, trouble: Trouble) -> Ongoing:
        """Let a trouble begin now; its times are ignored. :meth:`end` ends it.

        Raises:
            ValueError: it does not fit this kind of link, or this gripper.
            RuntimeError: it is about connections, and the server is not running.
        """
        self.check([trouble])
        ongoing, kind = Ongoing(trouble), KINDS[trouble.kind]
        self._do(trouble)
        if kind.corruption is not None or kind.lasts == math.inf:
            self._link.add(ongoing)
        else:
            ongoing.over.set()
        return ongoing

    async def end(self, ongoing: Ongoing) -> None:
        """End a trouble and undo its effects, also when cancelled. Idempotent."""
        if ongoing not in self._link.ongoing:
            return
        self._link.remove(ongoing)
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
            OSError: another process took the port while new connections were refused.
        """
        self.check(plan)
        try:
            async with asyncio.TaskGroup() as group:
                for trouble in plan:
                    group.create_task(self._play(trouble, tell), name=f"trouble: {trouble}")
        except ExceptionGroup as errors:
            raise errors.exceptions[0] from None

    async def _play(self, trouble: Trouble, tell: Callable[[Trouble], object]) -> None:
        """Carry out one trouble of a plan, from its beginning to its end, again and again if it repeats."""
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

    # Effects that begin and end.

    def _do(self, trouble: Trouble) -> None:
        """Begin the effect of a trouble."""
        server, gripper, amount = self._server, self._server.gripper, trouble.amount
        match trouble.kind:
            case "close":
                server.cut()
            case "reset" | "accept-silence":
                server.cut(reset=True)
            case "refuse" | "power-cut":
                server.refuse()
                server.cut(reset=True)
                if trouble.kind == "power-cut":
                    gripper.power_off()
            case "foreign":
                image = Request.from_registers(gripper.request_registers, gripper.model)
                axes = tuple(AxisRequest(int(amount), axis.speed, axis.force) for axis in image.axes)
                image = replace(image, individual_fingers=True, individual_scissor=True)
                gripper.write(0, replace(image, go=True, axes=axes).registers)
            case "slow-device":
                if not self._link.lasting("slow-device"):
                    self._device_cycle = gripper.device_cycle
                gripper.device_cycle = amount * gripper.speedup
            case "interference":
                gripper.interfere()
            case "fault":
                gripper.inject_fault(int(amount))
            case "release":
                gripper.emergency_release()
            case "controller-fault":
                gripper.controller_fault = int(amount)
            case "stranded":
                gripper.strand()
            case "e-stop":
                gripper.emergency_stop(int(amount))
        if KINDS[trouble.kind].habit is not None:
            if not self._changed_habits():
                self._habits = gripper.habits
            self._change_habit(trouble)

    async def _undo(self, trouble: Trouble) -> None:
        """End the effect of a trouble; the troubles that last keep theirs."""
        server, gripper = self._server, self._server.gripper
        match trouble.kind:
            case "refuse" | "power-cut":
                if not self._link.lasting("power-cut"):
                    gripper.power_on()
                if not self._link.lasting("refuse", "power-cut") and server.is_running:
                    await server.accept()
            case "slow-device":
                slow = self._link.lasting("slow-device")
                gripper.device_cycle = slow[-1].amount * gripper.speedup if slow else self._device_cycle
            case "interference" | "fault":
                gripper.clear_faults()
                for each in self._link.lasting("interference", "fault"):
                    self._do(each)
            case "controller-fault":
                lasting = self._link.lasting(trouble.kind)
                gripper.controller_fault = int(lasting[-1].amount) if lasting else 0
            case "e-stop":
                if not self._link.lasting("e-stop"):
                    gripper.end_emergency_stop()
            case "wake-needed":
                gripper.is_asleep = gripper.is_asleep and bool(self._link.lasting("wake-needed"))
        if KINDS[trouble.kind].habit is not None:
            gripper.habits = self._habits
            for each in self._changed_habits():
                self._change_habit(each)

    def _change_habit(self, trouble: Trouble) -> None:
        """Give the gripper a habit; its times are the gripper's, the times of a trouble are real."""
        gripper, kind = self._server.gripper, KINDS[trouble.kind]
        change: Any = {kind.habit: True if kind.value is None else trouble.amount * gripper.speedup}
        gripper.habits = replace(gripper.habits, **change)

    def _changed_habits(self) -> list[Trouble]:
        """The troubles that last and change habits, oldest first."""
        return self._link.lasting(*(name for name, kind in KINDS.items() if kind.habit is not None))
