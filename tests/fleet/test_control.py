"""Control is lost, noticed to be lost, and comes back, also from a restarted agent."""

from __future__ import annotations

import asyncio
import json
import logging
import os
import stat
from pathlib import Path
from typing import Any

import pytest

from robotiq_async import Finger, State
from robotiq_async.calibration.scales import SpeedCalibration
from robotiq_async.fleet.agent import records
from robotiq_async.fleet.agent.records import Records, file_records
from robotiq_async.fleet.control.lease import Holder, Lease
from robotiq_async.fleet.errors import AgentError, ControlLostError
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentCall
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.values.model import TWO_FINGER_85
from robotiq_async.values.request import Request as Image
from tests.fleet.cell import ending
from tests.fleet.lab import LEFT, Garbling, Lab, Spoiling, lab
from tests.fleet.world import World, world
from tests.virtual import VirtualLoop, inside, until

# -- control -----------------------------------------------------------------------------------------------


@inside(lab)
async def test_a_client_that_was_cut_off_does_not_reacquire_after_the_next_holder_halts(
    here: Lab, hand: RemoteHand
) -> None:
    """Only a halt of a client that had not held the lease barred the one before."""
    here.network.cut(("client", "agent"), ("agent", "client"))
    await asyncio.sleep(2)
    async with here.client("next") as other:
        await other.halt()
    here.network.mend(*here.network.both("client", "agent"))
    await asyncio.sleep(3)
    assert not hand.is_in_control
    with pytest.raises(ControlLostError):
        await hand.move(30)


@inside(world)
async def test_a_halt_of_the_holder_bars_no_client(here: World) -> None:
    here.cut(here.holder)
    await asyncio.sleep(2)
    here.mend(here.holder)
    await here.holder.do(here.holder.hand.halt())
    await here.until(lambda: here.holder.hand.is_in_control)


@inside(lab)
async def test_a_lease_that_comes_back_after_its_release_is_not_held(here: Lab, hand: RemoteHand) -> None:
    """The hand had asked for its lost lease by itself when the program released it."""
    here.network.delay("client", "agent", 0.05)
    here.network.cut(("client", "agent"), ("agent", "client"))
    await until(lambda: not hand.is_in_control)
    lost = here.lease
    here.network.mend(*here.network.both("client", "agent"))
    await until(lambda: here.lease > lost)
    assert not hand.is_in_control, "the answer is on its way"
    await hand.release()
    await asyncio.sleep(2)
    assert not hand.is_in_control
    with pytest.raises(ControlLostError):
        await hand.move(30)


@inside(lab)
@pytest.mark.parametrize("how", ["acquire", "take", "move"])
async def test_a_lease_that_is_granted_after_a_release_moves_nothing(here: Lab, how: str) -> None:
    """The motion began after release() had returned."""
    here.network.delay("client", "agent", 0.05)
    async with here.client(control=None) as hand:
        calling = asyncio.create_task(hand.move(200, speed=0) if how == "move" else getattr(hand, how)())
        lease = here.lease
        await until(lambda: here.lease > lease)
        await hand.release()
        with pytest.raises(ControlLostError, match="released while it was acquired"):
            await calling
        await asyncio.sleep(2)
        assert not hand.is_in_control
        assert not here.gripper.is_moving


@inside(lab)
async def test_a_lease_that_is_granted_after_a_release_is_free_for_others(here: Lab) -> None:
    """They heard for a second that this client commanded."""
    here.network.delay("client", "agent", 0.05)
    async with here.client(control=False) as hand, here.client("other", control=False) as other:
        acquiring, lease = asyncio.create_task(hand.acquire()), here.lease
        await until(lambda: here.lease > lease)
        await hand.release()
        with pytest.raises(ControlLostError, match="released while it was acquired"):
            await acquiring
        await asyncio.sleep(0.1)
        await other.acquire()


@inside(lab, window=5.0)
async def test_a_hand_is_not_held_up_by_its_own_last_run(here: Lab, hand: RemoteHand) -> None:
    """Its release had been lost: started again, it heard that this very program commanded."""
    await here.moving(hand)
    stream = here.network.stream("client", "agent")
    stream.is_cut, stream.keeps = True, False
    await hand.stop()
    assert here.gripper.is_moving
    here.network.mend(stream)
    await hand.start()
    await asyncio.sleep(0.1)
    assert not here.gripper.is_moving, "what its last run had set in motion is held"
    await hand.move(30, Finger.A)


@inside(lab, window=5.0)
async def test_a_forked_process_is_another_client(here: Lab, monkeypatch: pytest.MonkeyPatch) -> None:
    """Both have the same hand, and the second would take the lease unseen."""
    hand = here.client()
    await hand.start()
    stream = here.network.stream("client", "agent")
    stream.is_cut, stream.keeps = True, False
    await hand.stop()
    here.network.mend(stream)
    process = os.getpid()
    monkeypatch.setattr(os, "getpid", lambda: process + 1)
    with pytest.raises(ControlLostError, match="commands the gripper"):
        await hand.start()


@inside(lab)
@pytest.mark.parametrize(
    ("verb", "arguments"),
    [("cmd/move", {"position": 250}), ("lease", {"what": "take"}), ("lease", {"what": "release"})],
)
async def test_a_late_request_of_the_last_run_does_nothing_in_the_next(
    here: Lab, hand: RemoteHand, verb: str, arguments: dict[str, Any]
) -> None:
    assert hand._remote.session is not None
    late = hand._remote.session.dialog.call(arguments)
    await hand.stop()
    await hand.start()
    lease = here.lease
    assert (await here.answer(verb, late.pack())).error
    await asyncio.sleep(0.1)
    assert (here.lease, here.gripper.is_moving, hand.is_in_control) == (lease, False, True)


@inside(lab)
async def test_a_calibration_of_another_model_is_refused_before_anything_moves(here: Lab) -> None:
    here.gripper.write(0, [0x0000])
    await asyncio.sleep(0.5)
    travel = here.gripper.travel(Finger.A)
    jaw = SpeedCalibration("a jaw", ((0, 4.0), (255, 1.0)), TWO_FINGER_85)
    with pytest.raises(ValueError, match="2F-85"):
        await here.client(calibration=jaw).start()
    await asyncio.sleep(2)
    assert here.gripper.travel(Finger.A) == travel


@inside(lab)
@pytest.mark.parametrize(("lost", "keeps"), [(1, True), (100, False)])
async def test_one_lost_renewal_does_not_lose_the_lease(here: Lab, lost: int, keeps: bool) -> None:
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


@inside(lab)
async def test_a_lost_lease_is_noticed_from_an_answer_that_cannot_be_read(
    here: Lab,
) -> None:
    """The question ended in a TypeError, and the hand took itself for the one that commands."""
    async with here.client("other", control=False) as other:
        bus = Garbling(here.network.bus("client"))
        async with here.client_over(bus) as hand:
            bus.verb = "/lease"
            await other.take()
            await asyncio.sleep(1)
            assert not hand.is_in_control
            with pytest.raises(AgentError, match="does not understand lease"):
                await hand.acquire()
            bus.verb = "nothing"


@inside(lab)
async def test_a_lease_that_was_lost_unnoticed_is_not_taken_for_held(here: Lab, hand: RemoteHand) -> None:
    async with here.client("other", control=False) as other:
        stream = here.network.stream("agent", "client")
        stream.is_cut = True
        await other.take()
        acquiring = asyncio.create_task(hand.acquire())
        await asyncio.sleep(0.01)
        here.network.mend(stream)
        with pytest.raises(ControlLostError, match="commands the gripper"):
            await acquiring
        assert not hand.is_in_control


@inside(lab)
async def test_the_error_goes_on_saying_that_another_client_took_the_lease(
    here: Lab, hand: RemoteHand
) -> None:
    """The hand does not request it again, and so does not learn that it is held."""
    async with here.client("other", control=False) as other:
        await other.take()
        await asyncio.sleep(2)
        with pytest.raises(ControlLostError) as lost:
            await hand.set_speed(9)
        assert lost.value.reason == "taken"


@inside(lab)
async def test_a_move_that_runs_is_not_given_the_refusal_of_another_request(here: Lab) -> None:
    """The answer to the move is lost; by that to a renewal nothing was done."""
    bus = Spoiling(here.network.bus("client"), "/cmd/move", sends=True)
    async with here.client("other", control=False) as other, here.client_over(bus) as hand:
        moving = asyncio.create_task(hand.move(215, Finger.A, speed=0))
        await until(lambda: here.gripper.is_moving)
        await other.take()
        with pytest.raises(ControlLostError, match=r"taken.*cmd/move may have been carried out") as lost:
            await moving
        assert "nothing was done" not in str(lost.value)
        assert lost.value.reason == "taken"
        with pytest.raises(ControlLostError, match="nothing was done"):
            await hand.move(10)


@inside(lab)
async def test_silence_is_noticed_while_the_lease_is_asked_for_again(here: Lab, hand: RemoteHand) -> None:
    """The last status of an agent that had died was the present one for ever."""
    here.network.cut(("client", "agent"))
    await until(lambda: not hand.is_in_control)
    here.network.cut(("agent", "client"))
    await asyncio.sleep(3)
    assert hand.state is State.DISCONNECTED


@inside(lab)
async def test_an_agent_that_is_ending_refuses_and_says_so(here: Lab, reader: RemoteHand) -> None:
    """It acknowledged what it no longer did."""
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


@inside(lab)
async def test_the_secret_of_the_holder_is_not_sent(here: Lab, reader: RemoteHand) -> None:
    async with here.client("first"):
        answer = await here.answer("info/stranger", AgentCall(LEFT.base, "stranger").pack())
        assert b'"client"' not in answer.pack()
        assert reader.state is State.RUNNING_IDLE


# -- restarts ----------------------------------------------------------------------------------------------


async def restart(here: World, how: str) -> None:
    if how == "killed":
        here.kill(here.agent.host)
        await asyncio.sleep(1)
    else:
        await here.agent.end()
    await here.start_agent("next agent")


INTERVENTIONS = [
    *((what, after, ()) for what in ("halt", "take") for after in (0.4, 1.6)),
    *((what, 0.0, (how,)) for what in ("halt", "take", "command") for how in ("killed", "ended")),
    *(("halt", 2.0, (how, how)) for how in ("killed", "ended")),
]
"""Action of another client, seconds after the cut (at 2 s the lease has ended by itself), and restarts."""


@pytest.mark.parametrize(("what", "after", "restarts"), INTERVENTIONS)
@inside(world)
async def test_a_client_that_was_cut_off_does_not_come_back_after_an_intervention(
    here: World, what: str, after: float, restarts: tuple[str, ...]
) -> None:
    """It hears of none: for it the link was lost. It came back, and moved 3 s after another client's halt."""
    hand, other = here.holder.hand, here.other.hand

    async def loop() -> None:
        """A program that continues as soon as it may."""
        while True:
            await ending(hand.move(200, Finger.A, speed=0))
            await asyncio.sleep(0.05)

    looping = here.holder.host.create_task(loop())
    await here.until(lambda: here.gripper.is_moving)
    here.cut(here.holder)
    await asyncio.sleep(after)
    if what == "halt":
        await here.other.do(other.halt())
    else:
        await here.other.do(other.take())
        if what == "command":  # the gripper's rGTO is set again
            await here.other.do(other.move(0, Finger.B))
        await here.other.do(other.release())
    for how in restarts:
        await restart(here, how)
    if not restarts:
        await asyncio.sleep(1.5)
    here.mend(here.holder)
    stood = here.gripper.travel(Finger.A)
    await asyncio.sleep(2)
    assert not hand.is_in_control
    assert here.gripper.travel(Finger.A) == stood
    word = "halted" if what == "halt" else "taken"
    assert await here.holder.do(ending(hand.set_speed(9))) == f"ControlLost {word}"
    looping.cancel()
    await here.holder.do(hand.acquire())
    await here.holder.do(hand.move(60, Finger.A, speed=255))


@pytest.mark.parametrize("record", [None, {"runs": "?", "number": 3, "barred": [1, "x"]}])
@inside(world)
async def test_without_a_record_no_client_comes_back_by_itself(
    here: World, record: dict[str, Any] | None, caplog: pytest.LogCaptureFixture
) -> None:
    here.kill(here.agent.host)
    await asyncio.sleep(1)
    here.records.records.clear()
    if record is not None:
        here.records.records[LEFT] = record
    await here.start_agent("next agent")
    assert ("the record of the gripper cannot be read" in caplog.text) is (record is not None)
    await asyncio.sleep(3)
    assert not here.holder.hand.is_in_control
    assert await here.holder.do(ending(here.holder.hand.set_speed(9))) == "ControlLost restarted"
    await here.holder.do(here.holder.hand.acquire())


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


def test_the_newest_intervention_says_why_a_lease_is_not_reacquired() -> None:
    lease = Lease()
    for client, reason in (("a", "halted"), ("b", "taken")):
        lease.intervene(client, reason)
        assert lease.why_not_again(0) == reason


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
    one = Records(folder)
    assert one.read(LEFT) is None
    for number in range(100):
        one.keep(LEFT, {"number": number})
    await one.kept()
    assert Records(folder).read(LEFT)["number"] == 99, "one that waited for the one before it counts, too"  # type: ignore[index]
    (file,) = folder.iterdir()
    assert file.name == "lab+cell+left.json"
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert Records(folder).read(GripperName("lab", "cell", "right")) is None


async def test_a_record_of_before_a_restart_of_the_machine_says_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    one = Records(tmp_path)
    one.keep(LEFT, {"number": 3})
    await one.kept()
    boot = tmp_path / "boot"
    for said in ("another boot\n", ""):
        boot.write_text(said)
        monkeypatch.setattr(records, "_BOOT", boot)
        assert Records(tmp_path).read(LEFT) is None
    monkeypatch.setattr(records, "_BOOT", tmp_path / "nowhere")
    unknown = Records(tmp_path)
    unknown.keep(LEFT, {"number": 3})
    await unknown.kept()
    assert Records(tmp_path).read(LEFT) is None, "what cannot be read is unknown"


async def test_a_record_that_cannot_be_written_removes_the_old_one(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    """An old record would let back in who must not come."""
    one = Records(tmp_path)
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
    assert Records(tmp_path).read(LEFT) is None


def test_where_the_files_are(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    def folder() -> Path:
        found = file_records()._folder
        assert found is not None
        return found

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
    assert file_records()._folder is None


@inside(world, records=None)
async def test_an_agent_serves_without_records(here: World) -> None:
    await here.holder.do(here.holder.hand.move(30, Finger.A))
    here.cut(here.holder)
    await asyncio.sleep(2)
    here.mend(here.holder)
    await here.until(lambda: here.holder.hand.is_in_control)


# -- a loop that is held up --------------------------------------------------------------------------------


@inside(lab)
@pytest.mark.parametrize("turns", range(1, 40, 4))
async def test_a_start_outlasts_a_loop_that_is_held_up(here: Lab, turns: int) -> None:
    """Its time had passed with the block, and no agent was looked for any more."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    hand = here.reader()
    loop.after_turns(turns, lambda: loop.hold_up(10.0))
    await hand.start()
    loop.after_turns(turns, lambda: loop.hold_up(10.0))
    await hand.stop()
    assert hand.state is State.SHUTDOWN


@inside(lab)
@pytest.mark.parametrize(("call", "held"), [("acquire", 0.9), ("halt", 10.0)])
async def test_a_lost_request_is_repeated_after_a_loop_that_was_held_up(
    here: Lab, call: str, held: float
) -> None:
    """Its time had passed with the block, and no other copy was sent."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    bus = Spoiling(here.network.bus("client"), "/halt" if call == "halt" else "/lease", times=0)
    async with here.client_over(bus, control=False) as hand:
        bus.left = 1
        calling = asyncio.create_task(getattr(hand, call)())
        loop.after_turns(2, lambda: loop.hold_up(held))
        await calling
        assert bus.left == 0


@inside(world)
@pytest.mark.parametrize("disorder", [{"copies": 2, "lateness": 0.4}, {"delay": 0.2}])
async def test_messages_that_come_when_their_agent_is_gone_are_no_sign_of_it(
    here: World, disorder: dict[str, float]
) -> None:
    """Its silence was taken for a denied access, and it may have carried out the command."""
    for stream in here.network.both("holder", here.agent.host.name):
        vars(stream).update(disorder)
    await asyncio.sleep(1)
    calling = here.holder.host.create_task(ending(here.holder.hand.set_speed(9)))
    await asyncio.sleep(0)
    here.kill(here.agent.host)
    await here.until(calling.done)
    assert calling.result() == "ConnectionLost"
