"""How control is lost, noticed to be lost, and when it comes back, also from a restarted agent."""

from __future__ import annotations

import asyncio
import json
import logging
import stat
from pathlib import Path
from typing import Any

import pytest

from robotiq_async import Finger, State
from robotiq_async.fleet.agent import records
from robotiq_async.fleet.agent.records import FileRecords, NoRecords, file_records
from robotiq_async.fleet.control.lease import Holder, Lease
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.wire.envelope import Call
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.values.errors import AgentError, ControlLostError
from robotiq_async.values.request import Request as Image
from tests.fleet.cell import told
from tests.fleet.lab import Garbling, Spoiling, lab
from tests.fleet.world import World, world
from tests.virtual import virtual

LEFT = GripperName("lab", "cell", "left")


# -- control -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("after", [0.4, 1.6])
@pytest.mark.parametrize("what", ["halt", "take"])
@virtual
async def test_who_was_cut_off_does_not_come_back_after_a_halt_or_a_take(what: str, after: float) -> None:
    """It hears of neither: for it the lease has ended because the link was lost. Before that, and after."""
    async with world() as here:
        here.cut(here.holder)
        await asyncio.sleep(after)
        other = here.other.hand
        await here.other.do(other.halt() if what == "halt" else other.take())
        if what == "take":
            await here.other.do(other.release())
        await asyncio.sleep(1.5)
        here.mend(here.holder)
        await asyncio.sleep(3)
        assert not here.holder.hand.is_in_control
        word = {"halt": "halted", "take": "taken"}[what]
        assert await here.holder.do(told(here.holder.hand.set_speed(9))) == f"ControlLost {word}"
        await here.holder.do(here.holder.hand.acquire())
        await here.holder.do(here.holder.hand.set_speed(9))


@virtual
async def test_who_was_cut_off_does_not_come_back_after_a_halt_of_the_next_holder() -> None:
    """Only a halt of a client that had not held the lease barred the one before."""
    async with lab() as here:
        first = here.client("first")
        await first.start()
        here.network.cut(("first", "agent"), ("agent", "first"))
        await asyncio.sleep(2)
        async with here.client("next") as other:
            await other.halt()
        here.network.mend(*here.network.both("first", "agent"))
        await asyncio.sleep(3)
        assert not first.is_in_control
        with pytest.raises(ControlLostError):
            await first.move(30)
        await first.stop()


@virtual
async def test_its_own_halt_bars_nobody() -> None:
    async with world() as here:
        here.cut(here.holder)
        await asyncio.sleep(2)
        here.mend(here.holder)
        await here.holder.do(here.holder.hand.halt())
        await here.until(lambda: here.holder.hand.is_in_control)


@virtual
@pytest.mark.parametrize(("lost", "keeps"), [(1, True), (100, False)])
async def test_one_lost_renewal_does_not_lose_the_lease(lost: int, keeps: bool) -> None:
    async with lab() as here:
        bus = Spoiling(here.network.bus("client"), "/lease", times=0)
        async with here.client_over(bus) as hand:
            bus.left = lost
            moving = asyncio.create_task(hand.move(215, Finger.A, speed=0))
            for _ in range(300):
                await asyncio.sleep(0.01)
                if not hand.is_in_control:
                    break
            assert hand.is_in_control is keeps
            bus.left = 0
            if keeps:
                assert (await moving).positions[Finger.A] == pytest.approx(215, abs=2)
            else:
                with pytest.raises(ControlLostError):
                    await moving


@virtual
async def test_whoever_lost_the_lease_notices_although_the_agent_does_not_understand_the_question() -> None:
    """The question ended in a TypeError, and the hand took itself for the one that commands."""
    async with lab() as here, here.client("other", control=False) as other:
        bus = Garbling(here.network.bus("client"))
        async with here.client_over(bus) as hand:
            bus.verb = "/lease"
            await other.take()
            await asyncio.sleep(1)
            assert not hand.is_in_control
            with pytest.raises(AgentError, match="does not understand lease"):
                await hand.acquire()
            bus.verb = "nothing"


@virtual
async def test_silence_is_noticed_while_the_lease_is_asked_for_again() -> None:
    """The last status of an agent that had died was shown as the present one for ever."""
    async with lab() as here, here.client() as hand:
        here.network.cut(("client", "agent"))
        while hand.is_in_control:  # noqa: ASYNC110  # there is no event to wait for
            await asyncio.sleep(0.01)
        here.network.cut(("agent", "client"))
        await asyncio.sleep(3)
        assert hand.state is State.DISCONNECTED


@virtual
async def test_an_agent_that_is_ending_refuses_and_says_so() -> None:
    """It acknowledged what it no longer did."""
    async with lab() as here, here.client("reader", control=False) as reader:
        await here.local.set_speed(0)
        await here.local.set_position(250, Finger.A)
        writes = len(here.gripper.writes)
        here.serving.cancel()
        with pytest.raises(ControlLostError, match="the agent is ending; nothing was done") as refused:
            await reader.acquire()
        assert refused.value.reason == "closed"
        await asyncio.gather(here.serving, return_exceptions=True)
        assert not here.gripper.is_moving
        ends = [Image.from_registers(write.registers) for write in here.gripper.writes[writes:]]
        assert ends, "the halt"
        assert not any(image.go for image in ends), "and nothing else"


@virtual
async def test_the_holders_secret_is_told_to_nobody() -> None:
    async with lab() as here, here.client("first"), here.client("reader", control=False) as reader:
        bus = here.network.bus("stranger")
        call = Call("robotiq/v1/lab/cell/left", "stranger")
        reply = await bus.ask(f"{call.to}/info", call.pack(), timeout=1.0, urgency=Urgency.COMMAND)
        assert reply is not None
        assert b'"client"' not in reply.payload
        assert reader.state is State.RUNNING_IDLE


# -- restarts ----------------------------------------------------------------------------------------------


async def restart(here: World, how: str) -> None:
    if how == "killed":
        here.kill(here.agent.host)
        await asyncio.sleep(1)
    else:
        await here.agent.end()
    await here.start_agent("next agent")


@pytest.mark.parametrize("how", ["killed", "ended"])
@pytest.mark.parametrize("what", ["halt", "take", "command"])
@virtual
async def test_who_was_cut_off_does_not_come_back_although_the_agent_was_started_anew(
    what: str, how: str
) -> None:
    """It came back by itself, and moved 3 s after another client's halt."""
    async with world() as here:
        hand, other = here.holder.hand, here.other.hand

        async def loop() -> None:
            """A program that goes on as soon as it may."""
            while True:
                await told(hand.move(200, Finger.A, speed=0))
                await asyncio.sleep(0.05)

        looping = here.holder.host.start(loop())
        await here.until(lambda: here.gripper.is_moving)
        here.cut(here.holder)
        if what == "halt":
            await here.other.do(other.halt())
        else:
            await here.other.do(other.take())
            if what == "command":  # the gripper's rGTO is set again
                await here.other.do(other.move(0, Finger.B))
            await here.other.do(other.release())
        await restart(here, how)
        here.mend(here.holder)
        stood = here.gripper.travel(Finger.A)
        await asyncio.sleep(4)
        assert not hand.is_in_control
        assert here.gripper.travel(Finger.A) == stood
        word = "halted" if what == "halt" else "taken"
        assert await here.holder.do(told(hand.set_speed(9))) == f"ControlLost {word}"
        looping.cancel()
        await here.holder.do(hand.acquire())
        await here.holder.do(hand.move(60, Finger.A))


@pytest.mark.parametrize("how", ["killed", "ended"])
@virtual
async def test_a_halt_without_a_holder_counts_as_well(how: str) -> None:
    async with world() as here:
        here.cut(here.holder)
        await asyncio.sleep(2)  # its lease has ended by itself
        await here.other.do(here.other.hand.halt())
        await restart(here, how)
        await restart(here, how)
        here.mend(here.holder)
        await asyncio.sleep(3)
        assert not here.holder.hand.is_in_control


@virtual
async def test_where_nothing_is_known_nobody_comes_back_by_itself() -> None:
    async with world() as here:
        here.kill(here.agent.host)
        await asyncio.sleep(1)
        here.records.records.clear()
        await here.start_agent("next agent")
        await asyncio.sleep(3)
        assert not here.holder.hand.is_in_control
        assert await here.holder.do(told(here.holder.hand.set_speed(9))) == "ControlLost restarted"
        await here.holder.do(here.holder.hand.acquire())


@virtual
async def test_a_record_that_is_none_lets_nobody_back(caplog: pytest.LogCaptureFixture) -> None:
    async with world() as here:
        here.kill(here.agent.host)
        await asyncio.sleep(1)
        here.records.records[LEFT] = {"runs": "?", "number": 3, "barred": [1, "x"]}
        await here.start_agent("next agent")
        assert "the record of the lease cannot be read" in caplog.text
        await asyncio.sleep(3)
        assert not here.holder.hand.is_in_control


def test_a_lease_goes_on_where_the_last_run_ended() -> None:
    kept: list[dict[str, Any]] = []
    first = Lease(run=1, changed=lambda: kept.append(json.loads(json.dumps(first.record))))
    first.grant(Holder("a", "anna"), 0.0)
    first.intervene("b", "halted")
    first.end("halted")
    first.grant(Holder("c", "carl"), 0.0)
    for run in (2, 3):
        following = Lease(run=run)
        following.resume(kept[-1])
        assert following.runs == (1, run)
        assert following.number > first.number
        assert following.why_not_again(1) == "halted"
        assert following.why_not_again(3) == ""
        assert following.holder is None


def test_a_lease_remembers_a_bounded_number_of_runs() -> None:
    record: dict[str, Any] = Lease(run=0).record
    for run in range(1, 200):
        lease = Lease(run=run)
        lease.resume(record)
        record = lease.record
    assert len(record["runs"]) == 64
    assert record["runs"][-1] == 199


async def test_files_are_kept_for_their_owner_alone_and_the_newest_counts(tmp_path: Path) -> None:
    folder = tmp_path / "state" / "robotiq"
    one = FileRecords(folder)
    assert one.read(LEFT) is None
    for number in range(100):
        one.keep(LEFT, {"number": number})
    while one._writing:
        await one.kept()
    assert FileRecords(folder).read(LEFT)["number"] == 99  # type: ignore[index]
    (file,) = folder.iterdir()
    assert file.name == "lab+cell+left.json"
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert FileRecords(folder).read(GripperName("lab", "cell", "right")) is None


async def test_a_record_of_before_a_restart_of_the_machine_says_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = FileRecords(tmp_path)
    one.keep(LEFT, {"number": 3})
    await one.kept()
    boot = tmp_path / "boot"
    for said in ("another boot\n", ""):
        boot.write_text(said)
        monkeypatch.setattr(records, "_BOOT", boot)
        assert FileRecords(tmp_path).read(LEFT) is None
    monkeypatch.setattr(records, "_BOOT", tmp_path / "nowhere")
    unknown = FileRecords(tmp_path)
    unknown.keep(LEFT, {"number": 3})
    await unknown.kept()
    assert FileRecords(tmp_path).read(LEFT) is None, "what cannot be read is unknown"


async def test_what_cannot_be_kept_takes_the_old_one_away(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """An old record would let back in who must not come."""
    one = FileRecords(tmp_path)
    one.keep(LEFT, {"number": 3})
    await one.kept()
    (tmp_path / "lab+cell+left.new").mkdir()
    with caplog.at_level(logging.WARNING):
        for number in (4, 5):
            one.keep(LEFT, {"number": number})
            await one.kept()
    assert caplog.text.count("no client reacquires the lease automatically") == 1
    assert one.read(LEFT) is None


@pytest.mark.parametrize("content", [b"", b"[]", b"{", b'"x"', b"\xff", b"[" * 100_000])
def test_files_that_are_no_records(content: bytes, tmp_path: Path) -> None:
    (tmp_path / "lab+cell+left.json").write_bytes(content)
    assert FileRecords(tmp_path).read(LEFT) is None


def test_where_the_files_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def folder() -> Path:
        found = file_records()
        assert isinstance(found, FileRecords)
        return found._folder

    monkeypatch.setenv("STATE_DIRECTORY", f"{tmp_path}:/other")
    assert folder() == tmp_path
    monkeypatch.delenv("STATE_DIRECTORY")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert folder() == tmp_path / "robotiq-async"
    monkeypatch.delenv("XDG_STATE_HOME")
    monkeypatch.setattr(Path, "home", classmethod(lambda _: tmp_path))
    assert folder() == tmp_path / ".local" / "state" / "robotiq-async"

    def homeless(_: object) -> Path:
        raise RuntimeError("no home")

    monkeypatch.setattr(Path, "home", classmethod(homeless))
    assert isinstance(file_records(), NoRecords)


@virtual
async def test_an_agent_without_records_serves_all_the_same() -> None:
    async with world(records=None) as here:
        await here.holder.do(here.holder.hand.move(30, Finger.A))
        here.cut(here.holder)
        await asyncio.sleep(2)
        here.mend(here.holder)
        await here.until(lambda: here.holder.hand.is_in_control)


async def test_all_that_was_kept_is_waited_for(tmp_path: Path) -> None:
    """A record that waited for the one before it was not: a halt was answered with its grant on the disk."""
    records, name = FileRecords(tmp_path), GripperName("lab", "cell", "left")
    for number in range(5):
        records.keep(name, {"number": number})
    await records.kept()
    record = FileRecords(tmp_path).read(name)
    assert record is not None
    assert record["number"] == 4
