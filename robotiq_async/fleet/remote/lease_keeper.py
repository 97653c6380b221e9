"""LeaseKeeper: acquires, renews, reacquires and releases the lease of one run.

After a lost connection the lease is reacquired automatically, unless another client took it or halted the
gripper in the meantime, which must not be overruled. The agent decides that, by the number of the lost lease.
"""

from __future__ import annotations

import asyncio
import logging
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from ...runtime import Limit
from ...values import RobotiqError, StopLevel
from ..errors import AgentError, ControlLostError
from ..limited_log import LimitedLog
from ..network.bus import Bus, Undo
from ..wire.values import Fields, reading
from .dialog import Dialog
from .errand import NoAnswerError
from .lease_state import OVERRULING, own_label

LOOK_S: Final = 0.5  # seconds to look for the tokens of agents
TWO_AGENTS: Final = "two agents serve it, perhaps different grippers under one name: stop one of them"
RENEWALS: Final = 5  # renewals, and checks for silence, per window
ANSWER_S: Final = 0.5  # seconds for an answer that the agent gives at once; callers with more time ask again
RELEASE_S: Final = 2.0
"""Seconds for the answer to a release. It may have to report a halt that the gripper did not show for 1 s."""


class LeaseKeeper:
    """The requests about the lease of one run.

    With two agents for one gripper, only a person can say which one is the mistake.
    """

    def __init__(self, dialog: Dialog, bus: Bus) -> None:
        self._dialog = dialog
        self._lease = dialog.lease
        self._bus = bus
        self._tokens: set[str] = set()  # of the agents that announce themselves for the gripper
        self._two_agents = LimitedLog(dialog.log)
        self.end_watch: Undo = bus.watch(dialog.name.key("alive", "*"), self._update_token)
        self._acquiring = asyncio.Lock()
        self._releases = 0
        self._reacquiring: asyncio.Task[Any] | None = None
        self._checking: asyncio.Task[Any] | None = None
        self._level: StopLevel | None = None  # of the last release
        self._releasing: asyncio.Task[Any] | None = None  # the wait for the answer to it

    async def begin(self, limit: Limit) -> None:
        """Acquire the lease at the start of a run; repeat within the limit if an answer was lost."""
        while not self._lease.is_held:  # also in doubt: acquire() says which
            try:
                await self.acquire()
            except (NoAnswerError, ControlLostError) as error:
                if getattr(error, "reason", "late") != "late" or limit.left <= 0:
                    raise

    async def acquire(self, *, take: bool = False) -> None:
        """Get the lease, with ``take`` also from another client; errors as of :meth:`RemoteHand.acquire`."""
        before = self._releases
        async with self._acquiring:
            if self._lease.is_held:
                await self._renew()  # it may have been lost unnoticed
            if self._lease.is_held:
                return  # a new lease would end the motions under this one
            granted = await self._acquire({"what": "take" if take else "acquire"})
            if self._releases != before:
                self._dialog.spawn(self._give_back(*granted))
                raise ControlLostError(f"{self._dialog.name}: released while it was acquired", "released")
            self._take_over(*granted)

    def release(self, level: StopLevel) -> None:
        """Release the lease, if this client holds it; the request is sent within this call.

        Called again before the release is acknowledged, the strongest level applies. An acquire() that waits
        for its answer fails.
        """
        self._releases += 1
        if is_held := self._lease.is_held:
            self._level = None
        elif self._releasing is not None and self._releasing.done():
            self._releasing = None  # an earlier one: there is nothing to release now
        self._dialog.release_lease()
        if is_held or self._releasing is not None:
            self._request_release(level)

    def end(self, level: StopLevel) -> None:
        """The run ends: release the lease. Called again, the strongest level applies."""
        if not self._lease.is_over:
            self.release(level)
            self._lease.end()
        elif self._releasing is not None:
            self._request_release(level)

    async def released(self) -> None:
        """Wait until the strongest release is acknowledged; errors as of :meth:`RemoteHand.release`."""
        awaited = None
        while self._releasing is not awaited:
            awaited = self._releasing
            assert awaited is not None
            await asyncio.wait({awaited})
        if awaited is not None:
            awaited.result()

    def _request_release(self, level: StopLevel) -> None:
        if self._level is None or level > self._level:
            self._level = level
            what = {
                "what": "release",
                "halt": level > StopLevel.LEAVE,
                "keep_grip": level is StopLevel.KEEP,
            }
            errand = self._dialog.post(self._dialog.call(what), "lease", timeout=RELEASE_S)
            self._releasing = self._dialog.spawn(self._dialog.answer(errand))
            # After a stronger release, callers wait for that one, so the error of this one may go unread.
            self._releasing.add_done_callback(lambda task: task.cancelled() or task.exception())
        elif level < self._level:
            self._dialog.log.warning(self._level.prevails)

    def maintain(self) -> None:
        """Renew the lease, or reacquire it when due. Called several times in a window."""
        if self._lease.is_held:
            # Renewals may overlap: a lost one must not cost the lease.
            self._dialog.spawn(self._renew())
            return
        is_due = self._lease.seeks and not self._dialog.mirror.is_silent
        if is_due and (self._reacquiring is None or self._reacquiring.done()):
            self._reacquiring = self._dialog.spawn(self._reacquire())

    def receive(self, lease: int) -> None:
        """A status had this number of the present lease."""
        is_checking = self._checking is not None and not self._checking.done()
        if self._lease.is_held and lease > self._lease.number and not is_checking:
            # The answer to a request under the lost lease has the reason.
            self._checking = self._dialog.spawn(self._check_lease())

    async def _acquire(self, what: Fields) -> tuple[int, int]:
        # Returns the number of the lease, and the run of the agent that gave it.
        await self._check_one_agent()
        call = self._dialog.call({**what, "label": own_label()})
        value = await self._dialog.send(call, "lease", timeout=ANSWER_S)
        with reading("a lease"):
            number, is_kept = int(value["lease"]), bool(value["settings"])
        settings = self._dialog.settings.fields
        if settings and not is_kept:  # the agent has lost its record: before any motion under this lease
            call = replace(self._dialog.call({"what": "settings", "settings": settings}), lease=number)
            await self._dialog.send(call, "lease", timeout=ANSWER_S)
        return number, self._dialog.mirror.epoch

    async def _reacquire(self) -> None:
        try:
            async with self._acquiring:
                lost = {"again": self._lease.number, "run": self._lease.run}
                granted = await self._acquire({"what": "acquire", **lost})
                if self._lease.seeks:
                    self._take_over(*granted)
                else:  # it was released in the meantime, or a second agent has come
                    await self._give_back(*granted)
        except ControlLostError as error:
            if error.reason in OVERRULING:
                self._lease.refuse(error)
        except RobotiqError:
            pass  # the next maintain() tries again

    def _take_over(self, number: int, run: int) -> None:
        self._lease.grant(number, run)
        if len(self._tokens) > 1:  # the second has come since the request
            self._lease.doubt()

    async def _check_one_agent(self) -> None:
        name = self._dialog.name
        if len(self._tokens) > 1:  # one may be gone, and its sign-off lost
            self._tokens = set(await self._bus.announced(name.key("alive", "*"), timeout=LOOK_S))
        if len(self._tokens) > 1:
            raise AgentError(f"{name}: {TWO_AGENTS}; nothing was done")

    def _update_token(self, token: str, is_there: bool) -> None:
        before = len(self._tokens)
        (self._tokens.add if is_there else self._tokens.discard)(token)
        if before < 2 <= len(self._tokens):
            self._two_agents.warn("%s", TWO_AGENTS, level=logging.ERROR)
            self._lease.doubt()

    async def _give_back(self, number: int, run: int) -> None:
        # Otherwise other clients are refused until it expires. Nothing has moved under it.
        call = self._dialog.call({"what": "release", "halt": False})
        with suppress(RobotiqError):
            await self._dialog.send(replace(call, lease=number, epoch=run), "lease", timeout=ANSWER_S)

    async def _renew(self) -> None:
        await self._dialog.ask_quietly("lease", {"what": "renew"}, self._dialog.window)

    async def _check_lease(self) -> None:
        before = (self._lease.number, self._lease.run)
        await self._dialog.ask_quietly("lease", {"what": "renew"}, self._dialog.window / RENEWALS)
        if before == (self._lease.number, self._dialog.mirror.epoch):
            # No answer with a reason. If another client intervened, the agent refuses to reacquire.
            self._dialog.lose_lease("expired", "its agent reports that the lease has ended")
