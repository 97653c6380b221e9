"""Finds the gripper, and decides whether the run may write to it. Only reads."""

from __future__ import annotations

import asyncio
from typing import Final

from ...hands import POLL_INTERVAL_S
from ...link import registers_of
from ...values import Fault, RobotiqStatus, contradiction, names_that_fit, why_stranger
from ..doctor.answer import STRANGER, find_gripper
from ..doctor.findings import Finding, GiveUpError
from ..doctor.urcap import find_urcap
from .bench import Bench
from .catalogue import URCAP, EndError
from .watch import LASTING, describe

WATCH_S: Final = 2.0  # seconds of watching for another client, and for motion
STILL_COUNTS: Final = 1


async def find(bench: Bench) -> None:
    """Find the gripper, and open the link to it."""
    findings: list[Finding] = []
    try:
        if bench.address.kind == URCAP:
            link, registers = await find_urcap(bench.address, None, findings.append), None
        else:
            link, registers = await find_gripper(bench.address, registers_of(bench.address), findings.append)
    except GiveUpError:
        last = findings[-1]
        end = "" if last.found.endswith("?") else "."
        # A stranger answers; in all other cases nothing does.
        why = "refused" if last.what == STRANGER else "link"
        raise EndError(why, f"{last.what}: {last.found}{end} {last.advice}") from None
    await link.close()
    bench.found_at(registers)
    await asyncio.sleep(0.5)  # for a gateway that serves one client to see that the other has gone
    await bench.link.open()
    statuses = [await bench.link.read() for _ in range(LASTING)]
    bench.first_seen(statuses[-1])
    strange = [why for status in statuses if (why := why_no_gripper(status))]
    if strange:
        raise EndError("refused", f"another device may be answering: {strange[0]}")


def why_no_gripper(status: RobotiqStatus) -> str:
    """The reason why this status is not from a gripper of the model; empty if it may be from one."""
    words = " ".join(f"{word:04X}" for word in status.registers)
    if not any(status.registers):
        return "all registers read 0; the gripper behind the fieldbus may have no power"
    if why := why_stranger(status.registers):
        return why
    if shown := contradiction(status.model, status.registers):
        how = names_that_fit(status.registers)
        return f"this is no {status.model.title}: its registers show {shown}; {how}"
    if status.fault.name.startswith("UNKNOWN"):
        return f"a fault code that is not in the manual: {words}"
    if not status.activation_echo and not status.is_reset:
        return f"gIMC says active or activating while gACT is 0: {words}"
    axes = status.model.axes
    values = {read(axis) for axis in axes for read in (status.position, status.requested_position)}
    if len(axes) > 1 and len(values) == 1:
        return f"every position and every request read the same: {words}"
    return ""


async def check_before_writing(bench: Bench) -> RobotiqStatus:
    """End the run unless the gripper may be written to; returns the newest status."""
    loop, first = asyncio.get_running_loop(), await bench.link.read()
    until, not_ready, last = loop.time() + WATCH_S, 0, first
    interval = bench.lengths.interval or 2 * POLL_INTERVAL_S
    while loop.time() < until:
        await asyncio.sleep(interval)
        last = await bench.link.read()
        if why := why_no_gripper(last):
            raise EndError("refused", f"another device may be answering: {why}")
        if last.echo != first.echo:
            raise EndError(
                "refused", "another client commands the gripper: its requests change. Stop that client."
            )
        if any(abs(last.position(axis) - first.position(axis)) > STILL_COUNTS for axis in last.model.axes):
            raise EndError("refused", "the fingers move: wait until they rest, and find the cause")
        not_ready = not_ready + 1 if last.fault is Fault.COMMUNICATION_NOT_READY else 0
    bench.link.expect(last.echo)
    _check_rest(last, not_ready)
    return last


def _check_rest(status: RobotiqStatus, not_ready: int) -> None:
    fault = status.fault
    passes = fault is Fault.COMMUNICATION_NOT_READY and not_ready < LASTING
    if fault.is_serious and not passes:
        raise EndError("refused", f"the gripper reports fault 0x{int(fault):02X}: {fault.description}")
    if status.is_activated and status.contacts:
        held = f"{status.contacts} reads a contact: the gripper holds something"
        raise EndError("refused", f"{held}. Open the fingers (robotiq-async move 0): it falls.")
    if status.is_moving:
        raise EndError("refused", f"an axis is moving: the gripper is {describe(status)}")
    if status.activation_echo and not status.is_activated and fault is Fault.NONE:
        raise EndError("refused", "an activation or a change of mode is under way: wait until it ends")
