"""What callers have asked for and have no answer to yet."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ..runtime.log import Log, log
from ..values.enums import NO_AXES, Finger
from ..values.errors import MoveSupersededError, RobotiqError
from ..values.status import RobotiqStatus
from .motion import LiveMoves
from .requests.pending import Command, PendingCommand
from .waiters import Waiter, resolve


@dataclass(slots=True, eq=False)
class _Halt:
    """A halt that was acknowledged and does not act yet."""

    write: int
    waiter: Waiter[None]
    is_repeated: bool = False


class OpenRequests:
    """Commands, moves and halts: pending, on the line, or acknowledged and not seen to act.

    Attributes:
        pending: what is to be written.
        moves: the moves that callers wait for.
        halting: the halts that were acknowledged and do not act yet.
    """

    def __init__(self, log: Log = log) -> None:
        self.pending = PendingCommand()
        self.moves = LiveMoves(log)
        self.halting: list[_Halt] = []
        self._sent = PendingCommand()
        """What is on the line."""

    @property
    def has_undelivered_stop(self) -> bool:
        """Whether a halt or a hold waits to be sent, or for its acknowledgement."""
        return any(each.hold or each.halting is not None for each in (self.pending, self._sent))

    # -- what is asked ---------------------------------------------------------------------------------

    def command(self, command: Command, waiter: Waiter[None] | None = None) -> None:
        """Ask something of axes. A position supersedes the moves of these axes."""
        if command.position is not None and self.moves:  # few loops at 200 Hz have a move to end
            self._supersede(command.axes, MoveSupersededError(f"another command moves {command.axes}"))
        self.pending.merge(command, waiter)

    def hold(self, axes: Finger, why: str, waiter: Waiter[None] | None = None) -> None:
        """Hold those axes that move. It supersedes their moves."""
        superseded = MoveSupersededError(why)
        self._supersede(axes, superseded)
        self.pending.merge_hold(axes, superseded, waiter)

    def halt(self, waiter: Waiter[None]) -> None:
        """Stop every axis."""
        superseded = MoveSupersededError("halt() stopped the fingers")
        self.moves.fail(superseded)
        self.pending.merge_halt(waiter, superseded)

    def _supersede(self, axes: Finger, error: MoveSupersededError) -> None:
        if self.moves:
            self.moves.fail(error, lambda move: bool(move.axes & axes))

    # -- what becomes of it ----------------------------------------------------------------------------

    def take(self) -> PendingCommand:
        """Take what is written now. A halt goes alone: the rest follows once the gripper has stopped."""
        sent, self.pending = self.pending, PendingCommand()
        if sent.halting is not None:
            self.pending = replace(sent, hold=NO_AXES, holding=[], halting=None)
            # The halt also stops the axes to be held, so the callers of hold() have their answer with it.
            sent = PendingCommand(hold=sent.hold, holding=sent.holding, halting=sent.halting)
        self._sent = sent
        return sent

    def nothing_to_send(self) -> None:
        """Everything pending is in force already."""
        resolve(self.pending.waiters)
        self.pending = PendingCommand()

    def acknowledged(self, number: int) -> None:
        """The write on the line, ``number``, was acknowledged."""
        sent, self._sent = self._sent, PendingCommand()
        resolve(sent.waiters)
        if sent.halting is not None:
            for halt in self.halting:
                halt.write = number  # this write also repeats the halts before it
            self.halting += [_Halt(number, waiter) for waiter in sent.halting]

    def halt_again(self) -> None:
        """The last halt is on the line again."""
        self._sent = PendingCommand(halting=[])

    def see_halt(self, status: RobotiqStatus, acts: Callable[[int], bool]) -> None:
        """Answer the callers whose halt the status shows, and repeat a halt that it should show and does not.

        A gripper may acknowledge a write and forget it. A halt may be sent twice, unlike a motion. After the
        repetition the caller gets its answer even if the status still shows rGTO set.
        """
        for halt in self.halting[:]:
            if not status.go_echo or (halt.is_repeated and acts(halt.write)):
                self.halting.remove(halt)
                resolve([halt.waiter])
            elif acts(halt.write) and self.pending.halting is None:
                halt.is_repeated, self.pending.halting = True, []

    def fail(self, error: RobotiqError) -> None:
        """Fail everything asked so far. A write may be on the line all the same."""
        failing = (self.pending, self._sent, PendingCommand(halting=[halt.waiter for halt in self.halting]))
        self.pending, self._sent, self.halting = PendingCommand(), PendingCommand(), []
        for command in failing:
            command.fail(error)
        self.moves.fail(error)

    def fail_but_stops(self, error: RobotiqError) -> None:
        """Fail everything that would move an axis; halts and holds remain."""
        asked, halting, self.halting = self.pending, self.halting, []
        self.pending = replace(asked, holding=[], halting=None)
        self.fail(error)
        self.halting = halting
        self.pending = PendingCommand(hold=asked.asked_to_hold, holding=asked.holding, halting=asked.halting)

    def lost(self, error: RobotiqError) -> Finger:
        """The link is down: fail everything, and return the axes whose hold was not acknowledged.

        A hold stops motion, so it is sent once the link is back.
        """
        axes = self.pending.hold | self._sent.hold
        self.fail(error)
        return axes
