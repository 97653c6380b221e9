"""What an agent says of a gripper: its answers, its statuses, its troubles."""

from __future__ import annotations

import asyncio
import json
import secrets
from typing import Any, Final

from ...fleet.network.bus import Bus, Urgency
from ...fleet.remote.pending_request import of_its_run
from ...fleet.remote.requests import NoAnswerError
from ...fleet.wire.envelope import Call, unpack_answer
from ...fleet.wire.names import GripperName
from ...fleet.wire.status_message import StatusMessage, unpack
from ...fleet.wire.values import Fields
from ...runtime.clock import now
from ...runtime.version import __version__
from ...values.errors import AgentError, NotAllowedError, ProtocolError, RobotiqError
from ...values.statistics import percentile
from ...values.status import RobotiqStatus
from .findings import Finding, GiveUpError, Level, Report
from .gripper import report_state

ANSWER_S: Final = 1.0
TRIES: Final = 3
"""An empty answer also comes just after a connection was made: it is asked again."""
PROBES: Final = 100
"""Requests from which the round trip is determined."""
WATCH_S: Final = 2.0
"""How long to listen to statuses."""
_READ: Final = frozenset(
    {"epoch", "stamp", "version", "window", "statistics", "problem", "state", "address", "holder"}
)
LOST: Final = 0.01
"""Share of statuses that may be lost on the way."""


async def examine_agent(name: GripperName, bus: Bus, report: Report) -> Fields:
    """Examine what an agent answers and tells; returns what it says about the gripper.

    Raises:
        GiveUpError: it does not answer.
    """
    asker = Asker(name, bus)
    info = await _describe(asker, report)
    listener = Listener(name)
    undo = bus.subscribe(name.key("*"), listener.hear)
    try:
        began = now()
        times = await _round_trips(asker, began + WATCH_S)
        await asyncio.sleep(max(0.0, began + WATCH_S - now()))
        info = await _describe(asker, report, again=True)
    finally:
        undo()
    _report_version(info, report)
    _report_round_trip(times, info["window"], report)
    _report_statuses(listener, now() - began, info, report)
    _report_gripper(listener, info, report)
    _report_holder(info, report)
    return info


class Asker:
    """Asks an agent, under no lease."""

    def __init__(self, name: GripperName, bus: Bus) -> None:
        self._name = name
        self._bus = bus
        self._client = secrets.token_hex(8)
        self._number = 0

    async def ask(
        self, verb: str, *, epoch: int = 0, seen: float = 0.0, arguments: Fields | None = None
    ) -> Any:  # noqa: ANN401  # what each request returns
        """What the agent answers.

        Raises:
            NotAllowedError: nobody answers, and that was plain at once.
            NoAnswerError: no answer in time.
            AgentError: another answer came.
            RobotiqError, TypeError, ValueError: what the agent raised.
        """
        self._number += 1
        call = Call(self._name.base, self._client, epoch, 0, self._number, seen, arguments or {})
        asked, key = now(), self._name.key(verb)
        reply = await self._bus.ask(
            key, call.pack(), timeout=ANSWER_S, urgency=Urgency.COMMAND, decides=of_its_run(call)
        )
        if reply is None and now() - asked < ANSWER_S / 2:
            raise NotAllowedError(f"the agent is there, and does not answer to {verb}: access denied")
        if reply is None:
            raise NoAnswerError(f"no answer to {verb} within {ANSWER_S:g} s")
        answer = unpack_answer(reply.payload)
        if answer.to != self._name.base or answer.number not in (0, call.number):
            raise AgentError(f"another answer came to {verb}")
        return answer.outcome(lambda stamp: stamp)


class Listener:
    """Counts what comes.

    Attributes:
        statuses: about the gripper.
        misrouted: messages about another gripper.
        unreadable: why the last that could not be read could not; empty if all could.
    """

    def __init__(self, name: GripperName) -> None:
        self._mark = name.mark
        self.statuses: list[StatusMessage] = []
        self.misrouted = 0
        self.unreadable = ""

    def hear(self, _key: str, payload: bytes) -> None:
        """A message has arrived."""
        try:
            if payload[:1] == b"{":
                self.misrouted += json.loads(payload)["mark"] != self._mark
                return
            message = unpack(payload)
        except (ProtocolError, ValueError, KeyError) as error:
            self.unreadable = str(error)
            return
        if message.mark == self._mark:
            self.statuses.append(message)
        else:
            self.misrouted += 1


async def _describe(asker: Asker, report: Report, *, again: bool = False) -> Fields:
    """What the agent says about the gripper.

    Raises:
        GiveUpError: it does not answer.
    """
    why: RobotiqError | None = None
    for _ in range(TRIES):
        try:
            info: Fields = _checked(await asker.ask("info"))
        except (NoAnswerError, NotAllowedError) as error:
            why = error
            await asyncio.sleep(0.1)
        except RobotiqError as error:
            why = error
            break
        else:
            if not again:
                report(Finding(Level.GOOD, "access", "the agent answers"))
            return info
    assert why is not None
    if isinstance(why, AgentError):
        advice = "Install the same version of robotiq_async on both hosts."
    elif isinstance(why, NotAllowedError):
        advice = "Is this client in the agent's access.toml, and was the agent started since?"
    else:
        advice = "Its token is seen, so it ran a second ago. Is its host busy, or the network in between?"
    report(Finding(Level.BAD, "access", str(why), advice))
    raise GiveUpError


def _checked(info: object) -> Fields:
    """What the other checks read.

    Raises:
        AgentError: something is missing.
    """
    if not isinstance(info, dict) or not info.keys() >= _READ:
        raise AgentError(f"the agent describes the gripper in another way: {info!r:.200}")
    return info


async def _round_trips(asker: Asker, ends: float) -> list[float]:
    """How long answers take; at least one."""
    times: list[float] = []
    while len(times) < PROBES and (now() < ends or not times):
        asked = now()
        try:
            await asker.ask("info")
        except RobotiqError:
            times.append(ANSWER_S)
        else:
            times.append(now() - asked)
    return sorted(times)


def _report_version(info: Fields, report: Report) -> None:
    version = info["version"]
    if version == __version__:
        report(Finding(Level.GOOD, "version", f"{version} on both sides"))
    else:
        advice = "They speak the same protocol; update the older side when you can."
        report(Finding(Level.GOOD, "version", f"{version} there, {__version__} here", advice))


def _report_round_trip(times: list[float], window: float, report: Report) -> None:
    p50, p99 = percentile(times, 0.5), percentile(times, 0.99)
    found = f"{1000 * p50:.1f} ms, 99th percentile {1000 * p99:.1f} ms"
    if p99 < window / 5:
        report(Finding(Level.GOOD, "round trip", found))
        return
    # A round trip of a quarter of the window is about what a lease survives.
    level = Level.BAD if p50 > window / 4 else Level.DOUBT
    advice = f"Whoever commands may lose the lease: its window is {window:g} s (window in FLEET.toml)."
    report(Finding(level, "round trip", found, advice))


def _report_statuses(listener: Listener, seconds: float, info: Fields, report: Report) -> None:
    if listener.misrouted:
        found = f"{listener.misrouted} messages about another gripper came under this one's key; dropped"
        advice = "zenoh does that after a link has been down; clients notice. Restarting the client ends it."
        report(Finding(Level.DOUBT, "misrouted", found, advice))
    if listener.unreadable:
        advice = "Does somebody else publish under these keys? Or update the older side."
        report(Finding(Level.DOUBT, "statuses", listener.unreadable, advice))
    if not listener.statuses:
        advice = "Answers come and statuses do not: is the client in the agent's access list, in one role?"
        report(Finding(Level.BAD, "statuses", f"none within {seconds:.1f} s", advice))
        return
    sequences = {each.sequence for each in listener.statuses if each.registers is not None}
    if len(sequences) < 2:
        return  # the gripper is not polled, and that is told with its state
    lost = 1 - len(sequences) / (max(sequences) - min(sequences) + 1)
    period = 1000 * info["statistics"]["period_p99"]
    found = f"{len(sequences) / seconds:.0f} a second, {100 * lost:.1f} % lost on the way"
    found += f"; 99 % of the agent's polls within {period:.1f} ms"
    if lost < LOST:
        report(Finding(Level.GOOD, "statuses", found))
    else:
        advice = (
            "The newest one counts, so commands are safe; streams and recordings have gaps. A wired network?"
        )
        report(Finding(Level.DOUBT, "statuses", found, advice))


def _report_gripper(listener: Listener, info: Fields, report: Report) -> None:
    problem, state = info["problem"], str(info["state"])
    if problem or state == "disconnected":
        found = f"its agent does not reach it: {problem or 'the link is down'}"
        advice = f"On that host: robotiq-async doctor {info['address']}, while the agent is stopped."
        report(Finding(Level.BAD, "gripper", found, advice))
        return
    report(Finding(Level.GOOD, "gripper", f"{info['address']} in {state}"))
    newest = listener.statuses[-1] if listener.statuses else None
    if newest is not None and newest.registers is not None:
        report_state(RobotiqStatus.from_registers(newest.registers), report)


def _report_holder(info: Fields, report: Report) -> None:
    holder = info["holder"]
    report(Finding(Level.GOOD, "commanded by", "nobody" if holder is None else str(holder)))
