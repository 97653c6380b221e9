"""Fleet: an overview of all grippers of a site, and a halt for all of them."""

from __future__ import annotations

import asyncio
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import TracebackType
from typing import Any, Final, Self

from ..hands import Channel, Stream
from ..runtime import now
from ..values import MODELS, Fault, Inhibit, ProtocolError, RobotiqError, State
from .errors import NotAllStoppedError
from .limited_log import LimitedLog
from .network.bus import Bus, Undo
from .network.route import Route, default_route
from .remote.dialog import Dialog
from .remote.errand import NoAnswerError
from .remote.mirror import AgentClock, Mirror
from .remote.remote_hand import RemoteHand
from .wire.names import ROOT, GripperName, check_name
from .wire.values import reading, words

LOOK_S: Final = 0.5  # seconds to wait for the tokens of agents
LOOK_AGAIN_S: Final = 0.1  # seconds until the next look for agents, during a halt
FLEET_SETTLE_S: Final = 2.0  # seconds after which the links to all agents that can be reached are up
STOPPED: Final = "stopped"


@dataclass(frozen=True, slots=True)
class Member:
    """A gripper of a fleet, as of its last summary.

    Attributes:
        name: the gripper's name.
        is_there: whether an agent serves it now.
        agents: number of agents that serve it; more than 1 is a mistake.
        state: of the agent's hand; None before the first summary.
        model: name of the gripper's model, which a newer agent may know alone; empty before that.
        fault: the fault that the gripper reports; None if unknown, as with an unknown model.
        is_moving: whether an axis moves.
        holder: label of the client that commands it; None if no client does.
        inhibited: why motion is refused, and who has stopped it; empty if it is permitted.
        problem: why the agent cannot reach the gripper; empty if it can.
        address: of the gripper, as its agent reaches it.
        seen_at: time of the agent's last read of the gripper, in monotonic seconds of this process; None if
            it never has. The clocks of hosts differ, so the true time may be earlier, by the transit time of
            the fastest summary.
    """

    name: GripperName
    is_there: bool = False
    agents: int = 0
    state: State | None = None
    model: str = ""
    fault: Fault | None = None
    is_moving: bool = False
    holder: str | None = None
    inhibited: str = ""
    problem: str = ""
    address: str = ""
    seen_at: float | None = field(default=None, compare=False)


class Fleet:
    """All grippers of a site, or of all sites, that agents serve.

    Use it as ``async with Fleet("lab") as fleet:``. It reads and halts. To command a gripper, use
    :meth:`hand`.
    """

    def __init__(
        self, site: str | None = None, *, route: Route | None = None, bus: Bus | None = None
    ) -> None:
        """Opens nothing and needs no running loop.

        Args:
            site: the site's name; None for all sites.
            route: the way to agents; None for the route in the environment, else agents on this machine.
            bus: an open session to share; it stays open. None opens one.

        Raises:
            TypeError, ValueError: a malformed name, or a malformed or unprotected route.
        """
        self._site = "*" if site is None else check_name("site", site)
        self._route = route or default_route()
        if bus is None:
            self._route.configuration()  # a malformed or unprotected route fails here, not at the start
        self._shared = bus
        self._bus: Bus | None = None
        self._entered_at = 0.0
        self._undo: list[Undo] = []
        self._members: dict[GripperName, Member] = {}
        self._tokens: dict[GripperName, set[str]] = {}
        self._summaries = Summaries()
        self._unreadable = LimitedLog()
        self._changes: Channel[Member] = Channel()

    async def __aenter__(self) -> Self:
        """Subscribe, and find the agents that are there already.

        Raises:
            RuntimeError: not in a running asyncio event loop.
            RobotiqError: no session could be opened.
        """
        loop = asyncio.get_running_loop()
        self._changes.check_loop(loop)
        self._bus = bus = self._shared or await self._open()
        self._changes.reopen(loop)
        self._entered_at = now()
        base = f"{ROOT}/{self._site}/*/*"
        self._undo = [
            bus.subscribe(f"{base}/summary", self._receive),
            bus.watch(f"{base}/alive/*", self._update_token),
        ]
        try:
            await self._discover()
        except BaseException:
            await self.__aexit__(None, None, None)
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        for undo in self._undo:
            undo()
        self._changes.end()
        bus, self._bus = self._bus, None
        if bus is not None and bus is not self._shared:
            await bus.close()

    @property
    def members(self) -> Mapping[GripperName, Member]:
        """All grippers seen since the fleet was entered, also grippers that have left."""
        return dict(sorted(self._members.items()))

    def changes(self) -> Stream[Member]:
        """A stream of members: each member when it joins, leaves, moves, fails or changes otherwise."""
        return self._changes.open(None)

    def hand(self, name: GripperName | str, *, control: bool = True) -> RemoteHand:
        """A hand for one of the grippers, over the session of this fleet; it is not started.

        Args:
            name: the gripper's name, or its address.
            control: whether it acquires the lease when it starts.

        Raises:
            ValueError: a malformed address.
            RuntimeError: the fleet is not entered.
        """
        return RemoteHand(str(name), control=control, bus=self._entered())

    async def halt_all(self, inhibit: str = "") -> Mapping[GripperName, str]:
        """Halt every gripper that is or was there; returns "stopped" for each.

        With a reason to ``inhibit``, motion of each is refused from then on until a person permits it
        again, as by :meth:`Hand.inhibit`.

        It is no safety function: a network may be down when it is needed. A gripper that does not answer is
        tried for 2 s. For 2 s after the fleet was entered, it waits for agents whose links come up late. If
        cancelled, halts that have not ended are given up.

        Raises:
            NotAllStoppedError: a gripper was not seen to stop; no gripper was found; or an endpoint of the
                route was not reached, so that the grippers behind it are unknown.
            RuntimeError: the fleet is not entered.
        """
        bus = self._entered()
        halting: dict[tuple[GripperName, int], asyncio.Task[str]] = {}
        """Halts by gripper and number of its agents: if another one appears, the gripper is halted again."""
        try:
            # Links come up one after the other: each gripper is halted as soon as it is found.
            while True:
                await self._discover()
                for name, member in self._members.items():
                    if (name, member.agents) not in halting:
                        work = halt(bus, name, member.agents, inhibit)
                        halting[name, member.agents] = asyncio.ensure_future(work)
                if now() - self._entered_at >= FLEET_SETTLE_S:
                    break
                await asyncio.sleep(LOOK_AGAIN_S)
            outcomes: dict[GripperName, str] = {}
            for (name, _), task in sorted(halting.items()):
                how = await task
                if outcomes.setdefault(name, how) == STOPPED:
                    outcomes[name] = how
        finally:
            for task in halting.values():
                task.cancel()
        unreached = await bus.unreached()
        failed = {name: how for name, how in outcomes.items() if how != STOPPED}
        if failed or unreached or not outcomes:
            raise NotAllStoppedError(_report(outcomes, unreached), outcomes, unreached)
        return outcomes

    # -- inside ----------------------------------------------------------------------------------------

    async def _open(self) -> Bus:
        from .network.zenoh_bus import open_bus  # noqa: PLC0415  # needs the extra

        return await open_bus(self._route.configuration(), f"the fleet {self._site}")

    def _entered(self) -> Bus:
        if self._bus is None:
            raise RuntimeError("the fleet is not entered: use 'async with Fleet(...)'")
        return self._bus

    async def _discover(self) -> None:
        for key in await self._entered().announced(f"{ROOT}/{self._site}/*/*/alive/*", timeout=LOOK_S):
            self._update_token(key, True)

    def _update_token(self, key: str, is_there: bool) -> None:
        try:
            name = GripperName.of_key(key)
        except ValueError:
            return
        tokens = self._tokens.setdefault(name, set())
        (tokens.add if is_there else tokens.discard)(key)
        self._change(name, is_there=bool(tokens), agents=len(tokens))

    def _receive(self, _key: str, payload: bytes) -> None:
        try:
            read = self._summaries.read(payload, now())
        except ProtocolError as error:
            self._unreadable.warn("a summary was dropped: %s", error)
            return
        if read is not None and self._site in ("*", read[0].site):
            self._change(read[0], **read[1])

    def _change(self, name: GripperName, **what: Any) -> None:  # noqa: ANN401
        before = self._members.get(name) or Member(name)
        self._members[name] = after = replace(before, **what)
        if after != before:
            self._changes.push(after)

    def __iter__(self) -> Iterator[Member]:
        return iter(self.members.values())


def _report(outcomes: Mapping[GripperName, str], unreached: Sequence[str]) -> str:
    stopped = sum(how == STOPPED for how in outcomes.values())
    parts = [
        f"halted {stopped} of {len(outcomes)}" if outcomes else "no gripper was found: nothing was stopped"
    ]
    parts += [f"{name}: {how}" for name, how in outcomes.items() if how != STOPPED]
    parts += [f"not reached: {', '.join(unreached)}"] if unreached else []
    return "; ".join(parts)


async def halt(bus: Bus, name: GripperName, agents: int, inhibit: str = "") -> str:
    """Halt a gripper; returns "stopped", or "no answer" or "refused" with the reason. Raises no such error.

    All ``agents`` that serve it must confirm that it has stopped.
    """
    dialog = Dialog(name, bus, Mirror(name.mark))
    try:
        answer = await dialog.halt(agents, {"inhibit": inhibit} if inhibit else None)
    except NoAnswerError as error:
        return error.why
    except (RobotiqError, TypeError, ValueError) as error:
        return f"refused: {error}"
    finally:
        await dialog.close()
    if inhibit and "inhibited" not in answer:
        return "stopped, but not inhibited: its agent is older"
    return STOPPED


def _inhibited(fields: Mapping[str, Any]) -> str:
    inhibit = fields.get("inhibited")
    return "" if inhibit is None else str(Inhibit.from_dict(inhibit))


@dataclass(slots=True)
class _AgentRun:
    """A run of an agent: its clock, and the newest stamp."""

    epoch: int
    newest: float = -math.inf
    clock: AgentClock = field(default_factory=AgentClock)

    def is_overtaken(self, stamp: float) -> bool:
        """Whether a newer stamp has come before this one."""
        newest, self.newest = self.newest, max(self.newest, stamp)
        return stamp < newest


class Summaries:
    """Reads summaries, and drops summaries that were overtaken."""

    def __init__(self) -> None:
        self._runs: dict[GripperName, _AgentRun] = {}  # the last run of the agent, by gripper

    def read(self, payload: bytes, arrival: float) -> tuple[GripperName, dict[str, Any]] | None:
        """The gripper of a summary, and the fields of its member; None if a newer one has overtaken it."""
        with reading("a summary"):
            fields = json.loads(payload)
            # The name in the payload, not in the key: zenoh may deliver under a wrong one.
            name = GripperName.of_key(f"{fields['to']}/summary")
            stamp, age, fault = float(fields["stamp"]), fields["age"], fields["fault"]
            model = MODELS.get(name_of_model := words(fields["model"]))
            seen = stamp if age is None else stamp - float(age)
            if not math.isfinite(seen):
                raise ValueError(f"not a time: {stamp}, {age}")
            what = {
                "state": State[fields["state"]],
                "model": name_of_model,
                "fault": None if fault is None or model is None else model.fault(fault),
                "is_moving": bool(fields["is_moving"]),
                "holder": None if fields["holder"] is None else words(fields["holder"]),
                "inhibited": _inhibited(fields),
                "problem": words(fields["problem"]),
                "address": words(fields["address"]),
            }
            run = self._run_of(name, int(fields["epoch"]))
        run.clock.receive(stamp, arrival)
        if run.is_overtaken(stamp):
            return None
        return name, what | {"seen_at": None if age is None else run.clock(seen)}

    def _run_of(self, name: GripperName, epoch: int) -> _AgentRun:
        run = self._runs.get(name)
        if run is None or run.epoch != epoch:
            run = self._runs[name] = _AgentRun(epoch)
        return run
