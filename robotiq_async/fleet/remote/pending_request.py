"""A request on its way. It may be said more than once, with the same number: agents know repetitions."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from ...runtime.clock import now
from ...values.errors import RobotiqError
from ..network.bus import Reply, Urgency
from ..wire.envelope import Answer, Call, unpack_answer

REPEAT_S: Final = 0.25
"""After so long without an answer a request is said again: a round trip is shorter than that."""
REPEAT_SLOWLY_S: Final = 1.0
"""After this time, so often: it has been let in by then, or is too late, and its answer may be lost."""
STRAYS: Final = 3
"""So many answers to something else are passed over."""


def of_its_run(call: Call) -> Callable[[Reply], bool]:
    """Whether a reply is that of the run of the agent that was asked; of any, if the request names none.

    Where two agents serve a gripper, the one that refuses is the quicker one.
    """

    def decides(reply: Reply) -> bool:
        try:
            answer = unpack_answer(reply.payload)
        except RobotiqError:
            return False
        return (answer.to, answer.number) == (call.to, call.number) and call.epoch in (0, answer.epoch)

    return decides


def is_refusal(reply: Reply) -> bool:
    """Whether a reply to a halt says anything but that the fingers stand: of two agents both have to."""
    try:
        return unpack_answer(reply.payload).error is not None
    except RobotiqError:
        return True


class PendingRequest:
    """Waits for the first answer to any of its copies.

    Attributes:
        call: the request.
        verb: the last part of the key it goes to.
        urgency: of it and its answer.
        timeout: seconds for its answer, from the first time that it is said.
        asked_at: when it was last said anew.
        answered: the reply; None if there will be none, or an error that says why.
    """

    def __init__(self, call: Call, verb: str, timeout: float, urgency: Urgency) -> None:
        self.call = call
        self.verb = verb
        self.timeout = timeout
        self.urgency = urgency
        self._loop = asyncio.get_running_loop()
        self._until = now() + timeout
        self._strays = 0
        self._copies: set[asyncio.Future[Reply | None]] = set()
        self._timer: asyncio.TimerHandle | None = None
        self.begin()

    def begin(self) -> None:
        """Wait for an answer from now on."""
        self.asked_at = now()
        self.answered: asyncio.Future[Reply | RobotiqError | None] = self._loop.create_future()

    @property
    def is_halt(self) -> bool:
        """Whether it is for every run of the agent, and answered also when the agent falls silent."""
        return self.urgency is Urgency.STOP

    @property
    def is_command(self) -> bool:
        """Whether it has its place among other commands."""
        return self.verb.startswith("cmd/") and self.verb != "cmd/cancel"

    @property
    def may_repeat(self) -> bool:
        """Whether it is said again until it is answered. Renewals follow each other, halts have their own."""
        return self.is_command or (self.verb == "lease" and self.call.arguments.get("what") != "renew")

    @property
    def is_allowed_after_stop(self) -> bool:
        """Whether it may still be said when the hand was stopped: it starts and continues no motion."""
        return self.is_halt or (self.verb == "lease" and self.call.arguments.get("what") == "release")

    @property
    def left(self) -> float:
        """Seconds for its answer."""
        return max(0.0, self._until - now())

    def packed(self, after: int) -> bytes:
        """As bytes; ``after`` is the command before it that has not been answered yet, or 0."""
        return (replace(self.call, after=after) if after else self.call).pack()

    def add(self, copy: asyncio.Future[Reply | None], came_early: Callable[[], None]) -> None:
        """It was said; ``came_early`` is called if it arrived, and one that was said before it did not."""

        def take(_: object) -> None:
            self._copies.discard(copy)
            reply = None if copy.cancelled() else copy.result()
            if self.answered.done() or (reply is None and self._copies):
                return
            if reply is not None and self.may_repeat:
                if self._is_stray(reply) and self._strays < STRAYS:
                    self._strays += 1
                    return  # a copy went astray, or its answer: it is said again
                if _came_early(reply):
                    came_early()
                    return
            self.answered.set_result(reply)

        self._copies.add(copy)
        copy.add_done_callback(take)

    def _is_stray(self, reply: Reply) -> bool:
        try:
            answer = unpack_answer(reply.payload)
        except RobotiqError:
            return False
        is_about_this = answer.to == self.call.to and answer.number == self.call.number
        return bool(answer.number) and not is_about_this

    def repeat(self, say: Callable[[], None]) -> None:
        """Have it said again if it is not answered in time."""
        self.stop_repeating()
        if self.may_repeat:
            pause = REPEAT_S if now() < self._until - self.timeout + REPEAT_SLOWLY_S else REPEAT_SLOWLY_S
            self._timer = self._loop.call_later(pause, say)

    def stop_repeating(self) -> None:
        """Say it no more."""
        if self._timer is not None:
            self._timer.cancel()

    def fail(self, error: RobotiqError) -> None:
        """There will be no answer."""
        if not self.answered.done():
            self.answered.set_result(error)

    def end(self) -> None:
        """Nobody waits for it."""
        self.stop_repeating()
        self.answered.cancel()
        for copy in list(self._copies):
            copy.cancel()

    async def ended(self) -> None:
        """Wait until nothing of it is left."""
        await asyncio.gather(*self._copies, return_exceptions=True)


def _came_early(reply: Reply) -> bool:
    """Whether the agent waits for a request that was said before this one."""
    try:
        answer: Answer = unpack_answer(reply.payload)
    except RobotiqError:
        return False
    return isinstance(answer.error, dict) and answer.error.get("reason") == "early"
