"""Speed and force of a client outlive its agent: they have no echo, and the next would not know them."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Any

import pytest

from robotiq_async import Finger, MotionInhibitedError, MoveSupersededError, MoveTimeoutError, State
from robotiq_async.fleet.remote.lease_state import OwnSettings
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import unpack_call
from robotiq_async.fleet.wire.settings import Setting, asked_of, read_settings, settings_fields, settings_of
from robotiq_async.fleet.wire.values import Fields
from robotiq_async.values.request import Request
from robotiq_async.values.status import RobotiqStatus
from tests.fleet.lab import Lab, lab
from tests.fleet.world import World, world
from tests.virtual import inside, virtual

A, ALL = Finger.A, Finger.ALL
MOTIONS: dict[str, Any] = {
    "grasp": lambda hand: hand.grasp(A, timeout=60),
    "move": lambda hand: hand.move(30, A),
    "set_position": lambda hand: hand.set_position(30, A),
    "hold": lambda hand: hand.hold(),
}
GENTLE = (10, 5)


# -- settings ----------------------------------------------------------------------------------------------


def images(here: World, since: int) -> list[Request]:
    return [Request.from_registers(write.registers) for write in here.gripper.writes[since:]]


async def next_agent(here: World) -> int:
    """Kill the agent, start the next; returns how much was written by then."""
    here.kill(here.agent.host)
    await asyncio.sleep(1)
    await here.start_agent("next agent")
    hand = here.holder.hand
    await here.until(lambda: hand.state is State.RUNNING_IDLE)
    await asyncio.sleep(0.5)
    if not hand.is_in_control:
        await here.holder.do(hand.acquire())
    return len(here.gripper.writes)


@pytest.mark.parametrize("motion", [*MOTIONS, "command", "many commands"])
@inside(world)
async def test_an_agent_that_was_started_anew_moves_with_what_was_asked_of_the_former(
    here: World, motion: str
) -> None:
    """Speed 10 and force 5 were requested; after a restart it moved with 128 and 64."""
    hand = here.holder.hand
    await here.holder.do(hand.set_speed(10, ALL))
    await here.holder.do(hand.set_force(5, ALL))
    since = await next_agent(here)
    if "command" in motion:
        for position in range(30, 31 if motion == "command" else 50):
            await here.holder.command(A, position=position)
            await asyncio.sleep(0.005)
        await asyncio.sleep(0.5)
    else:
        await here.holder.do(MOTIONS[motion](hand))
    written = images(here, since)
    assert written or motion == "hold"
    for image in written:
        assert [(axis.speed, axis.force) for axis in image.axes] == [(10, 5)] * 4


@inside(world)
async def test_settings_of_a_move_and_of_single_axes_count_too(here: World) -> None:
    hand = here.holder.hand
    await here.holder.do(hand.move(5, A, speed=200, force=7))
    await here.holder.do(hand.set_speed(3, Finger.B))

    await here.holder.command(Finger.C, speed=9)
    await asyncio.sleep(0.2)
    since = await next_agent(here)
    await here.holder.do(hand.set_speed(20, A))
    await here.holder.do(hand.move(30, A))
    for image in images(here, since):
        assert [axis.speed for axis in image.axes] == [20, 3, 9, 128]
        assert [axis.force for axis in image.axes] == [7, 64, 64, 64]


@inside(world)
async def test_it_is_given_again_until_the_gripper_has_it(here: World) -> None:
    """The link to the gripper goes down with the first command, and the second comes."""
    hand = here.holder.hand
    await here.holder.do(hand.set_speed(10, ALL))
    await next_agent(here)
    local = here.agent.hands["left"]
    await here.servers["left"].stop()
    await here.holder.command(A, position=30)
    await here.until(lambda: local.state is State.DISCONNECTED)
    await here.servers["left"].start()
    await here.until(lambda: hand.state is State.RUNNING_IDLE)
    since = len(here.gripper.writes)
    await here.holder.do(hand.move(30, A))
    assert images(here, since)
    for image in images(here, since):
        assert [axis.speed for axis in image.axes] == [10] * 4


@inside(lab)
async def test_settings_are_restored_after_another_client_changed_them(here: Lab, hand: RemoteHand) -> None:
    await hand.set_force(5)
    async with here.client("other", control=False) as other:
        await other.take()
        await other.set_force(200)
        await other.set_speed(3)
        await other.release()
    await hand.acquire()
    await hand.set_position(30, A)
    image = Request.from_registers(here.gripper.request_registers)
    assert [axis.force for axis in image.axes] == [5, 200, 200, 200], "it moves one axis"
    assert [axis.speed for axis in image.axes] == [128, 3, 3, 3], "of the speed it has asked for nothing"


@inside(lab)
async def test_a_copy_of_the_request_for_the_lease_forgets_no_setting_on_its_way(
    here: Lab, reader: RemoteHand
) -> None:
    """The force was acknowledged, and the next time the hand's own was written in its place."""
    assert reader._remote.session is not None
    dialog = reader._remote.session.dialog
    take = dialog.call({"what": "take", "label": "twice"})
    lease = (await here.answer("lease", take.pack())).value["lease"]
    force = replace(dialog.call({"value": 200, "fingers": 1}), lease=lease)
    setting = asyncio.create_task(here.answer("cmd/set_force", force.pack()))
    await asyncio.sleep(0.001)
    await here.answer("lease", take.pack())
    assert (await setting).begun is True
    async with here.client("other", control=False) as other:
        await other.take()
        await other.move(20, A)
        await other.release()
    await reader.acquire()
    await reader.set_position(30, A)
    assert Request.from_registers(here.gripper.request_registers).axes[0].force == 200


@pytest.mark.parametrize("timeout", ["soon", True, 0, -1.0, float("inf"), float("nan")])
@inside(lab)
async def test_a_command_that_is_refused_changes_no_grip(
    here: Lab, hand: RemoteHand, timeout: object
) -> None:
    """Its axis had got the new holder's force by then, and the next image wrote it."""
    await hand.set_force(200)
    await hand.release(keep_grip=True)
    async with here.client("other") as other:
        assert other._remote.session is not None
        arguments = {"position": 90, "fingers": 1, "timeout": timeout}
        with pytest.raises((TypeError, ValueError), match="timeout"):
            await other._remote.session.dialog.ask("cmd/move", arguments, timeout=1.0)
        await other.set_speed(3, Finger.B)
        await asyncio.sleep(0.5)
        axes = Request.from_registers(here.gripper.request_registers).axes
        assert [axis.force for axis in axes] == [200] * 4


@inside(lab)
async def test_a_new_holder_changes_no_grip(here: Lab, hand: RemoteHand) -> None:
    """Its first motion of an axis sets that axis alone, and uses FLEET.toml for what it did not ask for."""
    await hand.move(100, A, speed=255, force=200)
    await hand.release(keep_grip=True)
    async with here.client("other") as other:
        await other.set_speed(3, Finger.B)
        await other.hold()
        await other.move(20, Finger.B)
        axes = Request.from_registers(here.gripper.request_registers).axes
        assert [(axis.speed, axis.force) for axis in axes[:2]] == [(255, 200), (3, 64)]
        await other.halt()
        await other.move(110, A)
        axes = Request.from_registers(here.gripper.request_registers).axes
        assert (axes[0].speed, axes[0].force) == (128, 64)


@inside(lab)
async def test_what_was_acknowledged_is_kept_however_its_move_ended(here: Lab, hand: RemoteHand) -> None:
    with pytest.raises(MoveTimeoutError):
        await hand.move(140, A, speed=0, force=200, timeout=0.2)
    await hand.stop()  # and it has forgotten it
    async with here.client("other") as other:
        await other.move(20, A, force=7)
    await hand.start()
    await hand.set_position(30, A)
    assert Request.from_registers(here.gripper.request_registers).axes[0].force == 200


@inside(lab)
async def test_nothing_is_restored_while_one_client_stays_the_last_holder(
    here: Lab, hand: RemoteHand
) -> None:
    await hand.set_force(10, A)
    await here.local.set_force(99, A)  # by a program of the agent's host
    await hand.release()
    await hand.acquire()
    await hand.set_position(30, A)
    assert Request.from_registers(here.gripper.request_registers).axes[0].force == 99


async def of_another_client(here: Lab) -> None:
    """Another client gives all axes a speed and a force of its own."""
    async with here.client("other", control=False) as other:
        await other.take()
        await other.set_force(7)
        await other.set_speed(7)
        await other.release()


@virtual
async def test_a_force_that_a_superseded_move_replaced_on_its_way_is_not_an_older_one() -> None:
    """``set_force(158)`` was answered as done, and 151, the one before it, was written."""
    async with lab(poll_interval=0.1) as here, here.client() as hand:
        await hand.set_force(151, A)
        await of_another_client(here)
        await hand.acquire()
        await anext(here.local.statuses())  # all that follows comes before the next poll
        written = len(here.gripper.writes)
        setting = asyncio.create_task(hand.set_force(158, A))
        await asyncio.sleep(0)
        moving = asyncio.create_task(hand.move(109, A, force=159))
        await asyncio.sleep(0)
        positions = [asyncio.create_task(hand.set_position(110, A))]
        with pytest.raises(MoveSupersededError):
            await moving
        positions.append(asyncio.create_task(hand.set_position(111, A)))
        await asyncio.sleep(0)
        assert len(here.gripper.writes) == written
        await asyncio.gather(setting, *positions)
        assert Request.from_registers(here.gripper.request_registers).axes[0].force == 159


@inside(lab)
async def test_a_setting_that_an_inhibit_drops_or_refuses_is_not_on_its_way(
    here: Lab, hand: RemoteHand
) -> None:
    await hand.set_force(151, A)
    await of_another_client(here)
    await hand.acquire()
    dropped = asyncio.create_task(hand.set_force(158, A))
    await asyncio.sleep(0)
    await hand.inhibit("a guard")
    refused = asyncio.create_task(hand.move(20, A, speed=3))
    for each in (dropped, refused):
        with pytest.raises(MotionInhibitedError):
            await each
    await hand.permit()
    await hand.set_position(30, A)
    image = Request.from_registers(here.gripper.request_registers).axes[0]
    assert (image.speed, image.force) == (128, 151)


def of_settings(here: World) -> list[Fields]:
    """Have the settings noted that the holder sends to its agent."""
    sent: list[Fields] = []

    def note(_key: str, payload: bytes) -> None:
        arguments = unpack_call(payload).arguments
        if arguments.get("what") == "settings":
            sent.append(arguments["settings"])

    here.holder.bus.listen = note
    return sent


@inside(world)
async def test_an_agent_that_knows_a_clients_settings_is_sent_none(here: World) -> None:
    """Also a hand that was started again has its own, of which it knows nothing any more."""
    hand, sent = here.holder.hand, of_settings(here)
    await here.holder.do(hand.set_force(200, A))
    await next_agent(here)
    await here.holder.do(hand.move(20, A))
    await here.holder.do(hand.stop())
    await here.other.do(here.other.hand.take())
    await here.other.do(here.other.hand.move(30, A, force=7))
    await here.other.do(here.other.hand.release())
    here.kill(here.agent.host)
    await asyncio.sleep(1)
    await here.start_agent("third agent")
    await here.holder.do(hand.start())
    await here.holder.do(hand.move(40, A))
    assert images(here, 0)[-1].axes[0].force == 200
    assert not sent


@inside(world)
async def test_an_agent_without_a_record_is_sent_what_was_carried_out(here: World) -> None:
    hand, sent = here.holder.hand, of_settings(here)
    await here.holder.do(hand.set_force(200, A))
    here.kill(here.agent.host)
    await asyncio.sleep(1)
    here.records.records.clear()
    await here.start_agent("next agent")
    await here.until(lambda: hand.state is State.RUNNING_IDLE)
    await here.holder.do(hand.acquire())
    assert sent == [{"1": {"force": 200}}]
    await here.holder.do(hand.move(40, A))
    assert images(here, 0)[-1].axes[0].force == 200


@inside(world)
async def test_a_restarted_agent_knows_what_the_gripper_has(here: World) -> None:
    """Of the last holder, and not of one before it that set something else."""
    hand = here.holder.hand
    await here.holder.do(hand.set_force(200, A))
    await here.other.do(here.other.hand.take())
    await here.other.do(here.other.hand.move(20, A))
    await here.other.do(here.other.hand.release())
    since = await next_agent(here)
    await here.holder.do(hand.hold(A))
    await here.holder.do(hand.set_speed(9, Finger.B))
    assert {image.axes[0].force for image in images(here, since)} == {64}
    await here.holder.do(hand.move(30, A))
    assert images(here, since)[-1].axes[0].force == 200


@pytest.mark.parametrize(
    ("name", "arguments", "settings"),
    [
        ("set_speed", {"value": 3, "fingers": 3}, {(A, "speed"): 3, (Finger.B, "speed"): 3}),
        ("set_force", {"value": 0, "fingers": 1}, {(A, "force"): 0}),
        ("move", {"position": 9, "fingers": 1, "speed": 4, "force": None}, {(A, "speed"): 4}),
        ("command", {"axes": {"1": {"position": 1}, "8": {"force": 2}}}, {(Finger.SCISSOR, "force"): 2}),
        ("set_position", {"value": 3, "fingers": 3}, {}),
        ("activate", {}, {}),
        ("command", {"axes": {"1": {"speed": 256}}}, {}),
        ("command", {"axes": 3}, {}),
        ("set_speed", {"fingers": "x"}, {}),
    ],
)
def test_which_settings_a_command_sets(
    name: str, arguments: dict[str, Any], settings: dict[Any, int]
) -> None:
    assert settings_of(asked_of(name, arguments)) == settings
    assert read_settings(settings_fields(settings)) == settings


@pytest.mark.parametrize(
    "fields",
    [None, [], {"1": 3}, {"16": {"speed": 3}}, {"0": {"speed": 1}}, {"1": {"speed": True}}, {"x": {}}],
)
def test_malformed_settings_are_refused(fields: object) -> None:
    with pytest.raises((TypeError, ValueError)):
        read_settings(fields)


@inside(lab)
async def test_a_lease_with_settings_that_are_none_is_refused(here: Lab, reader: RemoteHand) -> None:
    assert reader._remote.session is not None
    await reader.acquire()
    call = reader._remote.session.dialog.call({"what": "settings", "settings": {"1": {"speed": 999}}})
    with pytest.raises(ValueError, match="speed"):
        (await here.answer("lease", call.pack())).outcome(RobotiqStatus.from_raw)


# -- restarted agents --------------------------------------------------------------------------------------


@inside(world)
async def test_new_settings_override_restored_ones(here: World) -> None:
    hand = here.holder.hand
    await here.holder.do(hand.set_speed(10))
    await here.holder.do(hand.set_force(5))
    writes = await next_agent(here)
    await here.holder.do(hand.move(40, A, speed=33))
    found = [image for image in images(here, writes) if image.go]
    assert (found[-1].axes[0].speed, found[-1].axes[0].force) == (33, 5)
    assert (found[-1].axes[1].speed, found[-1].axes[1].force) == GENTLE


def forces(value: int) -> dict[Setting, int]:
    return {(axis, "force"): value for axis in (A, Finger.B, Finger.C)}


def test_only_what_was_carried_out_and_not_what_it_may_have_replaced_is_sent() -> None:
    settings = OwnSettings()
    assert not settings.fields
    settings.note(2, {(A, "position"): 9, (A, "speed"): 3}, begun=True)
    assert settings.fields == {"1": {"speed": 3}}
    settings.note(4, forces(7), begun=True)
    settings.note(3, forces(200), begun=True)
    assert settings.fields == {"1": {"speed": 3, "force": 7}, "2": {"force": 7}, "4": {"force": 7}}
    settings.note(5, forces(9), begun=False)
    assert settings.fields["2"] == {"force": 7}
    settings.note(6, {(Finger.B, "force"): 9}, begun=None)
    assert settings.fields == {"1": {"speed": 3, "force": 7}, "4": {"force": 7}}
