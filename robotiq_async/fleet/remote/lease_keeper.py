"""LeaseKeeper: the client's side of the lease: acquires, renews, reacquires and releases it.

After a lost connection the lease is reacquired automatically, unless another client took it or halted the
gripper in the meantime, which must not be overruled. The agent decides that, by the number of the lost lease.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, Final

from ...runtime.clock import now
from ...runtime.log import Log
from ...values.enums import StopLevel
from ...values.errors import AgentError, ControlLostError, RobotiqError
from ..limited_log import LimitedLog
from ..network.bus import Bus, Undo
from ..wire.names import GripperName
from ..wire.values import Fields, reading
from .requests import NoAnswerError, label

if TYPE_CHECKING:
    from .session import RemoteSession

RENEWALS: Final = 5  # renewals, and checks for silence, per window
ANSWER_S: Final = 0.5  # seconds for an answer that the agent gives at once; callers with more time ask again
RELEASE_S: Final = 0.9
"""Seconds for the answer to a release. Closing a session of zenoh may take 1 s, and a stop 2 s in total."""
NOT_REACQUIRED: Final = ("taken", "halted", "held", "restarted")
"""Reasons after which the lease is not reacquired automatically: only an explicit acquire() does."""
LOOK_S: Final = 0.5  # seconds to look for the tokens of agents
TWO_AGENTS: Final = "two agents serve it, perhaps different grippers under one name: stop one of them"


class Agents:
    """The agents that serve one gripper. With two of them, only a person can say which one is the mistake."""

    def __init__(self, name: GripperName, bus: Bus, two: Callable[[], None]) -> None:
        self._name = name
        self._bus = bus
        self._two = two
        self._tokens: set[str] = set()
        self._log = LimitedLog(Log(str(name)))
        self.end: Undo = bus.watch(name.key("alive", "*"), self._update_token)

    async def check_one(self) -> None:
        if len(self._tokens) > 1:  # one may be gone, and its sign-off lost
            self._tokens = set(await self._bus.announced(self._name.key("alive", "*"), timeout=LOOK_S))
        if len(self._tokens) > 1:
            raise AgentError(f"{self._name}: {TWO_AGENTS}; nothing was done")

    def _update_token(self, token: str, is_there: bool) -> None:
        before = len(self._tokens)
        (self._tokens.add if is_there else self._tokens.discard)(token)
        if before < 2 <= len(self._tokens):
            self._log.warn("%s", TWO_AGENTS, level=logging.ERROR)
            self._two()


class LeaseKeeper:
    """The lease of one run.

    Attributes:
        is_in_control: whether this client holds the lease, as far as it knows.
        lease: number of the lease that it holds, or held last.
        lost: why it lost control; None while it is in control, and if it never was.
    """

    def __init__(self, run: RemoteSession, *, wants_control: bool) -> None:
        self.is_in_control = False
        self.lease = 0
        self.lost: ControlLostError | None = None
        self._run = run
        self._log = Log(str(run.name))
        self._wants_control = wants_control
        self._may_reacquire = True
        self._lease_run = 0  # the run of the agent that gave the number of the lease
        self._acquiring = asyncio.Lock()
        self._reacquiring: asyncio.Task[Any] | None = None
        self._checking: asyncio.Task[Any] | None = None
        self._releasing: asyncio.Task[Any] | None = None  # the present release, or the last one
        self._level: StopLevel | None = None
        self._is_ending = False

    async def begin(self, deadline: float) -> None:
        """Acquire the lease if wanted; repeat until the deadline if an answer was lost."""
        while self._wants_control and not self.is_in_control:
            try:
                await self.acquire()
            except (NoAnswerError, ControlLostError) as error:
                if getattr(error, "reason", "late") != "late" or now() >= deadline:
                    raise

    def end(self, level: StopLevel) -> None:
        """The run ends: release the lease at once; see :meth:`release`."""
        if not self._is_ending and self._releasing is not None and self._releasing.done():
            self._releasing = None  # an earlier release, which has ended
        self._is_ending = True
        self.release(level)

    def abandon(self) -> None:
        # The event loop is closed: nothing can be sent.
        self.is_in_control = self._wants_control = False

    def forbid_reacquiring(self) -> None:
        # Two agents serve the gripper, so the lease may be the one of the wrong gripper.
        self._may_reacquire = False

    async def acquire(self, *, take: bool = False) -> None:
        """Get the lease, with ``take`` also from another client; errors as of :meth:`RemoteHand.acquire`."""
        async with self._acquiring:
            if self.is_in_control:
                await self._renew()  # it may have been lost unnoticed
            if self.is_in_control:
                return  # asked for it again, the agent would end what is under way
            await self._acquire({"what": "take" if take else "acquire"})

    def release(self, level: StopLevel) -> None:
        """Release the lease, if this client holds it; the request is sent within this call.

        Called again before the release is acknowledged, or before the run is over, the strongest level
        applies.
        """
        self._wants_control = False
        if self.is_in_control:
            self.lose("released", "it was released")
            self._releasing, self._level = None, None
        elif self._releasing is None or (self._releasing.done() and not self._is_ending):
            self._releasing = None
            return
        if self._level is None or level > self._level:
            self._level = level
            what = {
                "what": "release",
                "halt": level > StopLevel.LEAVE,
                "keep_grip": level is StopLevel.KEEP,
            }
            posted = self._run.requests.post(self._run.call(what), "lease", timeout=RELEASE_S)
            self._releasing = self._run.spawn(self._run.answer(posted))
            # After a stronger release, callers wait for that one, so the error of this one may go unread.
            self._releasing.add_done_callback(lambda task: task.cancelled() or task.exception())
        elif level < self._level:
            self._log.warning("a stop that is under way is stronger: the fingers are %s", self._level.done)

    async def released(self) -> None:
        """Wait until the release is acknowledged; errors as of :meth:`RemoteHand.release`."""
        awaited = None
        while self._releasing is not awaited:
            awaited = self._releasing
            assert awaited is not None
            await asyncio.wait({awaited})
        if awaited is not None:
            awaited.result()

    def maintain(self) -> None:
        """Renew the lease, or reacquire it when due. Called several times in a window."""
        if self.is_in_control:
            # Renewals may overlap: a lost one must not cost the lease.
            self._run.spawn(self._renew())
            return
        is_reacquiring = self._reacquiring is not None and not self._reacquiring.done()
        wants_back = self._wants_control and self._may_reacquire
        if wants_back and not self._run.mirror.is_silent and not is_reacquiring:
            self._reacquiring = self._run.spawn(self._reacquire())

    def receive(self, lease: int) -> None:
        """A status had this number of the present lease."""
        is_checking = self._checking is not None and not self._checking.done()
        if self.is_in_control and lease > self.lease and not is_checking:
            # The answer to a request under the lost lease has the reason.
            self._checking = self._run.spawn(self._check_lease())

    def lose(self, reason: str, why: str) -> None:
        if not self.is_in_control:
            return
        self.is_in_control = False
        # After a halt or a take by another client only an explicit acquire() gets it back.
        self._wants_control = self._wants_control and reason not in (*NOT_REACQUIRED, "released")
        self.lost = ControlLostError(f"lost control of {self._run.name}: {why}", reason)
        self._run.requests.lose_lease(self.lease, reason)
        if reason != "released":
            self._log.warning("lost control: %s", why)

    def check(self) -> None:
        if not self.is_in_control:
            if self.lost is None:
                raise ControlLostError("this hand only reads: acquire() the lease first", "released")
            raise ControlLostError(str(self.lost), self.lost.reason)

    # -- inside ----------------------------------------------------------------------------------------

    async def _acquire(self, what: Fields) -> None:
        await self._run.agents.check_one()
        # Sent with the request for the lease, so that no motion precedes them.
        settings = self._run.requests.settings.fields
        call = self._run.call({**what, "label": label(), **({"settings": settings} if settings else {})})
        value = await self._run.send(call, "lease", timeout=ANSWER_S)
        with reading("a lease"):
            self.lease, self._lease_run = int(value["lease"]), self._run.mirror.epoch
        if not self._is_ending:
            self.is_in_control, self._wants_control, self._may_reacquire, self.lost = True, True, True, None

    async def _reacquire(self) -> None:
        try:
            async with self._acquiring:
                await self._acquire({"what": "acquire", "again": self.lease, "run": self._lease_run})
        except ControlLostError as error:
            if error.reason in NOT_REACQUIRED:
                # Another client was first, or intervened: people decide which one commands.
                self._wants_control, self.lost = False, error
        except RobotiqError:
            pass  # the next maintain() tries again

    async def _renew(self) -> None:
        await self._run.ask_quietly("lease", {"what": "renew"}, self._run.window)

    async def _check_lease(self) -> None:
        lease, run = self.lease, self._lease_run
        await self._run.ask_quietly("lease", {"what": "renew"}, self._run.window / RENEWALS)
        if (lease, run) == (self.lease, self._run.mirror.epoch):
            # No answer with a reason. If another client intervened, the agent refuses to reacquire.
            self.lose("expired", "its agent reports that the lease has ended")
