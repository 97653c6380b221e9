"""An agent's messages about a gripper: its description, its statuses, its troubles."""

from __future__ import annotations

import asyncio
import json
import secrets
from typing import Final

from ...fleet.errors import AgentError, NotAllowedError
from ...fleet.network.bus import Bus, Urgency
from ...fleet.remote.errand import of_its_run
from ...fleet.wire.envelope import AgentCall, unpack_answer
from ...fleet.wire.names import GripperName
from ...fleet.wire.status_message import StatusMessage, unpack
from ...fleet.wire.values import Fields
from ...hands import percentile
from ...runtime import __version__, now, quoted
from ...values import ConnectionLostError, ProtocolError, RobotiqError, RobotiqStatus, State
from .findings import Finding, GiveUpError, Level, ReportFinding
from .gripper import report_state

AGENT_ANSWER_S: Final = 1.0
PROBE_TRIES: Final = 3  # attempts: just after a connection was made the first answers may be empty
AGENT_PROBES: Final = 100  # requests for measuring the round trip
WATCH_S: Final = 2.0  # seconds of listening to statuses
_INFO_KEYS: Final = frozenset({"version", "window", "statistics", "problem", "state", "address", "holder"})
LOST_SHARE: Final = 0.01  # accepted share of lost statuses


async def examine_agent(name: GripperName, bus: Bus, report: ReportFinding) -> None:
    """Examine the answers and the messages of an agent."""
    asker = _Asker(name, bus)
    await _describe(asker, report)
    report(Finding(Level.GOOD, "access", "the agent answers"))
    listener = _MessageSorter(name)
    undo = bus.subscribe(name.key("*"), listener.hear)
    try:
        began = now()
        times = await _round_trips(asker, began + WATCH_S)
        await asyncio.sleep(max(0.0, began + WATCH_S - now()))
        info = await _describe(asker, report)
    finally:
        undo()
    _report_version(info, report)
    _report_round_trip(times, info["window"], report)
    _report_statuses(listener, now() - began, info, report)
    _report_gripper(listener, info, report)
    holder = info["holder"]
    report(Finding(Level.GOOD, "commanded by", "no client" if holder is None else str(holder)))


class _Asker:
    """Requests the description of a gripper from its agent. A RemoteHand would not report why none comes."""

    def __init__(self, name: GripperName, bus: Bus) -> None:
        self._name = name
        self._bus = bus
        self._client = secrets.token_hex(8)
        self._number = 0

    async def info(self) -> Fields:
        """The agent's description of the gripper."""
        self._number += 1
        call = AgentCall(self._name.base, self._client, number=self._number)
        asked, key = now(), self._name.question(self._bus.who or self._client)
        reply = await self._bus.ask(
            key, call.pack(), timeout=AGENT_ANSWER_S, urgency=Urgency.QUESTION, decides=of_its_run(call)
        )
        if reply is None and now() - asked < AGENT_ANSWER_S / 2:
            raise NotAllowedError("the agent is running, but does not answer info: access denied")
        if reply is None:
            raise ConnectionLostError(f"no answer to info within {AGENT_ANSWER_S:g} s")
        answer = unpack_answer(reply.payload)
        if answer.to != self._name.base or answer.number not in (0, call.number):
            raise AgentError("the answer to info belongs to another request")
        info = answer.outcome(RobotiqStatus.from_raw)
        if not isinstance(info, dict) or not info.keys() >= _INFO_KEYS:
            raise AgentError(f"the agent's description of the gripper has another format: {info!r:.200}")
        return info


class _MessageSorter:
    """Sorts the messages under the keys of a gripper."""

    def __init__(self, name: GripperName) -> None:
        self._mark = name.mark
        self.statuses: list[StatusMessage] = []  # about the gripper
        self.misrouted = 0  # number of messages about another gripper
        self.unreadable = ""  # the error of the last unreadable message; empty before the first

    def hear(self, _key: str, payload: bytes) -> None:
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


async def _describe(asker: _Asker, report: ReportFinding) -> Fields:
    why: RobotiqError | None = None
    for _ in range(PROBE_TRIES):
        try:
            return await asker.info()
        except (ConnectionLostError, NotAllowedError) as error:
            why = error
            await asyncio.sleep(0.1)
        except RobotiqError as error:
            why = error
            break
    assert why is not None
    if isinstance(why, AgentError):
        advice = "Install the same version of robotiq_async on both hosts."
    elif isinstance(why, NotAllowedError):
        advice = "Is this client in the agent's access.toml, and was the agent started since?"
    else:
        advice = "Its liveliness token exists, so it ran a second ago. Is its host or the network busy?"
    report(Finding(Level.BAD, "access", str(why), advice))
    raise GiveUpError


async def _round_trips(asker: _Asker, ends: float) -> list[float]:
    times: list[float] = []
    while len(times) < AGENT_PROBES and (now() < ends or not times):
        asked = now()
        try:
            await asker.info()
        except RobotiqError:
            times.append(AGENT_ANSWER_S)
        else:
            times.append(now() - asked)
    return sorted(times)


def _report_version(info: Fields, report: ReportFinding) -> None:
    version = info["version"]
    if version == __version__:
        report(Finding(Level.GOOD, "version", f"{version} on both sides"))
    else:
        advice = "They speak the same protocol; update the older side when you can."
        report(Finding(Level.GOOD, "version", f"{version} there, {__version__} here", advice))


def _report_round_trip(times: list[float], window: float, report: ReportFinding) -> None:
    p50, p99 = percentile(times, 0.5), percentile(times, 0.99)
    found = f"{1000 * p50:.1f} ms, 99th percentile {1000 * p99:.1f} ms"
    if p99 < window / 5:
        report(Finding(Level.GOOD, "round trip", found))
        return
    # A lease survives round trips of up to about a quarter of its window.
    level = Level.BAD if p50 > window / 4 else Level.DOUBT
    advice = f"A client that commands may lose the lease: its window is {window:g} s (window in FLEET.toml)."
    report(Finding(level, "round trip", found, advice))


def _report_statuses(listener: _MessageSorter, seconds: float, info: Fields, report: ReportFinding) -> None:
    if listener.misrouted:
        found = f"{listener.misrouted} messages about another gripper came under this one's key; dropped"
        advice = "zenoh does that after a link has been down; clients notice. Restarting the client ends it."
        report(Finding(Level.DOUBT, "misrouted", found, advice))
    if listener.unreadable:
        advice = "Does another program publish under these keys? Otherwise update the older side."
        report(Finding(Level.DOUBT, "statuses", listener.unreadable, advice))
    if not listener.statuses:
        advice = "Answers arrive, statuses do not: is the client in the agent's access list, in one role?"
        report(Finding(Level.BAD, "statuses", f"none within {seconds:.1f} s", advice))
        return
    sequences = {each.status.sequence for each in listener.statuses if each.status is not None}
    if len(sequences) < 2:
        return  # the gripper is not polled; the state reports that
    lost = 1 - len(sequences) / (max(sequences) - min(sequences) + 1)
    period = 1000 * info["statistics"]["period_p99"]
    found = f"{len(sequences) / seconds:.0f} a second, {100 * lost:.1f} % lost on the way"
    found += f"; 99 % of the agent's polls within {period:.1f} ms"
    if lost < LOST_SHARE:
        report(Finding(Level.GOOD, "statuses", found))
    else:
        advice = "Commands are safe, the newest counts; streams and recordings have gaps. A wired network?"
        report(Finding(Level.DOUBT, "statuses", found, advice))


def _report_gripper(listener: _MessageSorter, info: Fields, report: ReportFinding) -> None:
    problem, state = info["problem"], str(info["state"])
    if problem or state == State.DISCONNECTED.name:
        found = f"its agent cannot reach it: {problem or 'the link is down'}"
        advice = (
            f"On that host: robotiq-async doctor {quoted(str(info['address']))}, while the agent is stopped."
        )
        report(Finding(Level.BAD, "gripper", found, advice))
        return
    report(Finding(Level.GOOD, "gripper", f"{info['address']} in {state}"))
    newest = listener.statuses[-1] if listener.statuses else None
    if newest is not None and newest.status is not None:
        report_state(newest.status, report)
