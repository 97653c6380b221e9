"""Tries what must fail: commands without the lease, under another run of the agent, without the right.

What is asked for is to hold none of the axes: an agent that carried it out would move nothing, and end
nobody's lease.
"""

from __future__ import annotations

from typing import Final

from ...fleet.keys.access_list import Role
from ...fleet.network.bus import Bus
from ...fleet.remote.requests import NoAnswerError
from ...fleet.wire.names import GripperName
from ...fleet.wire.values import Fields
from ...values.errors import AgentError, ControlLostError, NotAllowedError, RobotiqError
from .agent import Asker
from .findings import Finding, Level, Report

HARMLESS: Final = {"fingers": 0}


async def try_what_must_fail(
    name: GripperName, bus: Bus, info: Fields, role: Role | None, report: Report
) -> None:
    """Try to command without the lease, and for another run of the agent.

    Args:
        name: of the gripper.
        bus: an open session.
        info: what the agent has said; its epoch and its time.
        role: what the certificate shown is for; None without one.
        report: called with each finding.
    """
    asker = Asker(name, bus)
    outcome = await _try(asker, info["epoch"], info["stamp"])
    if role in (Role.READ, Role.HALT):
        assert role is not None
        _report_role(outcome, role, report)
        return
    _report_lease(outcome, report)
    if isinstance(outcome, ControlLostError):
        _report_epoch(await _try(asker, info["epoch"] + 1, info["stamp"]), report)


async def _try(asker: Asker, epoch: int, seen: float) -> Exception | None:
    """What comes of it; None if it was carried out."""
    try:
        await asker.ask("cmd/hold", epoch=epoch, seen=seen, arguments=HARMLESS)
    except (RobotiqError, TypeError, ValueError) as error:
        return error
    return None


def _report_role(outcome: Exception | None, role: Role, report: Report) -> None:
    """Access rules say nothing at all."""
    if isinstance(outcome, NotAllowedError | NoAnswerError):
        report(
            Finding(Level.GOOD, "commands", f"not let in with a certificate to {role.value}, as it must be")
        )
    else:
        found = f"a command came through with a certificate to {role.value}: {outcome or 'carried out'}"
        advice = "The agent's access list has this name as one that operates, or a router has no rules."
        report(Finding(Level.BAD, "commands", found, advice))


def _report_lease(outcome: Exception | None, report: Report) -> None:
    if isinstance(outcome, ControlLostError):
        report(Finding(Level.GOOD, "no lease", "commands are refused without one, as they must be"))
    elif isinstance(outcome, NotAllowedError | NoAnswerError):
        found = "no command is answered: this client may not command"
        advice = (
            "Is that meant? Else put the name into operate in the agent's access.toml, and start it anew."
        )
        report(Finding(Level.DOUBT, "commands", found, advice))
    else:
        found = f"a command without the lease was not refused: {outcome or 'carried out'}"
        advice = "That is a mistake in the agent: stop it, and do not work near the fingers."
        report(Finding(Level.BAD, "no lease", found, advice))


def _report_epoch(outcome: Exception | None, report: Report) -> None:
    if isinstance(outcome, AgentError):
        report(Finding(Level.GOOD, "another run", "what was asked of another run of the agent is refused"))
    else:
        found = f"a command for another run of the agent was not refused as such: {outcome or 'carried out'}"
        advice = "That is a mistake in the agent: stop it, and do not work near the fingers."
        report(Finding(Level.BAD, "another run", found, advice))
