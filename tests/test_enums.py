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

ASSIGNED = {
    0x00: "NONE",
    0x05: "PRIORITY",
    0x06: "PRIORITY",
    0x07: "PRIORITY",
    0x09: "MINOR",
    0x0A: "MINOR",
    0x0B: "MINOR",
    0x0D: "MAJOR",
    0x0E: "MAJOR",
    0x0F: "MAJOR",
}
"""The fault codes of the manual, with their class."""
UNASSIGNED = sorted(set(range(16)) - set(ASSIGNED))


def test_the_axes_have_the_bits_of_the_contract() -> None:
    values = {name: int(member) for name, member in Finger.__members__.items()}
    assert values == {"A": 1, "B": 2, "C": 4, "SCISSOR": 8, "ABC": 7, "ALL": 15}


def test_the_axes_are_listed_in_the_order_of_their_registers() -> None:
    assert THREE_FINGER.axes == (Finger.A, Finger.B, Finger.C, Finger.SCISSOR)


def test_masks_are_put_together_with_or() -> None:
    assert Finger.A | Finger.B | Finger.C is Finger.ABC
    assert Finger.ABC | Finger.SCISSOR is Finger.ALL
    assert ~Finger.A == Finger.B | Finger.C | Finger.SCISSOR


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("OPEN", 0),
        ("CLOSED", 255),
        ("WIDTH_NORMAL", 100),
        ("WIDTH_WIDE", 0),
        ("WIDTH_PINCH", 255),
        ("SPEED_MIN", 0),
        ("SPEED_MAX", 255),
        ("FORCE_MIN", 0),
        ("FORCE_MAX", 255),
    ],
)
def test_a_constant_has_the_value_of_the_contract(name: str, value: int) -> None:
    assert getattr(package, name) == value
    assert type(getattr(package, name)) is int


def test_one_is_a_contact_while_opening_and_two_a_contact_while_closing() -> None:
    assert {int(member): member.name for member in ObjectStatus} == {
        0: "IN_MOTION",
        1: "CONTACT_OPENING",
        2: "CONTACT_CLOSING",
        3: "AT_POSITION",
    }


def test_only_the_two_contacts_are_contacts() -> None:
    assert [member.is_contact for member in ObjectStatus] == [False, True, True, False]


def test_modes_and_initialization_have_the_numbers_of_the_manual() -> None:
    assert {int(member): member.name for member in Mode} == {0: "BASIC", 1: "PINCH", 2: "WIDE", 3: "SCISSOR"}
    assert {int(member): member.name for member in Initialization} == {
        0: "RESET",
        1: "ACTIVATING",
        2: "CHANGING_MODE",
        3: "COMPLETE",
    }


def test_the_states_are_those_of_the_thesis_and_reset() -> None:
    assert set(State.__members__) == {
        "DISCONNECTED",
        "DO_ACTIVATION",
        "WF_ACTIVATION",
        "RUNNING_IDLE",
        "RUNNING_CC",
        "FAULT",
        "DO_ATR",
        "WF_ATR",
        "ATR_DONE",
        "DO_RESET",
        "WF_RESET",
        "RESET",
        "DO_SHUTDOWN",
        "SHUTDOWN",
    }


# -- faults ------------------------------------------------------------------------------------------------


def test_the_ten_codes_of_the_manual_are_the_members_of_fault() -> None:
    assert {int(each) for each in THREE_FINGER.faults if not each.name.startswith("UNKNOWN")} == set(ASSIGNED)


@pytest.mark.parametrize(("code", "severity"), ASSIGNED.items())
def test_an_assigned_code_has_the_severity_of_the_manual(code: int, severity: str) -> None:
    assert Fault(code).severity is Severity[severity]


def test_there_are_four_severities() -> None:
    assert list(Severity.__members__) == ["NONE", "PRIORITY", "MINOR", "MAJOR"]


@pytest.mark.parametrize("code", range(16))
def test_minor_and_major_faults_are_serious_and_nothing_else_is(code: int) -> None:
    assert Fault(code).is_serious == (code not in (0x00, 0x05, 0x06, 0x07))


def test_every_code_has_a_description_of_its_own() -> None:
    descriptions = {Fault(code).description for code in range(16)}
    assert len(descriptions) == 16
    assert all(descriptions)


@pytest.mark.parametrize("code", UNASSIGNED)
class TestAnUnassignedCode:
    def test_keeps_its_number_and_is_not_no_fault(self, code: int) -> None:
        fault = Fault(code)
        assert int(fault) == code
        assert fault.value == code
        assert fault is not Fault.NONE
        assert fault != Fault.NONE

    def test_shows_its_number_to_a_person(self, code: int) -> None:
        fault = Fault(code)
        assert fault.name == f"UNKNOWN_0x{code:02X}"
        assert f"0x{code:02X}" in fault.description
        assert f"UNKNOWN_0x{code:02X}" in repr(fault)

    def test_counts_as_major(self, code: int) -> None:
        assert Fault(code).severity is Severity.MAJOR

    def test_is_one_object_that_hashes_and_compares_like_the_others(self, code: int) -> None:
        assert Fault(code) is Fault(code)
        assert len({Fault(code), Fault(code), Fault.NONE}) == 2
        assert isinstance(Fault(code), Fault)

    def test_survives_copying_and_pickling(self, code: int) -> None:
        fault = Fault(code)
        assert pickle.loads(pickle.dumps(fault)) is fault
        assert copy.copy(fault) is fault
        assert copy.deepcopy(fault) is fault

    def test_does_not_become_one_of_the_documented_members(self, code: int) -> None:
        assert Fault(code) not in list(Fault)


@pytest.mark.parametrize("value", [16, -1, 255, "NONE", None, 1.5])
def test_what_does_not_fit_into_four_bits_is_no_fault_code(value: object) -> None:
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


def test_an_unassigned_fault_prints_its_number() -> None:
    assert str(Fault(0x0C)) == "UNKNOWN_0x0C"
    assert json.dumps(Fault(0x0C)) == "12"
