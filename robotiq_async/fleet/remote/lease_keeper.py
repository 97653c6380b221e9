"""LeaseKeeper: the lease as its client sees it. It is renewed, lost, and acquired again when nobody minds."""

from __future__ import annotations

import asyncio
from collections.abc import Coroutine
from typing import Any, Final, Protocol

from ...runtime.clock import now
from ...runtime.log import Log
from ...session.ending import Ending
from ...values.errors import ControlLostError, RobotiqError
from ..wire.envelope import Call
from ..wire.names import GripperName
from ..wire.values import Fields, reading
from .agents import Agents
from .mirror import Mirror
from .pending_request import PendingRequest
from .requests import NoAnswerError, label
from .settings import Settings

RENEWALS: Final = 5
"""How many times in a window the lease is renewed, and silence looked for."""
ANSWER_S: Final = 0.5
"""For an answer that the agent gives at once; asked again within the time that there is."""
RELEASE_S: Final = 0.9
"""With the second that closing a session of zenoh may take, within the two of a stop."""
NOT_REACQUIRED: Final = ("taken", "halted", "held", "restarted")
"""Reasons for which nobody comes back without having been asked to."""


class AgentClient(Protocol):
    """What the keeper needs of a run: to know whom it is about, and to ask."""

    name: GripperName
    mirror: Mirror
    agents: Agents
    settings: Settings
    window: float

    def call(self, arguments: Fields | None = None) -> Call:
        """The next request, under the present lease."""

    async def send(self, call: Call, verb: str, **how: Any) -> Any:  # noqa: ANN401
        """Send a request and wait for its answer."""

    def post(self, call: Call, verb: str, **how: Any) -> PendingRequest:  # noqa: ANN401
        """Send a request."""

    async def answer(self, posted: PendingRequest) -> Any:  # noqa: ANN401
        """Wait for the answer to a request."""

    def fail_calls(self, lease: int, error: ControlLostError) -> None:
        """A lease has ended: who waits for something that was asked under it is told."""

    async def ask_quietly(self, verb: str, arguments: Fields, timeout: float) -> None:
        """Ask for what the answer does by itself."""

    def spawn(self, work: Coroutine[Any, Any, Any]) -> asyncio.Task[Any]:
        """Do something beside; it ends with the run."""


class LeaseKeeper:
    """One run's lease.

    Attributes:
        is_in_control: whether this client holds the lease, as far as it knows.
        lease: number of the lease it holds, or held last.
        lost: why control was lost; None while it is held, or was never asked for.
    """

    def __init__(self, run: AgentClient, *, wants_control: bool) -> None:
        self.is_in_control = False
        self.lease = 0
        self.lost: ControlLostError | None = None
        self._run = run
        self._log = Log(str(run.name))
        self._wants_control = wants_control
        self._may_reacquire = True
        self._lease_run = 0
        """The run of the agent that the number is of."""
        self._acquiring = asyncio.Lock()
        self._reacquiring: asyncio.Task[Any] | None = None
        self._checking: asyncio.Task[Any] | None = None
        self._releasing: asyncio.Task[Any] | None = None
        """How the lease is given back now, or was last."""
        self._ending: Ending | None = None
        self._is_ending = False

    async def begin(self, deadline: float) -> None:
        """Acquire the lease if that is wanted; again when an answer was lost, until it is time to give up.

        Raises:
            ControlLostError: another client commands the gripper.
            AgentError: two agents serve it.
            RobotiqError: the agent did not answer.
        """
        while self._wants_control and not self.is_in_control:
            try:
                await self.acquire()
            except (NoAnswerError, ControlLostError) as error:
                if getattr(error, "reason", "late") != "late" or now() >= deadline:
                    raise

    def end(self, ending: Ending) -> None:
        """The run ends: give the lease back, at once; see :meth:`release`."""
        if not self._is_ending and self._releasing is not None and self._releasing.done():
            self._releasing = None  # that was another end, and is over
        self._is_ending = True
        self.release(ending)

    def abandon(self) -> None:
        """Nothing can be sent any more."""
        self.is_in_control = self._wants_control = False

    def forbid_reacquiring(self) -> None:
        """If the lease is lost, it is not acquired again without that being asked for."""
        self._may_reacquire = False

    async def acquire(self, *, take: bool = False) -> None:
        """Get the lease.

        Raises:
            ControlLostError: another client holds it, and it is not to be taken away.
            AgentError: two agents serve the gripper.
            RobotiqError: the agent did not answer.
        """
        async with self._acquiring:
            if self.is_in_control:
                await self._renew()  # it may have been lost without a word
            if self.is_in_control:
                return  # asked for again, the agent would take what is under way for forgotten
            await self._acquire({"what": "take" if take else "acquire"})

    def release(self, ending: Ending) -> None:
        """Give the lease back, if this client holds it; sent in this very call.

        Asked for again, before that is acknowledged or before the run is over, the strongest ending counts.
        """
        self._wants_control = False
        if self.is_in_control:
            self.lose("released", "it was given back")
            self._releasing, self._ending = None, None
        elif self._releasing is None or (self._releasing.done() and not self._is_ending):
            self._releasing = None
            return
        if self._ending is None or ending > self._ending:
            self._ending = ending
            what = {"what": "release", "halt": ending > Ending.LEAVE, "keep_grip": ending is Ending.KEEP}
            posted = self._run.post(self._run.call(what), "lease", timeout=RELEASE_S)
            self._releasing = self._run.spawn(self._run.answer(posted))
            # Who asked for a gentler end is not told of its failure, but of how this one went.
            self._releasing.add_done_callback(lambda task: task.cancelled() or task.exception())
        elif ending < self._ending:
            self._log.warning("a stop that is under way is stronger: the fingers are %s", self._ending.done)

    async def released(self) -> None:
        """Wait until the end that was asked for is acknowledged.

        Raises:
            RobotiqError: the agent did not answer, or the fingers were not seen to stop.
        """
        awaited = None
        while self._releasing is not awaited:
            awaited = self._releasing
            assert awaited is not None
            await asyncio.wait({awaited})
        if awaited is not None:
            awaited.result()

    def maintain(self) -> None:
        """Renew the lease, or acquire it again when that is due; several times in a window."""
        if self.is_in_control:
            # Also while others are under way: one that is lost is not to cost the lease.
            self._run.spawn(self._renew())
            return
        is_reacquiring = self._reacquiring is not None and not self._reacquiring.done()
        wants_back = self._wants_control and self._may_reacquire
        if wants_back and not self._run.mirror.is_silent and not is_reacquiring:
            self._reacquiring = self._run.spawn(self._reacquire())

    def receive(self, lease: int) -> None:
        """The agent has told the number of the present lease."""
        is_checking = self._checking is not None and not self._checking.done()
        if self.is_in_control and lease > self.lease and not is_checking:
            # The answer to a request under the former one says why it ended.
            self._checking = self._run.spawn(self._check_lease())

    def lose(self, reason: str, why: str) -> None:
        """The lease has ended."""
        if not self.is_in_control:
            return
        self.is_in_control = False
        # After a halt or a take of somebody else nobody takes it back without having been asked to.
        self._wants_control = self._wants_control and reason not in (*NOT_REACQUIRED, "released")
        self.lost = ControlLostError(f"lost control of {self._run.name}: {why}", reason)
        self._run.fail_calls(self.lease, self.lost)
        if reason != "released":
            self._log.warning("lost control: %s", why)

    def check(self) -> None:
        """Refuse commands without a lease.

        Raises:
            ControlLostError: there is none.
        """
        if not self.is_in_control:
            if self.lost is None:
                raise ControlLostError("this hand only reads: acquire() the lease first", "released")
            raise ControlLostError(str(self.lost), self.lost.reason)

    # -- inside ----------------------------------------------------------------------------------------

    async def _acquire(self, what: Fields) -> None:
        await self._run.agents.check_one()
        # With the lease, so that nothing moves before.
        settings = {"settings": self._run.settings.fields} if self._run.settings.fields else {}
        call = self._run.call({**what, "label": label(), **settings})
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
                # Somebody else was first, or has stepped in meanwhile; whose turn it is people decide.
                self._wants_control, self.lost = False, error
        except RobotiqError:
            pass  # again in a moment

    async def _renew(self) -> None:
        await self._run.ask_quietly("lease", {"what": "renew"}, self._run.window)

    async def _check_lease(self) -> None:
        lease, run = self.lease, self._lease_run
        await self._run.ask_quietly("lease", {"what": "renew"}, self._run.window / RENEWALS)
        if (lease, run) == (self.lease, self._run.mirror.epoch):
            # Nobody answers. When the lease is asked for again the agent says whether somebody stepped in.
            self.lose("expired", "its agent says that the lease has ended")
