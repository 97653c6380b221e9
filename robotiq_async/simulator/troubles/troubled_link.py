"""The troubles that a simulated link has now. They decide on its connections, requests and replies."""

# Theory of operation
#
# The simulator calls lets_in(), left(), hears(), loses_set() and deliver(), and reads the attributes. Of
# several troubles about one request or reply the oldest decides. A trouble that needs only the reply is a
# function of corruption.py; one that needs earlier ones keeps them in deliver().
#
# A trouble of new connections does not affect present connections.

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterable
from dataclasses import dataclass, field
from random import Random
from typing import TYPE_CHECKING, ClassVar, Protocol

from robotiq_async.values.registers import REGISTER_COUNT

from ..functions import READ_INPUT, READ_WRITE
from . import corruption
from .corruption import Parts, Reply, ReplyPolicy, reply_on
from .trouble import KINDS, Trouble, TroubleLink

if TYPE_CHECKING:
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


class TroubledLink:
    """The troubles of one simulator that have begun and are not over.

    If several troubles concern one reply, the oldest acts; if no trouble does, the simulator's policy acts.

    Attributes:
        ongoing: these troubles, oldest first.
        is_multiplexed: whether clients share a connection to the gripper that outlives theirs.
        refused_functions: Modbus functions that are refused although the link serves them.
        reads_only_with_function_3: whether function 4 is refused and 3 reads the status.
        echoes: whether the line echoes the bytes that are sent.
        strict_silence: seconds after a reply in which no request is heard.
        served_registers: the number of registers of each block that are served.
        set_spacing: seconds between the variables of a SET; 0 if they are taken at once.
        is_unreadable: whether a GET cannot read the variables of the gripper.
    """

    def __init__(self, server: TroubledServer) -> None:
        self.ongoing: tuple[Ongoing, ...] = ()
        self._server = server
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

    def add(self, ongoing: Ongoing) -> None:
        """A trouble lasts from now on."""
        self.ongoing = (*self.ongoing, ongoing)
        self._changed(ongoing)

    def remove(self, ongoing: Ongoing) -> None:
        """A trouble is over."""
        self.ongoing = tuple(each for each in self.ongoing if each is not ongoing)
        self._changed(ongoing)
        ongoing.over.set()

    def lasting(self, *kinds: str) -> list[Trouble]:
        """The troubles of these kinds that last, oldest first."""
        return [each.trouble for each in self.ongoing if each.trouble.kind in kinds]

    def _changed(self, ongoing: Ongoing) -> None:
        self._decide()
        if ongoing.trouble.kind == "idle-reset":
            self._await_request()

    def _decide(self) -> None:
        """Work out the attributes once: the simulator reads them at each request."""
        refusing = {"function-3-only": READ_INPUT, "no-function-23": READ_WRITE}
        silences = [trouble.amount for trouble in self.lasting("strict-silence")]
        served = [int(trouble.amount) for trouble in self.lasting("registers")]
        waits = [trouble.amount for trouble in self.lasting("idle-reset")]
        spacings = [trouble.amount for trouble in self.lasting("one-by-one")]
        self.is_multiplexed: bool = bool(self.lasting("multiplexer"))
        refused = (refusing[trouble.kind] for trouble in self.lasting(*refusing))
        self.refused_functions: frozenset[int] = frozenset(refused)
        self.reads_only_with_function_3: bool = bool(self.lasting("function-3-only"))
        self.echoes: bool = bool(self.lasting("echo"))
        self.strict_silence: float = max(silences, default=0.0)
        self.served_registers: int = min(served, default=REGISTER_COUNT)
        self.set_spacing: float = max(spacings, default=0.0)
        self.is_unreadable: bool = bool(self.lasting("unreadable"))
        self._kept_for = max((trouble.amount for trouble in self.lasting("old-connection")), default=0.0)
        self._idle_after = min(waits, default=None)

    # -- connections, requests, replies ----------------------------------------------------------------------

    def lets_in(self, present: int) -> bool:
        """Whether a new connection is let in, beside ``present`` connections."""
        if present and self.lasting("one-connection-only"):
            return False
        if self.lasting("wake-needed"):
            self._server.gripper.is_asleep = True
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
        for ongoing in self.ongoing:
            if (parts := self._corrupted(reply_on(self._server.link, frame), ongoing.trouble)) is not None:
                self._hit(ongoing)
                return parts
        return self._server.policy(frame)

    def _corrupted(self, reply: Reply, trouble: Trouble) -> Parts | None:
        """The bytes to send instead of a reply; None for a refusal, or a reply that it leaves alone."""
        # A multiplexer is late, and that is not all it does.
        change = KINDS["delay" if trouble.kind == "multiplexer" else trouble.kind].corruption
        if change is None or reply.is_exception or not trouble.is_about(write=reply.is_to_a_write):
            return None
        return change(reply, self._amount(trouble))

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
        for ongoing in self.ongoing:
            if ongoing.trouble.kind in kinds:
                self._hit(ongoing)
                return True
        return False

    def _hit(self, ongoing: Ongoing) -> None:
        """Count a hit of a trouble; it is over if it was for once."""
        ongoing.hit()
        if ongoing.trouble.duration == 0:
            self.remove(ongoing)

    def _await_request(self) -> None:
        """Begin to wait for the next request, for as long as the least patient trouble allows."""
        if self._idle is not None:
            self._idle.cancel()
            self._idle = None
        if self._idle_after is not None:
            self._idle = asyncio.get_running_loop().call_later(self._idle_after, self._reset)

    def _reset(self) -> None:
        """Take the activation from the gripper, which keeps its power."""
        if self._server.gripper.is_powered:
            self._server.gripper.power_cycle()
