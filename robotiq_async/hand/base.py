"""Hand: what every hand can do, in this process or on another host.

What stands around a hand (actions, telemetry, measurements, the command line) is typed against this, and
uses nothing else. :class:`~robotiq_async.RobotiqHand` is the hand that owns the link to a gripper. The
docstrings here are what every implementation promises.
"""

from __future__ import annotations

from collections.abc import Iterator
from types import TracebackType
from typing import Protocol, Self, TypeVar

from ..control.grip_watch import SLIP_COUNTS
from ..values.calibration import Units
from ..values.enums import Finger, State
from ..values.events import SentRequest, Transition
from ..values.grasp_result import GraspResult
from ..values.grip_event import GripEvent
from ..values.move_result import MoveResult
from ..values.statistics import Statistics
from ..values.status import RobotiqStatus

T_co = TypeVar("T_co", covariant=True)


class HandStream(Protocol[T_co]):
    """What happens to a hand, for one reader. Dropping it ends it: nothing has to be closed."""

    @property
    def missed(self) -> int:
        """Items that were dropped, the oldest first, because the reader was slow."""

    def __aiter__(self) -> Self:
        """The stream itself."""

    async def __anext__(self) -> T_co:
        """The next item. A cancelled wait loses nothing.

        Raises:
            StopAsyncIteration: the hand was stopped, or the stream was closed.
            RobotiqConnectionError: the hand gave up on its link.
        """

    def take_nowait(self) -> T_co | None:
        """The next item if it is there already."""

    def drain(self) -> Iterator[T_co]:
        """The items that are there already, also those that came before the end."""

    async def aclose(self) -> None:
        """End the stream; a waiting reader ends too. Idempotent."""


class Hand(Protocol):
    """A gripper, as a program sees it.

    Calls belong to one event loop, never block it, and end in bounded time; any number of tasks may make
    them. Masks are :class:`Finger` or the same integers; values are integers in 0..255, whatever has an
    ``__index__`` being one. Anything else is a TypeError or a ValueError, and nothing has been asked of the
    gripper then. Timestamps are monotonic seconds by the clock of this process, wherever the gripper is. No
    command is ever sent twice.
    """

    # -- lifetime --------------------------------------------------------------------------------------

    async def __aenter__(self) -> Self:
        """Start, with activation."""

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Stop, also when the block failed or was cancelled."""

    async def start(self, activate: bool = True, *, wait: float = 0.0) -> None:
        """Connect, read the status, and activate a gripper that is reset: its fingers MOVE then.

        An active gripper is adopted, and one in fault is left there. A failed or cancelled start leaves
        nothing running. A hand may be started again after it was stopped.

        Args:
            activate: False writes nothing to the gripper.
            wait: seconds, 0..86400, for which there may be no gripper yet: it is tried until it answers, and
                activated only then.

        Raises:
            InvalidStateError: started already, or another hand owns the gripper.
            RobotiqError: no gripper there, a link that failed, or an activation that failed.
        """

    async def stop(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        """Stop the fingers and disconnect, within 2 s and also when cancelled meanwhile. Idempotent.

        Final from the call on: every request is refused, what was not sent is dropped, and what others wait
        for ends with NotStartedError. The strongest of several calls under way counts. The state is SHUTDOWN
        afterwards.

        Args:
            halt: False leaves the fingers to what they do.
            keep_grip: True holds what moves and lets a grip stay in force; on any doubt the fingers are
                stopped as ever. None for what the hand was made with.
        """

    # -- commands --------------------------------------------------------------------------------------

    async def set_position(self, value: int, fingers: Finger | int = Finger.ABC) -> None:
        """Ask axes to go somewhere; returns when the gripper has acknowledged it.

        Raises:
            RobotiqError: the hand takes no commands now, or the acknowledgement did not come.
        """

    async def set_speed(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the speed of axes, also of a motion under way; never starts one.

        Raises:
            RobotiqError: as :meth:`set_position`.
        """

    async def set_force(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the force of axes; never starts a motion. More force tightens a grip.

        Raises:
            RobotiqError: as :meth:`set_position`.
        """

    def command(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        position: int | None = None,
        speed: int | None = None,
        force: int | None = None,
    ) -> None:
        """Ask axes for something, without waiting: the last value wins, nothing queues.

        Raises:
            ValueError: none of position, speed and force.
            RobotiqError: the hand takes no commands now.
        """

    async def move(
        self,
        position: int,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Move axes and return when every one of them has stopped: there, or against something.

        The other axes stay as they are. Cancelled or timed out, those that still move are held, and a grip
        stays.

        Args:
            position: target in counts.
            fingers: the axes.
            speed: new speed of these axes; None leaves it.
            force: new force of these axes; None leaves it.
            timeout: seconds; None for twice the expected time plus 2 s.

        Raises:
            MoveTimeoutError: an axis still moved when the time was over; as MoveIgnoredError: the first
                motion on a connection was echoed, and nothing has moved for a second.
            MoveSupersededError: another command, halt(), reset() or another client took over an axis.
            GripperFaultError: the gripper reports a minor or a major fault.
            RobotiqError: the hand takes no commands now, the link went down, or the hand was stopped.
        """

    async def open(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Open fingers: :meth:`move` to 0."""

    async def close(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Close the fingers, not the connection: :meth:`move` to 255."""

    async def grasp(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        at_least: int | None = None,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> GraspResult:
        """Close fingers until each of them has met something or is closed, and say which of them hold it.

        Too few contacts are a result and not an error: the result is false, and the fingers stay as they are.
        When cancelled or timed out, as :meth:`move`.

        What holds is what the gripper calls a contact while closing. A thin object between fingertips may
        never be called one; and a contact latches: a finger that stood in one before still counts, also when
        the part has been taken out meanwhile. Open first, or ask for more force.

        Args:
            fingers: the axes that close.
            at_least: contacts that make a grasp, 1..as many as there are axes; None for all of them.
            speed: new speed of these axes; None leaves it.
            force: new force of these axes; None leaves it.
            timeout: seconds; None for twice the expected time plus 2 s.

        Raises:
            TypeError, ValueError: an argument of the wrong type or outside its range; nothing is sent.
            RobotiqError: as :meth:`move`.
        """

    async def hold(self, fingers: Finger | int = Finger.ALL) -> None:
        """Ask axes that move to stay where they are; returns when the gripper has acknowledged it.

        An axis in contact keeps its grip, and one at rest is left alone. Moves of these axes end with
        MoveSupersededError. In an activation, a release or a reset nothing is sent.

        Raises:
            RobotiqError: not connected, or the acknowledgement did not come.
        """

    async def halt(self) -> None:
        """Stop every axis now; returns when the gripper shows it. The next command goes again.

        Raises:
            RobotiqError: not connected, or the acknowledgement did not come.
        """

    # -- activation, faults ----------------------------------------------------------------------------

    async def activate(self) -> None:
        """Activate the gripper, if it is not active yet: its fingers MOVE. When cancelled, it goes on.

        Raises:
            RobotiqError: a fault is latched, the activation failed, or it is not possible now.
        """

    async def reset(self) -> None:
        """Reset the gripper, which lets go of what it holds; returns in RESET. When cancelled, it goes on.

        Raises:
            RobotiqError: not possible now, not in time, or the link went down.
        """

    async def atr(self) -> None:
        """Release automatically: all axes open slowly. Only in FAULT; returns in ATR_DONE.

        Raises:
            InvalidStateError: not in FAULT.
            RobotiqError: not in time, or the link went down.
        """

    async def recover(self, timeout: float | None = None) -> None:
        """Do whatever the present fault needs: after a major one the part DROPS and the fingers MOVE.

        Args:
            timeout: seconds for all of it; None for 90 s.

        Raises:
            RobotiqError: not active in time, the activation failed, or the link went down.
        """

    # -- what is going on ------------------------------------------------------------------------------

    @property
    def name(self) -> str:
        """What the hand is called, in the log and in metrics: by its address, unless it was given a name."""

    @property
    def address(self) -> str:
        """Which gripper, for people and labels: no two hands of a process have the same one."""

    @property
    def units(self) -> Units:
        """Converts mm, mm/s, seconds and newton labels to what commands take, and back.

        There before the start, and the same as long as the hand lives.
        """

    @property
    def state(self) -> State:
        """Where the hand is."""

    @property
    def status(self) -> RobotiqStatus:
        """The newest status, also after the link went down: its timestamp tells how old it is.

        Raises:
            NotStartedError: there is none yet.
        """

    @property
    def is_activated(self) -> bool:
        """Whether the gripper is active.

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """

    @property
    def is_reset(self) -> bool:
        """Whether the gripper is reset.

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will because of a command that does not act yet.

        Raises:
            RobotiqError: not known: not started, or the link is down.
        """

    @property
    def statistics(self) -> Statistics:
        """How the polling went since the last start."""

    def statuses(self, buffer: int = 1) -> HandStream[RobotiqStatus]:
        """Every status from now on, in its order; the newest ``buffer`` of them are kept for the reader.

        Like the other two it may be opened before the start, waits out a lost link, and ends after
        :meth:`stop`.
        """

    def transitions(self) -> HandStream[Transition]:
        """Every change of state from now on, none lost."""

    def requests(self, buffer: int | None = None) -> HandStream[SentRequest]:
        """Every request written from now on, by whomever it was asked for; None loses none."""

    def grip_events(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> HandStream[GripEvent]:
        """What becomes of the grips from now on: contacts gained and lost, parts that slip.

        For one reader, none lost. Nothing is told while the link is down; what has become of a grip meanwhile
        is told when it is back.

        It tells what the gripper reports. A contact latches: a part that is pulled out is noticed when its
        finger closes on, which it does when more force is asked for, and by the manual not before.

        Args:
            fingers: the axes that are watched.
            since: the status to begin with, ``result.status`` of a grasp or a move: what has changed between
                that and the next status is told, too. None for the newest one.
            slip: counts that an axis in contact may move without being told, 1..255.

        Raises:
            TypeError, ValueError: an argument of the wrong type or outside its range.
        """

    async def wait_for_state(self, *states: State, timeout: float | None = None) -> State:
        """Wait until the hand is, if only for a moment, in one of these states, and return it.

        Args:
            states: at least one.
            timeout: seconds; None waits for as long as the hand runs.

        Raises:
            StateTimeoutError: not reached in time.
            RobotiqError: not started, stopped meanwhile, or the hand gave up on its link.
        """
