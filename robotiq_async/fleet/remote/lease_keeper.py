"""LeaseKeeper: acquires, renews, reacquires and releases the lease of one run.

After a lost connection the lease is reacquired automatically, unless another client took it or halted the
gripper in the meantime, which must not be overruled. The agent decides that, by the number of the lost lease.
"""

from __future__ import annotations

import asyncio
from contextlib import suppress
from dataclasses import replace
from typing import Any, Final

from ...runtime.clock import now
from ...values.enums import StopLevel
from ...values.errors import ControlLostError, RobotiqError
from ..wire.values import Fields, reading
from .agents import Agents
from .client import Client
from .lease_state import OVERRULING, LeaseState
from .requests import NoAnswerError, label

RENEWALS: Final = 5  # renewals, and checks for silence, per window
ANSWER_S: Final = 0.5  # seconds for an answer that the agent gives at once; callers with more time ask again
RELEASE_S: Final = 2.0
"""Seconds for the answer to a release. It may have to report a halt that the gripper did not show for 1 s."""


class LeaseKeeper:
    """The requests about the lease of one run."""

    def __init__(self, client: Client, agents: Agents) -> None:
        self._client = client
        self._lease = client.lease
        self._agents = agents
        self._acquiring = asyncio.Lock()
        self._releases = 0
        self._reacquiring: asyncio.Task[Any] | None = None
        self._checking: asyncio.Task[Any] | None = None
        self._release: Release | None = None

    async def begin(self, deadline: float) -> None:
        """Acquire the lease at the start of a run; repeat until the deadline if an answer was lost."""
        while not self._lease.is_held:  # also in doubt: acquire() says which
            try:
                await self.acquire()
            except (NoAnswerError, ControlLostError) as error:
                if getattr(error, "reason", "late") != "late" or now() >= deadline:
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
                self._client.spawn(self._give_back(*granted))
                raise ControlLostError(f"{self._client.name}: released while it was acquired", "released")
            self._take_over(*granted)

    def release(self, level: StopLevel) -> None:
        """Release the lease, if this client holds it; the request is sent within this call.

        Called again before the release is acknowledged, the strongest level applies. An acquire() that waits
        for its answer fails.
        """
        self._releases += 1
        if self._lease.is_held:
            self._release = Release(self._client)
        elif self._release is not None and self._release.is_done:
            self._release = None  # an earlier one: there is nothing to release now
        self._client.release_lease()
        if self._release is not None:
            self._release.request(level)

    def end(self, level: StopLevel) -> None:
        """The run ends: release the lease. Called again, the strongest level applies."""
        if not self._lease.is_over:
            self.release(level)
            self._lease.end()
        elif self._release is not None:
            self._release.request(level)

    async def released(self) -> None:
        """Wait until the release is acknowledged; errors as of :meth:`RemoteHand.release`."""
        if self._release is not None:
            await self._release.acknowledged()

    def maintain(self) -> None:
        """Renew the lease, or reacquire it when due. Called several times in a window."""
        if self._lease.is_held:
            # Renewals may overlap: a lost one must not cost the lease.
            self._client.spawn(self._renew())
            return
        is_due = self._lease.state is LeaseState.SEEKS and not self._client.mirror.is_silent
        if is_due and (self._reacquiring is None or self._reacquiring.done()):
            self._reacquiring = self._client.spawn(self._reacquire())

    def receive(self, lease: int) -> None:
        """A status had this number of the present lease."""
        is_checking = self._checking is not None and not self._checking.done()
        if self._lease.is_held and lease > self._lease.number and not is_checking:
            # The answer to a request under the lost lease has the reason.
            self._checking = self._client.spawn(self._check_lease())

    async def _acquire(self, what: Fields) -> tuple[int, int]:
        # Returns the number of the lease, and the run of the agent that gave it.
        await self._agents.check_one()
        # Sent with the request for the lease, so that no motion precedes them.
        settings = self._client.requests.settings.fields
        call = self._client.call({**what, "label": label(), **({"settings": settings} if settings else {})})
        value = await self._client.send(call, "lease", timeout=ANSWER_S)
        with reading("a lease"):
            return int(value["lease"]), self._client.mirror.epoch

    async def _reacquire(self) -> None:
        try:
            async with self._acquiring:
                lost = {"again": self._lease.number, "run": self._lease.run}
                granted = await self._acquire({"what": "acquire", **lost})
                if self._lease.state is LeaseState.SEEKS:
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
        if self._agents.are_several:  # the second has come since the request
            self._lease.doubt()

    async def _give_back(self, number: int, run: int) -> None:
        # Otherwise other clients are refused until it expires. Nothing has moved under it.
        call = self._client.call({"what": "release", "halt": False})
        with suppress(RobotiqError):
            await self._client.send(replace(call, lease=number, epoch=run), "lease", timeout=ANSWER_S)

    async def _renew(self) -> None:
        await self._client.ask_quietly("lease", {"what": "renew"}, self._client.window)

    async def _check_lease(self) -> None:
        before = (self._lease.number, self._lease.run)
        await self._client.ask_quietly("lease", {"what": "renew"}, self._client.window / RENEWALS)
        if before == (self._lease.number, self._client.mirror.epoch):
            # No answer with a reason. If another client intervened, the agent refuses to reacquire.
            self._client.lose_lease("expired", "its agent reports that the lease has ended")


class Release:
    """One release of the lease, requested again with each stronger level."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._level: StopLevel | None = None
        self._answering: asyncio.Task[Any] | None = None  # the wait for the newest answer

    @property
    def is_done(self) -> bool:
        return self._answering is not None and self._answering.done()

    def request(self, level: StopLevel) -> None:
        if self._level is None or level > self._level:
            self._level = level
            what = {
                "what": "release",
                "halt": level > StopLevel.LEAVE,
                "keep_grip": level is StopLevel.KEEP,
            }
            posted = self._client.requests.post(self._client.call(what), "lease", timeout=RELEASE_S)
            self._answering = self._client.spawn(self._client.answer(posted))
            # After a stronger release, callers wait for that one, so the error of this one may go unread.
            self._answering.add_done_callback(lambda task: task.cancelled() or task.exception())
        elif level < self._level:
            self._client.log.warning(self._level.prevails)

    async def acknowledged(self) -> None:
        """Wait for the answer to the strongest request."""
        awaited = None
        while self._answering is not awaited:
            awaited = self._answering
            assert awaited is not None
            await asyncio.wait({awaited})
        if awaited is not None:
            awaited.result()
