"""Stages 0 and 1: this computer, and reading only. Nothing is written, and nothing moves."""

from __future__ import annotations

import asyncio
import math
from collections import Counter
from dataclasses import replace
from typing import Final

from ....hands import POLL_INTERVAL_S, percentile
from ....link import latency_file, latency_timer, registers_of
from ....runtime import is_loopback
from ....values import RTU_REGISTERS, TCP_REGISTERS, Fault, RegisterMap, Registers, RobotiqConnectionError
from ..bench import Bench
from ..catalogue import CheckVerdict, EndError, Figure
from ..recorded_link import RecordedExchange, RecordedLink
from ..watch import LASTING, show_echo

TIMERS: Final = 300
SLEEP_S: Final = 0.002
READ_LATE_S: Final = 0.001
KEPT_MS: Final = 2


async def host(bench: Bench) -> None:
    """Stage 0: measure the timers, and read the latency timer of a serial adapter."""
    loop, late = asyncio.get_running_loop(), []
    for _ in range(TIMERS):
        due = loop.time() + SLEEP_S
        await asyncio.sleep(SLEEP_S)
        late.append(loop.time() - due)
    late.sort()
    p99 = percentile(late, 0.99)
    found = f"99 of 100 timers are at most {1000 * p99:.2f} ms late"
    figures: dict[str, Figure] = {
        "p50_ms": 1000 * percentile(late, 0.5),
        "p99_ms": 1000 * p99,
        "worst_ms": 1000 * late[-1],
    }
    follows = "This computer adds to the times below: stop other programs on it."
    bench.judge("host.timer", p99 < READ_LATE_S, found, follows, **figures)
    _adapter(bench)


def _adapter(bench: Bench) -> None:
    if bench.address.kind != "rtu":
        what = "the line is the arm's" if bench.address.kind == "tunnel" else "the link is a socket"
        bench.as_assumed("host.adapter", f"no adapter: {what}")
        return
    kept = latency_timer(bench.address.host)
    if kept is None:
        why = "unknown: only FTDI adapters on Linux have a timer that can be read"
        bench.inconclusive("host.adapter", why)
        return
    found = f"passes on bytes after {kept} ms"
    file = latency_file("PORT")
    follows = f"Every read waits that long: echo 1 | sudo tee {file}, with your port (ttyUSB0) for PORT."
    bench.judge("host.adapter", kept <= KEPT_MS, found, follows, latency_ms=kept)


ANSWERED_UNITS: Final = (0, 1, 2, 9, 255)
NOWHERE: Final = 3000  # no source has registers of a 3-Finger there
PERIODS_S: Final = (0.02, 0.01)  # between reads, beside the usual interval
LET_GO_S: Final = 0.5  # for a gateway that serves one client to notice that it has gone
CLOSED_S: Final = 0.05  # for a gripper to notice a closed connection
LONGEST_INTERVAL_S: Final = 0.1
EXTRA_CONNECTIONS: Final = 2
QUANTILES: Final = (0.0, 0.1, 0.25, 0.5, 0.75, 0.9, 0.99, 1.0)


async def reading(bench: Bench) -> None:
    if bench.registers is not None:
        _registers(bench)
        await _others(bench)
        await _counts(bench)
    await _round_trip(bench)
    await _connections(bench)
    await _silence(bench)
    await _unchanged(bench)


async def _unchanged(bench: Bench) -> None:
    """Check that the requests are unchanged: nothing was written."""
    assert bench.found is not None
    statuses = [await bench.link.read() for _ in range(LASTING)]
    if statuses[-1].echo != bench.found.echo:
        words = f"from {show_echo(bench.found.echo)} to {show_echo(statuses[-1].echo)}"
        raise EndError("foreign", f"another client commands the gripper: its requests changed {words}")
    if all(status.fault.is_serious for status in statuses):
        fault = statuses[-1].fault
        raise EndError("fault", f"0x{int(fault):02X} {fault.name}: {fault.description}")


def _registers(bench: Bench) -> None:
    usual, found = registers_of(bench.address), bench.registers
    assert found is not None
    given = {
        "device_id": (found.device_id, usual.device_id),
        "read_function": (found.read_function, usual.read_function),
        "request_address": (found.request, usual.request),
        "status_address": (found.status, usual.status),
    }
    options = {name: value for name, (value, as_usual) in given.items() if value != as_usual}
    words = (
        f"unit {found.device_id}, function {found.read_function}, "
        f"requests at {found.request}, status at {found.status}"
    )
    follows = "Give the hand the options below. Check that these registers hold the status."
    bench.judge("read.registers", not options, words, follows, options)


async def _others(bench: Bench) -> None:
    """Find unit ids, functions and places that answer beside the one that is used."""
    found = bench.registers
    assert found is not None
    await bench.link.close()
    await asyncio.sleep(LET_GO_S)
    units = (
        ANSWERED_UNITS
        if not bench.address.is_rtu
        else tuple(unit for unit in ANSWERED_UNITS if 1 <= unit <= 247)
    )
    answering: list[Figure] = [
        unit for unit in units if await _answers(bench, replace(found, device_id=unit))
    ]
    places: list[Figure] = [
        f"function {function} at {kind.status}"
        for function in (3, 4)
        for kind in (TCP_REGISTERS, RTU_REGISTERS)
        if await _answers(bench, replace(found, read_function=function, status=kind.status))
    ]
    nowhere = await _answers(bench, replace(found, status=NOWHERE))
    await bench.link.open()
    words = f"answers as unit {', '.join(map(str, answering))}; {', '.join(map(str, places))}"
    if nowhere:
        follows = "It may have another register map: please report the firmware version."
        bench.differs(
            "read.others", f"there are registers at {NOWHERE}, too", follows, units=answering, places=places
        )
    else:
        bench.as_assumed("read.others", f"{words}; nothing at {NOWHERE}", units=answering, places=places)


async def _answers(bench: Bench, registers: RegisterMap) -> bool:
    """Whether something can be read there, even if it is no status."""
    loop = asyncio.get_running_loop()
    link, began = bench.another_link(registers, lambda _: None), loop.time()
    block: Registers = ()
    try:
        await link.open()
        block = (await link.read()).registers
        words = " ".join(f"{word:04X}" for word in block)
    except RobotiqConnectionError as error:
        words = str(error)
    finally:
        await link.close()
    question = f"unit {registers.device_id}, function {registers.read_function} at {registers.status}"
    bench.keep(RecordedExchange(began, loop.time(), "probe", words=f"{question}: {words}"))
    await asyncio.sleep(CLOSED_S)
    return bool(block)


async def _counts(bench: Bench) -> None:
    """Opening reads one to seven registers, a different number each time."""
    refused: list[Figure] = []
    for count in range(1, 8):
        try:
            await bench.link.open()
        except RobotiqConnectionError as error:
            refused.append(f"{count}: {error}")
            await asyncio.sleep(LET_GO_S)
    if refused:
        await bench.link.open()
        bench.differs(
            "read.counts",
            f"{len(refused)} of 7 connections failed; each reads another number of registers",
            "A hand does the same, so connecting may fail at times. Please report this.",
            refused=refused,
        )
    else:
        bench.as_assumed("read.counts", "1 to 8 registers can be read, over 7 successive connections")


async def _round_trip(bench: Bench) -> None:
    worst, figures = 0.0, dict[str, Figure]()
    for period in (*PERIODS_S, POLL_INTERVAL_S):
        times = sorted(await _trips(bench.link, bench.lengths.reads, period))
        p50, p99 = percentile(times, 0.5), percentile(times, 0.99)
        name = f"at_{1000 * period:g}_ms"
        figures |= {f"{name}_p50_ms": 1000 * p50, f"{name}_p99_ms": 1000 * p99}
        figures[f"{name}_quantiles_ms"] = [1000 * percentile(times, share) for share in QUANTILES]
        figures[f"{name}_histogram"] = _histogram(times)
        worst = max(worst, p99)
    found = f"99 of 100 reads take at most {1000 * worst:.1f} ms"
    timer = bench.checks.get("host.timer")
    if worst >= POLL_INTERVAL_S and timer is not None and timer.verdict is CheckVerdict.DIFFERS:
        why = f"{found}, but timers of this computer are late: it may be the slow one"
        bench.inconclusive("read.round_trip", why, **figures)
        return
    interval = min(LONGEST_INTERVAL_S, math.ceil(1000 * worst * 1.2) / 1000)
    follows = f"A hand reads the status every {1000 * interval:g} ms at best"
    if bench.address.is_socket and not is_loopback(bench.address.host):
        follows += "; a wired network is quicker"
    follows += "."
    options = {"poll_interval": interval}
    bench.judge("read.round_trip", worst < POLL_INTERVAL_S, found, follows, options, **figures)


def _histogram(seconds: list[float]) -> list[Figure]:
    """Pairs of [milliseconds, count] for each tenth of a millisecond that occurs."""
    counts = Counter(round(1000 * each, 1) for each in seconds)
    return [[tenth, counts[tenth]] for tenth in sorted(counts)]


async def _trips(link: RecordedLink, count: int, period: float) -> list[float]:
    loop, times = asyncio.get_running_loop(), []
    for _ in range(count):
        began = loop.time()
        await link.read()
        times.append(loop.time() - began)
        await asyncio.sleep(max(0.0, began + period - loop.time()))
    return times


async def _connections(bench: Bench) -> None:
    if bench.address.kind == "rtu":
        bench.as_assumed("read.connections", "a serial port has one owner", connections=1)
        return
    others: list[RecordedLink] = []
    why = ""
    try:
        for _ in range(EXTRA_CONNECTIONS):
            others.append(bench.another_link())
            await others[-1].open()
            await others[-1].read()
            await bench.link.read()
    except RobotiqConnectionError as error:
        why = str(error)
    finally:
        for each in others:
            await each.close()
    let_in = len(others) if why else 1 + len(others)
    if not why:
        bench.as_assumed("read.connections", f"{let_in} at once, and each was answered", connections=let_in)
        return
    if not bench.link.is_open:
        await asyncio.sleep(LET_GO_S)
        await bench.link.open()
    follows = "Run one program at a time, or an agent: it shares the gripper between several."
    bench.differs("read.connections", f"{let_in} at once: {why}", follows, connections=let_in)


async def _silence(bench: Bench) -> None:
    """Check the first two reads after a silence, and whether the activation is still there."""
    link, first = bench.link, await bench.link.read()
    shown: list[Figure] = []
    lasting, lost = "", ""
    watch = bench.watch(sum(bench.lengths.idle) + 60)
    for seconds in bench.lengths.idle:
        await watch.pause(seconds)
        statuses = [await link.read(), await link.read()]
        codes = [int(status.fault) for status in statuses]
        shown.append([seconds, *codes])
        if Fault.COMMUNICATION_NOT_READY in codes[1:]:
            lasting = f"after {seconds:g} s two reads in a row show fault 0x09"
        if statuses[1].is_activated != first.is_activated:
            lost = f"after {seconds:g} s"
            break
    if lost:
        follows = "Keep a program polling: after a pause the next start activates the gripper, and it MOVES."
        bench.differs("read.idle", f"the activation was lost {lost} of silence", follows, seconds=seconds)
    else:
        words = f"answers after each of {sum(bench.lengths.idle):g} s of silence in all"
        bench.as_assumed("read.idle", words, seconds=max(bench.lengths.idle, default=0.0))
    passing = [each for each in shown if isinstance(each, list) and each[1] == Fault.COMMUNICATION_NOT_READY]
    if lasting:
        follows = "A hand takes that for a fault: poll without pauses, and please report this."
        bench.differs("read.silence", lasting, follows, faults=shown)
    elif passing:
        found = f"after {passing[0][0]} s of silence the first read shows fault 0x09, the next read does not"
        follows = "No option is needed: a hand believes 0x09 only after a third read."
        bench.differs("read.silence", found, follows, faults=shown)
    else:
        bench.as_assumed("read.silence", "no fault in the first read after any silence", faults=shown)
