"""Connection: the hand of a configured node, its goals and its commands."""

# Theory of operation
#
# A connection lasts from configure to cleanup, and takes goals and commands while the node is active. A halt
# is taken at any time.
#
#   _stop()       counts the stop, ends goals and commands, and halts. Until the halt is answered all else is
#                 refused. A goal keeps the number of stops from its acceptance: after a stop it never begins
#   forbid()      the same at deactivation. It cannot fail: the node refuses commands in any case
#   PendingStop   a hold or a halt that a lost link has prevented: sent once the link is back. No goal and no
#                 command is taken before, or for PENDING_S
#   close()       ends the hand, and stops the fingers if commands were ever accepted

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from importlib.util import find_spec
from typing import Final

from ...fleet.errors import ControlLostError
from ...fleet.remote.remote_hand import RemoteHand
from ...hands import Hand
from ...link import is_remote
from ...local import RobotiqHand
from ...runtime import Log, install, now
from ...tools.actions import ACTIONS, Operator
from ...values import NotStartedError, RobotiqConnectionError, RobotiqError, State, StateTimeoutError
from ..translation.diagnosis import why_not
from ..translation.joints import Targets
from ..translation.settings import NodeSettings
from .goals import GoalOutcome, GoalRunner

NODE_COMMANDS: Final = ("activate", "reset", "halt", "recover", "release", "inhibit", "permit")
"""Names of the services, and of the actions that they carry out."""
PERSON: Final = "~/inhibit"
"""The ``who`` of an inhibit, as others hear it."""
MOST_CALLS: Final = 16  # commands that run at a time, without halts, which are always accepted


class RefusedError(RobotiqError):
    """The node does not accept the request now."""


class GripperConnection:
    """A hand, from the configuration of the node to its cleanup.

    A stop ends all earlier requests, also requests that have not begun, and no other request is
    accepted until the stop is answered.

    Attributes:
        hand: the hand.
        takes_commands: whether the node is active. Halts are accepted in any case.
        stops: number of stops; a goal that was accepted before the last one does not begin.
    """

    def __init__(self, hand: Hand, settings: NodeSettings) -> None:
        """Opens nothing; the hand, made with these settings, is not started.

        Belongs to the loop of the hand; other threads may read its attributes.
        """
        self.hand = hand
        self.takes_commands: bool = False
        self.stops: int = 0
        self._operator = Operator(hand, speed=settings.speed, force=settings.force)
        self._person = Operator(hand, who=PERSON, speed=settings.speed, force=settings.force)
        self._pending_stop = PendingStop(hand)
        self._goals = GoalRunner(hand, lost=lambda axes: self._pending_stop.schedule(lambda: hand.hold(axes)))
        self._calls: set[asyncio.Task[str]] = set()
        self._stopping = 0
        self._took_commands = False
        self._is_closed = False

    # -- lifetime -------------------------------------------------------------------------------------

    async def open(self) -> None:
        """Connect and read; write nothing to the gripper."""
        self._check_open()
        await self.hand.start(activate=False)

    async def permit(self) -> None:
        """Accept commands from now on. Moves nothing."""
        self._check_open()
        self.takes_commands = self._took_commands = True

    async def forbid(self, reason: str) -> bool:
        """Refuse commands from now on, and halt; returns whether the gripper has confirmed that it stopped.

        A halt that does not reach the gripper is logged as an error, but does not fail: the node must refuse
        commands in any case. If the link comes back soon, the gripper is halted then.
        """
        self.takes_commands = False
        try:
            await self._stop(reason)
        except NotStartedError:
            return False  # the end of the hand stops the fingers
        except RobotiqError as error:
            Log(self.hand.name).error("no halt, the fingers MAY STILL MOVE: %s", error)
            if isinstance(error, RobotiqConnectionError):
                self._pending_stop.schedule(self.hand.halt)
            return False
        return True

    def refuse(self, reason: str) -> None:
        """Refuse commands from now on, and end the running commands: :meth:`close` follows."""
        self.takes_commands, self._is_closed = False, True
        self._end_all(reason)

    async def close(self, reason: str) -> None:
        """Disconnect; the fingers are stopped if commands were ever accepted. Idempotent."""
        self.refuse(reason)
        try:
            await self.hand.stop(halt=self._took_commands)
        finally:
            await self._pending_stop.cancel()

    # -- commands --------------------------------------------------------------------------------------

    async def command(self, name: str) -> str:
        """Carry out one of :data:`NODE_COMMANDS`; returns its outcome as a text.

        Raises:
            RefusedError: the node is not active, too many commands run, or a stop took over; never for a
                halt, an inhibit or a permit.
            RobotiqError: the command failed.
        """
        if name in ("halt", "inhibit"):
            return await self._stop(f"a {name} took over", for_good=name == "inhibit")
        if name == "permit":
            return await self._person.act(ACTIONS[name])
        self._check_active()
        self._check_stopped()
        if len(self._calls) >= MOST_CALLS:
            raise RefusedError(f"{MOST_CALLS} commands are under way")
        call = asyncio.ensure_future(self._operator.act(ACTIONS[name]))
        self._calls.add(call)
        try:
            await asyncio.wait({call})
        finally:
            call.cancel()
            self._calls.discard(call)
        if call.cancelled():
            raise RefusedError(f"a stop took over: {name} was aborted")
        return call.result()

    async def check_goal(self) -> None:
        """Refuse a goal that cannot begin now.

        Raises:
            RefusedError: the node is not active, the link is down, the gripper is not in a state to move, or
                it is being stopped.
        """
        self._check_active()
        reason = why_not(self.hand)
        if reason is not None:
            raise RefusedError(reason)
        self._check_stopped()

    async def run_goal(
        self, key: bytes, targets: Targets, settings: NodeSettings, feedback: Callable[[], object], stops: int
    ) -> GoalOutcome:
        """Carry out a goal; see :meth:`GoalRunner.run`. ``stops`` is :attr:`stops` when it was accepted.

        Raises:
            RefusedError: a stop came since, or the conditions of :meth:`check_goal` have changed.
        """
        if stops != self.stops:
            raise RefusedError("a stop took over before it began")
        await self.check_goal()
        return await self._goals.run(
            key,
            targets,
            speed=settings.speed,
            force=settings.force,
            allow_stalling=settings.allow_stalling,
            feedback=feedback,
        )

    async def cancel_goal(self, key: bytes) -> None:
        self._goals.cancel(key)

    # -- stops -----------------------------------------------------------------------------------------

    async def _stop(self, reason: str, *, for_good: bool = False) -> str:
        self._end_all(reason)
        self._stopping += 1
        try:
            return await (self._person if for_good else self._operator).act(ACTIONS["halt"])
        finally:
            self._stopping -= 1

    def _end_all(self, reason: str) -> None:
        # Also goals that have not reached the hand yet: run_goal() compares the number of stops.
        self.stops += 1
        self._goals.abort(reason)
        for call in self._calls:
            call.cancel()

    # -- checks ----------------------------------------------------------------------------------------

    def _check_open(self) -> None:
        if self._is_closed:
            raise RefusedError("the connection has been closed")

    def _check_active(self) -> None:
        if not self.takes_commands:
            raise RefusedError("the node is not active: activate it first (that moves nothing)")

    def _check_stopped(self) -> None:
        if self._stopping:
            raise RefusedError("a halt is under way")
        if self._pending_stop.is_pending:
            raise RefusedError("the fingers are not stopped yet: the link was down when they were to be")


PENDING_S: Final = 60.0
"""Seconds after which every motion from before the loss has ended; the longest is an automatic release."""
RETRY_S: Final = 0.05  # seconds between two attempts
_CONNECTED: Final = tuple(set(State) - {State.DISCONNECTED, State.DO_SHUTDOWN, State.SHUTDOWN})


class PendingStop:
    """Sends the stop as soon as the link is back. A stop moves nothing, so it may be late."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def is_pending(self) -> bool:
        return bool(self._tasks)

    def schedule(self, stop: Callable[[], Awaitable[None]]) -> None:
        """Send a stop when the link is back, within PENDING_S; again after RobotiqConnectionError."""
        task = asyncio.ensure_future(self._send(stop, now() + PENDING_S))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def cancel(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _send(self, stop: Callable[[], Awaitable[None]], until: float) -> None:
        while (left := until - now()) > 0:
            try:
                try:
                    await self._hand.wait_for_state(*_CONNECTED, timeout=left)
                except StateTimeoutError:
                    return  # it is too late
                await stop()
            except RobotiqConnectionError:
                await asyncio.sleep(RETRY_S)
            except (NotStartedError, ControlLostError):
                return  # the hand or its lease has ended, which stops the fingers
            except RobotiqError as error:
                Log(self._hand.name).error("the link is back, and the fingers MAY STILL MOVE: %s", error)
                return
            else:
                Log(self._hand.name).warning("the link is back, and axes that still moved were stopped")
                return


def make_hand(settings: NodeSettings) -> Hand:
    """A hand that is not started. In the ROS node only this module knows which kind of hand it is.

    A hand on another host acquires its lease with the first command: connecting only reads.

    Raises:
        ValueError: an option that the hand refuses.
        RobotiqError: the extra that this address needs is not installed.
    """
    if is_remote(settings.address):
        if find_spec("zenoh") is None:
            raise RobotiqError(f"a gripper on another host needs zenoh: {install('fleet')}")
        return RemoteHand(settings.address, control=None)
    return RobotiqHand(settings.address, speed=settings.speed, force=settings.force, **settings.options)


class HandMaker:
    """Makes the hand of each configure.

    A person's inhibit stays over a cleanup and the next configure: at an agent by itself, here until it is
    permitted here, also if the node has the hand of an agent in between.
    """

    def __init__(self) -> None:
        self._newest_here: RobotiqHand | None = None

    def make(self, settings: NodeSettings) -> Hand:
        """As :func:`make_hand`."""
        hand = make_hand(settings)
        if isinstance(hand, RobotiqHand):
            if self._newest_here is not None and self._newest_here.inhibited is not None:
                hand.resume_inhibit(self._newest_here.inhibited)
            self._newest_here = hand
        return hand
