"""PendingRequest: a request without an answer yet.

It is sent again with the same number until it is answered. The agent recognizes repetitions by the number and
carries them out once, so a repetition costs nothing but its message.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from ...runtime.clock import now
from ...values.errors import RobotiqError
from ..network.bus import Reply, Urgency
from ..wire.envelope import Answer, Call, unpack_answer

REPEAT_S: Final = 0.25  # seconds without an answer before a request is repeated: longer than a round trip
REPEAT_SLOWLY_S: Final = 1.0
"""After this many seconds, the interval of repetitions: by then the request was admitted or is too late, and
only its answer may be lost."""
STRAYS: Final = 3  # answers to other requests that are ignored, at most


def of_its_run(call: Call) -> Callable[[Reply], bool]:
    """A check that a reply comes from the addressed run of the agent, or any run if none is addressed.

    With two agents for one gripper, the refusal of the wrong one arrives first.
    """

    def decides(reply: Reply) -> bool:
        answer = _answer(reply)
        return answer is not None and _is_about(call, answer) and call.epoch in (0, answer.epoch)

    return decides


def is_refusal(reply: Reply) -> bool:
    # A halt ends with the first refusal. Of two agents both must confirm it, so a success does not end the
    # wait.
    answer = _answer(reply)
    return answer is None or answer.error is not None


def _answer(reply: Reply) -> Answer | None:
    try:
        return unpack_answer(reply.payload)
    except RobotiqError:
        return None


def _is_about(call: Call, answer: Answer) -> bool:
    return (answer.to, answer.number) == (call.to, call.number)


class PendingRequest:
    """Waits for the first answer to any of the copies of a request.

    Attributes:
        verb: the last part of its key.
        timeout: seconds for the answer, from the first copy.
        asked_at: when the wait for an answer began.
        answered: the reply; None if there is none, or the error that ended the wait.
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
        self.asked_at = now()
        self.answered: asyncio.Future[Reply | RobotiqError | None] = self._loop.create_future()

    @property
    def is_halt(self) -> bool:
        # Any run of the agent may answer a halt, and its answer is awaited even if the agent falls silent.
        return self.urgency is Urgency.STOP

    @property
    def is_command(self) -> bool:
        # Commands keep their order. A cancellation does not wait for those before it.
        return self.verb.startswith("cmd/") and self.verb != "cmd/cancel"

    @property
    def may_repeat(self) -> bool:
        # The next renewal replaces a lost one, and until_answered() repeats halts.
        return self.is_command or (self.verb == "lease" and self.call.arguments.get("what") != "renew")

    @property
    def is_allowed_after_stop(self) -> bool:
        # A halt and a release start and continue no motion.
        return self.is_halt or (self.verb == "lease" and self.call.arguments.get("what") == "release")

    @property
    def left(self) -> float:
        return max(0.0, self._until - now())

    def packed(self, after: int) -> bytes:
        """The request as bytes; ``after`` is the number of the unanswered command before it, or 0."""
        return (replace(self.call, after=after) if after else self.call).pack()

    def add(self, copy: asyncio.Future[Reply | None], came_early: Callable[[], None]) -> None:
        """Add a copy that was sent. ``came_early`` is called if it arrived before a preceding command."""

        def take(_: object) -> None:
            self._copies.discard(copy)
            reply = None if copy.cancelled() else copy.result()
            if self.answered.done() or (reply is None and self._copies):
                return
            if reply is not None and self.may_repeat:
                if self._is_stray(reply) and self._strays < STRAYS:
                    self._strays += 1
                    return  # the copy, or its answer, was misrouted: the request is repeated
                if _came_early(reply):
                    came_early()
                    return
            self.answered.set_result(reply)

        self._copies.add(copy)
        copy.add_done_callback(take)

    def _is_stray(self, reply: Reply) -> bool:
        answer = _answer(reply)
        return answer is not None and bool(answer.number) and not _is_about(self.call, answer)

    def repeat(self, send: Callable[[], None]) -> None:
        """Call ``send`` if there is no answer in time."""
        self.stop_repeating()
        if self.may_repeat:
            pause = REPEAT_S if now() < self._until - self.timeout + REPEAT_SLOWLY_S else REPEAT_SLOWLY_S
            self._timer = self._loop.call_later(pause, send)

    def stop_repeating(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def fail(self, error: RobotiqError) -> None:
        if not self.answered.done():
            self.answered.set_result(error)

    def end(self) -> None:
        self.stop_repeating()
        self.answered.cancel()
        for copy in list(self._copies):
            copy.cancel()

    async def ended(self) -> None:
        await asyncio.gather(*self._copies, return_exceptions=True)


def _came_early(reply: Reply) -> bool:
    # The agent waits for a command that was sent before this one.
    answer = _answer(reply)
    return answer is not None and isinstance(answer.error, dict) and answer.error.get("reason") == "early"
