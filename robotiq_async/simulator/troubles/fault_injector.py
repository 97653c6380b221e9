"""Makes troubles happen to one simulator, one at a time or by a plan."""

# Theory of operation
#
# A trouble is over as soon as it has begun (an event), or lasts in _ongoing until end(), or until its first
# hit if it is for once. It acts in one of three ways:
#
#   on demand   the simulator calls hears(), lets_in(), loses_set() and deliver(), and reads the attributes;
#               of several troubles about one request or reply the oldest decides. A trouble that needs only
#               the reply is a function of corruption.py; one that needs earlier ones keeps them in deliver()
#   on state    _do() changes the gripper or the server, and _undo() restores it. Troubles of one kind overlap
#               in any order, so the troubles that last are applied again
#   on habits   the gripper's own habits are kept from the first such trouble on, and restored at its end
#
# A trouble of new connections does not affect present connections. end() completes its work even when
# cancelled, and run() ends every trouble of its plan, also after an error or a cancellation.

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from random import Random
from typing import TYPE_CHECKING, Any, ClassVar, Protocol

from robotiq_async.values.enums import Finger
from robotiq_async.values.registers import REGISTER_COUNT
from robotiq_async.values.request import AxisRequest, Request

from ..functions import READ_INPUT, READ_WRITE
from . import corruption
from .corruption import ReplyPolicy, reply_on
from .trouble import KINDS, Trouble, TroubleLink

if TYPE_CHECKING:
    from collections.abc import AsyncIterator

    from ..physics.gripper import SimulatedGripper


class TroubledServer(Protocol):
    """A simulator that has troubles."""

    link: ClassVar[TroubleLink]
    gripper: SimulatedGripper
    policy: ReplyPolicy

    @property
    def is_running(self) -> bool:
        """Whether it serves, so that connections can be accepted again."""

    def cut(self, *, reset: bool = False) -> None:
        """Drop all connections."""

    def refuse(self) -> None:
        """Refuse new connections."""

    async def accept(self) -> None:
        """Accept connections again."""


@dataclass(slots=True, eq=False)
class Ongoing:
    """A trouble that has begun.

    Attributes:
        trouble: the trouble.
        hits: requests and replies it has met so far.
        over: set when it has ended.
    """

    trouble: Trouble
    hits: int = 0
    over: asyncio.Event = field(default_factory=asyncio.Event)

    def hit(self) -> None:
        """It has met a request or a reply."""
        self.hits += 1


class FaultInjector:
    """Applies troubles to one simulator. Troubles may overlap.

    If several troubles concern one reply, the oldest acts; if no trouble does, the simulator's policy acts.

    Attributes:
        is_multiplexed: whether clients share a connection to the gripper that outlives theirs.
        refused_functions: Modbus functions that are refused although the link serves them.
        reads_only_with_function_3: whether function 4 is refused and 3 reads the status.
        echoes: whether the line echoes the bytes that are sent.
        strict_silence: seconds after a reply in which no request is heard.
        served_registers: the number of registers of each block that are served.
        set_spacing: seconds between the variables of a SET; 0 if they are taken at once.
        is_unreadable: whether a GET cannot read the variables of the gripper.
    """

    def __init__(self, target: TroubledServer) -> None:
        self._target = target
        self._ongoing: list[Ongoing] = []
        self._device_cycle = target.gripper.device_cycle
        """The gripper's own device cycle, without a trouble."""
        self._habits = target.gripper.habits
        """The gripper's own habits, without a trouble."""
        self._idle: asyncio.TimerHandle | None = None
        """The timer after which the gripper loses its activation, unless a request comes first."""
        self._idle_after: float | None
        """Its seconds, by the least patient trouble."""
        self._draw = Random(1)
        """The delays of an uneven link: the same each time."""
        self._loses_next = False
        """Whether the next request is the first of a connection, and is not heard."""
        self._left_at = -math.inf
        """The time at which the last connection ended that was answered."""
        self._decide()

    @property
    def ongoing(self) -> tuple[Ongoing, ...]:
        """The troubles that last, oldest first."""
        return tuple(self._ongoing)

    def check(self, troubles: Iterable[Trouble]) -> None:
        """Check that troubles fit this kind of link, and this gripper.

        Raises:
            ValueError: one of them does not.
        """
        for trouble in troubles:
            if not KINDS[trouble.kind].fits(self._target.link):
                raise ValueError(f"{trouble.kind} does not fit a simulator on {self._target.link}")
            model = self._target.gripper.model
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
            self._ongoing.append(ongoing)
            self._decide()
            if trouble.kind == "idle-reset":
                self._await_request()
        else:
            ongoing.over.set()
        return ongoing

    async def end(self, ongoing: Ongoing) -> None:
        """End a trouble and undo its effects, also when cancelled. Idempotent."""
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

    def _decide(self) -> None:
        """Work out which troubles last; the simulator calls it at each request."""
        refusing = {"function-3-only": READ_INPUT, "no-function-23": READ_WRITE}
        silences = [trouble.amount for trouble in self._lasting("strict-silence")]
        served = [int(trouble.amount) for trouble in self._lasting("registers")]
        waits = [trouble.amount for trouble in self._lasting("idle-reset")]
        spacings = [trouble.amount for trouble in self._lasting("one-by-one")]
        self.is_multiplexed: bool = bool(self._lasting("multiplexer"))
        refused = (refusing[trouble.kind] for trouble in self._lasting(*refusing))
        self.refused_functions: frozenset[int] = frozenset(refused)
        self.reads_only_with_function_3: bool = bool(self._lasting("function-3-only"))
        self.echoes: bool = bool(self._lasting("echo"))
        self.strict_silence: float = max(silences, default=0.0)
        self.served_registers: int = min(served, default=REGISTER_COUNT)
        self.set_spacing: float = max(spacings, default=0.0)
        self.is_unreadable: bool = bool(self._lasting("unreadable"))
        self._kept_for = max((trouble.amount for trouble in self._lasting("old-connection")), default=0.0)
        self._idle_after = min(waits, default=None)

    # Called by the simulator.

    def lets_in(self, present: int) -> bool:
        """Whether a new connection is let in, beside ``present`` connections."""
        if present and self._lasting("one-connection-only"):
            return False
        if self._lasting("wake-needed"):
            self._target.gripper.is_asleep = True
        self._loses_next = True
        return True

    def left(self) -> None:
        """A connection has ended. One that was not answered because of an older one counts for nothing."""
        if not self._keeps_old_connection:
            self._left_at = asyncio.get_running_loop().time()

    @property
    def _keeps_old_connection(self) -> bool:
        return asyncio.get_running_loop().time() < self._left_at + self._kept_for

    def hears(self) -> bool:
        """Whether the request that came in is heard."""
        is_first, self._loses_next = self._loses_next, False
        if self._meets("silence", "accept-silence") or (is_first and self._meets("first-lost")):
            return False
        if self._keeps_old_connection:
            self._meets("old-connection")
            return False
        self._await_request()
        return True

    def loses_set(self) -> bool:
        """Whether the SET that came in is lost on its way to the gripper."""
        return self._meets("lost-set")

    def deliver(self, frame: bytes) -> Iterable[tuple[float, bytes]] | None:
        """The parts to send for a reply; None to hang up."""
        for ongoing in self._ongoing:
            trouble = ongoing.trouble
            parts = trouble.corrupt(reply_on(self._target.link, frame), self._amount(trouble))
            if parts is not None:
                self._hit(ongoing)
                return parts
        return self._target.policy(frame)

    def _amount(self, trouble: Trouble) -> float:
        """The value of a trouble for one reply."""
        match trouble.kind:
            case "uneven-delay":
                return corruption.uneven(self._draw.random(), trouble.amount)
            case "latency-timer":
                return trouble.amount - asyncio.get_running_loop().time() % trouble.amount
        return trouble.amount

    def _meets(self, *kinds: str) -> bool:
        """Whether a trouble of these kinds lasts; the oldest of them counts a hit."""
        for ongoing in self._ongoing:
            if ongoing.trouble.kind in kinds:
                self._hit(ongoing)
                return True
        return False

    def _hit(self, ongoing: Ongoing) -> None:
        """Count a hit of a trouble; it is over if it was for once."""
        ongoing.hit()
        if ongoing.trouble.duration == 0:
            self._forget(ongoing)

    def _forget(self, ongoing: Ongoing) -> None:
        self._ongoing.remove(ongoing)
        self._decide()
        ongoing.over.set()

    # Effects that begin and end.

    def _do(self, trouble: Trouble) -> None:
        """Begin the effect of a trouble."""
        target, gripper, amount = self._target, self._target.gripper, trouble.amount
        match trouble.kind:
            case "close":
                target.cut()
            case "reset" | "accept-silence":
                target.cut(reset=True)
            case "refuse" | "power-cut":
                target.refuse()
                target.cut(reset=True)
                if trouble.kind == "power-cut":
                    gripper.power_off()
            case "foreign":
                image = Request.from_registers(gripper.request_registers, gripper.model)
                axes = tuple(AxisRequest(int(amount), axis.speed, axis.force) for axis in image.axes)
                image = replace(image, individual_fingers=True, individual_scissor=True)
                gripper.write(0, replace(image, go=True, axes=axes).registers)
            case "slow-device":
                if not self._lasting("slow-device"):
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
        target, gripper = self._target, self._target.gripper
        match trouble.kind:
            case "refuse" | "power-cut":
                if not self._lasting("power-cut"):
                    gripper.power_on()
                if not self._lasting("refuse", "power-cut") and target.is_running:
                    await target.accept()
            case "slow-device":
                slow = self._lasting("slow-device")
                gripper.device_cycle = slow[-1].amount * gripper.speedup if slow else self._device_cycle
            case "idle-reset":
                self._await_request()
            case "interference" | "fault":
                gripper.clear_faults()
                for each in self._lasting("interference", "fault"):
                    self._do(each)
            case "controller-fault":
                lasting = self._lasting(trouble.kind)
                gripper.controller_fault = int(lasting[-1].amount) if lasting else 0
            case "e-stop":
                if not self._lasting("e-stop"):
                    gripper.end_emergency_stop()
            case "wake-needed":
                gripper.is_asleep = gripper.is_asleep and bool(self._lasting("wake-needed"))
        if KINDS[trouble.kind].habit is not None:
            gripper.habits = self._habits
            for each in self._changed_habits():
                self._change_habit(each)

    def _change_habit(self, trouble: Trouble) -> None:
        """Give the gripper a habit; its times are the gripper's, the times of a trouble are real."""
        gripper, kind = self._target.gripper, KINDS[trouble.kind]
        change: Any = {kind.habit: True if kind.value is None else trouble.amount * gripper.speedup}
        gripper.habits = replace(gripper.habits, **change)

    def _changed_habits(self) -> list[Trouble]:
        """The troubles that last and change habits, oldest first."""
        return self._lasting(*(name for name, kind in KINDS.items() if kind.habit is not None))

    def _await_request(self) -> None:
        """Begin to wait for the next request, for as long as the least patient trouble allows."""
        if self._idle is not None:
            self._idle.cancel()
            self._idle = None
        if self._idle_after is not None:
            self._idle = asyncio.get_running_loop().call_later(self._idle_after, self._reset)

    def _reset(self) -> None:
        """Take the activation from the gripper, which keeps its power."""
        if self._target.gripper.is_powered:
            self._target.gripper.power_cycle()

    def _lasting(self, *kinds: str) -> list[Trouble]:
        """The troubles of these kinds that last, oldest first."""
        return [each.trouble for each in self._ongoing if each.trouble.kind in kinds]
