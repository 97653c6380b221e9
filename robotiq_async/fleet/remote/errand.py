"""Errand: a request on its way, until it is answered.

It is sent again with the same number until it is answered. The agent recognizes repetitions by the number and
carries them out once, so a repetition costs nothing but its message. Only a halt is carried out each time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from ...runtime.clock import now
from ...values.errors import ConnectionLostError, RobotiqError
from ..network.bus import Reply, Urgency
from ..wire.envelope import Answer, Call, unpack_answer
from ..wire.settings import asked_of

REPEAT_S: Final = 0.25  # seconds without an answer before a request is repeated: longer than a round trip
REPEAT_SLOWLY_S: Final = 1.0
"""After this many seconds, the interval of repetitions: by then the request was admitted or is too late, and
only its answer may be lost."""
STRAYS: Final = 3  # answers to other requests that are ignored, at most
HALT_S: Final = 2.0  # seconds for which a halt is repeated
ATTEMPT_S: Final = 0.3  # seconds from one copy of a halt to the next
RETRY_S: Final = 0.05  # the same after a copy that failed at once, as no agent was reached
AT_ONCE_S: Final = 0.25
"""Seconds: an empty reply before that is no timeout, but means that no process received the request."""
_RETRIED: Final = ("AgentError", "ProtocolError")  # answers to a halt after which the next copy may succeed


class NoAnswerError(ConnectionLostError):
    """No answer arrived; whether the request was carried out is unknown.

    Attributes:
        why: no answer arrived.
    """

    def __init__(self, name: object, verb: str, why: str = "no answer") -> None:
        self.why = why
        super().__init__(f"{name}: {why}; {verb} may have been carried out")


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


class Errand:
    """Waits for the first answer to any of the copies of a request.

    Attributes:
        verb: the last part of its key.
        timeout: seconds for the answer, from the first copy.
        asked: the positions, speeds and forces that it asks for.
        asked_at: when the wait for an answer began.
        answered: the reply; None if there is none, or the error that ended the wait.
        was_empty: whether a copy came back at once without a reply.
    """

    def __init__(
        self, call: Call, verb: str, timeout: float, urgency: Urgency, agents: int, send: Callable[[], None]
    ) -> None:
        """``send`` sends another copy. A halt is answered when so many ``agents`` have confirmed it."""
        self.call = call
        self.verb = verb
        self.timeout = timeout
        self.urgency = urgency
        self.was_empty = False
        self._agents = agents
        self._send = send
        self._confirmed: set[int] = set()  # the runs of agents that have
        self._in_doubt: Reply | RobotiqError | None = None
        """What a halt is answered with when its time is over."""
        self.asked = asked_of(verb.removeprefix("cmd/"), call.arguments)
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
        # The next question or renewal replaces a lost one.
        return self.verb != "info" and self.call.arguments.get("what") != "renew"

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

    def decides(self, reply: Reply) -> bool:
        """Whether a reply ends the wait for the others."""
        if not self.is_halt:
            return of_its_run(self.call)(reply)
        answer = _answer(reply)
        if answer is not None and answer.error is None and _is_about(self.call, answer):
            self._confirmed.add(answer.epoch)
        return is_refusal(reply)

    def add(self, copy: asyncio.Future[Reply | None], came_early: Callable[[], None]) -> None:
        """Add a copy that was sent. ``came_early`` is called if it arrived before a preceding command."""
        sent_at = now()

        def take(_: object) -> None:
            self._copies.discard(copy)
            if self.answered.done() or copy.cancelled():
                return
            reply = copy.result()
            self.was_empty |= reply is None and now() - sent_at < min(AT_ONCE_S, self.timeout / 2)
            if self.is_halt:
                self._take_of_halt(reply, sent_at)
            elif reply is not None or not self._copies:
                self._take(reply, came_early)

        self._copies.add(copy)
        copy.add_done_callback(take)
        self._repeat()

    def _take(self, reply: Reply | None, came_early: Callable[[], None]) -> None:
        answer = _answer(reply) if reply is not None and self.may_repeat else None
        if answer is not None:
            is_stray = bool(answer.number) and not _is_about(self.call, answer)
            if is_stray and self._strays < STRAYS:
                self._strays += 1
                self._repeat(RETRY_S)  # the copy, or its answer, was misrouted
                return
            if isinstance(answer.error, dict) and answer.error.get("reason") == "early":
                came_early()
                return
        self.answered.set_result(reply)

    def _take_of_halt(self, reply: Reply | None, sent_at: float) -> None:
        # Only an answer about the gripper ends it before its time: that all have stopped, or why not.
        answer = None if reply is None else _answer(reply)
        if answer is None or not _is_about(self.call, answer):
            self._in_doubt = reply or self._in_doubt
        elif answer.error is None and len(self._confirmed) < self._agents:
            missing = f"no answer from {self._agents - len(self._confirmed)} of {self._agents} agents"
            self._in_doubt = NoAnswerError(self.call.to, self.verb, missing)
        elif answer.error is None or answer.error.get("kind") not in _RETRIED:
            self.answered.set_result(reply)
            return
        else:
            self._in_doubt = reply
        if not self._copies:
            self._repeat(max(0.001, sent_at + RETRY_S - now()))

    def _repeat(self, pause: float = 0.0) -> None:
        self.stop_repeating()
        if self.may_repeat:
            usual = REPEAT_S if now() < self._until - self.timeout + REPEAT_SLOWLY_S else REPEAT_SLOWLY_S
            pause = pause or (ATTEMPT_S if self.is_halt else usual)
            self._timer = self._loop.call_later(min(pause, self.left), self._send_again)

    def _send_again(self) -> None:
        if self.left > RETRY_S:
            self._send()
        elif self.is_halt and not self._copies and not self.answered.done():  # else those end in time
            self.answered.set_result(self._in_doubt)

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
