"""The names of the field."""

from __future__ import annotations

import copy
import json
import pickle
from enum import IntEnum

import pytest

import robotiq_async as package
from robotiq_async import Fault, Finger, Initialization, Mode, ObjectStatus, Severity, State
from robotiq_async.values.model import THREE_FINGER

ASSIGNED = (
    {0x00: "NONE"}
    | dict.fromkeys((0x05, 0x06, 0x07), "PRIORITY")
    | dict.fromkeys((0x09, 0x0A, 0x0B), "MINOR")
    | dict.fromkeys((0x0D, 0x0E, 0x0F), "MAJOR")
)
"""The fault codes of the manual, with their class."""


def test_the_axes_have_the_bits_of_the_contract() -> None:
    values = {name: int(member) for name, member in Finger.__members__.items()}
    assert values == {"A": 1, "JAW": 1, "B": 2, "C": 4, "SCISSOR": 8, "ABC": 7, "ALL": 15}


def test_a_member_has_the_number_of_the_manual() -> None:
    numbers: dict[type[IntEnum], list[str]] = {
        ObjectStatus: ["IN_MOTION", "CONTACT_OPENING", "CONTACT_CLOSING", "AT_POSITION"],
        Mode: ["BASIC", "PINCH", "WIDE", "SCISSOR"],
        Initialization: ["RESET", "ACTIVATING", "CHANGING_MODE", "COMPLETE"],
    }
    for kind, names in numbers.items():
        assert {member.name: int(member) for member in kind} == {name: n for n, name in enumerate(names)}
    assert [member.is_contact for member in ObjectStatus] == [False, True, True, False]
    assert THREE_FINGER.axes == (Finger.A, Finger.B, Finger.C, Finger.SCISSOR)
    assert ~Finger.A == Finger.B | Finger.C | Finger.SCISSOR


def test_the_states_are_those_of_the_thesis_and_reset() -> None:
    running = "DISCONNECTED DO_ACTIVATION WF_ACTIVATION RUNNING_IDLE RUNNING_CC FAULT DO_ATR WF_ATR ATR_DONE"
    ending = "DO_RESET WF_RESET RESET DO_SHUTDOWN SHUTDOWN"
    assert set(State.__members__) == {*running.split(), *ending.split()}


def test_a_constant_has_the_value_of_the_contract() -> None:
    low = "OPEN", "WIDTH_WIDE", "SPEED_MIN", "FORCE_MIN"
    high = "CLOSED", "WIDTH_PINCH", "SPEED_MAX", "FORCE_MAX"
    expected = dict.fromkeys(low, 0) | dict.fromkeys(high, 255) | {"WIDTH_NORMAL": 100}
    constants = {name: getattr(package, name) for name in package.__all__ if name.isupper()}
    assert {name: value for name, value in constants.items() if type(value) is int} == expected
    others = {type(value) for name, value in constants.items() if name not in expected}
    assert others == {Finger, package.Model}


# -- faults ------------------------------------------------------------------------------------------------


def test_the_ten_codes_of_the_manual_are_the_members_of_fault() -> None:
    assert {int(each) for each in THREE_FINGER.faults if not each.name.startswith("UNKNOWN")} == set(ASSIGNED)


def test_a_code_has_the_severity_of_the_manual_and_what_is_unassigned_is_major() -> None:
    for code in range(16):
        assert Fault(code).severity is Severity[ASSIGNED.get(code, "MAJOR")], code
        assert Fault(code).is_serious == (ASSIGNED.get(code, "MAJOR") in ("MINOR", "MAJOR"))


def test_every_code_has_a_description_of_its_own() -> None:
    descriptions = {Fault(code).description for code in range(16)}
    assert len(descriptions) == 16
    assert all(descriptions)


@pytest.mark.parametrize("code", sorted(set(range(16)) - set(ASSIGNED)))
def test_an_unassigned_code_is_a_fault_with_a_number_for_a_name(code: int) -> None:
    fault, name = Fault(code), f"UNKNOWN_0x{code:02X}"
    assert isinstance(fault, Fault)
    assert (fault, int(fault), fault.value) == (code, code, code)
    assert (fault.name, str(fault), json.dumps(fault)) == (name, name, str(code))
    assert name in repr(fault)
    assert name[-4:] in fault.description
    for same in (Fault(code), pickle.loads(pickle.dumps(fault)), copy.copy(fault), copy.deepcopy(fault)):
        assert same is fault
    assert fault not in list(Fault)


@pytest.mark.parametrize("value", [16, -1, "NONE", None, 1.5])
def test_a_code_beyond_four_bits_is_no_fault(value: object) -> None:
    with pytest.raises(ValueError, match="not a valid Fault"):
        Fault(value)  # type: ignore[arg-type]


def test_a_mask_prints_as_the_names_of_its_axes() -> None:
    assert str(Finger.A) == "A"
    assert f"holding it with {Finger.A | Finger.C}" == "holding it with A|C"
    assert str(Finger.ALL) == "A|B|C|SCISSOR"
    assert str(Finger(0)) == "none"


@pytest.mark.parametrize("kind", [Fault, Initialization, Mode, ObjectStatus])
def test_a_field_of_the_status_prints_as_its_name_and_is_its_number_elsewhere(kind: type[IntEnum]) -> None:
    for member in kind:
        assert (str(member), f"{member}", "%s" % member) == (member.name,) * 3  # noqa: UP031
        assert (f"{member:02X}", "%d" % member) == (f"{int(member):02X}", str(int(member)))  # noqa: UP031
        assert json.loads(json.dumps({"it": member, member: 1})) == {"it": int(member), str(int(member)): 1}
        assert member == int(member)
        assert pickle.loads(pickle.dumps(member)) is member
