"""Hand: the calls of every hand, with their promises and argument checks."""

from __future__ import annotations

import time
from typing import TYPE_CHECKING, Self

from ..calibration import Units
from ..calibration.amounts import LABELS, OPENINGS, RATES, force_of, needed, position_of, speed_of
from ..runtime.concurrency import running_loop
from ..values.checks import check_flag, check_optional_byte, check_seconds, check_timeout, repr_of
from ..values.enums import CLOSED, OPEN, Finger, State
from ..values.events import SentRequest, Transition
from ..values.grip import GraspResult, GripEvent, check_at_least
from ..values.inhibit import Inhibit
from ..values.model import Model
from ..values.move_result import MoveResult
from ..values.status import Part, RobotiqStatus
from .arguments import describes_arguments
from .backend import Backend
from .grip_watch import SLIP_COUNTS, GripWatch
from .options import LONGEST_WAIT_S
from .present_run import NamesErrors, refuse_copy, refuse_with
from .statistics import Statistics, no_statistics
from .streams import Stream, check_buffer, check_limit
from .waiting import check_states


class Hand:
    """One gripper, with the calls that every hand has.

    Use a hand with ``async with``, or call :meth:`start` and :meth:`stop`. A hand belongs to the event loop
    in which it was started: any number of tasks of that loop may call it. No call blocks the loop, and each
    ends in bounded time unless its arguments allow longer. Every such time counts while the event loop runs:
    while the loop is held up no call times out. From another thread or another loop every call raises
    RuntimeError and sends nothing; the properties can be read from anywhere. A hand whose loop was closed
    before :meth:`stop` takes no call any more: its fingers may still move, and a new hand can start.

    Many calls take the same arguments, and each lists its own. Any other value raises TypeError or
    ValueError, and nothing is sent. Any object with ``__index__`` is an integer, except a bool.

    Other amounts become the closest count by :attr:`units` (see there how far to trust them), and are
    refused outside their range. One amount is given once: counts and millimetres together are a TypeError.

    A stop, a halt, a hold, a reset or a command ends the calls that it supersedes. Their callers hear of it
    when its write has left, or at once if that takes 50 ms: their next steps may hold up the loop.

    Timestamps are monotonic seconds of this process, wherever the gripper is. No motion is ever sent twice.

    Args:
        backend: reaches the gripper; each kind of hand has its own.
    """

    def __init__(self, backend: Backend) -> None:
        self._backend = backend
        self._naming = NamesErrors(backend.name)

    def __repr__(self) -> str:
        name = f"{self._backend.name} " if self._backend.name else ""
        return f"<{type(self).__name__} {name}{self.address} {self.state.name}>"

    __reduce__ = refuse_copy

    # -- lifetime --------------------------------------------------------------------------------------

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.stop()

    if not TYPE_CHECKING:  # type checkers report the mistake themselves
        __enter__ = __exit__ = refuse_with  # Python looks for both before it calls the first

    @describes_arguments()
    async def start(self, activate: bool = True, *, wait: float = 0.0) -> None:
        """Connect, read the status, activate a gripper that is reset, and poll from then on.

        An activation MOVES the fingers: they open and close to their stops. An active gripper is adopted:
        nothing is written. A gripper in fault is left there, so that :meth:`atr` and
        :meth:`recover` can run. Fault 0x09, which some grippers report once after a second without a poll,
        is passed over first.

        A failed or cancelled start leaves nothing running and takes back an activation that it began. A hand
        that was stopped can be started again.

        Raises:
            InvalidStateError: this hand is started already, or another one owns the gripper.
            NotStartedError: stop() was called during the start.
            ConnectFailedError: nothing answers within the connect timeout, or within ``wait``, while the
                event loop runs.
            RobotiqConnectionError: something answers, but not a gripper; or the link went down again.
            GripperFaultError: the activation ended in a fault.
            NotActivatedError: the gripper was reset during the activation.
            MotionInhibitedError: the gripper is reset, and a person has inhibited motion.
            ActivationTimeoutError: the activation was not finished in time, or reported nothing but fault
                0x05 for 5 s, as with a pressed emergency stop.
        """
        check_flag("activate", activate)
        wait = check_seconds("wait", wait, 0.0, LONGEST_WAIT_S)
        with self._naming:
            self._backend.check_may_start(running_loop())
            await self._backend.start(activate, wait)

    @describes_arguments()
    async def stop(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        """Stop the fingers (rGTO = 0), keep the activation, disconnect. Idempotent.

        rGTO does not end an activation or a release. If this hand has begun it, a reset ends it (rACT = 0),
        and the part is let go. Sequences of other clients, and an emergency release, continue.

        The stop is final from the call on: every request is refused with NotStartedError, requests that were
        not sent are dropped, and every other wait ends with NotStartedError. Nothing
        that starts or continues a motion is sent after the call. The state is SHUTDOWN when it returns.

        It ends within 2 s, even on a dead link and when cancelled: the cancellation is raised once
        the hand has stopped. They count while the event loop runs, and the stop is tried at least once. A
        link that is down gets one more try. Of several calls at a time the strongest counts, in any order:
        without ``keep_grip``, then with it, then ``halt=False``. A call stronger than the calls before it
        gets another 2 s. A halt or a reset that does not show yet, or a hold that was not delivered, turns
        ``halt=False`` into a stop with ``keep_grip``.

        With ``keep_grip`` axes that move are held where they are, and rGTO stays set, so that a grip stays
        while nothing is connected. This needs every axis seen at rest. In any doubt rGTO is cleared, and
        the log has the reason: an axis is not at rest within 0.5 s, the link is or goes down, a fault, a
        sequence, another client that commands, or a ``halt()``. A client that starts a motion after the last
        status and before the disconnection is not seen. It is not known what a real gripper does with a
        part, either way. A gripper that is not polled may lose its activation, and the part: it is in RESET
        then.
        """
        check_flag("halt", halt)
        await self._backend.stop(halt, self._backend.keeps_grip(keep_grip))

    # -- commands --------------------------------------------------------------------------------------

    @describes_arguments(value="position")
    async def set_position(
        self,
        value: int | None = None,
        fingers: Finger | int = Finger.ABC,
        *,
        mm: float | None = None,
        open_fraction: float | None = None,
    ) -> None:
        """Send axes to a position; returns when the gripper has acknowledged it, not when they are there.

        When cancelled, the request may still be sent: :meth:`halt` stops it.

        Raises:
            RobotiqError: the hand takes no commands now, or the link went down before the acknowledgement.
                The request is not sent again, and may have been carried out.
        """
        axes = self.model.mask(fingers)
        target = position_of(self.units, axes, value, mm, open_fraction, "value")
        with self._naming:
            await self._backend.set("position", needed("set_position", target, "value", *OPENINGS), axes)

    @describes_arguments(value="new_speed")
    async def set_speed(
        self,
        value: int | None = None,
        fingers: Finger | int = Finger.ALL,
        *,
        mm_per_s: float | None = None,
    ) -> None:
        """Set the speed of axes, as :meth:`set_position`, also while they move; never starts a motion."""
        axes = self.model.mask(fingers)
        speed = speed_of(self.units, value, mm_per_s, "value")
        with self._naming:
            await self._backend.set("speed", needed("set_speed", speed, "value", *RATES), axes)

    @describes_arguments(value="new_force")
    async def set_force(
        self,
        value: int | None = None,
        fingers: Finger | int = Finger.ALL,
        *,
        label_n: float | None = None,
    ) -> None:
        """Set the force of axes as :meth:`set_position`; starts no motion. A higher force tightens a grip."""
        axes = self.model.mask(fingers)
        force = force_of(self.units, value, label_n, "value")
        with self._naming:
            await self._backend.set("force", needed("set_force", force, "value", *LABELS), axes)

    @describes_arguments()
    def command(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        position: int | None = None,
        speed: int | None = None,
        force: int | None = None,
        mm: float | None = None,
        open_fraction: float | None = None,
        mm_per_s: float | None = None,
        label_n: float | None = None,
    ) -> None:
        """Send axes a command and return at once, for control loops. The last value wins; nothing queues.

        Calls between two polls make one write, dropped, and logged, if the link goes down first.
        :attr:`is_moving` is true until the axes rest; statuses have the old request until the new one is
        echoed.

        Raises:
            ValueError: also if position, speed and force are all None, in any unit.
            RobotiqError: the hand takes no commands now.
        """
        axes = self.model.mask(fingers)
        if mm is open_fraction is mm_per_s is label_n is None:  # counts alone: loops call this in every cycle
            if position is None and speed is None and force is None:
                raise ValueError(
                    "command() needs at least one of position, speed and force in 0..255, or of "
                    f"{', '.join((*OPENINGS, *RATES, *LABELS))}, got none"
                )
            position = check_optional_byte("position", position)
            speed, force = check_optional_byte("speed", speed), check_optional_byte("force", force)
        else:
            units = self.units
            position = position_of(units, axes, position, mm, open_fraction)
            speed, force = speed_of(units, speed, mm_per_s), force_of(units, force, label_n)
        with self._naming:
            self._backend.command(axes, position, speed, force)

    @describes_arguments()
    async def move(
        self,
        position: int | None = None,
        fingers: Finger | int = Finger.ABC,
        *,
        mm: float | None = None,
        open_fraction: float | None = None,
        speed: int | None = None,
        mm_per_s: float | None = None,
        force: int | None = None,
        label_n: float | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Move axes; when all have stopped, return the outcome of each: at the target, or against something.

        A contact is a result, not an error, and so is an axis that is "at position" elsewhere:
        ``result.reached`` has the axes at their targets. When the call is cancelled (by a
        task, ``asyncio.timeout`` or an anyio scope) or times out, its axes that still move are held
        where they are; an axis in contact keeps its request and its grip.

        Raises:
            MoveTimeoutError: an axis still moved when the time was over, counted while the event loop runs.
            MoveSupersededError: another command, halt(), reset() or another client took over an axis.
            GripperFaultError: the gripper reports a minor or a major fault.
            NotActivatedError: the gripper is not activated, or lost its activation.
            ConnectionLostError: the link went down; the gripper may still be moving.
            RobotiqStateError: the hand takes no commands now, or was stopped.
        """
        axes = self.model.mask(fingers)
        units = self.units
        target = needed("move", position_of(units, axes, position, mm, open_fraction), "position", *OPENINGS)
        speed, force = speed_of(units, speed, mm_per_s), force_of(units, force, label_n)
        limit = check_timeout("timeout", timeout)
        with self._naming:
            return await self._backend.move(axes, target, speed, force, limit)

    @describes_arguments()
    async def open(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        mm_per_s: float | None = None,
        force: int | None = None,
        label_n: float | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Open fingers: :meth:`move` to 0. Returns and raises the same."""
        return await self.move(
            OPEN, fingers, speed=speed, mm_per_s=mm_per_s, force=force, label_n=label_n, timeout=timeout
        )

    @describes_arguments()
    async def close(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        mm_per_s: float | None = None,
        force: int | None = None,
        label_n: float | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Close the fingers, not the connection (that is :meth:`stop`): :meth:`move` to 255."""
        return await self.move(
            CLOSED, fingers, speed=speed, mm_per_s=mm_per_s, force=force, label_n=label_n, timeout=timeout
        )

    @describes_arguments()
    async def grasp(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        at_least: int | None = None,
        speed: int | None = None,
        mm_per_s: float | None = None,
        force: int | None = None,
        label_n: float | None = None,
        timeout: float | None = None,
    ) -> GraspResult:
        """Close fingers until each has met something or is closed, and return which of them hold it.

        Too few contacts are a result and not an error: the result is false, and the fingers stay as they are.
        Otherwise it is a :meth:`move`, with the same errors, and the same end when cancelled or timed out.

        An axis holds if the gripper reports a contact while closing. It may never report one for a thin
        object between fingertips. A contact latches: a finger that was in contact before still counts when
        the part has been taken out. Open first, or use more force.
        """
        axes = self.model.mask(fingers)
        contacts = check_at_least(at_least, axes)
        move = await self.close(
            axes, speed=speed, mm_per_s=mm_per_s, force=force, label_n=label_n, timeout=timeout
        )
        return GraspResult(move, contacts)

    @describes_arguments()
    async def hold(self, fingers: Finger | int = Finger.ALL) -> None:
        """Hold axes that move where they are; returns when the gripper has acknowledged it.

        An axis in contact keeps its request and its grip, and one at rest is left alone. Awaited moves and
        pending requests of these axes end with MoveSupersededError; their other axes keep moving. When
        cancelled, the hold is still sent. If a lost link prevents the acknowledgement, the hold is
        repeated once the link is back, unless another client moves the axes then. In RESET and ATR_DONE, and
        during an activation, a release or a reset, it sends nothing; :meth:`halt` ends these.

        A hold needs to know the gripper's request, so it may wait: for ``write_spacing``, and up to 0.25 s
        after a write of another client or a lost acknowledgement. :meth:`halt` waits for nothing.

        Raises:
            MoveSupersededError: reset() took over before it was sent.
            NotActivatedError: the gripper lost its activation before it was sent.
            RobotiqError: not connected, or the link went down before the acknowledgement.
        """
        axes = self.model.mask(fingers)
        with self._naming:
            await self._backend.hold(axes)

    async def halt(self) -> None:
        """Stop every axis now (rGTO = 0). The next command sets rGTO again, and moves only the axes it names.

        An axis that held a part resumes pressing with that command, and closes if the part was taken out.

        Returns when the gripper reports that it has stopped, at most 1 s after the acknowledgement. Awaited
        moves end with MoveSupersededError. When cancelled, the halt is still sent. If the link goes
        down before the acknowledgement, it is not sent again: once the link is back, its moving axes are
        held. In RESET and ATR_DONE nothing moves and nothing is sent. rGTO does not stop an activation or an
        automatic release: during these, halt() clears rACT, as :meth:`reset` does, and returns in RESET.

        Raises:
            MoveSupersededError: reset() took over before it was sent.
            StateTimeoutError: the gripper does not show that it has stopped after two writes, or that an
                activation or a release has ended within 5 s while the event loop runs: the fingers MAY STILL
                MOVE.
            RobotiqError: not connected, or the link went down before the acknowledgement.
        """
        with self._naming:
            await self._backend.halt()

    @describes_arguments(who="whose")
    async def inhibit(self, reason: str, *, who: str = "") -> None:
        """Halt for a person, and refuse calls that may move or press until a person calls :meth:`permit`.

        After :meth:`halt` the next command moves again; after this every motion, force, activation, release
        and recovery raises MotionInhibitedError, and so do calls that already wait for the end of one of
        these. The inhibit outlasts lost links, :meth:`stop` and :meth:`start`. A second call halts again, and
        the first reason stays. Motion is inhibited even if the call raises; axes that move while the link is
        down are held once it is back, and an activation or a release is ended by a reset. It is no emergency
        stop. A :meth:`stop` under way that would leave the fingers moving stops them, and this call then
        raises.

        Raises:
            TypeError, ValueError: of the arguments; nothing is inhibited.
            NotStartedError: the hand was stopped: the fingers MAY STILL MOVE. A hand that was never started
                raises nothing: it is inhibited from its start on.
            RobotiqError: as :meth:`halt`: the fingers MAY STILL MOVE.
        """
        with self._naming:
            await self._backend.inhibit(Inhibit(reason, who, time.time()))

    @describes_arguments(who="whose")
    async def permit(self, *, who: str = "", seen: Inhibit | None = None) -> None:
        """Permit motion after :meth:`inhibit`; nothing moves. For a person, and not for a program's loop.

        Raises:
            TypeError, ValueError: of the arguments.
            RobotiqStateError: a halt came after the one that was seen: nothing is permitted.
            RobotiqError: a hand on another host has got no answer.
        """
        Inhibit("permitted", who, 0.0)  # checks it
        if not isinstance(seen, Inhibit | None):
            raise TypeError(f"seen must be an Inhibit or None, got {repr_of(seen)}")
        with self._naming:
            await self._backend.permit(who, seen)

    # -- activation, faults ----------------------------------------------------------------------------

    async def activate(self) -> None:
        """Activate the gripper if it is not active. The fingers MOVE to their stops.

        When cancelled, the activation continues; :meth:`reset` ends it.

        Raises:
            GripperFaultError: a fault is latched (see :meth:`recover`), or the activation ended in a fault.
            NotActivatedError: the gripper was reset during the activation.
            ActivationTimeoutError: not finished within the activation timeout while the event loop runs, or
                nothing but fault 0x05 for 5 s, as with a pressed emergency stop. The activation continues.
            RobotiqError: not possible now, or the link went down.
        """
        with self._naming:
            await self._backend.activate()

    async def reset(self) -> None:
        """Reset the gripper (rACT = 0): this clears faults and lets go of the part. Returns in RESET.

        It also ends an activation or a release. Awaited moves end with MoveSupersededError. When
        cancelled, the reset continues. A lost link ends it as it ends a :meth:`halt`.

        Raises:
            StateTimeoutError: the gripper did not report the reset within 5 s while the event loop runs.
            RobotiqError: not possible now, or the link went down.
        """
        with self._naming:
            await self._backend.reset()

    async def atr(self) -> None:
        """Release automatically: all axes open slowly, in any fault. Only in FAULT.

        Returns in ATR_DONE. After that only :meth:`reset` and :meth:`activate`, or :meth:`recover`, help.
        When cancelled, the release continues. :meth:`halt`, :meth:`reset` and :meth:`stop` end it.

        Raises:
            InvalidStateError: not in FAULT.
            NotActivatedError: the gripper is reset, or was reset during the release.
            StateTimeoutError: the release was not finished within 60 s while the event loop runs.
            RobotiqError: the link went down.
        """
        with self._naming:
            await self._backend.atr()

    @describes_arguments(timeout="recovery")
    async def recover(self, timeout: float | None = None) -> None:
        """Clear the present fault and make the gripper active again.

        A minor or unknown fault, and an activation, reset or release that runs, are waited for. After a major
        fault the gripper is reset and activated. So is a gripper that makes no progress for 5 s while it
        waits for its activation (0x05, as after an emergency stop) or releases, at most twice. A reset DROPS
        the part, and an activation MOVES the fingers.

        Raises:
            StateTimeoutError: not active in time, with the fault that lasts, or not after two resets.
            ActivationTimeoutError: the new activation took longer than the activation timeout.
            GripperFaultError: the new activation ended in a fault.
            NotActivatedError: the gripper was reset during the new activation.
            RobotiqError: the link went down, or the hand was stopped.
        """
        limit = check_timeout("timeout", timeout)
        with self._naming:
            await self._backend.recover(limit)

    # -- reading ---------------------------------------------------------------------------------------

    @property
    def state(self) -> State:
        """The state of the hand."""
        return self._backend.state

    @property
    def inhibited(self) -> Inhibit | None:
        """The reason that motion is refused, since when, and by whom; None while it is permitted."""
        return self._backend.inhibited

    @property
    def name(self) -> str:
        """The hand's name in the log, errors and metrics: the one it was given, or else its address."""
        return self._backend.name or self._backend.address

    @property
    def address(self) -> str:
        """The gripper's address in its full form; for a tunnel object, its name in messages."""
        return self._backend.address

    @property
    def model(self) -> Model:
        """The model of the gripper. A remote hand knows it once it is started."""
        return self._backend.model

    @property
    def units(self) -> Units:
        """Converts mm, mm/s, seconds and newton labels to values and back, by the hand's calibrations."""
        return self._backend.units

    @property
    def status(self) -> RobotiqStatus:
        """The newest status, of any age (see its timestamp); NotStartedError before the first."""
        with self._naming:
            return self._backend.status

    def _current_status(self) -> RobotiqStatus:
        with self._naming:
            return self._backend.current_status()

    @property
    def part(self) -> Part | None:
        """The part that is held, with its width; None if the gripper reports none: ``status.part``.

        Raises as :attr:`is_moving`, so that an old answer is never taken for a new one.
        """
        return self._current_status().part

    @property
    def is_activated(self) -> bool:
        """Whether the gripper is active (gIMC = 3); raises as :attr:`is_moving`."""
        return self._current_status().is_activated

    @property
    def is_reset(self) -> bool:
        """Whether the gripper is reset (gACT = 0 and gIMC = 0); raises as :attr:`is_moving`."""
        return (status := self._current_status()).is_reset and not status.activation_echo

    @property
    def is_moving(self) -> bool:
        """Whether an axis moves, or will move by a command that does not act yet.

        Raises RobotiqError while that is not known: before the start, and when the link is down.
        """
        self._current_status()
        return self._backend.is_moving()

    @property
    def statistics(self) -> Statistics:
        """Figures of the polling since the last start."""
        return self._backend.statistics or no_statistics()

    @describes_arguments()
    def statuses(self, buffer: int = 1, *, lost_after: float | None = None) -> Stream[RobotiqStatus]:
        """Every status from now on, in order, for one reader.

        A slow reader costs only itself: the stream keeps the newest ``buffer`` statuses, and its ``missed``
        counts the others. Opened before the start it waits for it, in the same event loop. It ends after
        :meth:`stop`, and raises RobotiqConnectionError when the hand gives up on its link. While the link is
        down it waits; a control loop passes ``lost_after``: when no status has come for that time since the
        last one, or since the opening, it raises ConnectionLostError, also if the event loop was held up for
        that time. It may be read on, unless the hand has given up: then it is in SHUTDOWN.
        """
        kept, limit = check_buffer(buffer), check_limit("lost_after", lost_after)
        return self._backend.open_stream(self._backend.channels.statuses, kept, limit)

    def transitions(self) -> Stream[Transition]:
        """Every change of state from now on, none lost, for one reader. Ends as :meth:`statuses` does."""
        return self._backend.open_stream(self._backend.channels.transitions, None)

    @describes_arguments(buffer="requests")
    def requests(self, buffer: int | None = None) -> Stream[SentRequest]:
        """Every request written from now on, as :meth:`statuses`; a ``buffer`` of None loses none."""
        kept = None if buffer is None else check_buffer(buffer)
        return self._backend.open_stream(self._backend.channels.requests, kept)

    @describes_arguments(fingers="watched")
    def grip_events(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> Stream[GripEvent]:
        """Changes of grips from now on: contacts gained and lost, parts that slip. None lost.

        For one reader; ends as :meth:`statuses` does. Changes while the link is down are reported when it
        is back. The events follow the gripper's reports, and a contact latches: a part that is pulled out
        is noticed once its finger closes further; the manual says, only when the force is raised.
        """
        watch = GripWatch(self.model.mask(fingers), since=since, slip=slip)
        self._backend.check_may_listen()
        if since is None and self._backend.newest_status is not None:
            watch.see(self._backend.newest_status)
        return self._backend.channels.statuses.derive(watch.see)

    @describes_arguments(timeout="waiting")
    async def wait_for_state(self, *states: State, timeout: float | None = None) -> State:
        """Wait until the hand is in one of these states, if only for a moment, and return that state.

        Raises:
            StateTimeoutError: not reached in time.
            NotStartedError: the hand is not started, or was stopped.
            RobotiqConnectionError: the hand gave up on its link.
        """
        check_states(states)
        limit = check_timeout("timeout", timeout)
        if self.state in states:
            return self.state
        with self._naming:
            self._backend.check_running()
            return await self._backend.wait_for_state(states, limit)
