"""The hand without its link: decides what to write and learns from what is read.

No I/O, no clock and no event loop: whoever owns the link calls, once per cycle and in this order,

* :meth:`Core.take_request` for the image to write, if there is one, then :meth:`Core.acknowledged`;
* :meth:`Core.see` with the status read after that;
* :meth:`Core.lost` when the link went down at any point of it.

Everything a caller waits for is a callback, told exactly once.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from typing import Final

from ..calibration.closing_time import closing_time
from ..enums import AXES, Finger, Severity, State
from ..errors import (
    ConnectionLostError,
    GripperFaultError,
    MoveSupersededError,
    NotActivatedError,
    NotStartedError,
    RobotiqError,
)
from ..log import log
from ..wire.request import Request
from ..wire.status import RobotiqStatus
from .merging import compose
from .motion import Move, default_timeout
from .pending import Delivery, Desk, Failure, tell
from .sequences import (
    Procedure,
    activation,
    automatic_release,
    reset,
    shutdown,
)
from .shadow import NOBODY, Ledger
from .state_machine import RUNNING, Machine, Trigger, look, refusal

FOREIGN_WARNING_S: Final = 1.0
"""At most one warning about another client in this time."""
_COMMANDED: Final = RUNNING | {State.FAULT}
"""The states in which the gripper follows requests, ours or another client's."""


class Core:
    """State, requests and moves of one hand."""

    def __init__(
        self,
        machine: Machine,
        speed: int,
        force: int,
        closing_time: Callable[[int], float] = closing_time,
    ) -> None:
        """Start without a status.

        Args:
            machine: the state of the hand, in DISCONNECTED.
            speed: what every axis gets until set otherwise, 0..255.
            force: what every axis gets until set otherwise, 0..255.
            closing_time: seconds of a full closing at a speed; default time-outs of moves come from it.
        """
        self.machine = machine
        self._closing_time = closing_time
        self.status: RobotiqStatus | None = None
        self.foreign_commands = 0
        self._ledger = Ledger(speed, force)
        self._procedure: Procedure | None = None
        self._step: Request | None = None
        self._may_begin: Callable[[RobotiqStatus], bool] = lambda _: True
        self._step_number = 0
        """The write that carried the last step: a procedure sees only what came of it."""
        self._activating = False
        """Whether an activation of ours may still be under way: to be taken back if the hand is stopped."""
        self._hold_on_return = NOBODY
        """Axes whose hold was not delivered before the link went down."""
        self._warned = -math.inf
        self._desk = Desk()
        self._sent: Desk | None = None
        """What is on the line: sent, and not acknowledged yet."""
        self._halting: list[tuple[int, Delivery]] = []
        self._moves: list[tuple[Move, int]] = []
        """Live moves, each with the number of the write that carried it (-1: not sent yet)."""

    # -- what is asked ---------------------------------------------------------------------------------

    def command(
        self,
        axes: Finger,
        position: int | None,
        speed: int | None,
        force: int | None,
        delivery: Delivery | None = None,
    ) -> None:
        """Ask axes for a position, a speed, a force; goes out with the next write.

        Raises:
            RobotiqError: the hand takes no command now.
        """
        self.refuse_unless_running(Trigger.ASK_COMMAND)
        self.machine.happen(Trigger.ASK_COMMAND)
        if position is not None:
            self._end_moves(
                lambda: MoveSupersededError(f"another command moves {axes}"),
                lambda move: bool(move.axes & axes),
            )
        self._desk.put(axes, position, speed, force, delivery)

    def move(self, move: Move, speed: int | None, force: int | None) -> None:
        """Ask for a move; its end is told to the move.

        Raises:
            RobotiqError: the hand takes no command now.
        """
        self.command(move.axes, move.position, speed, force)
        self._moves.append((move, -1))

    def abandon(self, move: Move, *, unseen: bool = False) -> None:
        """Nobody waits for this move any more: hold those of its axes that still move.

        Args:
            move: the move.
            unseen: it was cancelled: if it has ended meanwhile, nobody knows of that.
        """
        if all(each is not move for each, _ in self._moves):
            if unseen and move.was_lost:
                self._hold_on_return |= move.axes
                self._hold_what_was_lost()
            return
        self._moves = [(each, number) for each, number in self._moves if each is not move]
        self._desk.put_hold(move.axes, lambda: MoveSupersededError("a move took over and was given up"))
        self.machine.happen(Trigger.ASK_COMMAND)

    def halt(self, delivery: Delivery) -> None:
        """Clear rGTO; where nothing moves, there is nothing to do. A sequence is ended by :meth:`reset`.

        Raises:
            RobotiqError: the hand cannot halt now.
        """
        if self.machine.state in (State.RESET, State.ATR_DONE):
            delivery(None)
            return
        self.refuse_unless_running(Trigger.ASK_HALT)
        self.machine.happen(Trigger.ASK_HALT)
        superseded: Failure = lambda: MoveSupersededError("halt() stopped the fingers")  # noqa: E731
        self._end_moves(superseded)
        self._desk.put_halt(delivery, superseded)

    def activate(self) -> None:
        """Begin an activation.

        Raises:
            InvalidStateError: not in RESET.
        """
        self.machine.happen(Trigger.ASK_ACTIVATE)
        self._activating = True
        self._begin(activation(self._at_rest()), lambda status: look(status) is Trigger.SEEN_RESET)

    def reset(self, trigger: Trigger = Trigger.ASK_RESET) -> None:
        """Begin a reset; one that is about to be sent already will do.

        Args:
            trigger: ASK_HALT for a halt that ends a sequence.

        Raises:
            InvalidStateError: not in a state that can be reset.
        """
        is_about_to = self.machine.state is State.DO_RESET
        self.machine.happen(trigger)
        if is_about_to:
            return
        self._drop_all(lambda: MoveSupersededError(f"{trigger.value} took over"))
        self._begin(reset(self._at_rest()))

    def release(self) -> None:
        """Begin an automatic release.

        Raises:
            InvalidStateError: not in FAULT.
            NotActivatedError: the gripper is reset; raising rACT for the release would activate it.
        """
        if self.machine.state is State.FAULT and self.status is not None and not self.status.activation_echo:
            raise NotActivatedError("the gripper is reset: there is nothing to release")
        self.machine.happen(Trigger.ASK_RELEASE)
        self._drop_all(lambda: MoveSupersededError("atr() took over"))
        # Raised rACT would activate a gripper that has been reset meanwhile.
        self._begin(automatic_release(self._at_rest()), lambda status: status.activation_echo)

    def stop(self) -> None:
        """The hand is being stopped: nothing more is taken, and whoever waits is told."""
        self.machine.happen(Trigger.ASK_STOP)
        self._drop_all(lambda: NotStartedError("the hand was stopped"))
        self._sent = self._procedure = self._step = None

    def shut_down(self) -> None:
        """Begin to stop the fingers, if there is anything to stop.

        An activation that this hand began is taken back (rACT = 0): clearing rGTO would not stop it.
        """
        status = self.status
        if status is None:
            return
        if self._activating:
            self._begin(reset(self._at_rest()))
        elif status.go_echo or not self._ledger.is_settled:
            # A gripper that lost its activation unnoticed must not be activated by our shutdown, nor one
            # that a reset of ours is just about to reach; and one that others have activated not be reset.
            base = self._ledger.base
            active = status.activation_echo and (base.activate or self._ledger.is_settled)
            self._begin(shutdown(replace(base, activate=active)))

    # -- the cycle -------------------------------------------------------------------------------------

    @property
    def is_busy(self) -> bool:
        """Whether a procedure is under way."""
        return self._procedure is not None

    @property
    def has_request(self) -> bool:
        """Whether there may be something to write."""
        return self._step is not None or not self._desk.is_empty

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will because of a command that does not act yet."""
        status = self.status
        if status is None or self.machine.state not in RUNNING:
            return status is not None and status.is_moving
        return (
            status.is_moving
            or bool(self._desk.positions)
            or self._sent is not None
            or not self._ledger.is_settled
        )

    def speeds(self) -> dict[Finger, int]:
        """The speed each axis has or is about to get."""
        return {
            axis: self._desk.speeds.get(axis, request.speed)
            for axis, request in zip(AXES, self._ledger.settings, strict=True)
        }

    def move_timeout(self, position: int, axes: Finger, speed: int | None) -> float:
        """The default time-out of a move from where the axes are, in seconds."""
        assert self.status is not None, "the hand is running, so a status has been read"
        speeds = self.speeds() if speed is None else dict.fromkeys(AXES, speed)
        return default_timeout(position, axes, self.status, speeds, self._closing_time)

    def found(self, status: RobotiqStatus, *, activate: bool, asked: float | None = None) -> None:
        """Take in the first status after the link was opened; the policy says whether to activate."""
        if activate and look(status) is Trigger.SEEN_RESET:
            self.status = status
            self._ledger.read(status, status.timestamp if asked is None else asked)
            self.activate()
        else:
            self.see(status, asked)

    def take_request(self, now: float) -> Request | None:
        """The image to write in this cycle, or None. It counts as sent from here on."""
        if self._step is not None:
            image, self._step = self._step, None
            self._sent = Desk()
            self._step_number = self._ledger.writing(image, NOBODY, now)
            return image
        if self._procedure is not None or self._desk.is_empty or self.machine.state not in _COMMANDED:
            return None
        composed = self._compose()
        if composed is None:
            return None
        if self._desk.only_holds and composed == self._ledger.base:
            # Nothing drifts; but what was written before may not act yet, and then something might.
            if self._ledger.is_settled:
                self._desk = Desk()
                self._deliver()
            return None
        if self._desk.halt is not None:
            # The halt leaves alone; what was asked after it follows once the gripper has stopped.
            self._sent = Desk(halt=self._desk.halt)
            self._desk.halt = None
        else:
            self._sent, self._desk = self._desk, Desk()
        number = self._ledger.writing(composed, self._sent.moved, now)
        if self._sent.positions:
            self._moves = [(move, number if at < 0 else at) for move, at in self._moves]
        return composed

    def acknowledged(self, now: float) -> None:
        """The image was acknowledged."""
        sent, self._sent = self._sent, None
        assert sent is not None, "nothing was sent"
        number = self._ledger.acknowledged(now)
        tell(sent.senders)
        self._halting += [(number, delivery) for delivery in sent.halt or ()]
        if self._step is None and (self._procedure is not None or self._desk.is_empty):
            self._deliver()

    def look_again(self, status: RobotiqStatus, asked: float) -> None:
        """Take in a status before a shutdown: what is known must be known now."""
        self.status = status
        self._ledger.read(status, asked)
        if look(status) is Trigger.SEEN_READY and not self._ledger.compare(status):
            self._ledger.adopt(status)

    def see(self, status: RobotiqStatus, asked: float | None = None) -> None:
        """Take in a status, read after everything that was acknowledged so far.

        Args:
            status: the status.
            asked: when its request was sent, in monotonic seconds; None for the time of the reply. After
                the loop was held up that is long before the reply was looked at.
        """
        self.status = status
        self._ledger.read(status, status.timestamp if asked is None else asked)
        if self._procedure is not None:
            if self._step is not None and not self._may_begin(status):
                self._call_off(status)
            elif self._step is None and self._sent is None and self._ledger.acts(self._step_number):
                self._advance(self._procedure, status)
            return
        before = self.machine.state
        after = self.machine.happen(look(status))
        if after is not before and before in _COMMANDED and after not in RUNNING:
            self._leave(after, status)
        elif after in _COMMANDED:
            self._go_on(before, status)
        else:
            self._hold_on_return = NOBODY
        self._note_activation(status)
        self._tell_halted(status)
        if after in RUNNING:
            self._follow(status)

    def lost(self, why: RobotiqError | None = None) -> None:
        """The link is down: what was not acknowledged is dropped, never to be sent again."""
        self.machine.happen(Trigger.LINK_LOST)

        def failure() -> RobotiqError:
            error = ConnectionLostError(f"the link went down before this was done: {why}")
            error.__cause__ = why
            return error

        # A hold is a stop and not a motion: it is not dropped.
        for desk in (self._desk, self._sent or Desk()):
            self._hold_on_return |= desk.hold | desk.replaced
        self._drop_all(failure)
        self._sent = self._procedure = self._step = None
        self._ledger.lost()

    def refuse_unless_running(self, trigger: Trigger) -> None:
        """Refuse what is not possible now, with the error that tells why.

        Raises:
            RobotiqError: NotStarted, ConnectionLost, NotActivated, GripperFault or InvalidState.
        """
        state = self.machine.state
        if state in RUNNING or (trigger is Trigger.ASK_HALT and state is State.FAULT):
            return
        match state:
            case State.DISCONNECTED:
                raise ConnectionLostError("the link is down and being opened again")
            case State.DO_SHUTDOWN | State.SHUTDOWN:
                raise NotStartedError("the hand is not started")
            case State.RESET:
                raise NotActivatedError("the gripper is not activated: call activate() or recover()")
            case State.FAULT | State.ATR_DONE:
                assert self.status is not None, "a fault was read from a status"
                raise GripperFaultError(self.status.fault)
        raise refusal(trigger, state)

    # -- inside ----------------------------------------------------------------------------------------

    def _compose(self) -> Request | None:
        """The image with everything asked, or None while it is too early to tell. A halt is never early."""
        status, desk, ledger = self.status, self._desk, self._ledger
        assert status is not None, "a hand that takes commands has read a status"
        if desk.halt is None:
            if not ledger.is_certain:
                return None
            if desk.positions and not ledger.base.go and status.go_echo and not ledger.is_settled:
                # Where the fingers stop is known once the halt has acted.
                return None
        return compose(ledger.base, desk, status, ledger.gripping(status))

    def _at_rest(self) -> Request:
        """The image with every axis asked to be where it is: nothing a raised rGTO could wake."""
        assert self.status is not None, "procedures begin after the first status"
        status = self.status
        return replace(self._ledger.base, go=False).with_positions(
            {axis: status.position(axis) for axis in AXES}
        )

    def _begin(
        self, procedure: Procedure, may_begin: Callable[[RobotiqStatus], bool] = lambda _: True
    ) -> None:
        """Begin a procedure; until its first request is sent, every status must allow it to begin."""
        self._procedure = procedure
        self._step = next(procedure)
        self._may_begin = may_begin
        self._hold_on_return = NOBODY
        self._ledger.forget_contacts()

    def _call_off(self, status: RobotiqStatus) -> None:
        """What a procedure was to begin from is gone: send nothing, and see where the hand is instead."""
        self._procedure = self._step = None
        self._activating = False
        self._deliver()
        self.machine.happen(look(status))

    def _advance(self, procedure: Procedure, status: RobotiqStatus) -> None:
        """Hand the status to the procedure; at its end, see where that leaves the hand."""
        try:
            self._step = procedure.send(status)
            return
        except StopIteration:
            pass
        except RobotiqError as error:
            log.warning("%s", error)
        self._procedure = None
        ours = self._ledger.is_echoed_by(status)
        self._ledger.restart(status)
        if self.machine.happen(look(status)) in _COMMANDED and not ours:
            self._take_over(status)
        self._note_activation(status)

    def _deliver(self) -> None:
        """A request was acknowledged: a DO_ state, or RUNNING_CC, is over."""
        if self.machine.state in (State.DO_ACTIVATION, State.DO_ATR, State.DO_RESET, State.RUNNING_CC):
            self.machine.happen(Trigger.DELIVERED)

    def _go_on(self, before: State, status: RobotiqStatus) -> None:
        """The gripper follows requests: see whose."""
        if before is State.DISCONNECTED:
            self._return(status)
        elif before not in _COMMANDED:
            self._ledger.adopt(status)
        elif not self._ledger.compare(status):
            self._take_over(status)

    def _return(self, status: RobotiqStatus) -> None:
        """The link is back: go on from the image that the gripper shows, or adopt it."""
        self._ledger.found(status)
        if self.machine.state is State.FAULT and status.activation_echo:
            # As when a fault is seen to begin: nothing resumes by itself when it clears.
            self._hold_on_return = Finger.ALL
        self._hold_what_was_lost()

    def _hold_what_was_lost(self) -> None:
        """Hold what a lost link kept from being held, unless somebody else moves it by now."""
        if self.machine.state not in _COMMANDED:
            return  # the link is still down
        axes, self._hold_on_return = self._hold_on_return & self._ledger.ours, NOBODY
        if axes:
            self._hold(axes)
            if self.machine.state in RUNNING:
                self.machine.happen(Trigger.ASK_COMMAND)

    def _take_over(self, status: RobotiqStatus) -> None:
        """Another client commands the gripper: take over its requests, or our next write undoes them."""
        self.foreign_commands += 1
        if status.timestamp - self._warned >= FOREIGN_WARNING_S:
            self._warned = status.timestamp
            log.warning("another client commands the gripper: %r", status)
        self._ledger.adopt(status)
        self._desk.hold &= self._ledger.ours
        self._end_moves(
            lambda: MoveSupersededError("another client commands the gripper"),
            lambda move: not move.is_under(status),
            sent_only=True,
        )

    def _note_activation(self, status: RobotiqStatus) -> None:
        """See whether an activation of ours has come to its end."""
        if not self._activating:
            return
        sight = look(status)
        self._activating = not (
            sight is Trigger.SEEN_READY
            or status.fault.severity is Severity.MAJOR
            or (sight is Trigger.SEEN_RESET and self._ledger.is_settled)
        )

    def _hold(self, axes: Finger) -> None:
        self._desk.put_hold(axes, lambda: MoveSupersededError("the fingers are held"))

    def _follow(self, status: RobotiqStatus) -> None:
        """Tell callers what has come true with this status."""
        self._ledger.note_contacts(status)
        for move, number in self._moves[:]:
            if number < 0:
                continue
            move.observe(status)
            if self._ledger.acts(number) and move.has_arrived(status):
                self._moves = [(each, at) for each, at in self._moves if each is not move]
                move.end(move.result(status))

    def _tell_halted(self, status: RobotiqStatus) -> None:
        if not self._halting:
            return
        now = [(n, d) for n, d in self._halting if not status.go_echo or self._ledger.acts(n)]
        self._halting = [each for each in self._halting if each not in now]
        tell(delivery for _, delivery in now)

    def _leave(self, after: State, status: RobotiqStatus) -> None:
        """The gripper is not active any more, or reports a fault: nothing asked before may resume."""
        fault = status.fault
        if after in (State.FAULT, State.ATR_DONE):
            failure: Failure = lambda: GripperFaultError(fault)  # noqa: E731
        else:
            failure = lambda: NotActivatedError("the gripper lost its activation")  # noqa: E731
        halt, halting = self._desk.halt, self._halting
        if after is State.FAULT:
            self._desk.halt, self._halting = None, []
        self._drop_all(failure)
        if after is State.FAULT:
            # A halt is good in a fault, too.
            self._desk.halt, self._halting = halt, halting
        if after is State.FAULT and status.activation_echo:
            # Which axes drift is decided when the hold is written: a command that was sent just before
            # may not act yet, and its motion would begin when the fault clears.
            self._hold(self._ledger.ours)

    def _drop_all(self, failure: Failure) -> None:
        """Nothing asked so far will happen: tell everybody."""
        desks, self._desk = (self._desk, self._sent or Desk()), Desk()
        if self._sent is not None:
            self._sent = Desk()  # it may be on the line at this moment, but nobody waits for it any more
        halting, self._halting = self._halting, []
        for desk in desks:
            desk.fail(failure)
        tell((delivery for _, delivery in halting), failure)
        self._end_moves(failure)

    def _end_moves(
        self, failure: Failure, which: Callable[[Move], bool] = lambda _: True, *, sent_only: bool = False
    ) -> None:
        ending = [each for each in self._moves if which(each[0]) and not (sent_only and each[1] < 0)]
        self._moves = [each for each in self._moves if each not in ending]
        for move, _ in ending:
            move.end(failure())
