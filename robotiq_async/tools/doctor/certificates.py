"""Checks the certificate of a client: files, dates, permissions, role."""

from __future__ import annotations

import stat
from datetime import datetime, timedelta
from pathlib import Path
from typing import Final

from ...fleet.keys.access import Role
from ...fleet.keys.key_folder import KEY, check_key_folder
from .findings import Finding, GiveUpError, Level, Report

SOON: Final = timedelta(days=30)
_MAY: Final = {
    Role.READ: "may watch",
    Role.HALT: "may watch and halt",
    Role.OPERATE: "may watch, halt and command",
}
_NEW: Final = "The owner of the authority can make a new one: robotiq-async fleet keys."


def examine_keys(folder: Path, report: Report, *, now: datetime) -> None:
    """Examine a folder of keys.

    Args:
        folder: of a client.
        report: called with each finding.
        now: the current time.

    Raises:
        GiveUpError: the certificate cannot be used.
    """
    # Needs the extra fleet. The folder of keys may come from another machine.
    from ...fleet.keys.credentials import read_credentials  # noqa: PLC0415

    try:
        found = read_credentials(check_key_folder(folder))
    except (OSError, ValueError) as error:
        advice = "Copy the folder again from the machine where robotiq-async fleet keys made it."
        report(Finding(Level.BAD, "certificate", f"{folder}: {error}", advice))
        raise GiveUpError from error
    _report_dates(found.begins, found.ends, now, report)
    _report_mode(folder / KEY, report)
    _report_role(found.common_name, found.role, report)


def _report_dates(begins: datetime, ends: datetime, now: datetime, report: Report) -> None:
    if now < begins:
        found = f"holds from {begins:%Y-%m-%d} on, and here it is {now:%Y-%m-%d}"
        report(Finding(Level.BAD, "certificate", found, "Set the clock of this machine."))
        raise GiveUpError
    if now > ends:
        report(Finding(Level.BAD, "certificate", f"ended on {ends:%Y-%m-%d}", _NEW))
        raise GiveUpError
    if ends - now < SOON:
        report(Finding(Level.DOUBT, "certificate", f"ends on {ends:%Y-%m-%d}", _NEW))
    else:
        report(Finding(Level.GOOD, "certificate", f"holds until {ends:%Y-%m-%d}"))


def _report_mode(key: Path, report: Report) -> None:
    if stat.S_IMODE(key.stat().st_mode) & (stat.S_IRWXG | stat.S_IRWXO) and stat.S_ISREG(key.stat().st_mode):
        advice = f"chmod 600 {key}"
        report(Finding(Level.DOUBT, "private key", "others on this machine may read or write it", advice))


def _report_role(common_name: str, role: Role | None, report: Report) -> None:
    if role in _MAY:
        assert role is not None
        report(Finding(Level.GOOD, "role", f"{common_name}: {_MAY[role]}, if the agent's list has it"))
    elif role is Role.AGENT:
        advice = "Name the folder of a client: read-, halt- or operate-NAME."
        report(Finding(Level.BAD, "role", f"{common_name}: an agent's, who is no client", advice))
    else:
        found = f"{common_name!r}: it names no role, so the agent's own rules decide what it may do"
        advice = "Is it of an authority of your own? The command fleet keys writes ROLE:NAME."
        report(Finding(Level.DOUBT, "role", found, advice))
