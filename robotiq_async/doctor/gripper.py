"""A gripper that this host reaches: name, port, Modbus, rate, activation, fault, other clients.

It only reads: nothing is written, nothing moves, and other clients of the gripper are not disturbed.
"""

from __future__ import annotations

import asyncio
import math
from dataclasses import replace
from typing import Final

from ..enums import Severity
from ..errors import ConnectFailedError, ProtocolError, ResponseTimeoutError, RobotiqConnectionError
from ..link.address import Address
from ..link.host_names import addresses_of
from ..link.modbus import ModbusTransport
from ..link.sim_transport import SimulatedTransport, new_gripper
from ..link.transport import Transport
from ..session.options import LONGEST_RESPONSE_S, POLL_INTERVAL_S, SERIAL_POLL_INTERVAL_S, registers_of
from ..session.statistics import percentile
from ..wire.registers import RTU_REGISTERS, TCP_REGISTERS, RegisterMap
from ..wire.status import RobotiqStatus
from .findings import Finding, GiveUpError, Level, Report
from .serial_line import report_adapter, report_damage

REACH_S: Final = 3.0
"""Timeout for resolving the name, and for connecting to the port."""
ANSWER_S: Final = 0.5
PROBES: Final = 300
"""Reads from which round trip and rate are determined."""
WATCH_S: Final = 2.0
"""How long to watch for another client."""
TRIES: Final = 3
"""Attempts with the usual unit id and registers, before others are tried."""
UNITS: Final = (2, 9, 1, 0, 255)
"""Unit ids that are tried when the usual one does not answer; on a serial line nobody has the last two."""


async def examine(address: Address, report: Report, *, device_id: int | None = None) -> None:
    """Examine a connection; reports each finding at once, and never raises for a bad one.

    Args:
        address: the gripper.
        report: called with each finding.
        device_id: Modbus unit id; None for the usual one.

    Raises:
        ValueError: a unit id that no unit on such a link can have.
    """
    registers = registers_of(address, device_id=device_id)
    try:
        if address.is_socket:
            await _reach(address, report)
        link = await _answer(address, registers, report)
        try:
            if address.kind == "rtu":
                report_adapter(address, report)
            await _timing(link, SERIAL_POLL_INTERVAL_S if address.is_rtu else POLL_INTERVAL_S, report)
            report_state(RobotiqStatus.from_registers(await link.read()), report)
            await _others(link, report)
        finally:
            await link.close()
    except GiveUpError:
        pass
    except RobotiqConnectionError as error:
        advice = "Look at cable, switch and power; something between here and the gripper drops packets."
        report(Finding(Level.BAD, "link", f"lost during the examination: {error}", advice))


async def _reach(address: Address, report: Report) -> None:
    """Resolve the name and connect to the port."""
    try:
        async with asyncio.timeout(REACH_S):
            found = await addresses_of(address.host, address.port)
    except (OSError, UnicodeError, TimeoutError) as error:
        why = "no answer" if isinstance(error, TimeoutError) else getattr(error, "strerror", None) or error
        advice = "Check the spelling, or use the IP address (shipped as 192.168.1.11)."
        report(Finding(Level.BAD, "name", f"{address.host} cannot be resolved: {why}", advice))
        raise GiveUpError from error
    report(Finding(Level.GOOD, "name", f"{address.host} is {', '.join(found)}"))
    try:
        async with asyncio.timeout(REACH_S):
            await _knock(found, address.port)
    except TimeoutError as error:
        advice = "Is it switched on, on this network, in this subnet? A firewall may drop the packets."
        report(Finding(Level.BAD, "port", f"{address.port} does not answer within {REACH_S:g} s", advice))
        raise GiveUpError from error
    except OSError as error:
        advice = "The host is up, but nothing listens on this port: is it the right address and port?"
        if not isinstance(error, ConnectionRefusedError):
            advice = "There is no way to it: check cable, IP address and subnet mask of this computer."
        report(Finding(Level.BAD, "port", f"{address.port}: {error.strerror or error}", advice))
        raise GiveUpError from error
    report(Finding(Level.GOOD, "port", f"{address.port} is open"))


async def _knock(hosts: list[str], port: int) -> None:
    """Connect to the first that can be reached, and hang up.

    Raises:
        OSError: none can be; why not the last.
    """
    failure: OSError | None = None
    for host in hosts:
        try:
            _, writer = await asyncio.open_connection(host, port)
        except OSError as error:
            failure = error
        else:
            writer.close()
            return
    raise failure or OSError("there is no address")


async def _answer(address: Address, usual: RegisterMap, report: Report) -> Transport:
    """A link that answers: the usual unit id and registers first, then others."""
    first: RobotiqConnectionError | None = None
    for tries, registers in enumerate(_candidates(address, usual), 1):
        link = _link(address, registers)
        try:
            await link.open()
            status = RobotiqStatus.from_registers(await link.read())
        except ConnectFailedError as error:
            await link.close()
            report(Finding(Level.BAD, "open", error.args[0], _advice_for_opening(address, str(error))))
            raise GiveUpError from error
        except RobotiqConnectionError as error:
            await link.close()
            first = first or error
            continue
        except BaseException:
            await link.close()
            raise
        _report_answer(usual, registers, tries, report)
        _report_doubts(status, report)
        return link
    assert first is not None
    if isinstance(first, ResponseTimeoutError):
        link = _link(address, usual, LONGEST_RESPONSE_S)
        if (took := await _seconds_to_answer(link)) is not None:
            enough = min(LONGEST_RESPONSE_S, math.ceil(20 * took) / 10)
            advice = f"Pass response_timeout={enough:g}; a write, and a stop, take as long."
            report(Finding(Level.DOUBT, "Modbus", f"answers, after {took:.1f} s", advice))
            return link
    advice = await _other_frames(address) or _advice_for_silence(first)
    report(Finding(Level.BAD, "Modbus", str(first), advice))
    raise GiveUpError


async def _seconds_to_answer(link: Transport) -> float | None:
    """How long a link takes to answer, and leave it open; None, and closed, if it does not answer."""
    loop = asyncio.get_running_loop()
    try:
        await link.open()
        asked = loop.time()
        await link.read()
    except RobotiqConnectionError:
        return None
    except BaseException:
        await link.close()
        raise
    return loop.time() - asked


async def _other_frames(address: Address) -> str:
    """What to do if a socket speaks the other kind of frames: those of a serial line, or of Modbus TCP."""
    if not address.is_socket:
        return ""
    other = replace(address, kind="tcp" if address.is_rtu else "rtu+tcp")
    link = _link(other, registers_of(other))
    answers = await _seconds_to_answer(link) is not None
    await link.close()
    return f"The frames there are others: write the address as {other}." if answers else ""


def _candidates(address: Address, usual: RegisterMap) -> list[RegisterMap]:
    """What to try: the usual several times, for replies get lost; then other units, other registers."""
    if address.kind == "sim":
        return [usual]
    units = UNITS[:-2] if address.is_rtu else UNITS
    others = [replace(usual, read_function=7 - usual.read_function)]
    others += [replace(usual, device_id=unit) for unit in units]
    for kind in (RTU_REGISTERS, TCP_REGISTERS):
        for function in dict.fromkeys((usual.read_function, 3, 4)):
            moved = replace(usual, request=kind.request, status=kind.status, read_function=function)
            others += [replace(moved, device_id=unit) for unit in dict.fromkeys((usual.device_id, *units))]
    return [usual] * TRIES + [each for each in dict.fromkeys(others) if each != usual]


def _link(address: Address, registers: RegisterMap, response_timeout: float = ANSWER_S) -> Transport:
    if address.kind == "sim":
        gripper = new_gripper(address.simulation)
        return SimulatedTransport(gripper, registers, connect_timeout=REACH_S, response_timeout=ANSWER_S)
    return ModbusTransport(address, registers, connect_timeout=REACH_S, response_timeout=response_timeout)


def _report_answer(usual: RegisterMap, found: RegisterMap, tries: int, report: Report) -> None:
    answers = Finding(Level.GOOD, "Modbus", "answers")
    if found == usual and tries > 1:
        advice = "Replies get lost or damaged: look at cable and switch, and for another client."
        answers = Finding(Level.DOUBT, "Modbus", f"answers when asked {tries} times", advice)
    report(answers)
    unit = Finding(Level.GOOD, "unit id", str(found.device_id))
    if found.device_id != usual.device_id:
        advice = f"Pass device_id={found.device_id}, or --device-id {found.device_id}."
        unit = Finding(Level.DOUBT, "unit id", f"{found.device_id}, and not {usual.device_id}", advice)
    report(unit)
    at = f"status at {found.status}, requests at {found.request}, function {found.read_function}"
    options = {
        "request_address": (found.request, usual.request),
        "status_address": (found.status, usual.status),
        "read_function": (found.read_function, usual.read_function),
    }
    given = [f"{name}={value}" for name, (value, as_usual) in options.items() if value != as_usual]
    where = Finding(Level.GOOD, "registers", at)
    if given:
        advice = f"Pass {', '.join(given)}, or the options so called."
        if found.read_function != usual.read_function:
            advice += (
                " What this function reads may be the requests: see that status shows what the gripper does."
            )
        where = Finding(Level.DOUBT, "registers", f"{at}: unusual on this kind of link", advice)
    report(where)


def _report_doubts(status: RobotiqStatus, report: Report) -> None:
    """Doubt that what answers is a gripper at all."""
    if len(set(status.registers)) == 1:
        found = f"all registers read {status.registers[0]}, which those of a gripper never do"
        advice = "The gripper behind the fieldbus may be without power, or this is another device."
        report(Finding(Level.DOUBT, "gripper", found, advice))


def _advice_for_opening(address: Address, why: str) -> str:
    if "pip install" in why:
        return "Install that, and look again."
    if address.kind == "rtu":
        return (
            "ls -l /dev/ttyUSB* /dev/ttyACM* shows the ports and whose they are, dmesg what was plugged in."
        )
    return "It took a connection before and refuses now: it may serve one client at a time. Stop the other."


def _advice_for_silence(error: RobotiqConnectionError) -> str:
    if isinstance(error, ResponseTimeoutError):
        return "Connected, but no unit answers: another device, or the gripper's fieldbus is not Modbus."
    if isinstance(error, ProtocolError):
        return "What answers is not this gripper: it has its registers elsewhere, or does not speak Modbus."
    return "It hangs up when asked: it may serve one client at a time, or not speak Modbus."


async def _timing(link: Transport, interval: float, report: Report) -> None:
    """Round trip, and the rate of reads that it allows; ``interval`` is the usual one on such a link."""
    loop = asyncio.get_running_loop()
    times, began = [], loop.time()
    for _ in range(PROBES):
        asked = loop.time()
        await link.read()
        times.append(loop.time() - asked)
        if loop.time() - began > WATCH_S:
            break
    rate = len(times) / (loop.time() - began)
    times.sort()
    p50, p99 = percentile(times, 0.5), percentile(times, 0.99)
    found = f"{1000 * p50:.1f} ms, 99th percentile {1000 * p99:.1f} ms"
    if p99 < interval:
        report(Finding(Level.GOOD, "round trip", found))
    else:
        hertz = f"{1 / interval:.0f} Hz"
        advice = f"Too slow for {hertz} at times: use a wired network, or a larger poll_interval."
        report(Finding(Level.DOUBT, "round trip", found, advice))
    report_damage(link, len(times), report)
    enough = rate >= 1 / interval
    advice = "" if enough else f"Pass poll_interval={max(0.01, math.ceil(100 / rate) / 100):g}."
    report(Finding(Level.GOOD if enough else Level.DOUBT, "rate", f"up to {rate:.0f} reads a second", advice))


def report_state(status: RobotiqStatus, report: Report) -> None:
    """Activation and fault."""
    if status.is_activated:
        report(Finding(Level.GOOD, "activation", "active"))
    elif status.activation_echo:
        report(Finding(Level.DOUBT, "activation", "under way, or ended in a fault", "Wait, and look again."))
    else:
        advice = "activate() or start() activates it; the fingers MOVE then."
        report(Finding(Level.GOOD, "activation", "not active", advice))
    fault = status.fault
    found = f"0x{int(fault):02X} {fault.name}: {fault.description}"
    match fault.severity:
        case Severity.NONE:
            report(Finding(Level.GOOD, "fault", "none"))
        case Severity.PRIORITY:
            report(Finding(Level.GOOD, "fault", found, "This is a hint and not a failure."))
        case Severity.MINOR:
            report(Finding(Level.DOUBT, "fault", found, "It may clear by itself; recover() waits for that."))
        case Severity.MAJOR:
            advice = "recover() resets and activates: the part DROPS and the fingers MOVE."
            report(Finding(Level.BAD, "fault", found, advice))


async def _others(link: Transport, report: Report) -> None:
    """Whether the requests change although this program writes none."""
    loop = asyncio.get_running_loop()
    until, seen = loop.time() + WATCH_S, set()
    while loop.time() < until:
        seen.add(RobotiqStatus.from_registers(await link.read()).echo)
        await asyncio.sleep(0.01)
    if len(seen) == 1:
        found = f"no request changed within {WATCH_S:g} s: none seen to write, unless always the same"
        report(Finding(Level.GOOD, "other clients", found))
    else:
        found = f"the requests changed within {WATCH_S:g} s, to {len(seen) - 1} others"
        advice = "Another program commands the gripper. Two that do so disturb each other: stop one."
        report(Finding(Level.DOUBT, "other clients", found, advice))
