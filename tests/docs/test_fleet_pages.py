"""Files, bytes and objects on the pages about hands on other hosts are those of the code."""

from __future__ import annotations

import json
import re
import struct
from dataclasses import MISSING, fields
from pathlib import Path
from typing import Any, Final

from robotiq_async import Finger, Inhibit, MoveResult, ObjectStatus, RobotiqHand, State, Transition, Trigger
from robotiq_async.cli.agent_file import AgentSettings, read_agent_file
from robotiq_async.fleet import GripperName
from robotiq_async.fleet.agent.inhibits import Inhibits
from robotiq_async.fleet.agent.publisher import AT_ONCE, KEPT, HandPublisher
from robotiq_async.fleet.agent.records import Records
from robotiq_async.fleet.agent.served_hand import ServedHand
from robotiq_async.fleet.control.lease import Lease
from robotiq_async.fleet.errors import ControlLostError
from robotiq_async.fleet.wire import status_message
from robotiq_async.fleet.wire.envelope import AgentAnswer, AgentCall, failure
from robotiq_async.fleet.wire.names import ROOT
from robotiq_async.fleet.wire.settings import COMMANDS
from robotiq_async.fleet.wire.status_message import StatusMessage
from robotiq_async.hands.options import Place, offered
from robotiq_async.values.events import SentRequest
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.docs.pages import blocks, read
from tests.fleet.network import Network
from tests.grippers import until

PROTOCOL: Final = read("fleet-protocol.md")
HOW_TO: Final = read("how-to/fleet.md")
NAME: Final = GripperName("lab", "cell-1", "left")
EPOCH: Final = 4503599627370497
CLIENT: Final = "5f0c3a9e1b7d2468"
LABEL: Final = "bob@desk:4711"
REGISTERS: Final = (0xF900, 0xFF00, 0x0064, 0x6400, 0x0606, 0x0000, 0x0606, 0x0089)
STATUS: Final = RobotiqStatus(REGISTERS, 812.4375, 20114)
MESSAGE: Final = StatusMessage(
    mark=NAME.mark,
    epoch=EPOCH,
    stamp=812.4375,
    state=State.RUNNING_IDLE,
    lease=3,
    is_held=True,
    events=41,
    is_moving=False,
    status=RobotiqStatus(REGISTERS, 812.4375 - 0.0009765625, 20114),
)
RESULT: Final = MoveResult(
    outcomes={Finger.A: ObjectStatus.AT_POSITION},
    positions={Finger.A: 100},
    contacts=Finger(0),
    reached=Finger.A,
    duration=0.75,
    peak_current_ma={Finger.A: 310},
    status=STATUS,
)
IMAGE: Final = Request(activate=True, go=True, axes=(AxisRequest(100, 128, 64),) * 4)


def call(number: int, lease: int = 3, **arguments: Any) -> AgentCall:
    return AgentCall(NAME.base, CLIENT, EPOCH, lease, number, 812.4375, arguments)


def event(index: int, what: dict[str, Any]) -> dict[str, Any]:
    return {"index": index, **what}


def parsed(what: dict[str, Any]) -> dict[str, Any]:
    return {"mark": NAME.mark, "epoch": EPOCH, "events": [what], "status": MESSAGE.pack().hex()}


INHIBIT: Final = Inhibit("the guard is open", "PLC, bob@desk:4711", 1790000000.5)
BEGUN: Final = Transition(State.RUNNING_IDLE, State.RUNNING_CC, Trigger.ASK_COMMAND, 811.5)
MOVE: Final = call(7, position=100, fingers=1, speed=None, force=None, timeout=None)
EXAMPLES: Final = [
    parsed(event(38, {"kind": "transition", **BEGUN.as_dict()})),
    event(39, {"kind": "request", **SentRequest(IMAGE, 811.53125, acknowledged=True).as_raw()}),
    event(40, {"kind": "lease", "number": 3, "holder": LABEL, "reason": "granted"}),
    event(41, {"kind": "conflict", "key": NAME.key("alive", "77")}),
    event(42, {"kind": "inhibit", "stamp": 812.4375, "inhibited": INHIBIT.as_dict()}),
    json.loads(MOVE.pack()),
    json.loads(AgentAnswer(NAME.base, 7, EPOCH, RESULT.as_dict() | {"status": STATUS.as_raw()}).pack()),
    json.loads(
        failure(
            MOVE, EPOCH, ControlLostError("the lease has ended (taken), ...", "taken"), begun=True
        ).pack(),
    ),
    json.loads(call(1, 0, what="acquire", label=LABEL).pack())["arguments"],
    json.loads(AgentAnswer(NAME.base, 1, EPOCH, {"lease": 3, "window": 1.0, "settings": True}).pack())[
        "value"
    ],
]
"""The objects in the order of the page."""


def shown(language: str, page: str) -> list[str]:
    return [block.text for block in blocks(page, language)]


def test_the_objects_are_those_of_the_code() -> None:
    assert [json.loads(text) for text in shown("json", PROTOCOL)] == json.loads(json.dumps(EXAMPLES))


def test_the_example_of_a_status() -> None:
    (text,) = shown("text", PROTOCOL)
    assert bytes.fromhex(text) == MESSAGE.pack()
    assert status_message.unpack(bytes.fromhex(text)) == MESSAGE


def test_a_status_byte_by_byte() -> None:
    rows = re.findall(r"^\| (\d+) \| (\d+) \| `(\w+)` \|", PROTOCOL, re.MULTILINE)
    offset = 0
    for begins, size, kind in rows:
        assert (int(begins), int(size)) == (offset, struct.calcsize(f"<{kind}"))
        offset += int(size)
    packed = "<" + "".join(kind for _, _, kind in rows)
    assert packed == status_message._LAYOUT.format
    assert f"`{packed}`" in PROTOCOL
    assert offset == status_message.SIZE
    assert f"{status_message.SIZE} bytes" in PROTOCOL


def test_every_state_has_its_number() -> None:
    numbers = re.findall(r"(\d+)\s([A-Z_]+)", PROTOCOL[PROTOCOL.index("The states:") :].partition("\n\n")[0])
    assert [(int(number), name) for number, name in numbers] == [
        (number, state.name) for number, state in enumerate(State)
    ]


async def test_an_event_is_published_as_documented() -> None:
    network = Network()
    heard: list[bytes] = []
    network.bus("client").subscribe(NAME.key("*"), lambda _, payload: heard.append(payload))
    hand = RobotiqHand("sim://")
    news = HandPublisher(NAME, hand, network.bus("agent"), EPOCH, Lease(), Inhibits(hand))
    news.add({"kind": "conflict", "key": NAME.key("alive", "77")})
    await until(lambda: bool(heard))
    (first,) = [json.loads(each) for each in heard]
    example = json.loads(shown("json", PROTOCOL)[0])
    assert first.keys() == example.keys()
    assert (first["mark"], first["epoch"]) == (example["mark"], example["epoch"])
    assert len(bytes.fromhex(first["status"])) == status_message.SIZE
    assert f"at most {AT_ONCE}" in PROTOCOL


async def test_a_summary_and_an_info() -> None:
    hand, bus = RobotiqHand("sim://"), Network().bus("agent")
    summary = HandPublisher(NAME, hand, bus, EPOCH, Lease(), Inhibits(hand)).summary()
    served = ServedHand(NAME, hand, bus, Records(), epoch=EPOCH, window=1.0)
    info = served._info(call(1))
    for name in {*summary, *info}:
        assert re.search(rf"^\| .*`{name}`", PROTOCOL, re.MULTILINE), name


def test_every_command_and_key_is_there() -> None:
    for name in (*COMMANDS, "cancel"):
        assert f"`{name}`" in PROTOCOL, name
    for key in ("feed", "summary", "info/WHO", "lease", "halt", "cmd/NAME", "alive/EPOCH"):
        assert f"| `{key}` |" in PROTOCOL, key
    assert ROOT in PROTOCOL
    assert f"{KEPT:,}" in PROTOCOL


def test_every_reason_for_losing_control_is_there() -> None:
    assert ControlLostError.__doc__ is not None
    for reason in re.findall(r'"(\w+)"', ControlLostError.__doc__):
        assert f"`{reason}`" in PROTOCOL, reason


# -- FLEET.toml --------------------------------------------------------------------------------------------


def test_every_option_of_a_gripper_is_named() -> None:
    (about,) = re.findall(r"^The table of a gripper holds (.+?)\n\n", HOW_TO, re.MULTILINE | re.DOTALL)
    named = set(re.findall(r"`(\w+)`", about)) - {"RobotiqHand"}
    assert named == offered(Place.FILE).keys()


def test_every_key_of_the_file_has_its_row() -> None:
    for each in fields(AgentSettings):
        key = "[grippers.NAME]" if each.name == "grippers" else each.name
        rows = re.findall(rf"^\| `{re.escape(key)}` \| ([^|]+) \|", HOW_TO, re.MULTILINE)
        assert len(rows) == 1, key
        if isinstance(each.default, int | float) and not isinstance(each.default, bool):
            assert rows == [f"`{each.default}`"]
        if each.default is MISSING and each.default_factory is MISSING:
            assert rows == ["needed"]


def test_the_file_on_the_page_is_taken(tmp_path: Path) -> None:
    (file,) = shown("toml", HOW_TO)
    (tmp_path / "FLEET.toml").write_text(file, encoding="utf-8")
    settings = read_agent_file(tmp_path / "FLEET.toml")
    assert (settings.site, settings.host, [*settings.grippers]) == ("lab", "cell-1", ["left"])


def test_two_more_lines_make_it_listen_to_others(tmp_path: Path) -> None:
    (file,) = shown("toml", HOW_TO)
    lines = re.findall(r"^ +((?:keys|listen) = .*)$", HOW_TO, re.MULTILINE)
    assert len(lines) == 2
    (tmp_path / "agent-cell-1").mkdir()
    for name in ("ca.pem", "cert.pem", "key.pem"):
        (tmp_path / "agent-cell-1" / name).touch()
    (tmp_path / "agent-cell-1" / "access.toml").write_text("", encoding="utf-8")
    (tmp_path / "FLEET.toml").write_text("\n".join((*lines, file)), encoding="utf-8")
    assert read_agent_file(tmp_path / "FLEET.toml").listen == ("tls/0.0.0.0:7447",)
