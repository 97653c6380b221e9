"""What a hand on another host is told: motions, the halt, activation, and the way out of a fault."""

from __future__ import annotations

import asyncio
from contextlib import nullcontext
from dataclasses import replace
from typing import Final

from ...control.state_machine import RUNNING, refusal
from ...values.checks import check_byte, check_mask, check_optional_byte, check_timeout
from ...values.enums import CLOSED, OPEN, Finger
from ...values.errors import NotAllowedError, NotStartedError, RobotiqConnectionError
from ...values.grasp_result import GraspResult, check_at_least
from ...values.move_result import MoveResult
from ...values.trigger import Trigger
from ..network.bus import Urgency
from ..wire.values import Fields, read_result, reading
from .observation import RemoteObservation
from .requests import no_answer_as_lost_connection

COMMAND_S: Final = 5.0
"""For what ends when the gripper acknowledges it."""
SEQUENCE_S: Final = 130.0
"""For an activation, a reset or a release; the agent has limits of its own, and they are shorter."""
MOVE_S: Final = 100.0
SLACK_S: Final = 5.0
"""Added to a timeout that the agent watches over."""


class RemoteCommands(RemoteObservation):
    """A hand on another host that is told to move."""

    _control: bool | None

    async def set_position(self, value: int, fingers: Finger | int = Finger.ABC) -> None:
        """Ask axes to go somewhere; returns when the gripper has acknowledged it, not when they are there.

        Raises:
            TypeError: value or mask of the wrong type; nothing is sent.
            ValueError: value or mask outside their range; nothing is sent.
            ControlLostError: this hand does not hold the lease.
            RobotiqError: the hand takes no commands now, or the agent fell silent before its answer (the
                request is not sent again, and may have been carried out).
        """
        await self._set("set_position", value, fingers)

    async def set_speed(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the speed of axes, also of a motion under way; never starts one.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`set_position`.
        """
        await self._set("set_speed", value, fingers)

    async def set_force(self, value: int, fingers: Finger | int = Finger.ALL) -> None:
        """Set the force of axes; never starts a motion. More force tightens a grip.

        Raises:
            TypeError, ValueError, RobotiqError: as :meth:`set_position`.
        """
        await self._set("set_force", value, fingers)

    async def _set(self, name: str, value: int, fingers: Finger | int) -> None:
        mask = check_mask(fingers)
        arguments = {"value": check_byte("value", value), "fingers": int(mask)}
        await self._ask(name, arguments, COMMAND_S)

    def command(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        position: int | None = None,
        speed: int | None = None,
        force: int | None = None,
    ) -> None:
        """Ask axes for something, for control loops: never blocks, and the last value wins.

        Some requests are under way at a time; what is asked meanwhile is merged and goes out with the next.
        A refusal that comes back is logged; the loss of the lease is raised by the next call.

        Raises:
            ValueError: none of position, speed and force; or a value outside its range.
            TypeError: a value of the wrong type.
            RobotiqError: not started, the agent is silent, this hand does not hold the lease, or the hand
                takes no commands now.
        """
        mask = check_mask(fingers)
        changes = {
            name: check_optional_byte(name, value)
            for name, value in (("position", position), ("speed", speed), ("force", force))
        }
        if all(value is None for value in changes.values()):
            raise ValueError("command() needs at least one of position, speed and force in 0..255, got none")
        session = self._asked()
        session.check_control()
        self._refuse_unless_running()
        assert self._outbox is not None
        self._outbox.put(mask, {name: value for name, value in changes.items() if value is not None})

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

        When cancelled, the axes that still move are held; when the agent falls silent, it holds them itself
        within its window.

        Args:
            position: target in counts, 0 (open) .. 255 (closed).
            fingers: mask of the axes.
            speed: new speed of these axes; None leaves it.
            force: new force of these axes; None leaves it.
            timeout: seconds; None for twice the expected time plus 2 s.

        Raises:
            TypeError, ValueError: an argument of the wrong type or outside its range; nothing is sent.
            ControlLostError: this hand does not hold the lease, or lost it on the way.
            RobotiqError: as for a hand of this process, or the agent fell silent.
        """
        arguments: Fields = {
            "fingers": int(check_mask(fingers)),
            "position": check_byte("position", position),
            "speed": check_optional_byte("speed", speed),
            "force": check_optional_byte("force", force),
            "timeout": (limit := check_timeout("timeout", timeout)),
        }
        value = await self._ask("move", arguments, MOVE_S if limit is None else limit + SLACK_S)
        session = self._session
        assert session is not None
        with reading("a result"):
            result = read_result(value, session.mirror.clock)
            return replace(result, status=session.mirror.renumbered(result.status))

    async def open(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Open fingers: :meth:`move` to 0."""
        return await self.move(OPEN, fingers, speed=speed, force=force, timeout=timeout)

    async def close(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        speed: int | None = None,
        force: int | None = None,
        timeout: float | None = None,
    ) -> MoveResult:
        """Close the fingers, not the connection: :meth:`move` to 255."""
        return await self.move(CLOSED, fingers, speed=speed, force=force, timeout=timeout)

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

        Too few contacts are a result and not an error. For the rest see :meth:`RobotiqHand.grasp`.

        Args:
            fingers: mask of the axes that close.
            at_least: contacts that make a grasp, 1..as many as there are axes; None for all of them.
            speed: new speed of these axes; None leaves it.
            force: new force of these axes; None leaves it.
            timeout: seconds; None for twice the expected time plus 2 s.

        Raises:
            TypeError, ValueError: an argument of the wrong type or outside its range; nothing is sent.
            RobotiqError: as :meth:`move`.
        """
        axes = check_mask(fingers)
        needed = check_at_least(at_least, axes)
        return GraspResult(await self.close(axes, speed=speed, force=force, timeout=timeout), needed)

    async def hold(self, fingers: Finger | int = Finger.ALL) -> None:
        """Have axes that move stay where they are; grips stay. Returns when it is acknowledged.

        Raises:
            RobotiqError: as :meth:`set_position`.
        """
        await self._ask("hold", {"fingers": int(check_mask(fingers))}, COMMAND_S)

    async def halt(self) -> None:
        """Stop every axis now; returns when the gripper shows it. Takes no lease; asked until answered.

        If somebody else commands the gripper, that one loses the lease.

        Raises:
            NotStartedError: not started.
            ConnectionLostError: no answer within 2 s: the fingers MAY STILL MOVE. Or the gripper is not
                connected to its agent.
            RobotiqError: the agent could not stop them.
        """
        session = self._asked()
        assert self._outbox is not None
        self._outbox.clear()
        halting = session.stops.halt()
        try:
            with no_answer_as_lost_connection():
                await asyncio.shield(halting)
        except asyncio.CancelledError:
            if not halting.cancelled():
                # Nobody looks at what becomes of it any more; it goes on all the same.
                halting.add_done_callback(lambda task: task.cancelled() or task.exception())
            elif session.is_over:
                raise NotStartedError("the hand was stopped") from None
            raise

    # -- activation, faults ----------------------------------------------------------------------------

    async def activate(self) -> None:
        """Activate the gripper, if it is not active yet: its fingers MOVE. When cancelled, it goes on.

        Raises:
            RobotiqError: as for a hand of this process, or the lease or the agent was lost.
        """
        await self._ask("activate", {}, SEQUENCE_S)

    async def reset(self) -> None:
        """Reset the gripper, which lets go of what it holds; returns in RESET. When cancelled, it goes on.

        Raises:
            RobotiqError: as :meth:`activate`.
        """
        await self._ask("reset", {}, SEQUENCE_S)

    async def atr(self) -> None:
        """Release automatically: all axes open slowly. Only in FAULT; returns in ATR_DONE.

        Raises:
            RobotiqError: as :meth:`activate`.
        """
        await self._ask("atr", {}, SEQUENCE_S)

    async def recover(self, timeout: float | None = None) -> None:
        """Do whatever the present fault needs: after a major one the part DROPS and the fingers MOVE.

        Args:
            timeout: seconds for all of it; None for 90 s.

        Raises:
            RobotiqError: as :meth:`activate`.
        """
        limit = check_timeout("timeout", timeout)
        await self._ask("recover", {"timeout": limit}, SEQUENCE_S if limit is None else limit + SLACK_S)

    # -- inside ----------------------------------------------------------------------------------------

    def _refuse_unless_running(self) -> None:
        if self.state not in RUNNING:
            status = None if self._session is None else self._session.mirror.status
            raise refusal(Trigger.ASK_COMMAND, self.state, status)

    async def _ask(self, name: str, arguments: Fields, timeout: float) -> Fields:
        """Have the agent's hand do something; when nobody waits for it any more, the agent calls it off."""
        session, outbox = self._asked(), self._outbox
        assert outbox is not None
        if self._control is None and not session.keeper.is_in_control and session.keeper.lost is None:
            with no_answer_as_lost_connection():
                await session.keeper.acquire()
        session.check_control()
        outbox.flush()
        call = session.call(arguments)
        try:
            with (
                no_answer_as_lost_connection(),
                outbox.motion() if name in ("move", "set_position") else nullcontext(),
            ):
                value: Fields = await session.send(
                    call, f"cmd/{name}", timeout=timeout, urgency=Urgency.COMMAND
                )
        except (asyncio.CancelledError, RobotiqConnectionError, NotAllowedError):
            # Also when an answer came that tells nothing of what became of it.
            cancelling = session.stops.call_off(name, call)
            if cancelling is not None and name in ("move", "set_position"):
                outbox.count_motion(cancelling)
            raise
        return value
