"""Halting one gripper of a fleet, without a lease: repeated until answered."""

from __future__ import annotations

import secrets
from itertools import count
from typing import Final

from ..values.errors import AgentError, RobotiqError
from .network.bus import Bus, Reply, Urgency
from .remote.pending_request import is_refusal
from .remote.persistence import HALT_S, until_answered
from .remote.requests import NoAnswerError, label
from .wire.envelope import Call, unpack_answer
from .wire.names import GripperName

STOPPED: Final = "stopped"


async def halt(bus: Bus, name: GripperName, agents: int) -> str:
    """Halt a gripper; returns "stopped", or "no answer" or "refused" with the reason. Raises no such error.

    Args:
        bus: an open session.
        name: the gripper.
        agents: number of agents that serve it: all of them must confirm that it has stopped.
    """
    client, numbers = secrets.token_hex(8), count(1)

    async def attempt(left: float) -> None:
        call = Call(name.base, client, number=next(numbers), arguments={"label": label()})
        confirmed: set[int] = set()

        def decides(reply: Reply) -> bool:
            if is_refusal(reply):
                return True
            answer = unpack_answer(reply.payload)
            if (answer.to, answer.number) == (call.to, call.number):
                confirmed.add(answer.epoch)
            return False

        reply = await bus.ask(
            name.key("halt"), call.pack(), timeout=left, urgency=Urgency.STOP, decides=decides
        )
        if reply is None:
            raise NoAnswerError("no answer")
        answer = unpack_answer(reply.payload)
        if answer.to != name.base or answer.number != call.number:
            raise AgentError("the answer to another request")
        answer.outcome(lambda stamp: stamp)
        if len(confirmed) < agents:
            raise NoAnswerError(f"no answer from {agents - len(confirmed)} of {agents} agents")

    try:
        await until_answered(attempt, HALT_S)
    except NoAnswerError as error:
        return str(error)
    except (RobotiqError, TypeError, ValueError) as error:
        return f"refused: {error}"
    return STOPPED
