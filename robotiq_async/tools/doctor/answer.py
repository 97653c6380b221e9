"""Finds the unit id and the registers that answer, and checks that a gripper answers."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final, NamedTuple

from ...hands import LONGEST_RESPONSE_S
from ...link import Address, Link, ModbusTransport, SimulatedTransport, new_gripper, registers_of
from ...values import (
    RTU_REGISTERS,
    TCP_REGISTERS,
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    RegisterMap,
    ResponseTimeoutError,
    RobotiqConnectionError,
    RobotiqStatus,
    model_of,
    why_stranger,
)
from .findings import Finding, GiveUpError, Level, ReportFinding

REACH_S: Final = 3.0  # timeout for resolving the name, and for connecting to the port
ANSWER_S: Final = 0.5
"""Timeout for a reply; the last attempt with the usual registers waits as long as a hand ever does."""
LET_GO_S: Final = 0.5
"""Pause after a failed attempt: a gateway that serves one client must notice that this one has gone."""
PROBE_TRIES: Final = (
    3  # attempts with the usual unit id and registers, before others are tried: replies get lost
)
PROBED_UNITS: Final = (2, 9, 1, 0, 255)
"""Unit ids to try when the usual one does not answer; 0 and 255 are not valid on a serial line."""
ALONE: Final = "It may serve one client at a time"
LOST_PORT: Final = (
    "Is the plug firm? fuser -v DEVICE shows who else has the port: ModemManager, brltty or a terminal."
)

NO_TUNNEL: Final = (
    "Is the arm switched on, in this network, and may clients command it? Does its own user interface move "
    "the gripper?"
)
FORWARDING: Final = (
    " Behind the forwarding of a UR, an earlier client that was cut off may still have the line: stop the "
    "forwarding in its URCap and start it again."
)
DAMAGED: Final = "Replies get lost or damaged: check cable, shield, ground and termination."


class Answering(NamedTuple):
    """A gripper that answers."""

    link: Link  # open
    registers: RegisterMap  # addresses of its registers, and its unit id


STRANGER: Final = "gripper"
"""The subject of a finding if a device answers that is no gripper."""


class _FirstReading(NamedTuple):
    """The first status on a link, which is open then."""

    link: Link
    status: RobotiqStatus
    seconds: float  # until the reply


@dataclass
class _Attempts:
    """The attempts so far, of which none has found a gripper."""

    failure: RobotiqConnectionError | None = None  # of the first that had no answer
    echoes: bool = False
    stranger: str = ""  # why a device that answered is no gripper

    def note_failure(self, error: RobotiqConnectionError, link: Link) -> None:
        self.failure = self.failure or error
        self.echoes = self.echoes or _echoes(link)

    def note_stranger(self, why: str) -> None:
        self.stranger = self.stranger or why

    async def reported(self, address: Address, report: ReportFinding) -> GiveUpError:
        """Report why none has found one; the error that ends the search."""
        if self.stranger:
            _report_stranger(self.stranger, report)
            return GiveUpError()
        assert self.failure is not None, "each attempt has failed, or has met a stranger"
        advice = await _other_frames(address) or _advice_for_silence(address, self.failure, self.echoes)
        report(Finding(Level.BAD, "Modbus", str(self.failure), advice))
        return GiveUpError()


async def find_gripper(address: Address, usual: RegisterMap, report: ReportFinding) -> Answering:
    """Find the unit id and the registers under which a gripper answers; returns an open link to it.

    It opens no extra connection to test the port, which would occupy a gateway that serves one client.
    """
    attempts = _Attempts()
    for number, (registers, patience) in enumerate(_attempts(address, usual)):
        link, reading = _link(address, registers, patience), None
        try:
            reading = await _first_reading(link)
        except ConnectFailedError as error:
            _report_no_connection(address, error, report, is_first=number == 0)
            raise GiveUpError from error
        except RobotiqConnectionError as error:
            attempts.note_failure(error, link)
        if number == 0:
            _report_port(address, report)
        if reading is None:
            await asyncio.sleep(LET_GO_S if number < PROBE_TRIES else 0)
        elif why := why_stranger(reading.status.registers):
            await link.close()
            attempts.note_stranger(why)
        elif registers != usual and (again := await _ask_again(address, usual, link)) is not None:
            # The line had lost the first requests, of any kind: nothing about this gripper is unusual.
            return _found(address, usual, again, usual, attempts.failure, number + 2, report)
        else:
            failure = attempts.failure if registers == usual else None
            return _found(address, usual, reading, registers, failure, number + 1, report)
    raise await attempts.reported(address, report)


def _found(
    address: Address,
    usual: RegisterMap,
    reading: _FirstReading,
    registers: RegisterMap,
    failure: RobotiqConnectionError | None,
    tries: int,
    report: ReportFinding,
) -> Answering:
    """Report a gripper that answers."""
    if _echoes(reading.link):
        report(Finding(Level.GOOD, "echo", "the line echoes what is sent, and the echo is dropped"))
    report(_answers(address, failure, tries, reading.seconds))
    _report_place(usual, registers, report)
    report_silence(reading.status, report)
    return Answering(reading.link, registers)


async def _ask_again(address: Address, usual: RegisterMap, other: Link) -> _FirstReading | None:
    """Read with the usual unit id and registers again; None if only ``other`` answers, which is open then.

    Some lines lose the first requests of a connection, or of a client. Settings that answered after them
    would else be taken for the gripper's.
    """
    await other.close()
    for _ in range(PROBE_TRIES):
        await asyncio.sleep(LET_GO_S)
        link = _link(address, usual, ANSWER_S)
        try:
            reading = await _first_reading(link)
        except RobotiqConnectionError:
            continue
        if why_stranger(reading.status.registers):
            await link.close()
            break
        return reading
    await asyncio.sleep(LET_GO_S)
    await _first_reading(other)
    return None


def long_enough(seconds: float) -> float:
    """A response_timeout for replies that take so long: twice that, within the limits of a hand."""
    return min(LONGEST_RESPONSE_S, math.ceil(20 * seconds) / 10)


def _attempts(address: Address, usual: RegisterMap) -> Iterator[tuple[RegisterMap, float]]:
    # Each with its timeout. The usual registers come first, several times.
    if address.kind == "sim":
        yield usual, ANSWER_S
        return
    units = PROBED_UNITS[:-2] if address.is_rtu else PROBED_UNITS
    others = [replace(usual, read_function=7 - usual.read_function)]
    others += [replace(usual, device_id=unit) for unit in units]
    for kind in (RTU_REGISTERS, TCP_REGISTERS):
        for function in dict.fromkeys((usual.read_function, 3, 4)):
            moved = replace(usual, request=kind.request, status=kind.status, read_function=function)
            others += [replace(moved, device_id=unit) for unit in dict.fromkeys((usual.device_id, *units))]
    for number in range(PROBE_TRIES):
        yield usual, ANSWER_S if number < PROBE_TRIES - 1 else LONGEST_RESPONSE_S
    for each in dict.fromkeys(others):
        if each != usual:
            yield each, ANSWER_S
    for _ in range(PROBE_TRIES):  # by now a line that loses the first requests may let them through
        yield usual, ANSWER_S


async def _other_frames(address: Address) -> str:
    # Advice for a socket with the wrong framing: RTU instead of Modbus TCP, or the reverse.
    if not address.is_socket:
        return ""
    other = replace(address, kind="tcp" if address.is_rtu else "rtu+tcp")
    link = _link(other, registers_of(other), ANSWER_S)
    try:
        await _first_reading(link)
    except RobotiqConnectionError:
        return ""
    await link.close()
    return f"It answers to another framing: write the address as {other}."


def _link(address: Address, registers: RegisterMap, patience: float) -> Link:
    if address.kind == "sim":
        gripper = new_gripper(address.simulation, model_of(address.model))
        return SimulatedTransport(gripper, registers, connect_timeout=REACH_S, response_timeout=patience)
    return ModbusTransport(address, registers, connect_timeout=REACH_S, response_timeout=patience)


async def _first_reading(link: Link) -> _FirstReading:
    # Closes the link when no reply comes.
    loop = asyncio.get_running_loop()
    try:
        await link.open()
        asked = loop.time()
        status = RobotiqStatus.from_registers(await link.read())
        return _FirstReading(link, status, loop.time() - asked)
    except BaseException:
        await link.close()
        raise


# -- no connection -----------------------------------------------------------------------------------------


def _report_port(address: Address, report: ReportFinding) -> None:
    if address.is_socket:
        report(Finding(Level.GOOD, "port", f"{address.port} is open"))
    elif address.scheme:
        report(Finding(Level.GOOD, "tunnel", "opens"))


def _report_no_connection(
    address: Address, error: ConnectFailedError, report: ReportFinding, *, is_first: bool
) -> None:
    if address.scheme and is_first:
        report(Finding(Level.BAD, "tunnel", error.args[0], NO_TUNNEL))
    elif address.is_socket and is_first:
        report(no_connection(address, error))
    else:
        report(Finding(Level.BAD, "open", error.args[0], _advice_for_opening(address, str(error))))


def no_connection(address: Address, error: ConnectFailedError) -> Finding:
    """The finding for a port of a host that could not be connected."""
    cause = error.__cause__
    if isinstance(cause, ConnectionRefusedError):
        advice = "The host is up, but nothing listens on this port: is it the right address and port?"
    elif isinstance(cause, OSError) and not isinstance(cause, TimeoutError):
        advice = "It cannot be reached: check the cable, and the IP address and subnet mask of this computer."
    else:
        advice = "Is it switched on, on this network, in this subnet? A firewall may drop the packets."
    return Finding(Level.BAD, "port", f"{address.port}: {error.args[0]}", advice)


def _advice_for_opening(address: Address, why: str) -> str:
    if "pip install" in why:
        return "Install it, and run doctor again."
    if address.kind == "rtu":
        return (
            "robotiq-async ports lists the ports of this computer; dmesg (Linux), the System Report (macOS) "
            "or the Device Manager (Windows) lists the devices that were plugged in."
        )
    return f"It accepted a connection before and refuses one now. {ALONE}: stop the other."


# -- no answer, or a late one ------------------------------------------------------------------------------


def _answers(address: Address, failure: RobotiqConnectionError | None, tries: int, seconds: float) -> Finding:
    if seconds > ANSWER_S:
        advice = f"Pass response_timeout={long_enough(seconds):g}; a write, and a stop, take as long."
        return Finding(Level.DOUBT, "Modbus", f"answers, after {seconds:.1f} s", advice)
    if failure is None:
        return Finding(Level.GOOD, "Modbus", "answers")
    if isinstance(failure, ConnectionLostError):
        advice = f"It closed the connection without an answer. {ALONE}: is another program connected?"
        advice = LOST_PORT if address.kind == "rtu" else advice
    elif address.kind == "rtu":
        advice = DAMAGED
    else:
        advice = (
            "Replies get lost or damaged: check cable and switch, and look for another client. "
            f"{ALONE}, and was busy with another."
        )
    return Finding(Level.DOUBT, "Modbus", f"answers when asked {tries} times", advice)


def _echoes(link: Link) -> bool:
    return isinstance(link, ModbusTransport) and link.echoes


def _advice_for_silence(address: Address, error: RobotiqConnectionError, echoes: bool) -> str:
    if "the gateway refuses" in str(error):
        return (
            "A gateway answers, and the gripper behind it does not: check that gripper's power and unit id "
            "(--device-id), A and B (swapped?), and the rate that the gateway has."
        )
    if address.is_rtu and isinstance(error, ResponseTimeoutError | ProtocolError):
        return _advice_for_a_line(address, error, echoes)
    if isinstance(error, ResponseTimeoutError):
        return (
            "Connected, but no unit answers: another device, the gripper's fieldbus is not Modbus, or it "
            "serves one client at a time and has another."
        )
    if isinstance(error, ProtocolError):
        return "The device is not this gripper: its registers are elsewhere, or it does not speak Modbus."
    if address.kind == "rtu":
        return LOST_PORT
    return f"It closes the connection when asked. {ALONE}, or not speak Modbus."


def _advice_for_a_line(address: Address, error: RobotiqConnectionError, echoes: bool) -> str:
    """Advice for a serial line on which no gripper answers. A line has nothing but its bytes."""
    if isinstance(error, ResponseTimeoutError):
        if address.scheme:
            return (
                "The arm answers, and the gripper does not: check the voltage and the rate that the arm "
                "gives its tool (24 V, 115200 baud, 8N1), unit id (--device-id), and whether a program of "
                "the arm has the line."
            )
        heard = "The line echoes what is sent, and nothing else answers" if echoes else "Nothing answers"
        return (
            f"{heard}: check the gripper's power, A and B (swapped?), its rate (?baud=) and unit id "
            "(--device-id), and whether another program has the line. At a UR the tool I/O must belong to "
            f"the user, and Robotiq's URCap be off.{FORWARDING if address.kind == 'rtu+tcp' else ''}"
        )
    if "refuses" in str(error):
        return (
            "Something answers, and refuses to be read: another device, or a gripper with its registers "
            "elsewhere (request_address, status_address)."
        )
    if "checksum" in str(error):
        return (
            "Replies come damaged: check shield, ground, termination and length of the cable, then parity "
            "and stop bits (?parity=, ?stopbits=); a serial server may be set to 7 data bits."
        )
    return (
        "Bytes come that are no reply: the line has another rate or parity (?baud=, ?parity=) or 7 data "
        "bits, a second master talks on it, or another device answers."
    )


# -- the device that answers -------------------------------------------------------------------------------


def _report_place(usual: RegisterMap, found: RegisterMap, report: ReportFinding) -> None:
    unit = Finding(Level.GOOD, "unit id", str(found.device_id))
    if found.device_id != usual.device_id:
        advice = f"Pass device_id={found.device_id}, or --device-id {found.device_id}."
        unit = Finding(Level.DOUBT, "unit id", f"{found.device_id}, not {usual.device_id}", advice)
    report(unit)
    at = f"status at {found.status}, requests at {found.request}, function {found.read_function}"
    if found.write_function == 23:
        at += "; a hand writes with function 23 (not tried: doctor writes nothing)"
    options = {
        "request_address": (found.request, usual.request),
        "status_address": (found.status, usual.status),
        "read_function": (found.read_function, usual.read_function),
    }
    given = [f"{name}={value}" for name, (value, as_usual) in options.items() if value != as_usual]
    where = Finding(Level.GOOD, "registers", at)
    if given:
        advice = f"Pass {', '.join(given)}, or the options of these names."
        if found.read_function != usual.read_function:
            advice += " This function may read the requests: check that the status follows the fingers."
        where = Finding(Level.DOUBT, "registers", f"{at}: unusual on this kind of link", advice)
    report(where)


def report_silence(status: RobotiqStatus, report: ReportFinding) -> None:
    """Report a status without information."""
    if not any(status.registers):
        found = "all registers read 0: nothing shows that this is a gripper"
        advice = (
            "Another device, a gripper without power behind its fieldbus, or one that was never activated. A "
            "hand cannot tell them apart, and start() writes: look at the gripper's lights and address first."
        )
        report(Finding(Level.BAD, STRANGER, found, advice))


def _report_stranger(why: str, report: ReportFinding) -> None:
    report(Finding(Level.GOOD, "Modbus", "answers"))
    advice = "Send it no commands: another machine may move. Are address, unit id and registers right?"
    report(Finding(Level.BAD, STRANGER, f"another device answers: {why}", advice))
