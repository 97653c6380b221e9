"""What the package exports, and that all of it is documented."""

from __future__ import annotations

import ast
import inspect
import itertools
import re
import subprocess
import sys
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import FunctionType

import pytest

import robotiq_async
from robotiq_async import fleet, simulator, sync
from robotiq_async.values import enums, model

CONTRACT = {
    # The hand and what it hands out.
    "RobotiqHand",
    "RobotiqStatus",
    "MoveResult",
    "Transition",
    # Enums and constants.
    "Finger",
    "ObjectStatus",
    "Fault",
    "State",
    "OPEN",
    "CLOSED",
    "WIDTH_NORMAL",
    "WIDTH_WIDE",
    "WIDTH_PINCH",
    "SPEED_MIN",
    "SPEED_MAX",
    "FORCE_MIN",
    "FORCE_MAX",
    # Errors.
    "RobotiqError",
    "RobotiqStateError",
    "NotStartedError",
    "InvalidStateError",
    "NotActivatedError",
    "GripperFaultError",
    "ActivationTimeoutError",
    "StateTimeoutError",
    "MoveTimeoutError",
    "MoveSupersededError",
    "RobotiqConnectionError",
    "ConnectFailedError",
    "ConnectionLostError",
    "ResponseTimeoutError",
    "ProtocolError",
}
"""The names of the contract."""
EXTRAS = {
    "Initialization": "type of RobotiqStatus.initialization",
    "Mode": "type of RobotiqStatus.mode",
    "Severity": "type of Fault.severity",
    "Trigger": "type of Transition.trigger",
    "Statistics": "type of RobotiqHand.statistics",
    "Stream": "type of RobotiqHand.statuses() and .transitions()",
    "Units": "type of RobotiqHand.units",
    "GraspResult": "what RobotiqHand.grasp() gives",
    "GripEvent": "what RobotiqHand.grip_events() gives",
    "GripChange": "type of GripEvent.change",
    "SentRequest": "what RobotiqHand.requests() gives",
    "Transport": "what may be passed in place of an address",
    "ReconnectPolicy": "what may be passed as reconnect",
    "Model": "type of RobotiqHand.model",
    "THREE_FINGER": "what may be passed as model",
    "TWO_FINGER_85": "what may be passed as model",
    "TWO_FINGER_140": "what may be passed as model",
    "HAND_E": "what may be passed as model",
    "JAW": "the axis of a 2F or a Hand-E",
    "WrongModelError": "what a start with another model raises",
}
"""What is exported beyond it, with the reason."""


def exported() -> dict[str, object]:
    return {name: getattr(robotiq_async, name) for name in robotiq_async.__all__}


def public_members(owner: type) -> Iterator[tuple[str, object]]:
    """The methods and properties a class defines itself, made ones (of dataclasses and enums) aside."""
    members: dict[str, object] = {}
    for base in reversed(owner.__mro__):
        if base.__module__.startswith("robotiq_async"):
            members |= vars(base)
    for name, member in members.items():
        if name.startswith("_"):
            continue
        if isinstance(function_of(member), FunctionType):
            yield name, member


def function_of(member: object) -> object:
    return member.fget if isinstance(member, property) else getattr(member, "__func__", member)


METHODS = [
    pytest.param(member, id=f"{module.__name__.rpartition('.')[2]}.{owner}.{name}")
    for module in (robotiq_async, simulator, fleet, sync)
    for owner in module.__all__
    if isinstance(getattr(module, owner), type)
    for name, member in public_members(getattr(module, owner))
]


def test_the_package_exports_the_contract_and_the_extras_and_nothing_else() -> None:
    assert set(robotiq_async.__all__) == CONTRACT | set(EXTRAS)


def test_no_name_is_exported_twice() -> None:
    assert len(set(robotiq_async.__all__)) == len(robotiq_async.__all__)


def test_the_exports_are_sorted_constants_first() -> None:
    assert list(robotiq_async.__all__) == sorted(
        robotiq_async.__all__, key=lambda name: (not name.isupper(), _natural(name))
    )


def _natural(name: str) -> list[object]:
    return [int(part) if part.isdigit() else part for part in re.split(r"(\d+)", name)]


def test_every_exported_name_exists() -> None:
    assert all(value is not None for value in exported().values())


def test_a_star_import_brings_exactly_the_exports() -> None:
    names: dict[str, object] = {}
    exec("from robotiq_async import *", names)
    assert set(names) - {"__builtins__"} == set(robotiq_async.__all__)


def test_dir_shows_the_public_names_only() -> None:
    assert dir(robotiq_async) == sorted([*robotiq_async.__all__, "__version__"])


def test_the_map_of_the_package_names_every_room() -> None:
    root = Path(robotiq_async.__file__).parent
    rooms = {path.parent.name for path in root.glob("*/__init__.py")}
    assert robotiq_async.__doc__ is not None
    assert rooms <= set(re.findall(r"\w+", robotiq_async.__doc__))


def test_the_package_has_a_version() -> None:
    assert robotiq_async.__version__.count(".") == 2


@pytest.mark.parametrize("name", [name for name in robotiq_async.__all__ if not name.isupper()])
def test_every_exported_class_has_a_docstring_of_its_own(name: str) -> None:
    value = getattr(robotiq_async, name)
    assert isinstance(value, type)
    doc = vars(value).get("__doc__")
    assert doc
    assert not doc.startswith(f"{name}("), "a dataclass without a docstring documents its signature"


def test_every_exported_constant_is_described_where_it_is_defined() -> None:
    files = [Path(str(each.__file__)) for each in (enums, model)]
    body = [node for file in files for node in ast.parse(file.read_text(encoding="utf-8")).body]
    described = {
        node.target.id
        for node, following in itertools.pairwise(body)
        if isinstance(node, ast.AnnAssign)
        and isinstance(node.target, ast.Name)
        and isinstance(following, ast.Expr)
        and isinstance(following.value, ast.Constant)
        and isinstance(following.value.value, str)
    }
    assert {name for name in robotiq_async.__all__ if name.isupper()} <= described


@pytest.mark.parametrize("member", METHODS)
def test_every_public_method_has_a_docstring(member: object) -> None:
    assert member.__doc__
    assert member.__doc__.strip()


@pytest.mark.parametrize("member", METHODS)
def test_every_public_method_is_annotated(member: object) -> None:
    function = function_of(member)
    assert isinstance(function, FunctionType)
    signature = inspect.signature(function)
    assert signature.return_annotation is not signature.empty
    assert all(
        parameter.annotation is not parameter.empty
        for name, parameter in signature.parameters.items()
        if name not in ("self", "cls")
    )


@pytest.mark.parametrize("name", [name for name in robotiq_async.__all__ if not name.isupper()])
def test_every_attribute_of_a_value_object_is_described(name: str) -> None:
    value = getattr(robotiq_async, name)
    fields = getattr(value, "__dataclass_fields__", {})
    for field in fields:
        if field.startswith("_"):
            continue
        assert f"{field}:" in value.__doc__, f"{name}.{field} is not in its docstring"


@pytest.mark.parametrize("name", sorted(name for name in vars(robotiq_async) if name[0].isupper()))
def test_no_public_name_is_imported_and_not_exported(name: str) -> None:
    assert name in robotiq_async.__all__


def test_every_module_has_a_docstring() -> None:
    root = Path(robotiq_async.__file__).parent
    bare = [
        str(path.relative_to(root))
        for path in root.rglob("*.py")
        if not ast.get_docstring(ast.parse(path.read_text(encoding="utf-8")))
    ]
    assert bare == []


def test_the_hand_has_the_calls_of_the_contract() -> None:
    names = (
        "start stop set_position set_speed set_force command move open close halt is_activated is_reset "
        "is_moving status atr reset activate recover state wait_for_state transitions statuses statistics"
    )
    hand = robotiq_async.RobotiqHand
    for name in [*names.split(" "), "__aenter__", "__aexit__"]:
        assert hasattr(hand, name), name
    calls = {name for name in names.split(" ") if inspect.iscoroutinefunction(getattr(hand, name))}
    assert calls == {
        "start",
        "stop",
        "set_position",
        "set_speed",
        "set_force",
        "move",
        "open",
        "close",
        "halt",
        "atr",
        "reset",
        "activate",
        "recover",
        "wait_for_state",
    }


def test_the_parameters_of_the_calls_are_those_of_the_contract() -> None:
    hand = robotiq_async.RobotiqHand
    empty = inspect.Parameter.empty

    def parameters(name: str) -> list[tuple[str, object, bool]]:
        """Name, default and whether it is keyword-only."""
        given = list(inspect.signature(getattr(hand, name)).parameters.values())[1:]
        return [(each.name, each.default, each.kind is each.KEYWORD_ONLY) for each in given]

    abc, every = robotiq_async.Finger.ABC, robotiq_async.Finger.ALL
    assert parameters("__init__")[0] == ("address", "sim://", False)
    assert all(keyword for _, _, keyword in parameters("__init__")[1:])
    assert {"device_id": None, "poll_interval": 0.005, "speed": 128, "force": 64}.items() <= {
        name: default for name, default, _ in parameters("__init__")
    }.items()
    assert {"response_timeout", "activation_timeout", "reconnect"} <= {
        name for name, _, _ in parameters("__init__")
    }
    assert parameters("start") == [("activate", True, False), ("wait", 0.0, True)]
    assert parameters("set_position") == [("value", empty, False), ("fingers", abc, False)]
    assert parameters("set_speed") == [("value", empty, False), ("fingers", every, False)]
    assert parameters("set_force") == [("value", empty, False), ("fingers", every, False)]
    changes = [(name, None, True) for name in ("position", "speed", "force")]
    assert parameters("command") == [("fingers", abc, False), *changes]
    options = [(name, None, True) for name in ("speed", "force", "timeout")]
    assert parameters("move") == [("position", empty, False), ("fingers", abc, False), *options]
    assert parameters("open") == parameters("close") == [("fingers", abc, False), *options]
    assert parameters("statuses") == [("buffer", 1, False)]
    assert parameters("transitions") == parameters("halt") == parameters("atr") == parameters("reset") == []
    assert parameters("wait_for_state")[-1] == ("timeout", None, True)


def test_the_status_has_the_attributes_of_the_contract() -> None:
    names = (
        "from_registers registers timestamp sequence finger_status position requested_position current "
        "current_ma fault is_activated is_reset is_moving mode"
    )
    for name in names.split(" "):
        assert name in vars(robotiq_async.RobotiqStatus), name


def test_the_result_of_a_move_has_the_attributes_of_the_contract() -> None:
    names = "outcomes positions contacts object_detected duration peak_current_ma status"
    for name in names.split(" "):
        assert hasattr(robotiq_async.MoveResult, name) or name in robotiq_async.MoveResult.__slots__, name


def test_importing_the_package_does_not_import_the_simulator_or_the_command_line() -> None:
    source = (
        "import sys, robotiq_async; print(*sorted(m for m in sys.modules if m.startswith('robotiq_async.')))"
    )
    run = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, check=True, timeout=60
    )
    loaded = run.stdout.split()
    assert "robotiq_async.hand" in loaded
    assert not [name for name in loaded if name.startswith(("robotiq_async.simulator", "robotiq_async.cli"))]


def test_enums_that_are_exported_have_members() -> None:
    for name, value in exported().items():
        if isinstance(value, type) and issubclass(value, Enum):
            assert len(value) > 0, name
