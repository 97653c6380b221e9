"""Cycles of read, decide and write without I/O: the controller, an exact simulated gripper, one clock."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterable
from typing import Any

from robotiq_async import Finger, MoveResult, RobotiqStatus, State
from robotiq_async.control.controller import Controller
from robotiq_async.control.pending import changes
from robotiq_async.control.state_machine import StateMachine
from robotiq_async.control.waiters import Move, Waiter, fail
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.enums import StopLevel, Trigger
from robotiq_async.values.errors import RobotiqError
from robotiq_async.values.model import THREE_FINGER, Model
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.states import TABLE
from tests.register_words import with_object_status

POLL_S = 0.005
LIVELY_S = 0.1
"""So long after anything has happened every poll is made. Then nothing happens until an axis arrives."""
DULL_POLLS = 4
"""The polls of which one is made then: an axis is on its way, or all of them rest."""
ACTIVATING_S = 0.2
"""Between two polls of an activation that is only a beginning: it takes many seconds."""
ROUNDING_S = 1e-6


def first_request(speed: int = 128, force: int = 64, model: Model = THREE_FINGER) -> Request:
    """The image of a hand that has written none."""
    return Request(axes=(AxisRequest(0, speed, force),) * len(model.axes), model=model)


class Outcome:
    """A caller that waits, and its result; a second result is a failure."""

    def __init__(self) -> None:
        self.answers: list[object] = []

    def done(self) -> bool:
        return bool(self.answers)

    def set_result(self, result: object) -> None:
        self.answers.append(result)
        assert len(self.answers) == 1, f"answered twice: {self.answers}"

    set_exception = set_result

    @property
    def is_answered(self) -> bool:
        return bool(self.answers)

    @property
    def result(self) -> MoveResult:
        assert isinstance(self.answers[0], MoveResult), self.answers
        return self.answers[0]

    @property
    def error(self) -> RobotiqError:
        assert isinstance(self.answers[0], RobotiqError), self.answers
        return self.answers[0]


class Ended:
    """The callers whom requests have ended, until the write has left."""

    def __init__(self) -> None:
        self._callers: list[tuple[Waiter[Any], RobotiqError]] = []

    def add(self, callers: Iterable[Waiter[Any]], error: RobotiqError) -> None:
        self._callers += [(caller, error) for caller in callers]

    def answer(self) -> None:
        callers, self._callers = self._callers, []
        for caller, error in callers:
            fail([caller], error)


class Scan:
    """Steps the controller and the gripper through them."""

    def __init__(
        self,
        *,
        device_cycle: float = 0.005,
        speed: int = 128,
        after: Scan | None = None,
        goes_on: bool = False,
        lag: int = 0,
        spacing: float = 0.0,
        model: Model = THREE_FINGER,
        **options: Any,
    ) -> None:
        """``after`` is the program before this one: the gripper is its, and so is the time.

        With ``goes_on`` it is the session before this one, in the same program.
        ``lag`` is by how many polls gDT and gSTA come late, ``spacing`` the hand's ``write_spacing``; the
        options are the gripper's.
        """
        self.lag_s = lag * POLL_S
        self._late: deque[tuple[float, Registers]] = deque()
        self._time: list[float] = [100.0] if after is None else after._time
        self.gripper: SimulatedGripper
        if after is not None:
            self.gripper = after.gripper
        else:
            self.gripper = SimulatedGripper(
                lambda: self.now, device_cycle=device_cycle, spread=False, model=model, **options
            )
        self.transitions: list[tuple[State, State, Trigger]] = []
        self.machine = StateMachine()
        self.machine.begin(self._change)
        self._ended = Ended()
        self.controller: Controller = Controller(
            self.machine,
            first_request(speed, 64, model),
            spacing,
            after.controller.ledger if after is not None and goes_on else None,
            ended=self._ended.add,
        )
        self.written: list[Registers] = []
        self.forgets = 0
        """Number of the next writes that the gripper acknowledges and forgets."""
        self.polls = 0
        self._lively_until = 0.0
        self._news: tuple[object, ...] = ()
        """Images written and statuses shown up to the last poll that was passed."""

    @property
    def now(self) -> float:
        return self._time[0]

    @now.setter
    def now(self, value: float) -> None:
        self._time[0] = value

    def _change(self, source: State, target: State, trigger: Trigger) -> None:
        assert TABLE[source][trigger] is target, "each change of every story is one of the table"
        self.transitions.append((source, target, trigger))

    # -- the link --------------------------------------------------------------------------------------

    def status(self) -> RobotiqStatus:
        self.polls += 1
        now, registers = self.now, self.gripper.status_registers()
        if self.lag_s:
            self._late.append((now, registers))
            while len(self._late) > 1 and self._late[1][0] <= now - self.lag_s + ROUNDING_S:
                self._late.popleft()
            registers = with_object_status(registers, self._late[0][1])
        return RobotiqStatus(registers, now, self.polls, self.gripper.model)

    def see(self) -> None:
        self.controller.see(self.status(), self.now)

    def connect(self, *, activate: bool = True) -> None:
        self.controller.activates = activate
        self.see()
        while self.controller.evidence.is_undecided:
            self.now += POLL_S
            self.see()
        self.controller.activates = False

    def step(
        self, *, answer: bool = True, poll: float = POLL_S, arrives: float = 0.0, lost: float = 0.0
    ) -> None:
        """One cycle; without an answer the write arrives and the link goes down before it is known.

        ``arrives`` and ``lost`` are the seconds from the write to that.
        """
        self.now += poll
        self.see()
        self._write(answer=answer, arrives=arrives, lost=lost)
        self.answer_ended()

    def hurry(self) -> None:
        """Write what is urgent before the next read, as the poller does."""
        write = self.controller.next_write(self.now)
        if write is not None and write.is_urgent and not write.wait:
            self._write(answer=True)
            self.answer_ended()

    def answer_ended(self) -> None:
        self._ended.answer()

    def decide(self) -> Request | None:
        return self.controller.decide(self.now)

    def _write(self, *, answer: bool, arrives: float = 0.0, lost: float = 0.0) -> None:
        request = self.decide()
        if request is not None:
            self.written.append(request.registers)
            self.now += arrives
            if self.forgets:
                self.forgets -= 1
            else:
                self.gripper.write(0, request.registers)
            if answer:
                self.controller.acknowledged(self.now)
            else:
                self.now += lost - arrives
                self.controller.lost(None, self.now)

    def run(self, seconds: float) -> None:
        self._lively_until = self.now + LIVELY_S
        left = round(seconds / POLL_S)
        while left > 0:
            left -= self._pass(left)

    def until(self, condition: Callable[[], bool], seconds: float = 30.0, poll: float | None = None) -> float:
        """Step until something is true; returns how long it took."""
        began = self.now
        self._lively_until = began + LIVELY_S
        while not condition():
            assert self.now - began < seconds, f"not within {seconds} s: {self.controller.status!r}"
            if poll is None:
                self._pass(DULL_POLLS)
            else:
                self.step(poll=poll)
        return self.now - began

    def _pass(self, most: int) -> int:
        """Make the next poll, or the last of some if nothing happens; returns how many have passed."""
        polls = 1 if self.now < self._lively_until else min(most, DULL_POLLS)
        before = self._news
        self.step(poll=polls * POLL_S)
        status = self.latest
        # All that a status shows but for positions and currents.
        self._news = (len(self.written), status.registers[:2], status.echo)
        if self._news != before:
            self._lively_until = self.now + LIVELY_S
        return polls

    def blink(self, away: float = 0.05) -> None:
        """The link is lost and comes back."""
        self.controller.lost(None, self.now)
        self.come_back(away)

    def come_back(self, away: float) -> None:
        """The link is back after some seconds, or the hand comes then."""
        self.now += away
        self.connect(activate=False)

    # -- a caller --------------------------------------------------------------------------------------

    def start(self) -> None:
        self.connect()
        self.until(lambda: self.state is State.RUNNING_IDLE, poll=ACTIVATING_S)

    @property
    def state(self) -> State:
        return self.machine.state

    @property
    def latest(self) -> RobotiqStatus:
        assert self.controller.status is not None
        return self.controller.status

    def move(
        self, position: int, axes: Finger = Finger.ABC, speed: int | None = None, force: int | None = None
    ) -> tuple[Move, Outcome]:
        outcome = Outcome()
        move = Move(position, axes, self.now, outcome)
        self.controller.move(move, speed, force)
        self.answer_ended()
        return move, outcome

    def moved(self, position: int, axes: Finger = Finger.ABC, **options: int) -> MoveResult:
        """A move, waited for."""
        _, outcome = self.move(position, axes, **options)
        self.until(lambda: outcome.is_answered)
        return outcome.result

    def command(
        self,
        axes: Finger,
        position: int | None = None,
        speed: int | None = None,
        force: int | None = None,
    ) -> Outcome:
        outcome = Outcome()
        self.controller.command(changes(axes, position, speed, force), outcome)
        self.answer_ended()
        return outcome

    def hold(self, axes: Finger = Finger.ALL) -> Outcome:
        outcome = Outcome()
        self.controller.hold(axes, outcome)
        self.answer_ended()
        return outcome

    def halt(self) -> Outcome:
        outcome = Outcome()
        self.controller.halt(outcome)
        self.answer_ended()
        return outcome

    def halted(self) -> None:
        """A halt, waited for."""
        outcome = self.halt()
        self.until(lambda: outcome.is_answered)

    def stop(self, *, keep_grip: bool = False) -> None:
        self.controller.refuse_requests()
        self.answer_ended()
        self.controller.stop_fingers(StopLevel.KEEP if keep_grip else StopLevel.SHUTDOWN)
        self.until(lambda: not self.controller.is_busy, 1.0)

    # -- what has happened -----------------------------------------------------------------------------

    @property
    def last_image(self) -> Request:
        return Request.from_registers(self.written[-1], self.gripper.model)

    def travels(self) -> dict[Finger, float]:
        return {axis: self.gripper.travel(axis) for axis in self.gripper.model.axes}

    def positions(self) -> dict[Finger, int]:
        status = self.status()
        return {axis: status.position(axis) for axis in self.gripper.model.axes}


def started(device_cycle: float = 0.005, *, lag: int = 0) -> Scan:
    """A hand that has activated its gripper."""
    scan = Scan(device_cycle=device_cycle, lag=lag)
    scan.start()
    return scan
