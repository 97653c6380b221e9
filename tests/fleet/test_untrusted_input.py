"""Malformed requests and messages are answered with an error, move no finger, and are harmless in logs."""

from __future__ import annotations

import asyncio
import json
from typing import Any

import pytest

from robotiq_async import Finger, State
from robotiq_async.fleet.errors import AgentError, ControlLostError
from robotiq_async.fleet.limited_log import EVERY_S
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentCall
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.fleet.wire.status_message import StatusMessage
from robotiq_async.fleet.wire.values import read_error
from robotiq_async.values.errors import ProtocolError, RobotiqError
from robotiq_async.values.status import RobotiqStatus
from tests.fleet.cell import ask, move_slowly
from tests.fleet.lab import LEFT, Lab, lab
from tests.fleet.world import World, world
from tests.virtual import inside

INFINITE = float("inf")  # JSON of Python has it
STRANGE: list[tuple[str, Any]] = [
    ("cmd/cancel", {"number": INFINITE}),
    ("cmd/cancel", {"number": [1]}),
    ("cmd/cancel", {"number": "x"}),
    ("cmd/move", {"position": 255, "fingers": INFINITE}),
    ("cmd/move", {"position": 255.0}),
    ("cmd/move", {"position": 255, "timeout": "soon"}),
    ("cmd/move", {"position": 255, "more": 1}),
    ("cmd/command", {}),
    ("cmd/command", {"axes": 3}),
    ("cmd/command", {"axes": {"16": {"position": 255}}}),
    ("cmd/command", {"axes": {"1": {"position": 256}}}),
    ("cmd/command", {"axes": {"1": 3}}),
    ("cmd/stop", {}),
    ("cmd/_session", {}),
    ("cmd/__init__", {}),
    ("lease", {"what": "steal"}),
    ("lease", {}),
]
NAME = "eve\nrobotiq-async: all is well\x1b[2J"
OTHERS = StatusMessage(LEFT.mark + 1, 2, 3.0, State.RUNNING_IDLE, 4, False, 5, False, None)


# -- malformed requests ------------------------------------------------------------------------------------


@inside(lab)
@pytest.mark.parametrize(("verb", "arguments"), STRANGE)
async def test_from_the_holder_of_the_lease(here: Lab, hand: RemoteHand, verb: str, arguments: Any) -> None:
    assert hand._remote.session is not None
    writes = len(here.gripper.writes)
    call = hand._remote.session.dialog.call(arguments)
    answer = await here.answer(verb, call.pack())
    assert answer.number == call.number
    with pytest.raises((RobotiqError, TypeError, ValueError)):
        answer.outcome(RobotiqStatus.from_raw)
    assert len(here.gripper.writes) == writes
    await hand.move(20, 1)


@inside(lab)
@pytest.mark.parametrize(
    "request_", [b"", b"{}", b"[1", b"null", b"\xff", json.dumps({"version": 9}).encode()]
)
@pytest.mark.parametrize("verb", ["info/x", "lease", "halt", "cmd/move"])
async def test_malformed_requests(here: Lab, hand: RemoteHand, verb: str, request_: bytes) -> None:
    with pytest.raises((ProtocolError, AgentError)):
        (await here.answer(verb, request_)).outcome(RobotiqStatus.from_raw)
    await hand.move(20, 1)


@inside(lab)
@pytest.mark.parametrize(("later", "refusal"), [(0, ControlLostError), (1, AgentError)])
async def test_a_command_without_a_lease_or_for_another_run(
    here: Lab, later: int, refusal: type[RobotiqError]
) -> None:
    """The arguments are valid for no command, so the refusal comes before they are read."""
    call = AgentCall(LEFT.base, "stranger", here.agent.epoch + later, number=2, arguments={"fingers": 0})
    writes = len(here.gripper.writes)
    with pytest.raises(refusal):
        (await here.answer("cmd/hold", call.pack())).outcome(RobotiqStatus.from_raw)
    assert len(here.gripper.writes) == writes


@pytest.mark.parametrize("second", [{"position": 999}, {}, {"speed": None}, {"position": 9, "mm": 3}])
@inside(lab)
async def test_of_a_command_for_several_axes_all_is_carried_out_or_nothing(
    here: Lab, hand: RemoteHand, second: dict[str, int]
) -> None:
    """The first axis moved, and the answer said that nothing was done."""
    assert hand._remote.session is not None
    axes = {"1": {"position": 90}, "2": second}
    with pytest.raises((TypeError, ValueError)):
        await hand._remote.session.dialog.ask("cmd/command", {"axes": axes}, timeout=1.0)
    await asyncio.sleep(1)
    assert here.gripper.position(Finger.A) < 10


@pytest.mark.parametrize(
    ("name", "missing"),
    [(f"set_{what}", "value") for what in ("position", "speed", "force")]
    + [("move", "position"), ("command", "axes")],
)
@inside(lab)
async def test_a_command_without_its_argument_is_refused_before_it_is_a_job(
    here: Lab, hand: RemoteHand, name: str, missing: str
) -> None:
    """It raised in its task: then it was a job of the lease, in the words of Python about a function."""
    assert hand._remote.session is not None
    fingers = {} if name == "command" else {"fingers": 1}
    call = hand._remote.session.dialog.call(fingers)
    answer = await here.answer(f"cmd/{name}", call.pack())
    assert answer.begun is False
    with pytest.raises(TypeError, match=f"^{name} needs {missing}$"):
        answer.outcome(RobotiqStatus.from_raw)
    assert here.agent.hands["left"]._jobs.find(call) is None
    await hand.move(20, 1)


@inside(lab)
async def test_arguments_that_do_not_fit_leave_nothing_behind(here: Lab, hand: RemoteHand) -> None:
    """The axes counted as commanded, and what others had set going was held at the end of the lease."""
    assert hand._remote.session is not None
    await here.local.set_speed(0)
    await here.local.set_position(250, Finger.B)
    for arguments in ({"position": 9, "fingers": 2, "more": 1}, {"position": 9, "fingers": INFINITE}):
        with pytest.raises((TypeError, ValueError, OverflowError, AgentError)):
            await hand._remote.session.dialog.ask("cmd/move", arguments, timeout=1.0)
    async with here.client("other", control=False) as other:
        await other.take()
        await asyncio.sleep(0.2)
        assert here.gripper.is_moving
        await other.release()
    assert not here.gripper.is_moving


@pytest.mark.parametrize("key", ["robotiq/v1/lab/cell/*/halt", "robotiq/v1/lab/cell/a$b/halt"])
@inside(world)
async def test_a_request_under_a_wildcard_is_refused(here: World, key: str) -> None:
    call = await move_slowly(here)
    refused = await ask(here.other, "halt", AgentCall(LEFT.base, "stranger", number=1), key)
    assert refused is not None
    assert here.gripper.is_moving
    await here.holder.do(here.holder.hand.halt())
    await call


@inside(world)
async def test_a_request_for_another_gripper_is_refused(here: World) -> None:
    """It came under the wrong key."""
    right = AgentCall(GripperName("lab", "cell", "right").base, "stranger", number=1)
    refused = await ask(here.other, "lease", right)
    assert "right" in str(refused)
    assert here.holder.hand.is_in_control


@pytest.mark.parametrize("name", ["\ud800", "\u00fc", "a\nb"])
@inside(lab)
async def test_a_client_whose_name_is_no_plain_text_gets_no_lease(
    here: Lab, reader: RemoteHand, name: str
) -> None:
    """With half a character as its name, requests of all others went unanswered until its lease ended."""
    assert reader._remote.session is not None
    seen = reader._remote.session.mirror.stamp
    acquire = {"what": "acquire", "label": "eve"}
    call = AgentCall(LEFT.base, name, number=1, seen=seen, arguments=acquire)
    with pytest.raises(ProtocolError, match="not a request"):
        (await here.answer("lease", call.pack())).outcome(RobotiqStatus.from_raw)
    await asyncio.wait_for(reader.take(), 1.0)
    assert reader.is_in_control


# -- untrusted input ---------------------------------------------------------------------------------------


@inside(lab)
async def test_labels_of_clients_are_made_printable(
    here: Lab, reader: RemoteHand, caplog: pytest.LogCaptureFixture
) -> None:
    assert reader._remote.session is not None
    seen = reader._remote.session.mirror.stamp
    for verb, number in (("lease", 1), ("halt", 2), ("lease", 3)):
        call = AgentCall(LEFT.base, "eve", 0, 0, number, seen, {"what": "acquire", "label": NAME})
        (await here.answer(verb, call.pack())).outcome(RobotiqStatus.from_raw)
    info = await reader._remote.session.dialog.ask("info", timeout=1.0)
    assert info["holder"].isprintable(), "who shows it elsewhere may not look at it first"
    with pytest.raises(ControlLostError) as refused:
        await reader.acquire()
    assert "eve" in str(refused.value)
    assert str(refused.value).isprintable()
    assert all(record.getMessage().isprintable() for record in caplog.records)
    assert "eve" in caplog.text


@pytest.mark.parametrize("kind", ["ControlLostError", "ConnectFailedError", "of the future\n", "ValueError"])
def test_error_messages_of_an_agent_are_made_printable(kind: str) -> None:
    fields = {"kind": kind, "message": "a\nb\x1b", "reason": "\n", "address": "\r", "state": None}
    error = read_error(fields, RobotiqStatus.from_raw)
    for words in (str(error), *map(str, vars(error).values())):
        assert words.isprintable()
    assert "a\\nb\\x1b" in str(error)


@inside(lab)
@pytest.mark.parametrize(
    ("payload", "words"),
    [
        (OTHERS.pack(), "about another gripper"),
        (b"?", "a message was dropped: not a status"),
        (b"{", "cannot be read"),
        (b"{" + b'"a":[' * 3000, "cannot be read"),
        (OTHERS._replace(mark=LEFT.mark, stamp=float("inf")).pack(), "impossible time"),
    ],
)
async def test_a_flood_of_messages_that_are_none_fills_no_log(
    here: Lab, hand: RemoteHand, payload: bytes, words: str, caplog: pytest.LogCaptureFixture
) -> None:
    publish = here.network.bus("stranger").publisher(LEFT.key("feed"), Urgency.TELEMETRY)
    for _ in range(100):
        publish(payload)
        await asyncio.sleep(0.001)
    assert caplog.text.count(words) == 1
    await asyncio.sleep(EVERY_S)
    publish(payload)
    await asyncio.sleep(0.01)
    assert caplog.text.count(words) == 2
    assert "100 similar" in caplog.text
    about = {getattr(record, "hand", "") for record in caplog.records if words in record.getMessage()}
    assert about == {hand.name}
    await hand.move(30, 1)


def test_words_that_are_none_are_refused() -> None:
    assert "cannot be read" in str(read_error({"kind": "AgentError", "message": 3}, RobotiqStatus.from_raw))
    assert not isinstance(read_error({"kind": 3, "message": "?"}, RobotiqStatus.from_raw), AgentError)
