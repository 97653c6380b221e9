"""Decides about writes: takes in statuses and requests, and gives the image that is due.

No I/O, no clock and no event loop. The task that owns the link calls see() with each status that it has read;
next_write() to learn whether there is something to write; decide() for the image, in the turn in which the
link writes, and acknowledged(); and lost() if the link goes down at any point.

A request may end the waits of others: a halt ends all moves, a command the moves of its axes. Their callers
are handed over and not answered: their next steps may hold up the loop, and the write goes first.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any, Final, NamedTuple

from ..values.enums import NO_AXES, Fault, Finger, Initialization, State, StopLevel, Trigger
from ..values.errors import (
    ConnectionLostError,
    GripperFaultError,
    MoveSupersededError,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
)
from ..values.request import Request
from ..values.states import RUNNING, SEEN
from ..values.status import RobotiqStatus
from .entry import Entry
from .evidence import FOLLOWS, Evidence, classify, is_interrupted
from .gate import gate, merged
from .ledger import NEVER, Ledger
from .pending import NONE_PENDING, OpenRequests, Pending, changes
from .procedures import Procedure, activation, automatic_release, reset_and_activation
from .state_machine import StateMachine
from .stops import Duty, Ended, Keeping, Stop
from .waiters import AnswerCallers, Move, Waiter, fail

WARNING_S: Final = 1.0
"""Seconds between two warnings about another client."""
_OFF: Final = frozenset({State.DO_SHUTDOWN, State.SHUTDOWN})
_CALLS: Final = frozenset({Trigger.ASK_COMMAND, Trigger.ASK_HOLD, Trigger.ASK_HALT})


class NextWrite(NamedTuple):
    """The next write, without its image: that is made in the turn in which it leaves."""

    wait: float  # seconds until it may leave, because of write_spacing
    is_urgent: bool  # a stop, which does not wait for a status that may never come
    is_command: bool  # a command or a hold, and no step of something longer
    is_stop: bool  # it stops motion, as urgent ones and holds do: no caller hears of it before it leaves


class Controller:
    """State, requests and moves of one hand.

    The ``first`` image has the speed and the force of each axis until set otherwise; ``machine`` is in
    DISCONNECTED. The ``ledger`` is for the next session of the gripper, too: its writes may still act.
    """

    def __init__(
        self,
        machine: StateMachine,
        first: Request,
        write_spacing: float = 0.0,
        before: Ledger | None = None,
        ended: AnswerCallers = fail,
    ) -> None:
        """``ended`` gets the callers whom a request has ended, and the error for each."""
        self.machine: Final = machine
        self.status: RobotiqStatus | None = None  # the newest; None before the first
        self.activates: bool = False  # whether a gripper that is found reset is activated
        self.foreign_commands: int = 0  # how often another client was seen to command the gripper
        self.ledger: Final = Ledger(first, machine.log, before)
        # Seconds from sending a write to the next one. A stop does not wait for them; it is repeated.
        self._spacing: Final = write_spacing
        self._ended: Final = ended
        self.evidence: Final = Evidence(machine.log)
        self._requests: Final = OpenRequests(machine.log, ended)
        self._duty: Stop | Procedure | None = None  # without one the pending changes are written
        self._owes_reset = False  # a stop was lost with the link while something drove the fingers
        self._why_no_grip = ""  # why a hand that is being stopped must not leave rGTO set
        self._warned = NEVER  # when another client was warned of
        self._free_at = NEVER  # when the spacing after the last write is over

    def allow_activation(self, allowed: bool) -> None:
        """Whether a gripper that is found reset is activated, from here on."""
        self.activates = allowed

    # -- requests --------------------------------------------------------------------------------------
    # Each call raises the error by which the state machine refuses it. A refusal changes nothing.

    def command(self, command: Pending, waiter: Waiter[None] | None = None) -> None:
        presses = bool(command.positions or command.forces)
        self.machine.ask(Trigger.ASK_COMMAND, self.status, presses=presses)
        self._requests.command(command, waiter)
        self._update_state(Trigger.ASK_COMMAND)

    def move(self, move: Move, speed: int | None, force: int | None) -> None:
        """Add a move as a command."""
        self.command(changes(move.axes, move.position, speed, force))
        self._requests.add(move)

    def abandon(self, move: Move, *, unseen: bool = False) -> None:
        """The caller of a move has left: if it has given up, hold the axes of the move that still move."""
        # ``unseen`` if it was cancelled: then it does not see, either, that the move has failed already.
        requests = self._requests
        is_open, left = requests.leave(move)
        if is_open or unseen:
            requests.hold(left, "a move was given up")
            # Its other axes follow it until the request that took them over is written, which may be lost.
            requests.merge_hold(move.axes & requests.pending.moved)
        if unseen and not is_open and self.evidence.condition is not None:
            # Axes that another client moves by now are left to it. On a new link that is found out first.
            requests.hold_only(self.ledger.ours)

    def hold(self, axes: Finger, waiter: Waiter[None]) -> None:
        """Hold axes that move, also for another client. It ends no activation and no release."""
        is_due = self.machine.ask(Trigger.ASK_HOLD, self.status)
        if self.is_driven:
            self.machine.log.warning("a hold ends no activation and no release: halt() does, by a reset")
        if is_due:
            self._requests.hold(axes, "a hold took over", waiter)
            self._update_state(Trigger.ASK_HOLD)
        else:
            waiter.set_result(None)

    def halt(self, waiter: Waiter[None]) -> None:
        """Clear rGTO, unless no axis can move. It ends no procedure: :meth:`reset` does."""
        if not self.machine.ask(Trigger.ASK_HALT, self.status):
            waiter.set_result(None)
            return
        self._requests.halt(waiter)
        duty = self._duty
        if duty is None or not duty.is_halt or duty.is_delivered:  # a new halt is sent again
            self._duty = Stop(StopLevel.HALT)
        self._update_state(Trigger.ASK_HALT)

    def activate(self) -> None:
        """Begin an activation, unless the gripper is active or activates already."""
        if self.machine.ask(Trigger.ASK_ACTIVATE, self.status):
            self._begin(Trigger.ASK_ACTIVATE)

    def reset(self, trigger: Trigger = Trigger.ASK_RESET) -> None:
        """Begin a reset, unless a reset is about to be sent; ASK_HALT or HALT_RESETS if a halt needs it."""
        if self.machine.ask(trigger, self.status):
            who = "reset" if trigger is Trigger.ASK_RESET else "halt"
            self._begin_reset(trigger, MoveSupersededError(f"a {who} took over"))

    def end_inhibited(self) -> None:
        """End the requests for motion, which is refused now. A halt comes next, if the link is up."""
        ended = self.machine.taken_over(MoveSupersededError("a halt took over"))
        self._ended(self._requests.drop(holds=False), ended)
        if self.machine.state is State.DISCONNECTED:
            self._requests.merge_hold(Finger.ALL, "motion was inhibited while the link was down")

    def release(self) -> None:
        """Begin an automatic release. Of a gripper that is reset it would raise rACT and activate it."""
        if self.machine.state is State.FAULT and self.status is not None and not self.status.activation_echo:
            raise NotActivatedError("the gripper is reset: there is nothing to release")
        self.machine.ask(Trigger.ASK_RELEASE, self.status)
        self._ended(self._drop_all(), MoveSupersededError("a release took over"))
        self._begin(Trigger.ASK_RELEASE)

    def drop_requests(self, error: RobotiqError) -> None:
        """End every command and every move, sent or not. Halts, and holds with a caller, remain."""
        self._ended(self._requests.drop(holds=False), error)
        self._update_state(Trigger.DELIVERED)

    def refuse_requests(self) -> None:
        """The hand is to stop: refuse requests from here on, and end all that are open, sent or not."""
        state, duty = self.machine.state, self._duty
        halts = duty is not None and duty.is_halt and not duty.writes
        was_elsewhere = "" if state in RUNNING else f"the hand was in {state.name}"
        self._why_no_grip = "halt() was asked for" if halts else was_elsewhere
        if self._requests.pending is not NONE_PENDING or halts:
            self.machine.log.info("stopped: requests that were not sent are dropped")
        if self.machine.ask(Trigger.ASK_STOP):
            self.machine.show(State.DO_SHUTDOWN, Trigger.ASK_STOP)
        self._ended(self._drop_all(), NotStartedError("the hand was stopped"))

    def close(self) -> None:
        """The hand has stopped, or the time for that is over."""
        self._duty = None
        if self.machine.ask(Trigger.STOPPED):
            self.machine.show(State.SHUTDOWN, Trigger.STOPPED)

    def keep_no_grip(self) -> None:
        """Turn a stop that has begun to keep a grip into a stop that clears rGTO."""
        if isinstance(self._duty, Keeping):
            self._duty = Stop(StopLevel.SHUTDOWN)

    def stop_fingers(self, level: StopLevel = StopLevel.SHUTDOWN) -> None:
        """Begin to stop the fingers, if any may move: by KEEP or SHUTDOWN, in our sequence by RESET."""
        status = self.evidence.status
        if self.ledger.begun is not None:
            self._duty = Stop(StopLevel.RESET)
        elif level is StopLevel.KEEP and status is not None:
            keeping = Keeping(status, self._why_no_grip, self.machine.log)
            self._duty = keeping.see(self.ledger, status)
        else:
            self._duty = Stop(StopLevel.SHUTDOWN)

    # -- their consequences ----------------------------------------------------------------------------

    def _begin(self, trigger: Trigger) -> None:
        is_stranded = self.evidence.condition is Trigger.SEEN_STRANDED
        activates = reset_and_activation if is_stranded else activation
        begin = automatic_release if trigger is Trigger.ASK_RELEASE else activates
        self._duty = Procedure(self.ledger, begin)
        self._update_state(trigger)

    def _begin_reset(self, trigger: Trigger, error: RobotiqError) -> None:
        """Reset; ``error`` is for the callers whose requests it ends."""
        self._ended(self._drop_all(), error)
        self._duty = Stop(StopLevel.RESET)
        self._update_state(trigger)

    def _drop_all(self) -> list[Waiter[Any]]:
        """Drop all requests and the duty, and return the callers. A write may be on the line."""
        self._duty = None
        return self._requests.drop(holds=True)

    # -- knowledge -------------------------------------------------------------------------------------

    @property
    def speeds(self) -> dict[Finger, int]:
        """The speed of each axis, as far as it is known, once the pending changes are written."""
        base = {axis: request.speed for axis, request in self.ledger.base.by_axis}
        return {**base, **self._requests.pending.speeds}

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will move by a change that is not written, or does not act yet."""
        if self.status is None:
            return False
        if self.status.is_moving or self.is_driven:
            return True
        if self.machine.state not in RUNNING:
            return self.ledger.may_set_go
        return bool(self._requests.pending.positions) or self.ledger.may_begin_to_move

    @property
    def is_driven(self) -> bool:
        """Whether an activation or a release moves the fingers, or may begin: only rACT = 0 ends these."""
        if (status := self.status) is None:
            return False
        is_busy = self.evidence.condition is Trigger.SEEN_BUSY or isinstance(self._duty, Procedure)
        shows = is_busy or status.fault is Fault.AUTOMATIC_RELEASE or is_interrupted(status)
        return shows or self.ledger.may_drive(status)

    @property
    def is_busy(self) -> bool:
        """Whether a procedure, a reset or the end of the hand has begun and not ended."""
        return self._duty is not None and not self._duty.is_halt

    @property
    def has_request(self) -> bool:
        return self._duty is not None or self._requests.pending is not NONE_PENDING

    @property
    def is_off(self) -> bool:
        """Whether the hand is to stop, or has stopped."""
        return self.machine.state in _OFF

    @property
    def has_open_stop(self) -> bool:
        """Whether a halt or a reset is not over, or a hold waits for its acknowledgement."""
        return isinstance(self._duty, Stop) or self._requests.has_undelivered_hold

    @property
    def may_have_to_stop(self) -> bool:
        """Whether a status was read, or the last session has left something that may still act."""
        ledger = self.ledger
        return self.status is not None or ledger.begun is not None or not ledger.is_settled

    def _view(self) -> State:
        """The state of the duty; if the duty has none, the state that the gripper shows."""
        duty, condition, state = self._duty, self.evidence.condition, self.machine.state
        if state in _OFF:
            return state
        if condition is None:
            return State.DISCONNECTED
        if duty is not None and (made := duty.state) is not None:
            return made
        if condition is not Trigger.SEEN_READY:
            return SEEN[condition]
        is_asked = (duty is not None and not duty.is_delivered) or self._requests.has_caller
        return State.RUNNING_CC if is_asked else State.RUNNING_IDLE

    def _update_state(self, trigger: Trigger) -> None:
        state = self._view()
        if state is State.RUNNING_CC and trigger not in _CALLS and self.machine.state is not state:
            state = State.RUNNING_IDLE  # a call begins it, and not a fault that clears while a hold waits
        self.machine.show(state, trigger)

    # -- statuses --------------------------------------------------------------------------------------

    def see(self, status: RobotiqStatus, asked: float) -> None:
        """Take in a status that was read after every acknowledgement so far, and requested at ``asked``."""
        ledger, duty, before = self.ledger, self._duty, self.evidence.condition
        self.status = status
        condition = self.evidence.update(status, asked)
        ledger.update(status, asked, is_ready=condition is before is Trigger.SEEN_READY)
        # This runs at every poll, so it works out only results that somebody waits for.
        if duty is not None:
            if isinstance(duty, Stop):
                self._advance(duty)
            if not duty.is_halt or self.is_busy:
                return  # a status counts for the duty alone
        if condition is None:
            return
        if condition is not before or ledger.match is None:
            if self.is_off:
                return
            self._note_news(before, condition, status)
            if condition is not before:
                self._note_condition(before, condition, status)
            if self.is_busy:
                return
            if condition is Trigger.SEEN_READY:
                ledger.update_rest(status)
        if condition is Trigger.SEEN_READY:
            if self._requests.moves:
                self._requests.end_arrived(status, ledger)
        elif condition is Trigger.SEEN_BUSY and ledger.sees_stray(status):
            self._take_back("the gripper was reset as it was commanded: its activation is taken back")

    def _note_news(self, before: Trigger | None, condition: Trigger, status: RobotiqStatus) -> None:
        """A new condition, or an image that no entry explains: whose image acts."""
        ledger, requests = self.ledger, self._requests
        # It followed requests before (None: the link was down), it does now, an entry explains its image.
        match before and before in FOLLOWS, condition in FOLLOWS, ledger.match is not None:
            case None, _, _:  # continue from our image if the gripper shows it
                if ledger.match is None or not ledger.match.is_ours:
                    ledger.adopt(status)
                requests.hold_only(ledger.ours)
            case False, True, _:
                # Others have reset and activated it, even if its image is equal to ours [follows].
                ledger.adopt(status, is_found=True)
            case True, True, False:
                self._adopt_other_client(status)  # before a fault's hold, which would undo its request
            case _, False, False:
                ledger.adopt(status)  # after a reset or a power cycle no image from before acts [follows]

    def _note_condition(self, before: Trigger | None, condition: Trigger, status: RobotiqStatus) -> None:
        """End and hold as a new condition demands; on a new link begin a due activation or reset."""
        requests, is_found, is_inhibited = self._requests, before is None, self.machine.inhibited is not None
        fault, lost = GripperFaultError(status.fault), NotActivatedError("the gripper lost its activation")
        if before in FOLLOWS and condition not in FOLLOWS:
            fail(self._drop_all(), fault if condition is Trigger.SEEN_RELEASED else lost)
        elif before in FOLLOWS and condition is Trigger.SEEN_FAULT:
            fail(requests.drop(holds=False), fault)
        if condition is Trigger.SEEN_FAULT and status.activation_echo:
            # When it clears [manual 2012, 4.7: if it is minor], no motion may resume, and none begin that was
            # sent just before and does not act yet. Which axes need it is decided when it is written.
            requests.merge_hold(self.ledger.ours, f"the gripper reports {status.fault.description}")
        elif condition not in FOLLOWS:
            requests.hold_only(NO_AXES)
        is_reset = condition in (Trigger.SEEN_RESET, Trigger.SEEN_STRANDED)
        if is_found and is_reset and self.activates and not is_inhibited:
            self._begin(Trigger.ACTIVATES)
            return
        self._update_state(condition)
        # A hold ends no sequence. A reset in a change of mode would drop a part.
        owes, self._owes_reset = self._owes_reset or is_inhibited, False
        changes_mode = status.initialization is Initialization.CHANGING_MODE
        if is_found and owes and self.is_driven and not changes_mode:
            why = "motion is inhibited" if is_inhibited else "a stop was lost with the link"
            self._take_back(f"{why}: an activation or a release that continues is reset")

    def _advance(self, stop: Stop) -> None:
        ledger, judged = self.ledger, self.evidence.status
        assert judged is not None
        if stop.has_activated(ledger, judged):
            self._take_back("the gripper was reset as it was stopped: its activation is taken back")
            return
        self._duty = stop.see(ledger, judged)
        if stop.is_halt:
            self._requests.answer_halts(ledger, judged, is_over=self._duty is None)
        elif self._duty is None and stop.level is not StopLevel.KEEP:
            self._finish(stop, judged)

    def _take_back(self, why: str) -> None:
        self.machine.log.warning("%s", why)
        self._begin_reset(Trigger.ASK_RESET, NotActivatedError(why))

    def _adopt_other_client(self, status: RobotiqStatus) -> None:
        """Another client commands the gripper: adopt its requests, or our next write would undo them."""
        ledger = self.ledger
        self.foreign_commands += 1
        if status.timestamp - self._warned >= WARNING_S:
            self._warned = status.timestamp
            self.machine.log.warning("another client commands the gripper: %r", status)
        ledger.limits.note_other_client(ledger.now.time)
        ledger.adopt(status)
        self._requests.hold_only(ledger.ours)
        self._requests.fail_replaced(status, ledger.limits.limited)

    def _finish(self, duty: Duty, status: RobotiqStatus) -> None:
        """A procedure, a reset or a shutdown is over: the condition counts again."""
        if duty.writes:
            is_known = self.ledger.restart(status)
        else:  # it had nothing to do; WF_ shows for a moment, as DO_ leads nowhere else in the table
            is_known = self.ledger.match is not None
            duty.written(self.ledger.shown)
            self._update_state(Trigger.DELIVERED)
        self._duty = None
        # On a new link a hand that ends stops the fingers before the condition is decided.
        condition = self.evidence.condition or classify(status)
        self._update_state(condition)
        if condition in FOLLOWS and not is_known and not self.is_off:
            self._adopt_other_client(status)

    # -- writes ----------------------------------------------------------------------------------------

    @property
    def in_flight(self) -> Entry | None:
        """The entry that is on the line: decided on, and neither acknowledged nor lost."""
        # One is written at a time, and no status is taken in meanwhile: only the last can be on the line.
        last = self.ledger.last
        return last if last.is_on_the_line else None

    def next_write(self, now: float) -> NextWrite | None:
        """The next write; None if nothing is due. It changes nothing, and makes no image."""
        duty, status, pending = self._duty, self.evidence.status, self._requests.pending
        if duty is None and pending is NONE_PENDING:
            return None  # most cycles end here
        urgent = isinstance(duty, Stop) and status is not None and duty.is_urgent(self.ledger, status)
        return NextWrite(self._wait(now), urgent, duty is None, urgent or bool(pending.hold))

    def _wait(self, now: float) -> float:
        duty = self._duty
        is_free = isinstance(duty, Stop) and duty.level is not StopLevel.KEEP and not duty.writes
        return 0.0 if is_free or now >= self._free_at else self._free_at - now

    def decide(self, now: float) -> Request | None:
        """Return the image to write now, or None. It counts as sent from here on."""
        status, duty = self.evidence.status, self._duty
        if status is None or not self.has_request or self._wait(now):
            return None  # most cycles end here
        return self._next_changes(status, now) if duty is None else self._next_of(duty, status, now)

    def _next_of(self, duty: Stop | Procedure, status: RobotiqStatus, now: float) -> Request | None:
        if duty.activates and not duty.writes and self.evidence.passing.is_open:
            return None  # if the fault lasts, no activation is begun
        image = duty.next_image(self.ledger, status)
        if isinstance(image, Ended):
            if image.why:
                self.machine.log.warning("%s", image.why)
            self._finish(duty, status)
        elif image is not None:
            # A halt also stops the axes to be held, so the callers of hold() have their answer with it.
            left = self._requests.pending
            left = replace(left, hold=NO_AXES) if duty.is_halt else left
            return self._send(image, status, now, left, duty)
        return None

    def _next_changes(self, status: RobotiqStatus, now: float) -> Request | None:
        ledger, pending = self.ledger, self._requests.pending
        if self.evidence.condition not in FOLLOWS or not ledger.is_certain:
            return None
        if self.evidence.passing.is_open and pending.has_changes:
            return None  # if the fault lasts, no motion is sent at all
        base = ledger.base
        gripping = ledger.gripping(status) if pending.positions and not base.go else NO_AXES
        held, left = {}, NONE_PENDING
        if pending.hold:
            pending = self._requests.begin_hold(now)
            held = ledger.held(pending.hold, status, now - ledger.now.time)
            # An axis that may press on its part is not held before that is known.
            left = pending.held_later(ledger.may_press(status, pending.hold_began))
        image = merged(base, pending, status, gripping=gripping, held=held)
        if not pending.has_changes and gate(image, status, may_reset=ledger.may_reset) == base:
            # No axis moves, so there is nothing to write, and the image of the gripper answers the callers.
            # If an earlier write does not act yet, an axis may begin to move: decide again then.
            if ledger.is_settled:
                self._requests.sending(ledger.last, left)
                self._requests.acknowledged()
                self._update_state(Trigger.DELIVERED)
            return None
        return self._send(image, status, now, left)

    def _send(
        self, image: Request, status: RobotiqStatus, now: float, left: Pending, duty: Duty | None = None
    ) -> Request:
        """Put an image through the gate and into the ledger; decide() returns it to be sent."""
        # ``left`` are the pending changes that the image leaves out.
        activates, releases = (False, False) if duty is None else (duty.activates, duty.releases)
        may_reset = self.ledger.may_reset
        image = gate(image, status, may_reset=may_reset, activates=activates, releases=releases)
        moved = NO_AXES if left.positions else self._requests.pending.moved
        is_early = now < self._free_at
        entry = self.ledger.write(image, moved, now, begins=activates or releases, is_early=is_early)
        self._requests.sending(entry, left)
        if duty is not None:
            duty.written(entry)
        self._free_at = now + self._spacing
        return image

    def note_repeat(self, now: float) -> None:
        """The link has written the last image again: the next write keeps its distance from that, too."""
        self._free_at = now + self._spacing

    def acknowledged(self, now: float) -> None:
        self.ledger.acknowledge(now)
        self._requests.acknowledged()
        self._update_state(Trigger.DELIVERED)

    def lost(self, why: RobotiqError | None = None, now: float = NEVER) -> None:
        """The link is down: fail every open call. No motion is sent again; holds are, on return."""
        self._why_no_grip = "the link went down"
        error = ConnectionLostError(f"the link went down before this was done: {why}")
        error.__cause__ = why
        duty, self._duty = self._duty, None
        if isinstance(duty, Stop) and duty.level in (StopLevel.HALT, StopLevel.RESET):
            self._requests.merge_hold(Finger.ALL, "a stop was lost with the link: once it is back")
            self._owes_reset = self.is_driven
        self._requests.lost(error, self.ledger.ahead)
        self.evidence.lost()
        self.ledger.lost(now)
        self._update_state(Trigger.LINK_LOST)
