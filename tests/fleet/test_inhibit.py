"""An inhibit at an agent: for all clients, over leases and its own restart; by a fleet's halt."""

from __future__ import annotations

import asyncio
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from robotiq_async import Finger, Inhibit, MotionInhibitedError, RobotiqError, RobotiqHand, RobotiqStateError
from robotiq_async.fleet.agent import records
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.agent.inhibits import Inhibits
from robotiq_async.fleet.agent.records import Records
from robotiq_async.fleet.errors import AgentError, ControlLostError, NotAllStoppedError
from robotiq_async.fleet.fleet import Fleet, halt
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import unpack_call
from tests.fleet.cell import move_slowly
from tests.fleet.lab import LEFT, Between, Lab, lab, serving
from tests.fleet.network import Network
from tests.fleet.world import MemoryRecords, World, world
from tests.virtual import inside, until, virtual


@inside(lab)
async def test_a_halt_of_the_fleet_stays_for_every_client_until_a_person_permits(here: Lab) -> None:
    async with here.client("holder") as hand, here.client("person", control=False) as person:
        moving = await here.moving(hand)
        async with Fleet("lab", bus=here.network.bus("console")) as fleet:
            assert list((await fleet.halt_all("fleet halt")).values()) == ["stopped"]
            await until(lambda: fleet.members[LEFT].inhibited.startswith("motion is inhibited: fleet halt ("))
        with pytest.raises(ControlLostError, match="halted"):
            await moving
        await hand.acquire()
        await until(lambda: hand.inhibited is not None)
        for work in (hand.move(9), hand.recover(), hand.set_force(200)):
            with pytest.raises(MotionInhibitedError, match="fleet halt"):
                await work
        with pytest.raises(MotionInhibitedError, match="fleet halt"):
            hand.command(position=9)
        hand.command(speed=9)
        assert not here.gripper.is_moving
        await person.permit(who="the foreman")
        assert person.inhibited is None
        await until(lambda: hand.inhibited is None)
        await hand.move(30, Finger.A)


@inside(world)
async def test_it_outlives_leases_and_the_agent(here: World) -> None:
    """The agent is killed, and the next one reads what it has left."""
    await move_slowly(here)
    await here.other.do(here.other.hand.inhibit("the guard is open", who="PLC"))
    assert not here.gripper.is_moving
    here.kill(here.agent.host)
    await here.start_agent("next agent")
    await asyncio.sleep(2)
    inhibit = here.holder.hand.inhibited
    assert inhibit is not None
    assert inhibit.reason == "the guard is open"
    assert inhibit.who.startswith("PLC, ")
    await here.holder.do(here.holder.hand.acquire())
    with pytest.raises(MotionInhibitedError, match="the guard is open"):
        await here.holder.do(here.holder.hand.move(0, Finger.A))
    await here.other.do(here.other.hand.permit())
    here.kill(here.agent.host)
    await here.start_agent("third agent")
    await asyncio.sleep(2)
    assert here.holder.hand.inhibited is None
    await here.holder.do(here.holder.hand.acquire())
    await here.holder.do(here.holder.hand.move(0, Finger.A))


@inside(lab)
async def test_nothing_malformed_keeps_it_from_halting(here: Lab) -> None:
    """Whatever a program of others calls the reason, the fingers stop, and stay."""
    async with here.client("holder") as hand:
        await here.moving(hand)
        dialog = hand._remote.session.dialog  # type: ignore[union-attr]
        await dialog.halt(arguments={"inhibit": ["\x1b[2J" * 400], "who": 7})
        assert not here.gripper.is_moving
        inhibit = here.local.inhibited
        assert inhibit is not None
        assert inhibit.reason.isprintable()


@virtual
async def test_a_halt_that_cannot_reach_the_gripper_is_no_success() -> None:
    """The agent tries to reach its gripper again and again, so that its hand runs only now and then."""
    network = Network()
    hand = RobotiqHand("tcp://127.0.0.1:65001")  # nobody listens there
    async with serving(Agent("lab", "cell", {"left": hand}, network.bus("agent"))):
        for number in range(8):
            await asyncio.sleep(0.13)
            outcome = await halt(network.bus(f"console {number}"), LEFT, 1, "HALT")
            assert outcome.startswith("refused"), number
    assert hand.inhibited is not None


class LatePermit(Between):
    """A network on which a permit is 0.6 s on its way."""

    def ask(self, key: str, payload: bytes, **how: Any) -> asyncio.Future[Any]:
        if unpack_call(payload).arguments.get("what") == "permit":
            return asyncio.ensure_future(self._late(key, payload, how))
        return self._bus.ask(key, payload, **how)

    async def _late(self, key: str, payload: bytes, how: Any) -> Any:
        await asyncio.sleep(0.6)
        return await self._bus.ask(key, payload, **how)


@inside(lab)
async def test_a_permit_lifts_the_inhibit_that_its_person_saw_and_no_later_one(here: Lab) -> None:
    late = here.client_over(LatePermit(here.network.bus("late")), control=False)
    async with late as one, here.client("other", control=False) as other:
        await one.inhibit("the guard is open")
        permitting = asyncio.create_task(one.permit(who="one"))
        await asyncio.sleep(0.1)
        await other.inhibit("a hand is in the gripper")
        with pytest.raises(RobotiqStateError, match="look at the gripper"):
            await permitting
        assert here.local.inhibited is not None
        for named in ({}, {"inhibited": 3}, {"inhibited": {"reason": "", "who": "", "since": 1}}):
            with pytest.raises(RobotiqStateError, match="look at the gripper"):
                await other._remote.session.dialog.ask("lease", {"what": "permit", **named}, timeout=1)  # type: ignore[union-attr]
        await other.permit()
        assert here.local.inhibited is None


@pytest.mark.parametrize("is_halt_first", [True, False])
@virtual
async def test_a_halt_and_a_permit_in_one_turn_leave_an_inhibit_that_the_next_agent_has(
    is_halt_first: bool,
) -> None:
    kept = MemoryRecords()
    async with (
        lab(records=kept) as here,
        here.client("one", control=False) as one,
        here.client("other", control=False) as other,
    ):
        await one.inhibit("first")
        asked = [other.inhibit("second"), one.permit()]
        await asyncio.gather(*(asked if is_halt_first else reversed(asked)), return_exceptions=True)
        assert other.inhibited is not None
        assert here.local.inhibited is not None
    async with lab(records=kept) as here, here.client("program") as program:
        with pytest.raises(MotionInhibitedError):
            await program.move(100)


class Older(Between):
    """The agent of an older version: it does not know the word."""

    def ask(self, key: str, payload: bytes, **how: object) -> object:
        fields = json.loads(payload)
        fields.get("arguments", {}).pop("inhibit", None)
        return self._bus.ask(key, json.dumps(fields).encode(), **how)  # type: ignore[arg-type]


@inside(lab)
async def test_an_older_agent_halts_and_the_caller_hears_that_it_inhibits_nothing(here: Lab) -> None:
    async with RemoteHand(str(LEFT), bus=Older(here.network.bus("new"))) as hand:  # type: ignore[arg-type]
        await here.moving(hand)
        with pytest.raises(AgentError, match="older"):
            await hand.inhibit("HALT")
        assert not here.gripper.is_moving
        assert hand.inhibited is None
    async with Fleet("lab", bus=Older(here.network.bus("console"))) as fleet:  # type: ignore[arg-type]
        with pytest.raises(NotAllStoppedError, match="not inhibited: its agent is older"):
            await fleet.halt_all("fleet halt")


async def test_its_record_counts_after_a_restart_of_the_machine(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The record of a lease does not: it may be outdated. An outdated inhibit only refuses."""
    one, inhibit = Records(tmp_path), Inhibit("the guard is open", "", 1.0)
    one.keep(LEFT, {"number": 3, "inhibited": inhibit.as_dict()})
    await one.kept()
    boot = tmp_path / "boot"
    boot.write_text("another")
    monkeypatch.setattr(records, "_BOOT", boot)
    later = Records(tmp_path)
    assert later.read(LEFT) is None
    assert later.read_inhibit(LEFT) == inhibit.as_dict()


async def test_a_record_that_is_lost_in_part_counts_as_an_inhibit(tmp_path: Path) -> None:
    """A power cut may leave an empty file; a gripper without a file was never inhibited."""
    one, file = Records(tmp_path), tmp_path / "lab+cell+left.json"
    assert one.read_inhibit(LEFT) is None
    one.keep(LEFT, {"number": 3, "inhibited": None})
    await one.kept()
    assert one.read_inhibit(LEFT) is None
    whole = file.read_bytes()
    for left in (b"", whole[:20], b"[]", b"null", b"\xff"):
        file.write_bytes(left)
        found = one.read_inhibit(LEFT)
        assert found is not None
        hand = RobotiqHand("sim://")
        Inhibits(hand).resume(found)
        assert hand.inhibited is not None
        assert hand.inhibited.reason == "the record of an inhibit cannot be read"


async def test_a_full_disk_loses_no_inhibit(tmp_path: Path) -> None:
    """Nor does it leave a record of the lease that is outdated."""
    one, inhibit = Records(tmp_path), Inhibit("the guard is open", "", 1.0)
    one.keep(LEFT, {"number": 3, "inhibited": inhibit.as_dict()})
    await one.kept()
    (tmp_path / "lab+cell+left.new").mkdir()  # as little room as on a full disk
    one.keep(LEFT, {"number": 4, "inhibited": inhibit.as_dict()})
    await one.kept()
    assert one.read(LEFT) is None
    assert one.read_inhibit(LEFT) is not None
    one.keep(LEFT, {"number": 5, "inhibited": None})  # a person has lifted it
    await one.kept()
    assert one.read_inhibit(LEFT) is None


async def test_an_inhibit_is_on_the_disk_before_it_replaces_the_record_of_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = Records(tmp_path)
    steps: list[str] = []

    def noted(name: str, work: Callable[..., Any]) -> Callable[..., Any]:
        def step(*arguments: Any) -> Any:
            steps.append(name)
            return work(*arguments)

        return step

    monkeypatch.setattr(os, "fsync", noted("sync", os.fsync))
    monkeypatch.setattr(Path, "replace", noted("replace", Path.replace))
    one.keep(LEFT, {"inhibited": None})
    await one.kept()
    assert steps == ["replace"]  # settings change often, and are not worth a wait for the disk
    one.keep(LEFT, {"inhibited": Inhibit("HALT", "", 1.0).as_dict()})
    await one.kept()
    assert steps == ["replace", "sync", "replace", "sync"]


@pytest.mark.parametrize("record", ["?", {"reason": 3}, {"reason": "", "who": "", "since": "x"}])
@inside(world)
async def test_an_inhibit_that_cannot_be_read_counts(here: World, record: object) -> None:
    here.kill(here.agent.host)
    here.records.records[LEFT] = {"inhibited": record}
    await here.start_agent("next agent")
    await asyncio.sleep(2)
    with pytest.raises(RobotiqError, match="cannot be read"):
        await here.other.do(_moved(here.other.hand))


async def _moved(hand: RemoteHand) -> None:
    await hand.take()
    await hand.move(9)
