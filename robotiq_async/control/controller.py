"""Decides what to write: takes in statuses and requests, and gives the image that is due.

No I/O, no clock and no event loop. The task that owns the link calls:

* :meth:`Controller.see` with each status that it has read;
* :meth:`Controller.decide` for the image to write now, if any, and then :meth:`Controller.acknowledged`:
  after the read of a cycle, and before it if the request is urgent, as a stop is;
* :meth:`Controller.lost` if the link goes down at any point.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from ..values.enums import NO_AXES, Finger, Severity, State, Trigger
from ..values.errors import (
    ConnectionLostError,
    GripperFaultError,
    MoveSupersededError,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
)
from ..values.model import THREE_FINGER, Model
from ..values.request import Request
from ..values.status import RobotiqStatus
from .gate import gate
from .grip_keeper import GripKeeper
from .motion import Move
from .open_requests import OpenRequests
from .passing_fault import PassingFault
from .requests.merging import at_rest, merged, stopped
from .requests.pending import Command
from .requests.shadow import NEVER, RequestShadow, Whose
from .sequences import Sequence, activation, automatic_release, reset, shutdown
from .state_machine import RUNNING, StateMachine
from .triggers import classify, is_activating
from .waiters import Waiter

_COMMANDED: Final = RUNNING | {State.FAULT}
"""The states in which the gripper follows requests, ours or another client's."""
WARNING_S: Final = 1.0
"""Seconds between two warnings about another client."""
_STOPPING: Final = frozenset({State.DO_RESET, State.WF_RESET, State.DO_SHUTDOWN})
"""The states whose writes end motion: these do not wait for write_spacing."""


class Controller:
    """State, requests and moves of one hand.

    Args:
        machine: the state of the hand, in DISCONNECTED.
        speed: what every axis gets until set otherwise, 0..255.
        force: what every axis gets until set otherwise, 0..255.
        closing_time: gives the seconds of a full closing at a speed; default timeouts of moves come from it.
        write_spacing: seconds from the acknowledgement of a write to the next one: a gripper may acknowledge
            one that comes sooner and forget it. A stop does not wait; it is repeated.
        model: of the gripper.

    Attributes:
        status: the newest status; None before the first.
        activates: whether a gripper that is found reset is activated.
        foreign_commands: how often another client was seen to command the gripper.
        passing_faults: how often 0x09 was shown in passing.
    """

    def __init__(
        self,
        machine: StateMachine,
        speed: int,
        force: int,
        closing_time: Callable[[int], float],
        write_spacing: float = 0.0,
        model: Model = THREE_FINGER,
    ) -> None:
        self.machine = machine
        self.status: RobotiqStatus | None = None
        self.activates = False
        self.foreign_commands = 0
        self.passing_faults = 0
        self._passing_fault = PassingFault(self._count_passing_fault)
        self._judged: RobotiqStatus | None = None
        """The newest status, with a brief 0x09 filtered out: decisions use this one."""
        self._warned = NEVER
        self._closing_time = closing_time
        self._shadow = RequestShadow(speed, force, model, log=machine.log)
        self._requests = OpenRequests(machine.log)
        self._step = 0
        """The number of the last write of a sequence: its next status must show the effect. 0 for none."""
        self._activating = False
        """Whether an activation of ours may be under way: stopping the hand takes it back."""
        self._write_spacing = write_spacing
        self._written_at = NEVER
        """When a write was last acknowledged."""
        self._early_stop: Request | None = None
        """A stop written sooner than write_spacing after another write. It is written again after the next
        status, even if that shows it: the gripper may forget it and go on with the write before."""
        self._hold_on_return = NO_AXES
        """The axes whose hold was not delivered before the link went down."""
        self._grip_keeper = GripKeeper(self._shadow, log=machine.log)
        self._keeps_grip = False
        """Whether the stop under way is to leave rGTO set."""

    # -- what is asked ---------------------------------------------------------------------------------

    def command(self, command: Command, waiter: Waiter[None] | None = None) -> None:
        """Add a command to the next write.

        Raises:
            RobotiqError: the hand takes no command now.
        """
        self.machine.fire(Trigger.ASK_COMMAND, self.status)
        self._requests.command(command, waiter)

    def move(self, move: Move, speed: int | None, force: int | None) -> float:
        """Add a move to the next write; return its default timeout in seconds.

        Raises:
            RobotiqError: the hand takes no command now.
        """
        self.command(Command(move.axes, move.position, speed, force))
        self._requests.moves.add(move)
        assert self.status is not None, "the hand takes commands, so a status has been read"
        written = {axis: asked.speed for axis, asked in self._shadow.base.by_axis}
        speeds = written | self._requests.pending.speeds
        return move.default_timeout(self.status, speeds, self._closing_time)

    def abandon(self, move: Move, *, unseen: bool = False) -> None:
        """The caller has given up on a move: hold those of its axes that still move.

        ``unseen`` if the call was cancelled: then the caller does not learn that the link went down, either.
        """
        if self._requests.moves.remove(move):
            self._requests.hold(move.axes, "a move took over and was given up")
        elif unseen and move.was_lost:
            self._hold_on_return |= move.axes
            self._hold_what_was_lost()

    def hold(self, axes: Finger, waiter: Waiter[None]) -> None:
        """Hold those axes that move, whichever client moves them. In a sequence there is nothing to do.

        Raises:
            RobotiqError: the gripper cannot be reached.
        """
        if self.machine.fire(Trigger.ASK_HOLD, self.status):
            self._requests.hold(axes, "hold() took over", waiter)
        else:
            waiter.set_result(None)

    def halt(self, waiter: Waiter[None]) -> None:
        """Clear rGTO, unless no axis can move. A sequence needs :meth:`reset`.

        Raises:
            RobotiqError: the hand cannot halt now.
        """
        if self.machine.fire(Trigger.ASK_HALT, self.status):
            self._requests.halt(waiter)
        else:
            waiter.set_result(None)

    def activate(self) -> None:
        """Begin an activation, unless the gripper is active or activating.

        Raises:
            GripperFaultError: a fault is reported, or the gripper has released automatically.
            InvalidStateError: a reset or a release is under way.
            ConnectionLostError: the link is down.
            NotStartedError: the hand is not started, or is being stopped.
        """
        self._begin_activation(Trigger.ASK_ACTIVATE)

    def reset(self, trigger: Trigger = Trigger.ASK_RESET) -> None:
        """Begin a reset, unless one is about to be sent.

        Args:
            trigger: ASK_HALT for a halt that ends a sequence.

        Raises:
            RobotiqError: not possible now.
        """
        self._begin_reset(trigger, MoveSupersededError(f"{trigger.value} took over"))

    def release(self) -> None:
        """Begin an automatic release.

        Raises:
            RobotiqError: not in FAULT; or the gripper is reset: raising rACT would activate it.
        """
        if self.machine.state is State.FAULT and self.status is not None and not self.status.activation_echo:
            raise NotActivatedError("the gripper is reset: there is nothing to release")
        self.machine.fire(Trigger.ASK_RELEASE, self.status)
        self._requests.fail(MoveSupersededError("atr() took over"))
        self._begin(automatic_release(self._at_rest))

    def drop_requests(self, error: RobotiqError) -> None:
        """Fail the requests that are not sent, except holds and halts."""
        self._requests.fail_but_stops(error)

    def stop(self) -> None:
        """Begin to stop the hand: refuse new requests, and fail those that are not sent."""
        self._grip_keeper.begin(self.machine.state, halts=self._requests.pending.halting is not None)
        if self._activating and not self._step:
            self._activating = False  # it was not sent, so it need not be taken back
        if not self._requests.pending.is_empty:
            self.machine.log.info("stopped: requests that were not sent are dropped")
        self.machine.fire(Trigger.ASK_STOP)
        self._requests.fail(NotStartedError("the hand was stopped"))
        self.machine.drop_sequence()

    def stopped(self) -> None:
        """The shutdown has ended or has run out of time."""
        self.machine.drop_sequence()
        self.machine.fire(Trigger.STOPPED)

    @property
    def has_undelivered_stop(self) -> bool:
        """Whether a halt, a hold or a reset waits for its acknowledgement."""
        resets = self.machine.state is State.DO_RESET
        waits = self._early_stop is not None or bool(self._hold_on_return)
        return resets or self._requests.has_undelivered_stop or waits

    def keep_no_grip(self, why: str) -> None:
        """Make the shutdown under way clear rGTO after all."""
        self._keeps_grip = False
        self._grip_keeper.doubt = why

    def shut_down(self, *, keep_grip: bool = False) -> None:
        """Begin to stop the fingers, if any may move.

        An activation that this hand began is taken back with rACT = 0: clearing rGTO would not stop it. With
        ``keep_grip`` rGTO stays set if every axis is known to rest.
        """
        self._keeps_grip = keep_grip
        if self._activating:
            self._begin(reset(self._at_rest))
        elif self.status is not None:
            stop = self._image_to_stop
            self._begin(self._grip_keeper.sequence(stop) if keep_grip else shutdown(stop))

    def _at_rest(self, status: RobotiqStatus) -> Request:
        return at_rest(self._shadow.base, status)

    def _image_to_stop(self, status: RobotiqStatus) -> Request | None:
        """The image that stops the fingers, whichever client moves them; None if there is nothing to stop."""
        if classify(status) is Trigger.SEEN_READY:
            self._shadow.follow(self._shadow.identify(), status)
        return stopped(self._shadow.base, status, settled=self._shadow.acts())

    # -- what is known ---------------------------------------------------------------------------------

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will because of a command that does not act yet."""
        if self.status is None or self.status.is_moving or self.machine.state not in RUNNING:
            return self.status is not None and self.status.is_moving
        return bool(self._requests.pending.positions) or self._shadow.may_begin_to_move

    # -- the cycle -------------------------------------------------------------------------------------

    def see(self, status: RobotiqStatus, asked: float | None = None) -> None:
        """Take in a status that was read after every acknowledgement so far.

        ``asked`` is when it was asked for, in monotonic seconds; None for the time of the reply.
        """
        asked = status.timestamp if asked is None else asked
        before, self.status = self.machine.state, status
        self._shadow.see(status, asked)
        self._judged, condition = status, classify(status)
        if condition is Trigger.SEEN_FAULT or self._passing_fault.reads:
            condition = self._look_past_fault(status, asked)
        if self.machine.sequence is not None:
            return  # the sequence takes it in decide()
        if before is State.DISCONNECTED and self.is_undecided:
            return  # the next status decides
        if before is State.DISCONNECTED and condition is Trigger.SEEN_RESET and self.activates:
            self._begin_activation(Trigger.ACTIVATES)
            return
        if self._requests.halting and (condition is Trigger.SEEN_RESET or is_activating(status)):
            self._take_back_activation()
            return
        self.machine.fire(condition)
        after = self.machine.state
        if after is not before and before in _COMMANDED and after not in RUNNING:
            self._leave(after, status)
        elif after in _COMMANDED:
            self._go_on(before, status)
        else:
            self._hold_on_return = NO_AXES
        # This runs at every poll, so it works out only what is waited for.
        if self._activating:
            self._see_activation(status)
        if self._requests.halting and self._early_stop is None:
            self._requests.see_halt(status, self._shadow.acts)
        if after in RUNNING:
            self._shadow.axes.see(status, self._shadow.now)
            if self._requests.moves:
                axes = self._shadow.axes
                self._requests.moves.see(status, self._shadow.acts, axes.resting, axes.limited)

    @property
    def is_undecided(self) -> bool:
        """Whether the first status on a new link shows 0x09, perhaps because of the silence before it."""
        return self._passing_fault.is_open and self.machine.state is State.DISCONNECTED

    @property
    def has_request(self) -> bool:
        """Whether there may be a request to write."""
        asked = self.machine.sequence is not None or not self._requests.pending.is_empty
        return asked or self._early_stop is not None

    @property
    def is_urgent(self) -> bool:
        """Whether to write a stop now, without waiting for a status that may never come."""
        if self.machine.sequence is None or self._judged is None:
            return self._requests.pending.halting is not None
        if self._step or self.machine.state not in (State.DO_RESET, State.DO_SHUTDOWN):
            return False
        if self.machine.state is State.DO_RESET:
            return True
        if self._keeps_grip and self._grip_keeper.rests(self._judged):
            return False  # the next status decides whether rGTO stays set
        return self._activating or self._judged.go_echo or not self._shadow.acts()

    def wait(self, now: float) -> float:
        """Seconds until the next write may leave; 0 for a stop that is not a repetition."""
        if self._stops and self._early_stop is None:
            return 0.0
        return max(0.0, self._written_at + self._write_spacing - now)

    @property
    def _stops(self) -> bool:
        """Whether the next write ends motion."""
        if self.machine.sequence is None:
            return self._requests.pending.halting is not None
        return self.machine.state in _STOPPING and not self._keeps_grip

    def decide(self, now: float) -> Request | None:
        """Return the image to write now, or None. It counts as sent from here on."""
        status, pending = self._judged, self._requests.pending
        if status is None:
            return None
        if self._early_stop is not None:
            return self._repeat_stop(self._early_stop, status, now)
        if self.machine.sequence is not None:
            return self._next_step(status, now)
        # Most cycles end here.
        if pending.is_empty or self.machine.state not in _COMMANDED or self.wait(now):
            return None
        shadow = self._shadow
        if self._passing_fault.is_open and pending.halting is None and not pending.holds_at_most:
            return None  # if the fault lasts, no motion is sent at all
        base = shadow.base
        # After a halt a motion waits until the halt acts: only then is it known where the fingers stopped.
        stopping = not base.go and status.go_echo and not shadow.acts()
        if pending.halting is None and (shadow.doubt is not None or (pending.positions and stopping)):
            return None  # only a halt does not wait
        image = gate(
            merged(
                base,
                pending,
                status,
                gripping=shadow.axes.grips.held(status, base),
                arrived=shadow.axes.resting,
                doubtful=shadow.axes.doubtful(status, shadow.now) if pending.hold else NO_AXES,
            ),
            status,
        )
        if pending.holds_at_most and image == base:
            # No axis moves. If an earlier write does not act yet, one may begin to: ask again then.
            if shadow.acts():
                self._requests.nothing_to_send()
                self.machine.delivered()
            return None
        sent = self._requests.take()
        self._note_early_stop(image, now, stops=sent.halting is not None)
        number = shadow.writing(image, sent.moved, now)
        if sent.positions:
            self._requests.moves.written(number)
        return image

    def _note_early_stop(self, image: Request, now: float, *, stops: bool) -> None:
        if stops and now - self._written_at < self._write_spacing:
            self._early_stop = image

    def _repeat_stop(self, stop: Request, status: RobotiqStatus, now: float) -> Request | None:
        if self.wait(now):
            return None
        self._early_stop, image = None, gate(stop, status)
        number = self._shadow.writing(image, NO_AXES, now)
        if self.machine.sequence is None:
            self._requests.halt_again()
        else:
            self._step = number
        return image

    def acknowledged(self, now: float) -> None:
        self._written_at = now
        number = self._shadow.acknowledged(now)
        self._requests.acknowledged(number)
        if number == self._step or (self.machine.sequence is None and self._requests.pending.is_empty):
            self.machine.delivered()

    def lost(self, why: RobotiqError | None = None) -> None:
        """The link is down: drop what was not acknowledged. No motion is sent again; holds are, on return."""
        self.machine.fire(Trigger.LINK_LOST)
        self._grip_keeper.doubt = "the link went down"
        error = ConnectionLostError(f"the link went down before this was done: {why}")
        error.__cause__ = why
        self._early_stop = None
        self._hold_on_return |= self._requests.lost(error)
        self.machine.drop_sequence()
        self._shadow.lost()

    # -- sequences -------------------------------------------------------------------------------------

    def _begin_reset(self, trigger: Trigger, error: RobotiqError) -> None:
        """Reset; ``error`` is what the callers get whose requests end with it."""
        if self.machine.fire(trigger, self.status):
            self._requests.fail(error)
            self._begin(reset(self._at_rest))

    def _begin_activation(self, trigger: Trigger) -> None:
        if self.machine.fire(trigger, self.status):
            self._activating = True
            self._begin(activation(self._at_rest))

    def _begin(self, sequence: Sequence) -> None:
        self.machine.begin(sequence)
        self._step, self._early_stop = 0, None
        self._hold_on_return = NO_AXES
        self._shadow.axes.grips.forget()

    def _next_step(self, status: RobotiqStatus, now: float) -> Request | None:
        """Advance the sequence under way; return the image that it wants written."""
        if self._step and not self._shadow.acts(self._step):
            return None
        if self.machine.state is State.DO_ACTIVATION and self._passing_fault.is_open:
            return None
        if self.wait(now):
            return None
        activates, releases = (self.machine.state is each for each in (State.DO_ACTIVATION, State.DO_ATR))
        image = self.machine.advance(status)
        if image is not None:
            image = gate(image, status, activates=activates, releases=releases)
            self._note_early_stop(image, now, stops=self._stops)
            self._step = self._shadow.writing(image, NO_AXES, now)
        elif self.machine.sequence is None:
            self._after_sequence(status)
        return image

    def _after_sequence(self, status: RobotiqStatus) -> None:
        if self._step:
            is_ours = self._shadow.restart(status)
        else:  # the sequence had nothing to do and has written nothing
            self._activating, whose = False, self._shadow.identify()
            is_ours = whose is not Whose.FOREIGN
            if is_ours:
                self._shadow.follow(whose, status)
        if self.machine.state in _COMMANDED and not is_ours:
            self._take_over(status)
        if self._activating:
            self._see_activation(status)

    def _take_back_activation(self) -> None:
        """Another client has reset the gripper just before a halt, whose rACT activates it then."""
        error = NotActivatedError("the gripper was reset when halt() came: an activation by it is taken back")
        self.machine.log.warning("%s", error)
        self._begin_reset(Trigger.ASK_RESET, error)

    def _see_activation(self, status: RobotiqStatus) -> None:
        condition = classify(status)
        self._activating = not (
            condition is Trigger.SEEN_READY
            or status.fault.severity is Severity.MAJOR
            or (condition is Trigger.SEEN_RESET and self._shadow.acts())
        )

    def _look_past_fault(self, status: RobotiqStatus, asked: float) -> Trigger:
        """The condition that a status shows, without 0x09 until that has lasted."""
        judged = self._passing_fault.see(status, asked)
        if self.machine.state is not State.FAULT:  # in FAULT 0x09 is no news, and counts at once
            self._judged = judged
        return classify(self._judged or status)

    def _count_passing_fault(self) -> None:
        self.passing_faults += 1
        if self.passing_faults == 1:
            self.machine.log.info(
                "the gripper showed fault 0x09 for a moment, as some do after a second without a poll: "
                "ignored, and from here on only counted"
            )

    # -- other clients, and a link that is back --------------------------------------------------------

    def _go_on(self, before: State, status: RobotiqStatus) -> None:
        """The gripper follows requests: find out whose."""
        if before is State.DISCONNECTED:
            self._return(status)
        elif before not in _COMMANDED:
            self._shadow.follow(Whose.FOREIGN, status)
        elif (whose := self._shadow.identify()) is Whose.FOREIGN:
            self._take_over(status)
        elif whose is not Whose.OURS:
            self._shadow.follow(whose, status)

    def _return(self, status: RobotiqStatus) -> None:
        """The link is back: go on from the image that the gripper shows, or adopt it."""
        self._shadow.returned(status)
        if self.machine.state is State.FAULT and status.activation_echo:
            # As when a fault begins: no motion may resume when it clears.
            self._hold_on_return = Finger.ALL
        self._hold_what_was_lost()

    def _hold_what_was_lost(self) -> None:
        """Hold the axes whose hold was not delivered, unless another client moves them now."""
        if self.machine.state not in _COMMANDED:
            return  # the link is still down
        axes, self._hold_on_return = self._hold_on_return & self._shadow.ours, NO_AXES
        if axes:
            self._requests.hold(axes, "the fingers are held")

    def _take_over(self, status: RobotiqStatus) -> None:
        """Another client commands the gripper: adopt its requests, or our next write would undo them."""
        self.foreign_commands += 1
        limited = self._shadow.axes.limited
        if status.timestamp - self._warned >= WARNING_S:
            self._warned = status.timestamp
            self.machine.log.warning("another client commands the gripper: %r", status)
        self._shadow.follow(Whose.FOREIGN, status)
        self._requests.pending.hold &= self._shadow.ours | self._requests.pending.asked_to_hold
        self._requests.moves.fail(
            MoveSupersededError("another client commands the gripper"),
            lambda move: move.write is not None and not move.is_under(status, limited),
        )

    def _leave(self, after: State, status: RobotiqStatus) -> None:
        """The gripper reports a fault or is no longer active: no earlier request may resume."""
        if after not in (State.FAULT, State.ATR_DONE):
            self._requests.fail(NotActivatedError("the gripper lost its activation"))
        elif after is State.ATR_DONE:
            self._requests.fail(GripperFaultError(status.fault))
        else:
            self._requests.fail_but_stops(GripperFaultError(status.fault))
        if after is State.FAULT and status.activation_echo:
            # Hold every axis of ours: a command sent just before may not act yet, and its motion would begin
            # when the fault clears. Which axes need it is decided when the hold is written.
            self._requests.hold(self._shadow.ours, "the fingers are held")
