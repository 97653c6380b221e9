"""Errand: a request on its way, until it is answered.

It is sent again with the same number until it is answered. The agent recognizes repetitions by the number and
carries them out once, so a repetition costs nothing but its message. Only a halt is carried out each time.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from typing import Final

from ...runtime import Limit, now
from ...values import ConnectionLostError, RobotiqError
from ..errors import AgentError
from ..network.bus import BusReply, Urgency
from ..wire.envelope import AgentAnswer, AgentCall, outcome, unpack_answer
from ..wire.settings import Setting, asked_of

ERRAND_REPEAT_S: Final = (
    0.25  # seconds without an answer before a request is repeated: longer than a round trip
)
REPEAT_SLOWLY_S: Final = 1.0
"""After this many seconds, the interval of repetitions: by then the request was admitted or is too late, and
only its answer may be lost."""
STRAYS: Final = 3  # answers to other requests that are ignored, at most
HALT_S: Final = 2.0  # seconds for which a halt is repeated
ATTEMPT_S: Final = 0.3  # seconds from one copy of a halt to the next
RETRY_S: Final = 0.05  # the same after a copy that failed at once, as no agent was reached
AT_ONCE_S: Final = 0.25
"""Seconds: an empty reply before that is no timeout, but means that no process received the request."""
IN_ANY_RUN: Final = ("info", "halt")  # requests that any run of the agent may answer
_RETRIED: Final = ("AgentError", "ProtocolError")  # answers to a halt after which the next copy may succeed


class NoAnswerError(ConnectionLostError):
    """No answer arrived; whether the request was carried out is unknown.

    Attributes:
        why: no answer arrived.
    """

    def __init__(self, name: object, verb: str, why: str = "no answer") -> None:
        self.why = why
        super().__init__(f"{name}: {why}{outcome(None, verb)}")


@contextmanager
def no_answer_as_lost_connection() -> Iterator[None]:
    """Around public calls: report a missing answer as a lost connection."""
    try:
        yield
    except NoAnswerError as error:
        raise ConnectionLostError(str(error)) from error


def of_its_run(call: AgentCall) -> Callable[[BusReply], bool]:
    """A check that a reply comes from the addressed run of the agent; without an address, from any run.

    With two agents for one gripper, the refusal of the wrong one arrives first.
    """
    return lambda reply: _is_of_its_run(call, _read(reply))


def _is_of_its_run(call: AgentCall, said: AgentAnswer | RobotiqError) -> bool:
    return isinstance(said, AgentAnswer) and _is_about(call, said) and call.epoch in (0, said.epoch)


def _read(reply: BusReply) -> AgentAnswer | RobotiqError:
    try:
        return unpack_answer(reply.payload)
    except RobotiqError as error:
        return error


def _is_about(call: AgentCall, answer: AgentAnswer) -> bool:
    return (answer.to, answer.number) == (call.to, call.number)


class Errand:
    """Waits for the first answer to any of the copies of a request.

    Attributes:
        verb: the last part of its key.
        timeout: seconds for the answer, from the first copy, while the event loop runs.
        carries: its positions, speeds and forces.
        asked_at: when the wait for an answer began.
        answered: the answer; None if none came; or the error that ended the wait.
        status: the status that came with the newest answer.
        was_empty: whether the last copy came back at once without a reply; for a halt, any of them.
    """

    def __init__(
        self,
        name: object,
        call: AgentCall,
        verb: str,
        timeout: float,
        urgency: Urgency,
        agents: int,
        resend: Callable[[Errand], None],
        came_early: Callable[[], None],
    ) -> None:
        """A halt of a gripper, by its ``name``, is answered when so many ``agents`` have confirmed it.

        ``resend`` sends another copy. ``came_early`` is called when one arrived before a preceding command.
        """
        self.call = call
        self.verb = verb
        self.timeout = timeout
        self.urgency = urgency
        self.was_empty: bool = False
        self.status: bytes = b""
        self._name = name
        self._agents = agents
        self._resend, self._came_early = resend, came_early
        self._confirmed: set[int] = set()  # the runs of agents that have confirmed a halt
        self._newest: BusReply | None = None
        self._said: AgentAnswer | RobotiqError | None = None  # the content of the newest reply
        self._in_doubt: AgentAnswer | RobotiqError | None = None
        """The outcome when the time is over."""
        self.carries: dict[Setting, int] = asked_of(verb.removeprefix("cmd/"), call.arguments)
        self._loop = asyncio.get_running_loop()
        self._limit = Limit(timeout)
        self._strays = 0
        self._copies: set[asyncio.Future[BusReply | None]] = set()
        self._timer: asyncio.TimerHandle | None = None
        self.begin()

    def begin(self) -> None:
        self.asked_at: float = now()
        self.answered: asyncio.Future[AgentAnswer | RobotiqError | None] = self._loop.create_future()

    @property
    def is_halt(self) -> bool:
        # Any run of the agent may answer a halt, and its answer is awaited even if the agent falls silent.
        return self.urgency is Urgency.STOP

    @property
    def is_command(self) -> bool:
        # Commands keep their order. A cancellation does not wait for earlier commands.
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
        return max(0.0, self._limit.left)

    def packed(self, after: int) -> bytes:
        """The request as bytes; ``after`` is the number of the unanswered command before it, or 0."""
        return (replace(self.call, after=after) if after else self.call).pack()

    async def wait(self) -> AgentAnswer | None:
        """Wait for the answer; None if none comes. NoAnswerError: the wait was ended."""
        with self._limit as limit:
            await asyncio.wait({self.answered})
        if limit.is_over:
            self.fail(self._in_doubt)
        if self.answered.cancelled():
            raise NoAnswerError(self._name, self.verb, "the agent fell silent")
        said = self.answered.result()
        if isinstance(said, RobotiqError):
            raise said
        return said

    # -- replies ---------------------------------------------------------------------------------------

    def decides(self, reply: BusReply) -> bool:
        """Whether a reply ends the wait for further replies to the same copy of the request."""
        said = self._say(reply)
        if not self.is_halt:
            return _is_of_its_run(self.call, said)
        if isinstance(said, AgentAnswer) and said.error is None:
            # Of two agents both must confirm it.
            if _is_about(self.call, said):
                self._confirmed.add(said.epoch)
                missing = self._agents - len(self._confirmed)
                why = f"no answer from {missing} of {self._agents} agents"
                self._in_doubt = NoAnswerError(self._name, self.verb, why) if missing > 0 else said
            return False
        return True

    def add(self, copy: asyncio.Future[BusReply | None]) -> None:
        """Add a copy that was sent."""
        sent_at = now()
        self._copies.add(copy)
        copy.add_done_callback(lambda copy: self._end_copy(copy, sent_at))
        self._repeat_later()

    def _end_copy(self, copy: asyncio.Future[BusReply | None], sent_at: float) -> None:
        self._copies.discard(copy)
        if self.answered.done() or copy.cancelled():
            return
        reply = copy.result()
        at_once = reply is None and now() - sent_at < min(AT_ONCE_S, self.timeout / 2)
        self.was_empty = at_once or (self.is_halt and self.was_empty)
        if self.is_halt:
            self._take_of_halt(reply)
            if not self.answered.done() and not self._copies:
                self._repeat_later(max(0.001, sent_at + RETRY_S - now()))
        elif reply is not None:
            self._take(reply)
        # A copy whose time passed while the loop was held up is followed by another.
        elif not self._copies and (at_once or not self.may_repeat or self.left <= RETRY_S):
            self.answered.set_result(None)

    def _take(self, reply: BusReply) -> None:
        said = self._say(reply)
        if isinstance(said, AgentAnswer) and self.may_repeat:
            is_stray = bool(said.number) and not _is_about(self.call, said)
            if is_stray and self._strays < STRAYS:
                self._strays += 1
                self._repeat_later(RETRY_S)  # the copy, or its answer, was misrouted
                return
            if said.error is not None and said.error.get("reason") == "early":
                self._came_early()
                return
        self._settle(reply)

    def _take_of_halt(self, reply: BusReply | None) -> None:
        # Only an answer about the gripper ends it before its time: that all have stopped, or why not.
        if reply is None:
            return
        said = self._say(reply)
        if not isinstance(said, AgentAnswer) or not _is_about(self.call, said):
            self._in_doubt = self._checked(said)
        elif said.error is not None:
            self._in_doubt = said
            if said.error.get("kind") not in _RETRIED:
                self._settle(reply)
        elif len(self._confirmed) >= self._agents:
            self._settle(reply)

    def _settle(self, reply: BusReply) -> None:
        self.status = reply.attachment
        self.answered.set_result(self._checked(self._say(reply)))

    def _say(self, reply: BusReply) -> AgentAnswer | RobotiqError:
        if reply is not self._newest or self._said is None:
            self._newest, self._said = reply, _read(reply)
        return self._said

    def _checked(self, said: AgentAnswer | RobotiqError) -> AgentAnswer | RobotiqError:
        """An answer if it may be the one to this request, else the error."""
        if not isinstance(said, AgentAnswer):
            return said
        if said.to != self.call.to or said.number not in (0, self.call.number):
            return AgentError(f"{self._name}: another answer came{outcome(None, self.verb)}")
        if self.call.epoch not in (0, said.epoch) and self.verb not in IN_ANY_RUN:
            # That run did nothing. Whether the addressed run carried it out is unknown.
            return NoAnswerError(self._name, self.verb, "another run of its agent answered")
        return said

    # -- time ------------------------------------------------------------------------------------------

    def _repeat_later(self, pause: float = 0.0) -> None:
        self._stop_repeating()
        if self.may_repeat:
            usual = ERRAND_REPEAT_S if now() < self.asked_at + REPEAT_SLOWLY_S else REPEAT_SLOWLY_S
            pause = pause or (ATTEMPT_S if self.is_halt else usual)
            self._timer = self._loop.call_later(pause, self._repeat)

    def _repeat(self) -> None:
        if self.left > RETRY_S:
            self._resend(self)

    def _stop_repeating(self) -> None:
        if self._timer is not None:
            self._timer.cancel()

    def end_soon(self, seconds: float, error: RobotiqError) -> None:
        """Wait for the answer no longer than these seconds; the error is the outcome then."""
        self._in_doubt = error
        self._limit.restart(min(seconds, self.left))

    def fail(self, why: AgentAnswer | RobotiqError | None) -> None:
        if not self.answered.done():
            self.answered.set_result(why)

    def end(self) -> None:
        self._stop_repeating()
        self._limit.stop()
        self.answered.cancel()
        for copy in list(self._copies):
            copy.cancel()

    async def ended(self) -> None:
        await asyncio.gather(*self._copies, return_exceptions=True)
