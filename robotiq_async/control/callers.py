"""Everything that callers have asked for, from the call until they have been told what became of it."""

from __future__ import annotations

from collections.abc import Callable

from ..enums import Finger
from ..errors import MoveSupersededError, RobotiqError
from ..wire.status import RobotiqStatus
from .motion import LiveMoves
from .pending import PendingCommand
from .waiters import Waiter, fail, resolve


class Callers:
    """Commands, moves and halts: pending, on the line, or acknowledged and not seen to act.

    Attributes:
        pending: what the gripper has not been told yet.
        moves: the moves that somebody waits for.
    """

    def __init__(self) -> None:
        """Begin with nobody."""
        self.pending = PendingCommand()
        self.moves = LiveMoves()
        self._sent: PendingCommand | None = None
        self._halting: list[tuple[int, Waiter[None]]] = []
        """Callers of halt() whose write was acknowledged, with its number."""

    # -- what they ask ---------------------------------------------------------------------------------

    def command(
        self,
        axes: Finger,
        position: int | None,
        speed: int | None,
        force: int | None,
        waiter: Waiter[None] | None = None,
    ) -> None:
        """Ask axes for something; moves of axes that get a position are superseded."""
        if position is not None:
            self._supersede(axes, MoveSupersededError(f"another command moves {axes}"))
        self.pending.merge(axes, position, speed, force, waiter)

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
        """What goes out now. A halt leaves alone: the rest follows once the gripper has stopped."""
        sent = self.pending
        if sent.halting is not None:
            sent, self.pending.halting = PendingCommand(halting=sent.halting), None
        else:
            self.pending = PendingCommand()
        self._sent = sent
        return sent

    def nothing_to_send(self) -> None:
        """What is pending holds already."""
        resolve(self.pending.waiters)
        self.pending = PendingCommand()

    def acknowledged(self, number: int) -> None:
        """What is on the line was acknowledged under this number."""
        sent, self._sent = self._sent, None
        if sent is not None:
            resolve(sent.waiters)
            self._halting += [(number, waiter) for waiter in sent.halting or ()]

    @property
    def wait_for_halt(self) -> bool:
        """Whether a halt was acknowledged and has not been seen to act."""
        return bool(self._halting)

    def see_halt(self, status: RobotiqStatus, acts: Callable[[int], bool]) -> None:
        """Tell those whose halt a status shows, or whose write acts by now."""
        shown = [each for each in self._halting if not status.go_echo or acts(each[0])]
        self._halting = [each for each in self._halting if each not in shown]
        resolve(waiter for _, waiter in shown)

    def fail(self, error: RobotiqError) -> None:
        """Nothing asked so far will happen: tell everybody."""
        commands = [self.pending] if self._sent is None else [self.pending, self._sent]
        halting, self._halting, self.pending = self._halting, [], PendingCommand()
        if self._sent is not None:
            self._sent = PendingCommand()  # it may be on the line, but nobody waits for it any more
        for command in commands:
            command.fail(error)
        fail((waiter for _, waiter in halting), error)
        self.moves.fail(error)

    def fail_but_stops(self, error: RobotiqError) -> None:
        """Nothing will move that was asked to; a halt and a hold are good all the same."""
        pending = self.pending
        kept = PendingCommand(hold=pending.asked_to_hold, holding=pending.holding, halting=pending.halting)
        pending.holding, pending.halting = [], None
        halting, self._halting = self._halting, []
        self.fail(error)
        self.pending, self._halting = kept, halting

    def lost(self, error: RobotiqError) -> Finger:
        """The link is down: tell everybody, and return the axes whose hold was not acknowledged.

        A hold is a stop and not a motion: it is not dropped.
        """
        axes = self.pending.hold | self.pending.replaced
        if self._sent is not None:
            axes |= self._sent.hold | self._sent.replaced
        self.fail(error)
        self._sent = None
        return axes

    def drop_sent(self) -> None:
        """Nobody asks any more what became of the write on the line."""
        self._sent = None
