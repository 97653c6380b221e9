"""Opens the text port of a URCap, and reports the likely cause when it does not answer."""

from __future__ import annotations

from typing import Final

from ...link import URCAP_PORT, Address, Link, UrcapTransport
from ...values import (
    ConnectFailedError,
    ConnectionLostError,
    ResponseTimeoutError,
    RobotiqConnectionError,
    RobotiqStatus,
)
from .answer import ANSWER_S, REACH_S, no_connection, report_silence
from .findings import Finding, GiveUpError, Level, ReportFinding

ABSENT: Final = (
    "The host is up, but nothing listens on this port. Is Robotiq's URCap installed on this UR, its gripper "
    "set up in the installation, and the controller booted? Without that URCap, forward the tool's RS-485: "
    "rtu+tcp://HOST:54321."
)


async def find_urcap(address: Address, gripper: int | None, report: ReportFinding) -> Link:
    """An open link to the gripper behind a URCap; ``gripper`` is the one to choose, None for the URCap's."""
    link = UrcapTransport(address, gripper, connect_timeout=REACH_S, response_timeout=ANSWER_S)
    try:
        await link.open()
        status = RobotiqStatus(await link.read())
    except ConnectFailedError as error:
        await link.close()
        report(_no_connection(address, error))
        raise GiveUpError from error
    except RobotiqConnectionError as error:
        await link.close()
        report(Finding(Level.GOOD, "port", f"{address.port} is open"))
        report(Finding(Level.BAD, "URCap", str(error), _advice(error)))
        raise GiveUpError from error
    report(Finding(Level.GOOD, "port", f"{address.port} is open"))
    report(Finding(Level.GOOD, "URCap", "answers"))
    if gripper is not None:
        report(Finding(Level.GOOD, "gripper id", f"{gripper} was chosen"))
    current = "COU" if link.has_current else "none: this port does not tell the motor's current"
    report(Finding(Level.GOOD, "current", current))
    report_silence(status, report)
    return link


def _no_connection(address: Address, error: ConnectFailedError) -> Finding:
    if isinstance(error.__cause__, RobotiqConnectionError):  # connected, and the gripper was not chosen
        advice = "Leave device_id out for the gripper that the URCap has, or see its ids in the installation."
        return Finding(Level.BAD, "gripper id", error.args[0], advice)
    if isinstance(error.__cause__, ConnectionRefusedError):
        usual = "" if address.port == URCAP_PORT else f" The URCap's port is {URCAP_PORT}."
        return Finding(Level.BAD, "port", f"{address.port}: {error.args[0]}", ABSENT + usual)
    return no_connection(address, error)


def _advice(error: RobotiqConnectionError) -> str:
    if isinstance(error, ResponseTimeoutError):
        return (
            "Connected, but no line comes back: the controller may be busy or booting, or another program "
            "listens there. Can the gripper be moved at the teach pendant?"
        )
    if "cannot be read" in error.message:
        return "Release the emergency stop, switch the arm on, and look at the gripper at the teach pendant."
    if isinstance(error, ConnectionLostError):
        return "It closes the connection when asked: another program listens there, or the URCap was stopped."
    return "This is not the text port of Robotiq's URCap, or an unknown version of it: report this line."
