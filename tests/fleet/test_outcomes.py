"""The outcome of a request is said truly, also late; settings are the agent's; questions come last."""

from __future__ import annotations

import asyncio
import json
import time
from dataclasses import replace

import pytest

from robotiq_async import Finger, MoveTimeoutError, RobotiqError
from robotiq_async.fleet import AgentError, ControlLostError
from robotiq_async.fleet.agent.jobs import JOBS_KEPT
from robotiq_async.fleet.network.bus import MessageKind, Urgency
from robotiq_async.fleet.network.mailbox import MOST_QUESTIONS, SHARE, Mailbox
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentAnswer, AgentCall
from robotiq_async.fleet.wire.status_message import SIZE
from robotiq_async.values.request import Request
from tests.fleet.lab import LEFT, Lab, lab
from tests.fleet.network import Network
from tests.fleet.outcomes import AFTER_S, outcome
from tests.virtual import inside, until, virtual

A, B = Finger.A, Finger.B


def call_of(hand: RemoteHand, **arguments: object) -> AgentCall:
    assert hand._remote.session is not None
    return hand._remote.session.dialog.call(arguments)


def force_of_a(here: Lab) -> int:
    return Request.from_registers(here.gripper.request_registers).axes[0].force


async def repeated(here: Lab, verb: str, call: AgentCall) -> AgentAnswer:
    return await here.answer(verb, call.pack())


@inside(lab)
async def test_a_repetition_after_the_lease_gets_the_first_answer(here: Lab, hand: RemoteHand) -> None:
    move = call_of(hand, position=200, fingers=1, speed=0)
    first = asyncio.create_task(repeated(here, "cmd/move", move))
    await until(lambda: here.gripper.is_moving)
    await hand.release()
    again = await repeated(here, "cmd/move", move)
    assert again == await first
    assert again.begun is True
    assert again.error is not None
    assert again.error["message"].endswith("it had begun")


@inside(lab)
async def test_what_was_not_begun_and_what_may_have_been(here: Lab, hand: RemoteHand) -> None:
    old = call_of(hand, value=3, fingers=1)
    await hand.release()
    never = await repeated(here, "cmd/set_speed", old)
    assert never.begun is False
    await hand.acquire()
    for _ in range(JOBS_KEPT + 2):
        await repeated(here, "cmd/command", call_of(hand, axes={"8": {"speed": 5}}))
    unknown = await repeated(here, "cmd/set_speed", replace(old, number=old.number + 1))
    assert unknown.begun is None, "it may be one of those that were forgotten"
    assert unknown.error is not None
    assert unknown.error["message"].endswith("it may have been carried out")
    other_run = await repeated(here, "cmd/set_speed", replace(old, epoch=old.epoch + 1))
    assert other_run.begun is None


@inside(lab)
async def test_the_last_512_are_kept(here: Lab, hand: RemoteHand) -> None:
    first = call_of(hand, value=3, fingers=1)
    answer = await repeated(here, "cmd/set_speed", first)
    for _ in range(511):
        await repeated(here, "cmd/command", call_of(hand, axes={"8": {"speed": 5}}))
    assert await repeated(here, "cmd/set_speed", first) == answer
    await repeated(here, "cmd/command", call_of(hand, axes={"8": {"speed": 5}}))
    assert await repeated(here, "cmd/set_speed", first) != answer


@inside(lab)
async def test_an_answer_belongs_to_one_client_and_one_lease(here: Lab, hand: RemoteHand) -> None:
    call = call_of(hand, value=3, fingers=1)
    first = await repeated(here, "cmd/set_speed", call)
    stranger = await repeated(here, "cmd/set_speed", replace(call, client="stranger"))
    assert stranger.error is not None
    assert stranger.error["kind"] == "ControlLostError"
    await hand.release()
    await hand.acquire()
    again = await repeated(here, "cmd/set_speed", replace(call, lease=here.lease))
    assert again.error is not None
    assert "a later request overtook this one" in again.error["message"]
    assert await repeated(here, "cmd/set_speed", call) == first


@inside(lab)
async def test_what_the_gripper_did_not_take_was_not_begun(here: Lab, hand: RemoteHand) -> None:
    await hand.reset()
    refused = await repeated(here, "cmd/set_speed", call_of(hand, value=3, fingers=1))
    assert (refused.begun, refused.error and refused.error["kind"]) == (False, "NotActivatedError")


@inside(lab)
async def test_a_move_that_timed_out_keeps_its_force(here: Lab, hand: RemoteHand) -> None:
    """After a loss of the lease a command to another axis loosened the grip: 10 was sent again."""
    await hand.move(100, A, force=10)
    with pytest.raises(MoveTimeoutError):
        await hand.move(140, A, speed=0, force=200, timeout=0.2)
    assert force_of_a(here) == 200
    stream = here.network.stream("client", "agent")
    stream.is_cut, stream.keeps = True, False
    await until(lambda: not hand.is_in_control)
    stream.is_cut = False
    await until(lambda: hand.is_in_control)
    await hand.set_speed(50, B)
    assert force_of_a(here) == 200


@inside(lab)
async def test_what_was_not_acknowledged_does_not_come_later(here: Lab, hand: RemoteHand) -> None:
    await hand.set_force(10, A)
    await here.server.stop()
    with pytest.raises(RobotiqError):
        await hand.set_force(200, A)
    await here.server.start()
    async with here.client("other", control=False) as other:
        await until(lambda: hand.state.name.startswith("RUNNING"))
        await other.take()
        await other.set_force(70, A)
        await other.release()
    await hand.acquire()
    await hand.set_position(30, A)
    assert force_of_a(here) == 10


@inside(lab)
async def test_a_move_that_is_superseded_on_its_way_may_have_begun(here: Lab, hand: RemoteHand) -> None:
    """Its image is on the wire when the next command supersedes it."""
    slow = asyncio.create_task(repeated(here, "cmd/move", call_of(hand, position=200, fingers=1)))
    await asyncio.sleep(0.001)
    hand.command(A, position=10)
    answer = await slow
    assert answer.error is not None
    assert answer.error["kind"] == "MoveSupersededError"
    assert answer.begun is not False


@inside(lab)
async def test_a_client_of_version_1_is_told_so(here: Lab) -> None:
    """It asks under the key that it knows, and reads that the answer is of another version."""
    call = json.dumps(json.loads(AgentCall(LEFT.base, "old").pack()) | {"version": 1})
    for verb in ("info", "halt", "lease", "cmd/move"):
        answer = await here.answer(verb, call.encode())
        assert answer.error is not None
        assert "version 1 of the protocol; here it is 2" in answer.error["message"]
    assert not here.gripper.writes or not here.gripper.is_moving


@virtual
async def test_an_agent_of_version_1_is_refused_with_a_sentence() -> None:
    network = Network()
    agent = network.bus("agent")
    agent.announce(LEFT.key("alive", "7"))
    publish = agent.publisher(LEFT.key("feed"), Urgency.TELEMETRY)
    hand = RemoteHand("zenoh://lab/cell/left", bus=network.bus("client"), connect_timeout=0.5)
    starting = asyncio.create_task(hand.start())
    await asyncio.sleep(0.1)
    publish(bytes([1]) + bytes(SIZE - 1))
    with pytest.raises(AgentError, match=r"its agent sends a status of version 1 .* update the older side"):
        await starting


def test_questions_come_last_and_get_a_share() -> None:
    """So do the requests of those who do not command, while somebody does."""

    async def ask(last: MessageKind) -> tuple[list[str], float]:
        mailbox, done = Mailbox(), []

        def work(what: str) -> None:
            time.sleep(0.002)
            done.append(what)

        accepted = [mailbox.put(lambda: work("last"), last) for _ in range(MOST_QUESTIONS + 1)]
        assert accepted == [True] * MOST_QUESTIONS + [False]
        mailbox.put(lambda: work("command"), MessageKind.REQUEST)
        mailbox.put(lambda: work("halt"), MessageKind.HALT)
        begun = time.perf_counter()
        while len(done) < 8:  # noqa: ASYNC110
            await asyncio.sleep(0.001)
        return done, 6 * 0.002 / (time.perf_counter() - begun)

    for last in (MessageKind.QUESTION, MessageKind.OTHERS):
        done, share = asyncio.run(ask(last))
        assert done[:3] == ["halt", "command", "last"]
        assert share < 1.5 * SHARE


@inside(lab)
async def test_whoever_commands_does_not_wait_for_the_requests_of_others(
    here: Lab, reader: RemoteHand
) -> None:
    ask = AgentCall(LEFT.base, "stranger").pack()
    verbs = ("lease", "cmd/move")
    sort = here.agent._sort
    assert {sort(LEFT.key(verb), lambda: ask) for verb in verbs} == {MessageKind.REQUEST}, "nobody does"
    await reader.acquire()
    assert {sort(LEFT.key(verb), lambda: ask) for verb in verbs} == {MessageKind.OTHERS}
    assert {sort(LEFT.key(verb), call_of(reader).pack) for verb in verbs} == {MessageKind.REQUEST}


@inside(lab)
async def test_a_taken_lease_says_what_became_of_the_move(here: Lab, hand: RemoteHand) -> None:
    moving = await here.moving(hand)
    async with here.client("other", control=False) as other:
        await other.take()
        with pytest.raises(ControlLostError, match="cancelled: taken; it had begun"):
            await moving


@inside(lab)
async def test_a_move_that_was_left_to_go_on_outlives_the_next_lease(here: Lab, hand: RemoteHand) -> None:
    await here.moving(hand)
    await hand.release(halt=False)
    async with here.client("next") as other, here.client("third", control=False) as third:
        assert other.is_in_control
        await third.take()
        await asyncio.sleep(0.2)
        assert here.gripper.is_moving
        await third.release(halt=False)


@pytest.mark.parametrize("after", AFTER_S)
@pytest.mark.parametrize("trouble", ["freeze of the client", "take"])
def test_the_words_for_a_move_whose_lease_ends_are_true(trouble: str, after: float) -> None:
    found = outcome(trouble, after)
    assert found["true"], found
    begun = "it had begun" in found["said"]
    assert begun or after < AFTER_S[-1], "it moved for half a second"
