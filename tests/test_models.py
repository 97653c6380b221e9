"""The siblings of the 3-Finger: what their registers mean, and that a hand on them keeps its promises."""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from robotiq_async import (
    CLOSED,
    HAND_E,
    JAW,
    THREE_FINGER,
    TWO_FINGER_85,
    TWO_FINGER_140,
    ConnectionLostError,
    Fault,
    Finger,
    GripperFaultError,
    Model,
    ObjectStatus,
    ProtocolError,
    RobotiqHand,
    RobotiqStatus,
    Severity,
    State,
    StateTimeoutError,
    WrongModelError,
)
from robotiq_async.cli.output.lines import status_line
from robotiq_async.link.address import parse_address
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, UrcapSimulatorServer
from robotiq_async.tools.actions import ACTIONS, Operator
from robotiq_async.tools.errors import MeasuringError
from robotiq_async.tools.measure.campaigns import grasp, time_closing
from robotiq_async.tools.recording.feed import TOPICS
from robotiq_async.tools.recording.recorder import Recorder
from robotiq_async.tools.recording.recordings import read_recording
from robotiq_async.tools.recording.table import COLUMNS, Table
from robotiq_async.tools.web.page.mirror import HandMirror
from robotiq_async.tools.web.page.widgets.words import axis_title, opening_words
from robotiq_async.values.checks import parse_fingers
from robotiq_async.values.contradictions import contradiction
from robotiq_async.values.errors import RobotiqStateError
from robotiq_async.values.model import MODELS, model_of
from robotiq_async.values.request import AxisRequest, Request
from tests.contract.bench import MODEL, OTHERWISE, SERVER
from tests.fleet.lab import SPEEDUP, lab
from tests.verify.test_contract import ASKING, FILES, OF_OTHERS, scenes
from tests.virtual import until, virtual

SIBLINGS = [TWO_FINGER_85, TWO_FINGER_140, HAND_E]
siblings = pytest.mark.parametrize("model", SIBLINGS, ids=lambda model: model.name)


def registers(*content: int) -> tuple[int, ...]:
    """Status bytes from byte 0 on; the rest is 0."""
    block = bytes((*content, *[0] * (16 - len(content))))
    return tuple(int.from_bytes(block[at : at + 2], "big") for at in range(0, 16, 2))


def status(*content: int, model: Model = TWO_FINGER_85) -> RobotiqStatus:
    return RobotiqStatus(registers(*content), model=model)


@asynccontextmanager
async def hand_on(model: Model) -> AsyncIterator[tuple[SimulatedGripper, RobotiqHand]]:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, speedup=SPEEDUP, model=model)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address, model=model) as hand:
        yield gripper, hand


# -- registers ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("first", "what", "moves"),
    [
        (0x39, ObjectStatus.IN_MOTION, True),
        (0x79, ObjectStatus.CONTACT_OPENING, False),
        (0xB9, ObjectStatus.CONTACT_CLOSING, False),
        (0xF9, ObjectStatus.AT_POSITION, False),
        (0x31, ObjectStatus.IN_MOTION, False),
    ],
)
def test_the_object_status_lies_in_byte_0(first: int, what: ObjectStatus, moves: bool) -> None:
    """Manual of the 2F-85, example of a grasp: 0x39 on the way, 0xB9 with an object."""
    seen = status(first, 0, 0, 255, 0xBD, 15)
    assert seen.finger_status(JAW) is what
    assert seen.is_moving is moves
    assert seen.contacts == (JAW if what.is_contact else Finger(0))
    assert (seen.requested_position(JAW), seen.position(JAW), seen.current_ma(JAW)) == (255, 0xBD, 150)
    assert seen.echo == (True, first == 0x39 or first > 0x70, 255)


def test_the_motion_summary_is_the_three_fingers_alone() -> None:
    assert RobotiqStatus(registers(0xF9)).motion == 3
    with pytest.raises(ValueError, match="a 2F-85 has no motion summary"):
        _ = status(0xF9).motion


@pytest.mark.parametrize("axis", [Finger.B, Finger.C, Finger.SCISSOR])
def test_an_axis_that_the_model_lacks_is_refused_by_name(axis: Finger) -> None:
    words = rf"finger must be an axis of a 2F-85 \(A\), got {axis}"
    for read in (status(0xF9).position, status(0xF9).finger_status, status(0xF9).current):
        with pytest.raises(ValueError, match=words):
            read(axis)


def test_a_status_in_types_for_json_has_the_axes_of_its_model() -> None:
    fields = status(0xB9, 0, 0, 255, 0xBD, 15).as_dict()
    assert fields["A"]["position"] == 0xBD
    assert not {"B", "C", "SCISSOR"} & fields.keys()
    assert fields["contacts"] == ["A"]


def test_a_status_and_its_model_are_one_value() -> None:
    words = registers(0xF9, 0, 0, 255, 228)
    assert RobotiqStatus(words, model=HAND_E) != RobotiqStatus(words)


def test_the_image_of_a_sibling_leaves_the_other_bytes_alone() -> None:
    image = Request(activate=True, go=True, axes=(AxisRequest(255, 128, 64),), model=HAND_E)
    assert image.registers == registers(0x09, 0, 0, 255, 128, 64)
    assert Request.from_registers(image.registers, HAND_E) == image


def test_a_release_of_a_sibling_opens() -> None:
    """RARD = 1: robotiq/grippers, request.hpp; without it the jaw closes."""
    image = Request(activate=True, release=True, model=HAND_E)
    assert image.registers[0] >> 8 == 0x31
    closing = registers(0x11)
    assert not Request.from_registers(closing, HAND_E).release_opens
    assert Request(activate=True, release=True).registers[0] >> 8 == 0x11, "a 3-Finger has no such bit"


FAULTS = {
    0x00: ("NONE", Severity.NONE),
    0x05: ("ACTIVATION_PENDING", Severity.PRIORITY),
    0x06: ("UNKNOWN_0x06", Severity.MAJOR),
    0x07: ("NOT_ACTIVATED", Severity.PRIORITY),
    0x08: ("OVER_TEMPERATURE", Severity.MINOR),
    0x09: ("COMMUNICATION_NOT_READY", Severity.MINOR),
    0x0A: ("UNDER_VOLTAGE", Severity.MAJOR),
    0x0B: ("AUTOMATIC_RELEASE", Severity.MINOR),
    0x0C: ("INTERNAL_FAULT", Severity.MAJOR),
    0x0D: ("ACTIVATION_FAULT", Severity.MAJOR),
    0x0E: ("OVER_CURRENT", Severity.MAJOR),
    0x0F: ("AUTOMATIC_RELEASE_DONE", Severity.MAJOR),
}
"""Manuals of the 2F-85/2F-140 and of the Hand-E, fault status."""


@pytest.mark.parametrize("code", range(16))
def test_the_faults_of_the_siblings(code: int) -> None:
    fault = status(0xF9, 0, code | 0x40).fault  # kFLT, in the high nibble, is the old controller's
    assert int(fault) == code
    assert (fault.name, fault.severity) == FAULTS.get(code, (f"UNKNOWN_0x{code:02X}", Severity.MAJOR))


def test_a_code_that_means_two_things_is_two_faults() -> None:
    one, other = Fault.SCISSOR_INTERFERENCE, Fault.UNDER_VOLTAGE
    assert one == 0x0A == other
    assert one != other
    assert len({one, other}) == 2


# -- naming a model ----------------------------------------------------------------------------------------


def test_a_model_has_a_name() -> None:
    assert list(MODELS) == ["3f", "2f85", "2f140", "hand-e"]
    assert model_of("Hand-E") is HAND_E
    assert model_of(None) is THREE_FINGER


def test_another_name_is_refused() -> None:
    with pytest.raises(ValueError, match="model must be one of 3f, 2f85, 2f140, hand-e, got '2f'"):
        RobotiqHand(model="2f")
    with pytest.raises(ValueError, match="got '2F-85'; did you mean 2f85"):
        RobotiqHand("sim://?model=2F-85")
    with pytest.raises(TypeError, match="model must be a Model or one of"):
        RobotiqHand(model=85)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "address",
    [
        "tcp://10.0.0.1:502?model=2f85",
        "rtu:///dev/ttyUSB0?model=hand-e",
        "rtu+tcp://10.0.0.1:54321?model=2f140",
        "sim://?speedup=10&model=2f85",
    ],
)
def test_an_address_may_name_the_model(address: str) -> None:
    assert str(parse_address(address)) == address
    assert RobotiqHand(address).model is parse_address(address).model


@pytest.mark.parametrize(
    "address", ["tcp://10.0.0.1?model=3f4", "sim://?model=2f85&model=2f85", "rtu:///x?model="]
)
def test_a_model_that_there_is_not_is_a_malformed_address(address: str) -> None:
    with pytest.raises(ValueError, match="malformed address"):
        parse_address(address)


def test_a_simulated_gripper_takes_the_name_of_its_model() -> None:
    assert SimulatedGripper(model="2f85").model is TWO_FINGER_85
    with pytest.raises(ValueError, match="model must be"):
        SimulatedGripper(model="2f-85")


def test_the_jaw_is_finger_a_by_another_name() -> None:
    assert Finger.JAW is Finger.A is JAW
    assert parse_fingers("fingers", "jaw") is JAW


def test_an_option_and_an_address_must_agree() -> None:
    assert RobotiqHand("sim://?model=2f85", model="2f85").model is TWO_FINGER_85
    with pytest.raises(ValueError, match="model hand-e contradicts the address"):
        RobotiqHand("sim://?model=2f85", model=HAND_E)


@siblings
def test_units_are_those_of_the_model(model: Model) -> None:
    units = RobotiqHand("sim://", model=model).units
    slow, fast = model.speeds_mm_s
    assert (units.mm(0), units.mm(255)) == (model.stroke.mm, 0.0)
    recorded = model is TWO_FINGER_85
    assert (units.mm_per_s(0), units.mm_per_s(255)) == pytest.approx(
        (20.6, 137.9) if recorded else (slow, fast), rel=0.01
    )
    assert (units.label_n(0), units.label_n(255)) == model.forces_n
    assert units.closing_s(255) > model.stroke.mm / fast, "a start and a landing take their time"
    assert ("recorded" if recorded else "estimate") in repr(units)


@siblings
def test_the_range_of_the_manual_is_accepted(model: Model) -> None:
    units = RobotiqHand("sim://", model=model).units
    slow, fast = model.speeds_mm_s
    assert (units.speed(mm_per_s=slow), units.speed(mm_per_s=fast)) == (0, 255)
    assert units.speeds.speed_value(fast) == 255
    with pytest.raises(ValueError, match="mm_per_s must be millimetres a second in"):
        units.speed(mm_per_s=fast + 1)


# -- a wrong model -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("named", "there", "words"),
    [
        (THREE_FINGER, TWO_FINGER_85, "this is no 3-Finger: its registers show one axis alone"),
        (HAND_E, THREE_FINGER, "this is no Hand-E: its registers show more than one axis"),
    ],
)
@virtual
async def test_a_gripper_of_another_model_is_refused_and_not_written_to(
    named: Model, there: Model, words: str
) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=there)
    async with SimulatorServer(gripper) as server:
        # The registers of a sibling lie elsewhere, and both are served: the content decides.
        hand = RobotiqHand(f"127.0.0.1:{server.port}", model=named)
        with pytest.raises(WrongModelError, match=words):
            await hand.start()
    assert not gripper.writes


def changed(reply: bytes, start: int, data: bytes) -> list[tuple[float, bytes]]:
    """A reply over TCP; one with registers has these bytes from byte ``start`` of the status on."""
    at = 9 + start
    strange = (reply[:at] + data + reply[at + len(data) :])[: len(reply)]
    return [(0.0, strange if reply[7] in (3, 4) and len(reply) > 13 else reply)]


def of_no_gripper(reply: bytes) -> list[tuple[float, bytes]]:
    """It shows several axes, and a controller as siblings have it."""
    return changed(reply, 1, b"\xff\xf0")


def of_one_axis(reply: bytes) -> list[tuple[float, bytes]]:
    return changed(changed(reply, 1, b"\x00")[0][1], 4, bytes((100, *bytes(10))))


def with_a_reserved_bit(reply: bytes) -> list[tuple[float, bytes]]:
    return changed(reply, 2, b"\x10")


@pytest.mark.parametrize(
    ("model", "replies", "words"),
    [
        (THREE_FINGER, of_one_axis, "this is no 3-Finger"),
        (TWO_FINGER_85, of_no_gripper, "another device answers: its registers"),
    ],
    ids=["3f", "2f85"],
)
@virtual
async def test_another_device_is_refused_and_not_written_to(
    model: Model, replies: Callable[[bytes], list[tuple[float, bytes]]], words: str
) -> None:
    """At a start, at a reconnection, and at the stop in the end."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=model)
    async with SimulatorServer(gripper) as server:
        hand = RobotiqHand(f"127.0.0.1:{server.port}", model=model)
        for stranger, why in ((replies, words), (of_no_gripper, "another device answers: its registers")):
            server.policy = stranger
            with pytest.raises(ProtocolError, match=why):
                await hand.start()
        assert not gripper.writes
        server.policy = lambda reply: [(0.0, reply)]
        await hand.start()
        await hand.set_position(200)
        server.policy = replies
        written = len(gripper.writes)
        server.cut()
        await hand.wait_for_state(State.DISCONNECTED)
        await asyncio.sleep(3)
        with pytest.raises(ConnectionLostError, match=words):
            hand.command(position=0)
        await hand.stop()
        assert len(gripper.writes) == written


@virtual
async def test_a_gripper_with_a_reserved_bit_is_refused_at_first_and_stopped_later(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """It was refused after a reconnection, and its fingers moved on: halt() raised, stop() wrote nothing."""
    caplog.set_level(logging.WARNING, "robotiq_async")
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with SimulatorServer(gripper) as server:
        hand = RobotiqHand(server.address)
        server.policy = with_a_reserved_bit
        with pytest.raises(ProtocolError, match="another device answers: its registers"):
            await hand.start()
        server.policy = lambda reply: [(0.0, reply)]
        await hand.start()
        hand.command(position=255, speed=0)
        await until(lambda: gripper.is_moving)
        server.policy = with_a_reserved_bit
        for _ in range(2):
            server.cut()
            await hand.wait_for_state(State.DISCONNECTED)
            await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        assert gripper.is_moving
        await hand.halt()
        assert not gripper.is_moving
        hand.command(position=255, speed=0)
        await until(lambda: gripper.is_moving)
        server.cut()
        await hand.stop()
        assert not gripper.is_moving
    told = [each for each in caplog.messages if "the gripper shows bits that are always 0 in it" in each]
    assert len(told) == 1


@pytest.mark.parametrize("model", MODELS.values(), ids=lambda model: model.name)
def test_zeros_contradict_no_model(model: Model) -> None:
    """A gateway may send them before its gripper has answered."""
    assert not contradiction(model, (0,) * 8)


# -- a hand ------------------------------------------------------------------------------------------------


@siblings
@virtual
async def test_from_the_first_start_to_a_grasp_and_back(model: Model) -> None:
    async with hand_on(model) as (gripper, hand):
        gripper.place_object(JAW, 150)
        assert hand.model is model
        assert list((await hand.move(100, JAW)).positions) == [JAW]
        grasp = await hand.grasp(force=100)
        assert grasp.is_held
        assert grasp.holds == JAW
        assert grasp.positions[JAW] == pytest.approx(150, abs=5)
        assert repr(grasp).endswith(f"; A={grasp.positions[JAW]}, {grasp.width_mm:.1f} mm wide>")
        assert repr(grasp.move).endswith(f" s, {grasp.width_mm:.1f} mm open>")
        opened = await hand.open()
        assert opened.outcomes == {JAW: ObjectStatus.AT_POSITION}
        assert opened.positions[JAW] <= model.open_reading_max
        gripper.remove_object()
        closed = await hand.close(speed=100)
        assert closed.positions[JAW] >= model.closed_reading_min
        assert closed.duration * SPEEDUP == pytest.approx(hand.units.closing_s(100), rel=0.1)


@virtual
async def test_a_motion_under_way_can_be_held_and_halted() -> None:
    async with hand_on(TWO_FINGER_85) as (gripper, hand):
        for stop in (hand.hold, hand.halt):
            await hand.set_position(CLOSED, Finger.ALL)
            await asyncio.sleep(0.3 / SPEEDUP)
            await stop()
            await asyncio.sleep(0.1 / SPEEDUP)
            at = gripper.position(JAW)
            await asyncio.sleep(1 / SPEEDUP)
            assert gripper.position(JAW) == at
            assert 10 < at < 220


@virtual
async def test_axes_of_another_model_are_refused_before_anything_is_sent() -> None:
    async with hand_on(TWO_FINGER_85) as (gripper, hand):
        before = len(gripper.writes)
        for mask in (Finger.B, Finger.A | Finger.SCISSOR):
            with pytest.raises(ValueError, match=r"fingers must be axes of a 2F-85 \(A\), got "):
                await hand.move(100, mask)
        assert len(gripper.writes) == before


@virtual
async def test_a_fault_is_that_of_the_model_and_is_recovered_from() -> None:
    async with hand_on(HAND_E) as (gripper, hand):
        moving = asyncio.ensure_future(hand.close(speed=0))
        await asyncio.sleep(0.3 / SPEEDUP)
        gripper.inject_fault(0x0A)
        with pytest.raises(GripperFaultError) as caught:
            await moving
        assert caught.value.fault is Fault.UNDER_VOLTAGE
        await hand.recover()
        assert hand.state is State.RUNNING_IDLE


@virtual
async def test_a_fault_that_the_model_does_not_know_is_waited_for() -> None:
    """0x0C is one of a jaw, and is reset; 0x02 is of none."""
    async with hand_on(HAND_E) as (gripper, hand):
        gripper.inject_fault(0x0C)
        await hand.wait_for_state(State.FAULT)
        await hand.recover()
        writes = len(gripper.writes)
        gripper.inject_fault(0x02)
        await hand.wait_for_state(State.FAULT)
        with pytest.raises(StateTimeoutError, match="0x02"):
            await hand.recover(timeout=0.3)
        assert len(gripper.writes) == writes


@virtual
async def test_an_automatic_release_opens_the_jaw() -> None:
    async with hand_on(HAND_E) as (gripper, hand):
        await hand.close()
        gripper.inject_fault(0x08)
        await hand.wait_for_state(State.FAULT)
        gripper.clear_faults()
        await asyncio.sleep(0.1)
        gripper.inject_fault(0x0E)
        await hand.wait_for_state(State.FAULT)
        await hand.atr()
        assert gripper.position(JAW) <= HAND_E.open_reading_max


@virtual
async def test_a_remote_hand_learns_the_model_from_its_agent() -> None:
    async with lab(model=TWO_FINGER_85) as here, here.client() as hand:
        assert hand.model is TWO_FINGER_85
        assert hand.units.mm(0) == 85.0
        assert list((await hand.close()).positions) == [JAW]
        here.gripper.inject_fault(0x0A)
        with pytest.raises(GripperFaultError) as caught:
            await hand.move(10)
        assert caught.value.fault is Fault.UNDER_VOLTAGE


# -- the contract ------------------------------------------------------------------------------------------


OF_FIGURES = ("test_amounts", "test_moves")
"""Scenes that go by strokes, speeds and readings, which is all that siblings differ in."""
OF_STATUSES = ("test_streams", "test_waiting")
"""Scenes about what is made of statuses, by whatever link these come."""
ASKED_ALIKE = [file for file in FILES if file not in OF_OTHERS]
GRID = [
    *((TWO_FINGER_85, SimulatorServer, file) for file in ASKED_ALIKE),
    *((model, SimulatorServer, file) for model in (TWO_FINGER_140, HAND_E) for file in OF_FIGURES),
    # Port 63352 speaks of one jaw, whichever it is. What is refused before is not asked there.
    *((TWO_FINGER_85, UrcapSimulatorServer, file) for file in ASKING if file not in OF_STATUSES),
]
"""A jaw has every scene; another one, and another link, those whose outcome can be another there."""


def named(each: object) -> str:
    return each.__name__ if isinstance(each, type) else str(each)


@pytest.mark.parametrize(("model", "server", "file"), GRID, ids=named)
def test_a_hand_on_a_sibling_keeps_its_contract(
    model: Model, server: type[SimulatorServer], file: str
) -> None:
    """All scenes of the contract, in one of their forms, but those about a 3-Finger."""
    tried = {name: scene for name, scene in scenes(file) if name not in OTHERWISE}
    assert tried
    assert not failing(tried, model, server)


def test_the_scenes_that_are_left_out_cannot_pass() -> None:
    left_out = {name: scene for file in ASKED_ALIKE for name, scene in scenes(file) if name in OTHERWISE}
    assert failing(left_out, TWO_FINGER_85, SimulatorServer) == OTHERWISE.keys()


def failing(tried: Mapping[str, Callable[[], None]], model: Model, server: type[SimulatorServer]) -> set[str]:
    """The names of the scenes that fail, in whatever way."""
    failed = set()
    token, link = MODEL.set(model), SERVER.set(server)
    try:
        for name, scene in tried.items():
            try:
                scene()
            except (Exception, pytest.fail.Exception):  # noqa: BLE001  # every way to fail counts
                failed.add(name)
    finally:
        MODEL.reset(token)
        SERVER.reset(link)
    return failed


# -- around a hand -----------------------------------------------------------------------------------------


async def test_a_recording_has_the_one_axis_and_can_be_read(tmp_path: Path) -> None:
    path = tmp_path / "jaw.mcap"
    async with RobotiqHand("sim://?model=2f85&speedup=20") as hand:
        async with Recorder(hand, path) as recorder:
            await hand.close(speed=0)
        assert recorder.recorded > 3
    entries = [*read_recording(path)]
    assert {entry.topic for entry in entries} == {topic.name for topic in TOPICS}
    (last,) = [entry for entry in entries if entry.topic == "/gripper/status"][-1:]
    row = Table("status").row("status", last.nanoseconds, last.fields)
    assert row is not None
    named = dict(zip(COLUMNS["status"], row, strict=True))
    assert named["A.position"] >= TWO_FINGER_85.closed_reading_min  # type: ignore[operator]
    assert named["B.position"] is None
    assert re.fullmatch(r"status   jaw=\d+ \(\d+\.\d mm\) AT_POSITION", status_line(last.fields))
    assert named["A.opening_mm"] == TWO_FINGER_85.stroke.opening_mm(int(str(named["A.position"])))
    assert 0 <= named["A.open_fraction"] < 0.05  # type: ignore[operator]
    assert named["B.opening_mm"] is None


def test_a_page_shows_the_axis_that_there_is() -> None:
    mirror = HandMirror(0, "sim://", State.RUNNING_IDLE)
    message = {
        "state": "RUNNING_IDLE",
        "inhibited": None,
        "problem": "",
        "events": [],
        "peaks": [150],
        "model": "hand-e",
        "has_current": True,
        "bodies": None,
        "age": 0.0,
    }
    mirror.hear(message | {"registers": registers(0xF9, 0, 0, 255, 228), "timestamp": 1.0, "sequence": 3})
    assert mirror.model is HAND_E
    assert mirror.samples[-1].positions == (228,)
    assert mirror.samples[-1].currents == (150,)
    assert (axis_title(mirror, 0), opening_words(mirror)) == ("jaw", "0.0 mm (nominal)")
    own = {"registers": registers(0xF9, 0, 0, 255, 228), "timestamp": 2.0, "sequence": 4}
    mirror.hear(message | own | {"stroke": [[3, 60.0], [240, 10.0]]})
    assert opening_words(mirror) == "12.5 mm (measured)"


async def test_calls_that_need_three_fingers_say_so() -> None:
    async with RobotiqHand("sim://?model=2f85&speedup=20") as hand:
        with pytest.raises(RobotiqStateError, match="a 2F-85 has no scissor"):
            await ACTIONS["wide"].run(Operator(hand))
        with pytest.raises(MeasuringError, match="a 2F-85 has one axis"):
            await grasp(hand, 100, 100)


@virtual
async def test_a_closing_is_timed_against_the_stroke_of_the_model() -> None:
    async with hand_on(TWO_FINGER_85) as (_, hand):
        assert await time_closing(hand, 255, JAW, speedup=SPEEDUP) == pytest.approx(0.828, rel=0.05)
