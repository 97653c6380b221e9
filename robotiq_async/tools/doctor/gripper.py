"""A gripper that this host reaches: name, port, Modbus or URCap, rate, activation, fault, other clients.

It only reads, as one client with one connection at a time: nothing is written and nothing moves.
"""

from __future__ import annotations

import asyncio
import math
from pathlib import Path
from typing import Final

from ...hands import POLL_INTERVAL_S, RESPONSE_TIMEOUT_S, percentile
from ...link import USB_SERIAL, Address, Link, ModbusTransport, latency_file, latency_timer, registers_of
from ...runtime import addresses_of
from ...values import (
    MODELS,
    ConnectionLostError,
    Model,
    Registers,
    RobotiqConnectionError,
    RobotiqStatus,
    Severity,
    contradiction,
    model_of,
    names_that_fit,
)
from .answer import DAMAGED, LOST_PORT, REACH_S, find_gripper, long_enough
from .findings import Finding, GiveUpError, Level, ReportFinding
from .urcap import find_urcap

LINK_PROBES: Final = 300  # reads for measuring round trip and rate
WATCH_S: Final = 2.0  # seconds of watching for another client
LONGEST_PERIOD_S: Final = 0.1  # the longest poll_interval of a hand


async def examine(address: Address, report: ReportFinding, *, device_id: int | None = None) -> None:
    """Examine a connection; reports each finding at once, and never raises for a bad one.

    ``device_id`` is the Modbus unit id, or the gripper of a URCap; None for the usual one.

    Raises:
        ValueError: a unit id that is not valid on such a link.
    """
    registers, model = registers_of(address, device_id=device_id), model_of(address.model)
    try:
        if address.is_socket:
            await _resolve(address, report)
        if address.kind == "urcap":
            link = await find_urcap(address, device_id, report)
        else:
            link, _ = await find_gripper(address, registers, report)
        try:
            if address.kind == "rtu":
                report_adapter(address, report)
            await _timing(address, link, report)
            _check_model(model, await link.read(), report)
            report_state(RobotiqStatus.from_registers(await link.read(), model=model), report)
            await _others(link, report)
        finally:
            await link.close()
    except GiveUpError:
        pass
    except RobotiqConnectionError as error:
        advice = _advice_for_a_loss(address, error)
        report(Finding(Level.BAD, "link", f"lost during the examination: {error}", advice))


def _advice_for_a_loss(address: Address, error: RobotiqConnectionError) -> str:
    if isinstance(error, ConnectionLostError):
        closed = "It closed the connection: it serves one client and another came, or it lost power."
        return LOST_PORT if address.kind == "rtu" else closed
    if address.is_rtu:
        return f"{DAMAGED} A second master on the line does that, too, and so does a gripper without power."
    return "Check cable, switch and power: something on the way to the gripper drops packets."


def _check_model(model: Model, registers: Registers, report: ReportFinding) -> None:
    """Report registers that only another model can have."""
    if not (why := contradiction(model, registers)):
        if any(registers):  # a gateway may send zeros before its gripper answers
            alike = [each.title for each in MODELS.values() if not contradiction(each, registers)]
            rest = f"; the registers do not say which: taken as a {model.title}" if len(alike) > 1 else ""
            report(Finding(Level.GOOD, "model", f"a {' or a '.join(alike)}{rest}"))
        return
    advice = f"{names_that_fit(registers).capitalize()}."
    report(Finding(Level.BAD, "model", f"this is no {model.title}: its registers show {why}", advice))
    raise GiveUpError


async def _resolve(address: Address, report: ReportFinding) -> None:
    try:
        async with asyncio.timeout(REACH_S):
            found = await addresses_of(address.host, address.port)
    except (OSError, UnicodeError, TimeoutError) as error:
        why = "no answer" if isinstance(error, TimeoutError) else getattr(error, "strerror", None) or error
        advice = "Check the spelling, or use the IP address (shipped as 192.168.1.11)."
        report(Finding(Level.BAD, "name", f"{address.host} cannot be resolved: {why}", advice))
        raise GiveUpError from error
    report(Finding(Level.GOOD, "name", f"{address.host} is {', '.join(found)}"))


async def _timing(address: Address, link: Link, report: ReportFinding) -> None:
    loop = asyncio.get_running_loop()
    times, began = [], loop.time()
    for _ in range(LINK_PROBES):
        asked = loop.time()
        await link.read()
        times.append(loop.time() - asked)
        if loop.time() - began > WATCH_S:
            break
    rate = len(times) / (loop.time() - began)
    times.sort()
    p50, p99 = percentile(times, 0.5), percentile(times, 0.99)
    found = f"{1000 * p50:.1f} ms, 99th percentile {1000 * p99:.1f} ms"
    if p99 < POLL_INTERVAL_S:
        report(Finding(Level.GOOD, "round trip", found))
    else:
        hertz = f"{1 / POLL_INTERVAL_S:.0f} Hz"
        what = "see what is said about adapter and line" if address.kind == "rtu" else "use a wired network"
        advice = f"Too slow for {hertz} at times: {what}, or pass a larger poll_interval."
        if p99 > RESPONSE_TIMEOUT_S / 2:
            advice = f"Pass response_timeout={long_enough(p99):g}; a write, and a stop, take as long."
        report(Finding(Level.DOUBT, "round trip", found, advice))
    report_damage(link, len(times), report)
    report(_rate(rate))


def _rate(rate: float) -> Finding:
    found = f"up to {rate:.0f} reads a second" if rate >= 10 else f"up to {rate:.1f} reads a second"
    period = max(0.01, math.ceil(100 / rate) / 100)
    if rate >= 1 / POLL_INTERVAL_S:
        return Finding(Level.GOOD, "rate", found)
    if period <= LONGEST_PERIOD_S:
        return Finding(Level.DOUBT, "rate", found, f"Pass poll_interval={period:g}.")
    advice = f"No poll_interval is that long (at most {LONGEST_PERIOD_S:g} s): statuses will come late."
    return Finding(Level.DOUBT, "rate", found, advice)


def report_state(status: RobotiqStatus, report: ReportFinding) -> None:
    """Report activation and fault."""
    if status.is_activated:
        report(Finding(Level.GOOD, "activation", "active"))
    elif status.activation_echo and status.is_reset and not status.fault.is_serious:
        found = "gACT is 1 and gIMC 0: it is about to activate, or has lost its activation"
        advice = (
            "Run doctor again. If it stays so, only a reset helps: start() and recover() reset and activate "
            "it; the part DROPS and the fingers MOVE."
        )
        report(Finding(Level.DOUBT, "activation", found, advice))
    elif status.activation_echo:
        report(
            Finding(
                Level.DOUBT, "activation", "not finished, or ended in a fault", "Wait, and run doctor again."
            )
        )
    else:
        advice = "activate() or start() activates it; the fingers MOVE then."
        report(Finding(Level.GOOD, "activation", "not active", advice))
    if status.controller_fault:
        advice = "Look at the controller first: emergency stop, 24 V, the cable to the gripper."
        report(Finding(Level.BAD, "controller", status.controller_fault_text, advice))
    fault = status.fault
    found = f"0x{int(fault):02X} {fault.name}: {fault.description}"
    match fault.severity:
        case Severity.NONE:
            report(Finding(Level.GOOD, "fault", "none"))
        case Severity.PRIORITY:
            report(Finding(Level.GOOD, "fault", found, "This is a hint, not a failure."))
        case Severity.MINOR:
            report(Finding(Level.DOUBT, "fault", found, "It may clear on its own; recover() waits for that."))
        case Severity.MAJOR:
            advice = "recover() resets and activates: the part DROPS and the fingers MOVE."
            report(Finding(Level.BAD, "fault", found, advice))


async def _others(link: Link, report: ReportFinding) -> None:
    loop = asyncio.get_running_loop()
    until, seen = loop.time() + WATCH_S, set()
    while loop.time() < until:
        seen.add(RobotiqStatus.from_registers(await link.read()).echo)
        await asyncio.sleep(0.01)
    if len(seen) == 1:
        found = (
            f"no request changed within {WATCH_S:g} s: no other client seen, unless it repeats one request"
        )
        report(Finding(Level.GOOD, "other clients", found))
    else:
        found = f"the requests changed within {WATCH_S:g} s, to {len(seen) - 1} others"
        advice = "Another program commands the gripper. Two programs that do so disturb each other: stop one."
        report(Finding(Level.DOUBT, "other clients", found, advice))


LATENCY_MS: Final = 2  # an adapter that keeps bytes for longer delays every read; a hand sets 1 ms


def report_adapter(address: Address, report: ReportFinding, folder: Path = USB_SERIAL) -> None:
    """Report the latency timer of the USB adapter, if it has one. The port is open."""
    kept = latency_timer(address.host, folder)
    if kept is None:
        return
    found = f"passes on received bytes after {kept} ms"
    if kept <= LATENCY_MS:
        report(Finding(Level.GOOD, "adapter", found))
    else:
        file = latency_file(address.host, folder)
        advice = (
            f"To change it: echo 1 | sudo tee {file}, or permanently a udev rule: "
            'ACTION=="add", SUBSYSTEM=="usb-serial", DRIVER=="ftdi_sio", ATTR{latency_timer}="1".'
        )
        report(Finding(Level.DOUBT, "adapter", f"{found}, which delays every read", advice))


def report_damage(link: Link, reads: int, report: ReportFinding) -> None:
    """Report reads that had to be repeated."""
    repeats = link.dialogues.repeats if isinstance(link, ModbusTransport) else 0
    if repeats:
        found = f"{repeats} of {reads} reads had to be repeated: answers get lost or damaged"
        advice = "Check cable, shield, ground and termination; a few are usual with USB adapters."
        report(Finding(Level.DOUBT, "line", found, advice))
