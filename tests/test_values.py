"""Results of the library are values: they can be compared, hashed, copied and sent to other processes."""

from __future__ import annotations

import copy
import dataclasses
import importlib
import inspect
import json
import pickle
import re
from collections.abc import Callable, Iterator
from concurrent.futures import Future
from datetime import UTC, datetime
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import robotiq_async
from robotiq_async import (
    ConnectFailedError,
    Fault,
    Finger,
    GraspResult,
    GripChange,
    GripEvent,
    GripperFaultError,
    Inhibit,
    InvalidStateError,
    Mode,
    MotionInhibitedError,
    MoveResult,
    MoveTimeoutError,
    ObjectStatus,
    ReconnectPolicy,
    RobotiqStatus,
    SentRequest,
    Severity,
    State,
    Statistics,
    Transition,
    Trigger,
    TunnelPlace,
    Units,
)
from robotiq_async.calibration import ForceCalibration, SpeedCalibration
from robotiq_async.calibration.conventions import Convention
from robotiq_async.calibration.csv_tables import SPEED_LAYOUT, TableError
from robotiq_async.control.waiters import Move
from robotiq_async.fleet import ControlLostError, GripperName, Member, NotAllStoppedError, Route
from robotiq_async.fleet.control.lease import Holder
from robotiq_async.fleet.keys.access import AccessList
from robotiq_async.fleet.keys.credentials import Credentials
from robotiq_async.fleet.network.endpoints import Endpoint
from robotiq_async.fleet.remote.errand import NoAnswerError
from robotiq_async.hands.statistics import Counters
from robotiq_async.link.address import Simulation, parse_address
from robotiq_async.simulator import Habits, Likeness, Trouble
from robotiq_async.tools.doctor import Finding, Level
from robotiq_async.tools.verify.catalogue import EndError
from robotiq_async.tools.web.settings import PageSettings
from robotiq_async.values.frozen_mapping import FrozenMapping
from robotiq_async.values.model import HAND_E
from robotiq_async.values.registers import TCP_REGISTERS, gDT
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import Part
from tests.register_words import status_of

A, B = Finger.A, Finger.B
LEFT = GripperName("lab", "cell-1", "left")


def result(**changes: object) -> MoveResult:
    fields: dict[str, Any] = {
        "outcomes": {A: ObjectStatus.CONTACT_CLOSING, B: ObjectStatus.AT_POSITION},
        "positions": {A: 150, B: 200},
        "contacts": A,
        "reached": B,
        "duration": 1.25,
        "peak_current_ma": {A: 310, B: 150},
        "status": status_of(0xB9, 0xEA, at=12.5, sequence=7),
    }
    return MoveResult(**fields | changes)


def statistics() -> Statistics:
    counters = Counters()
    counters.moves["reached"] = 3
    return counters.snapshot(0)


def real_result() -> MoveResult:
    waiter: Future[MoveResult] = Future()
    move = Move(255, A | B, 10.0, waiter)
    move.see(status_of(0x39, 0xC0, current=15), Finger.ALL, {})
    move.end(status_of(0xB9, 0xEA, at=12.5))
    return waiter.result(timeout=0)


VALUES: list[object] = [
    real_result(),
    result(),
    statistics(),
    status_of(0xB9, 0xEA, at=12.5, sequence=7),
    Transition(State.RESET, State.DO_ACTIVATION, Trigger.ASK_ACTIVATE, 12.5),
    SentRequest(Request(activate=True, axes=(AxisRequest(1, 2, 3),) * 4), 12.5, acknowledged=True),
    AxisRequest(1, 2, 3),
    Part(A, 30.5),
    ReconnectPolicy(give_up_after=3.0),
    TunnelPlace("arm", 502, 9, {"side": "left"}),
    Simulation(speedup=10.0, object=150),
    Habits(status_lag=0.05),
    Likeness(HAND_E, link="rtu", device_id=9),
    Convention("bench", open=0.0, closed=5.0),
    SpeedCalibration.thesis(),
    SpeedCalibration("mine", [[0, 9.0], [255, 2.0]]),  # type: ignore[arg-type]
    ForceCalibration.nominal(),
    Units(),
    GraspResult(result(), 2),
    Inhibit("someone is in the cell", "panel", 1.5),
    GripEvent(GripChange.SLIPPED, A, 5, A | B, status_of(0xB9, 0xEA, at=12.5, sequence=7)),
    Request(activate=True, mode=Mode.PINCH),
    parse_address("tcp://gripper"),
    HAND_E.stroke,
    HAND_E.faults[0x0A],
    Request(model=HAND_E),
    RobotiqStatus((0,) * 8, model=HAND_E),
    parse_address("sim://?speedup=10&object=150").simulation,
    TCP_REGISTERS,
    gDT[0],
    SPEED_LAYOUT,
    Finding(Level.GOOD, "port", "open"),
    Trouble("late", at=1.0),
    LEFT,
    Route(("tls/cell-1:7447",), Path("keys")),
    Member(LEFT, is_there=True, state=State.FAULT, fault=Fault.SCISSOR_BLOCKED, seen_at=12.5),
    Holder("5f0c3a9e", "bob@desk"),
    Endpoint("tls/[::1]:7447", "tls", "::1"),
    AccessList(read=("alice",)),
    Credentials("read:alice", datetime(2026, 1, 1, tzinfo=UTC), datetime(2028, 1, 1, tzinfo=UTC)),
    Fault.SCISSOR_BLOCKED,
    Fault(0x0C),
    Severity.MAJOR,
    Finger.A | Finger.SCISSOR,
    FrozenMapping({A: 1}),
]
ERRORS: list[Exception] = [
    InvalidStateError("not now", State.RESET, [State.FAULT]),
    GripperFaultError(Fault.SCISSOR_BLOCKED),
    GripperFaultError(Fault(0x0C), "as told"),
    MoveTimeoutError("too slow", status_of(0x39, 0xC0)),
    ConnectFailedError("tcp://192.168.1.11:502", "refused"),
    ControlLostError("another client commands the gripper", "held"),
    NoAnswerError(LEFT, "move"),
    NotAllStoppedError("not stopped", {LEFT: "no answer"}, ["tls/cell-2:7447"]),
    TableError("table.csv", 3, "no number"),
    TableError("table.csv", None, "the file is empty"),
    EndError("time", "too slow"),
    MotionInhibitedError(Inhibit("someone is in the cell", "panel", 1.5)),
]


AN_ERROR = re.compile(r"^class \w+\(.*(Error|Exception)\b", re.MULTILINE)


def errors() -> Iterator[type[Exception]]:
    """Every error that is defined in the package and has a public name."""
    root = Path(robotiq_async.__file__).parent
    # To import all of it takes a second.
    for file in (file for file in root.rglob("*.py") if AN_ERROR.search(file.read_text(encoding="utf-8"))):
        module = ".".join(file.relative_to(root.parent).with_suffix("").parts).removesuffix(".__init__")
        try:
            names = vars(importlib.import_module(module))
        except ImportError:
            continue  # of an extra that is not installed
        for name, kind in names.items():
            is_error = inspect.isclass(kind) and issubclass(kind, Exception)
            if is_error and kind.__module__ == module and not name.startswith("_"):
                yield kind


def named(each: list[Any]) -> list[Any]:
    """The values as parameters."""
    return [pytest.param(one, id=f"{type(one).__name__}-{number}") for number, one in enumerate(each)]


def copies(value: Any) -> Iterator[Any]:
    yield copy.copy(value)
    yield copy.deepcopy(value)
    for protocol in range(2, pickle.HIGHEST_PROTOCOL + 1):
        yield pickle.loads(pickle.dumps(value, protocol))


@pytest.mark.parametrize("value", named(VALUES))
def test_a_value_equals_its_copies_and_has_a_repr_of_one_line(value: object) -> None:
    for again in copies(value):
        assert type(again) is type(value)
        assert again == value
        assert hash(again) == hash(value)
        assert repr(again) == repr(value)
    assert "\n" not in repr(value)
    assert " object at 0x" not in repr(value)


@pytest.mark.parametrize("value", named([*filter(dataclasses.is_dataclass, VALUES)]))
def test_a_value_can_be_taken_apart_and_is_not_changed_by_that(value: Any) -> None:
    fields = dataclasses.asdict(value)
    assert list(fields) == [field.name for field in dataclasses.fields(value)]
    assert dataclasses.replace(value) == value
    for name in fields:
        with pytest.raises(dataclasses.FrozenInstanceError):
            setattr(value, name, None)


def test_no_value_is_forgotten() -> None:
    modules = (robotiq_async, robotiq_async.fleet, robotiq_async.simulator)
    public = [getattr(module, name) for module in modules for name in module.__all__]
    there = {kind.__name__ for kind in public if isinstance(kind, type) and dataclasses.is_dataclass(kind)}
    assert there - {type(value).__name__ for value in VALUES} == {"Model"}, "compared by identity"


BYTE: Any = np.uint8(9)
HALF: Any = np.float32(0.5)
WORDS: Any = np.arange(8, dtype=np.uint16)
NUMPY: dict[str, tuple[object, object]] = {
    "policy": (ReconnectPolicy(HALF, BYTE, BYTE), ReconnectPolicy(0.5, 9.0, 9.0)),
    "calibration": (
        SpeedCalibration("mine", [(np.uint8(0), HALF), (np.uint8(255), BYTE)]),  # type: ignore[arg-type]
        SpeedCalibration("mine", ((0, 0.5), (255, 9.0))),
    ),
    "delay": (Trouble("delay", HALF, at=BYTE), Trouble("delay", 0.5, at=9.0)),
    "fault": (Trouble("fault", BYTE, lasts=HALF, every=BYTE), Trouble("fault", 9, lasts=0.5, every=9.0)),
    "status": (
        RobotiqStatus.from_registers(WORDS, timestamp=HALF, sequence=BYTE),
        RobotiqStatus(tuple(range(8)), 0.5, 9),
    ),
    "request": (Request.from_registers(WORDS), Request.from_registers(range(8))),
    "page": (
        PageSettings(port=BYTE, speed=BYTE, token="t", folder="f"),
        PageSettings(port=9, speed=9, token="t", folder="f"),
    ),
    "code": (Fault(np.uint8(12)), Fault(12)),  # type: ignore[arg-type]
}


@pytest.mark.parametrize("what", NUMPY)
def test_values_made_from_numpy_hold_plain_numbers(what: str) -> None:
    given, kept = NUMPY[what]
    assert given == kept
    assert "np." not in repr(given)
    assert hash(given) == hash(kept)


# -- the result of a move ----------------------------------------------------------------------------------


def test_a_result_shows_each_axis_and_keeps_mappings_of_its_own() -> None:
    assert repr(result()) == ("<MoveResult A=150 CONTACT_CLOSING 310mA, B=200 AT_POSITION 150mA in 1.250 s>")

    positions = {A: 150}
    each = result(positions=positions)
    positions[A] = 0
    assert each.positions == {A: 150}
    assert each == result(positions={A: 150})


# -- for JSON and for tables --------------------------------------------------------------------------------


DICTS: dict[str, Any] = {type(value).__name__: value for value in VALUES if hasattr(value, "as_dict")}


def leaves(fields: Any) -> Iterator[object]:
    """The leaves of a dict of dicts, with their keys; a list may hold nothing but numbers and words."""
    for key, value in fields.items():
        yield key
        if type(value) is dict:
            yield from leaves(value)
        else:
            yield from value if type(value) is list else [value]


@pytest.mark.parametrize("kind", DICTS)
def test_a_value_as_a_dict_holds_what_json_knows_by_the_names_of_its_attributes(kind: str) -> None:
    value = DICTS[kind]
    fields = value.as_dict()
    assert json.loads(json.dumps(fields)) == fields
    assert {type(each) for each in leaves(fields)} <= {int, float, bool, str}
    for name, written in fields.items():
        if name in Finger.__members__ or name == "fault_code":
            continue
        held = getattr(value, name) if hasattr(value, name) else getattr(value.request, name)
        if name == "finger":
            held = held.name  # one axis, not a mask
        elif isinstance(held, Finger):
            held = [axis.name for axis in held]
        elif isinstance(held, Enum):
            held = held.name
        elif name == "registers":
            held = list(held)
        elif name in ("status", "move"):
            held = held.as_dict()
        assert written == held, name
    fields.clear()
    assert value.as_dict(), "it is made anew each time"


def test_values_of_one_axis_are_listed_below_its_name() -> None:
    status = status_of(0xB9, 0x0A, echo=200, position=150, current=31)
    assert status.as_dict()["B"] == {
        "position": status.position(B),
        "requested_position": status.requested_position(B),
        "current_ma": status.current_ma(B),
        "axis_state": status.axis_state(B),
        "opening_mm": status.opening_mm(B),
        "open_fraction": status.open_fraction(B),
    }
    assert not {"opening_mm", "open_fraction"} & status.as_dict()["SCISSOR"].keys()
    assert result().as_dict()["A"] == {
        "outcome": "CONTACT_CLOSING",
        "position": 150,
        "opening_mm": result().opening_mm(A),
        "reached": False,
        "peak_current_ma": 310,
    }
    assert "C" not in result().as_dict(), "it was not addressed"
    assert DICTS["SentRequest"].as_dict()["C"] == {"position": 1, "speed": 2, "force": 3}


def test_a_status_is_rebuilt_from_a_message() -> None:
    status = status_of(0xB9, 0xEA, fault=0x0C, at=12.5, sequence=7)
    fields = status.as_dict()
    assert (fields["fault"], fields["fault_code"]) == ("UNKNOWN_0x0C", 12)
    timed = {name: fields[name] for name in ("timestamp", "sequence")}
    assert RobotiqStatus.from_registers(fields["registers"], **timed) == status


# -- mappings ----------------------------------------------------------------------------------------------


CHANGES: list[Callable[[Any], object]] = [
    lambda each: each.__setitem__(A, 0),
    lambda each: each.__delitem__(A),
    lambda each: each.__ior__({A: 0}),
    lambda each: each.clear(),
    lambda each: each.pop(A, None),
    lambda each: each.popitem(),
    lambda each: each.setdefault(B, 0),
    lambda each: each.update(A=0),
]


def test_a_mapping_refuses_to_be_changed() -> None:
    each = result()
    for mapping in (each.outcomes, each.positions, each.peak_current_ma, statistics().moves):
        before = dict(mapping)
        for again in (mapping, *copies(mapping)):
            for change in CHANGES:
                with pytest.raises(TypeError, match="cannot be changed"):
                    change(again)
            assert again == before


def test_every_way_to_change_a_dict_is_refused() -> None:
    left = {name for name, method in vars(dict).items() if getattr(FrozenMapping, name) is method}
    assert left & {"__setitem__", "__delitem__", "__ior__"} == set()
    reading = {"copy", "fromkeys", "get", "items", "keys", "values"}
    assert {name for name in left if not name.startswith("_")} <= reading


def test_a_mapping_hashes_by_what_it_holds_and_not_by_its_order() -> None:
    assert hash(FrozenMapping({A: 1, B: 2})) == hash(FrozenMapping({B: 2, A: 1}))
    assert len({FrozenMapping({A: 1}), FrozenMapping({A: 1}), FrozenMapping({A: 2})}) == 2
    with pytest.raises(TypeError):
        hash(FrozenMapping({A: []}))


# -- errors ------------------------------------------------------------------------------------------------


def assert_survives(error: Exception) -> None:
    error.add_note("noted")
    for again in copies(error):
        assert type(again) is type(error)
        assert (str(again), repr(again), again.args) == (str(error), repr(error), error.args)
        assert vars(again) == vars(error)
        with pytest.raises(type(error)):
            raise again


@pytest.mark.parametrize("error", named(ERRORS))
def test_an_error_survives_copying_and_pickling_with_all_it_carries(error: Exception) -> None:
    assert_survives(error)


def test_so_does_every_other_public_error() -> None:
    others = {*errors()} - {type(each) for each in ERRORS}
    assert len(others) > 10
    for kind in others:
        assert_survives(kind("why"))
