"""Everything that callers have asked for, from the call until they have been told what became of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from ..values.enums import NO_AXES, Finger
from ..values.errors import MoveSupersededError, RobotiqError
from ..values.status import RobotiqStatus
from .motion import LiveMoves
from .requests.pending import Command, PendingCommand
from .waiters import Waiter, resolve


@dataclass(slots=True, eq=False)
class _Halt:
    """One halt that waits until it shows.

    Attributes:
        number: of its write.
        waiter: who asked.
        is_second: whether it has been sent twice.
    """

    number: int
    waiter: Waiter[None]
    is_second: bool = False


class Callers:
    """Commands, moves and halts: pending, on the line, or acknowledged and not seen to act.

    Attributes:
        pending: what the gripper has not been told yet.
        moves: the moves that somebody waits for.
        halting: halts that were acknowledged and not seen to act.
    """

    def __init__(self) -> None:
        """Begin with nobody."""
        self.pending = PendingCommand()
        self.moves = LiveMoves()
        self._sent = PendingCommand()
        """What is on the line."""
        self.halting: list[_Halt] = []

    @property
    def has_undelivered_stop(self) -> bool:
        """Whether a halt or a hold waits to be sent, or for its acknowledgement."""
        return any(each.hold or each.halting is not None for each in (self.pending, self._sent))

    # -- what they ask ---------------------------------------------------------------------------------

    def command(self, command: Command, waiter: Waiter[None] | None = None) -> None:
        """Ask axes for something; moves of axes that get a position are superseded."""
        if command.position is not None:
            self._supersede(command.axes, MoveSupersededError(f"another command moves {command.axes}"))
        self.pending.merge(command, waiter)

    def hold(self, axes: Finger, why: str, waiter: Waiter[None] | None = None) -> None:
        """Hold axes where they are, if they move; moves of them are superseded."""
        superseded = MoveSupersededError(why)
        self._supersede(axes, superseded)
        self.pending.merge_hold(axes, superseded, waiter)

    def halt(self, waiter: Waiter[None]) -> None:
        """Stop everything."""
        superseded = MoveSupersededError("halt() stopped the fingers")
        self.moves.fail(superseded)
        self.pending.merge_halt(waiter, superseded)

    def _supersede(self, axes: Finger, error: MoveSupersededError) -> None:
        if self.moves:
            self.moves.fail(error, lambda move: bool(move.axes & axes))

    # -- what becomes of it ----------------------------------------------------------------------------

    def take(self) -> PendingCommand:
        """What goes out now. A halt goes before the rest, which follows once the gripper has stopped."""
        sent, self.pending = self.pending, PendingCommand()
        if sent.halting is not None:
            self.pending = replace(sent, hold=NO_AXES, holding=[], halting=None)
            # It stops what was to be held.
            sent = PendingCommand(hold=sent.hold, holding=sent.holding, halting=sent.halting)
        self._sent = sent
        return sent

    def nothing_to_send(self) -> None:
        """What is pending holds already."""
        resolve(self.pending.waiters)
        self.pending = PendingCommand()

    def acknowledged(self, number: int) -> None:
        """What is on the line was acknowledged under this number."""
        sent, self._sent = self._sent, PendingCommand()
        resolve(sent.waiters)
        if sent.halting is not None:
            for halt in self.halting:
                halt.number = number  # this write is the second one of those before it, or as good
            self.halting += [_Halt(number, waiter) for waiter in sent.halting]

    def halt_again(self) -> None:
        """The last halt is on the line once more."""
        self._sent = PendingCommand(halting=[])

    def see_halt(self, status: RobotiqStatus, acts: Callable[[int], bool]) -> None:
        """Tell those whose halt a status shows. One that should act and does not show is sent once more.

        A gripper may acknowledge a write and forget it. Unlike a motion, a halt may be sent again; that it
        shows only then is not told twice.
        """
        for halt in self.halting[:]:
            if not status.go_echo or (halt.is_second and acts(halt.number)):
                self.halting.remove(halt)
                resolve([halt.waiter])
            elif acts(halt.number) and self.pending.halting is None:
                halt.is_second, self.pending.halting = True, []

    def fail(self, error: RobotiqError) -> None:
        """Nothing asked so far will happen: tell everybody. The write may be on the line all the same."""
        told = (self.pending, self._sent, PendingCommand(halting=[halt.waiter for halt in self.halting]))
        self.pending, self._sent, self.halting = PendingCommand(), PendingCommand(), []
        for command in told:
            command.fail(error)
        self.moves.fail(error)

    def fail_but_stops(self, error: RobotiqError) -> None:
        """Nothing will move that was asked to; a halt and a hold are good all the same."""
        asked, halting, self.halting = self.pending, self.halting, []
        self.pending = replace(asked, holding=[], halting=None)
        self.fail(error)
        self.halting = halting
        self.pending = PendingCommand(hold=asked.asked_to_hold, holding=asked.holding, halting=asked.halting)

    def lost(self, error: RobotiqError) -> Finger:
        """The link is down: tell everybody, and return the axes whose hold was not acknowledged.

        A hold is a stop and not a motion: it is not dropped.
        """
        axes = self.pending.hold | self._sent.hold
        self.fail(error)
        return axes
