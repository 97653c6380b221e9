"""The exports of the package, and that its methods and constants are documented."""

from __future__ import annotations

import ast
import dataclasses
import inspect
import itertools
import re
from collections.abc import Iterator
from enum import Enum
from pathlib import Path
from types import FunctionType

import robotiq_async
from robotiq_async import fleet, simulator, sync
from robotiq_async.calibration.amounts import UNITS
from robotiq_async.values import enums, model

CONTRACT = {
    *("RobotiqHand", "RobotiqStatus", "MoveResult", "Transition", "Finger", "ObjectStatus", "Fault", "State"),
    *("OPEN", "CLOSED", "WIDTH_NORMAL", "WIDTH_WIDE", "WIDTH_PINCH"),
    *("SPEED_MIN", "SPEED_MAX", "FORCE_MIN", "FORCE_MAX"),
    *("RobotiqError", "RobotiqStateError", "NotStartedError", "InvalidStateError", "NotActivatedError"),
    *("GripperFaultError", "ActivationTimeoutError", "StateTimeoutError", "MoveTimeoutError"),
    *("MoveSupersededError", "RobotiqConnectionError", "ConnectFailedError", "ConnectionLostError"),
    *("ResponseTimeoutError", "ProtocolError"),
}
"""The names of the contract."""
EXTRAS = {
    "Initialization": "type of RobotiqStatus.initialization",
    "Mode": "type of RobotiqStatus.mode",
    "Severity": "type of Fault.severity",
    "Trigger": "type of Transition.trigger",
    "Statistics": "type of RobotiqHand.statistics",
    "Stream": "type of RobotiqHand.statuses() and .transitions()",
    "Convention": "what numbers of learning stacks are turned by, for open_fraction=",
    "Units": "type of RobotiqHand.units",
    "GraspResult": "what RobotiqHand.grasp() gives",
    "Inhibit": "type of RobotiqHand.inhibited",
    "MotionInhibitedError": "what motions raise after a person's halt",
    "Part": "type of RobotiqHand.part",
    "GripEvent": "what RobotiqHand.grip_events() gives",
    "GripChange": "type of GripEvent.change",
    "SentRequest": "what RobotiqHand.requests() gives",
    "Tunnel": "what may be passed in place of an address",
    "TunnelPlace": "what makes a tunnel from an address gets",
    "ReconnectPolicy": "what may be passed as reconnect",
    "Model": "type of RobotiqHand.model",
    "THREE_FINGER": "what may be passed as model",
    "TWO_FINGER_85": "what may be passed as model",
    "TWO_FINGER_140": "what may be passed as model",
    "HAND_E": "what may be passed as model",
    "JAW": "the axis of a 2F or a Hand-E",
    "WrongModelError": "what a start with another model raises",
}
"""Exports beyond it, with the reason."""
ERROR = "advice hand message"
SERVING = "assume drop_requests halt_inhibited resume_inhibit"
"""Calls of a hand for programs that serve it to others: docs/reference.md has them under that title."""
HAND = (
    "activate address atr close command grasp grip_events halt hold inhibit inhibited "
    "is_activated is_moving is_reset model move name open part permit recover requests reset "
    "set_force set_position set_speed start state statistics status statuses stop transitions "
    "units wait_for_state"
)
SERVER = "accept address connections cut failed failure functions is_running link port refuse start stop"
SHOWN = {
    "Convention": (
        "DROID HIL_SERL LEROBOT LIBERO MANISKILL POLYMETIS_2F85 RADIANS_2F140 RADIANS_2F85 RLDS "
        "UR_RTDE closed fraction name open value"
    ),
    "GraspResult": "as_dict at_least holds is_held move positions status width_mm",
    "GripEvent": "as_dict change finger holds moved position status timestamp",
    "Inhibit": "again as_dict from_dict halts reason since who",
    "Model": (
        "all_axes axes closed_reading_min fault faults forces_n has_modes has_reached mask name names "
        "object_status open_reading_max open_reading_min rtu speeds_mm_s stroke tcp title"
    ),
    "MoveResult": (
        "as_dict contacts duration from_dict object_detected opening_mm outcomes peak_current_ma "
        "positions reached status"
    ),
    "Part": "holds width_mm",
    "ReconnectPolicy": "activate first_delay give_up_after max_delay",
    "RobotiqHand": f"{HAND} {SERVING} add_listener options",
    "RobotiqStatus": (
        "activation_echo as_dict as_raw axis_state contacts controller_fault controller_fault_text "
        "current current_ma echo fault finger_status from_raw from_registers go_echo has_current "
        "has_reached initialization is_activated is_moving is_reset mode model motion moving "
        "open_fraction opening_mm part position registers requested_position sequence stroke "
        "timestamp"
    ),
    "SentRequest": "acknowledged as_dict as_raw from_raw request timestamp",
    "Statistics": (
        "as_dict faults foreign_commands from_dict link_use longest_stall moves overruns "
        "passing_faults period_p50 period_p99 polls reconnects round_trip_p50 round_trip_p99 "
        "status_age_p50 status_age_p99 tick writes"
    ),
    "Stream": "aclose drain missed take_nowait",
    "Transition": "as_dict from_dict source target timestamp trigger",
    "Tunnel": "close exchange open",
    "TunnelPlace": "host options port unit",
    "Units": ("closing_s force forces label_n mm mm_per_s open_fraction position speed speeds stroke"),
    "Bodies": "joints parts",
    "Body": "kind position rotation size",
    "FaultInjector": "begin check end making ongoing run",
    "Habits": (
        "activation_time answers_with_echo echoes_limits keeps_status_on_halt lets_go_on_halt "
        "opens_without_rics silence_fault status_lag write_spacing"
    ),
    "Likeness": (
        "begin device_cycle device_id ends exchange_s from_file from_report gripper habits link model "
        "motion scissor_limit seed spread troubles unknown"
    ),
    "Physics": ("bodies control forces grip_force joint lift opening_mm part put_back take_away time"),
    "PhysicsError": "",
    "RtuOverTcpSimulatorServer": f"{SERVER} others power_cycle reply_silence",
    "SerialSimulatorServer": f"{SERVER} others reply_silence",
    "SimulatedGripper": (
        "bodies carry_out_writes clear_faults controller_fault device_cycle emergency_release "
        "emergency_stop end_emergency_stop fail_activation grips habits holds inject_fault interfere "
        "is_asleep is_moving is_powered model physics place_object position power_cycle power_off "
        "power_on remove_object request_registers speedup status_registers strand target travel write "
        "writes"
    ),
    "SimulatedScale": "reading",
    "SimulatorServer": f"{SERVER} power_cycle",
    "Trouble": "amount at duration every is_about kind lasts on value",
    "UrcapSimulatorServer": f"{SERVER} power_cycle",
    "Agent": "run",
    "Bus": "announce announced ask close publisher serve subscribe unreached watch who",
    "Fleet": "changes halt_all hand members",
    "GripperName": "base gripper host key mark of_key parse question site",
    "Member": "address agents fault holder inhibited is_moving is_there model name problem seen_at state",
    "RemoteHand": f"{HAND} acquire is_in_control release take",
    "Route": "configuration connect endpoints insecure keys",
}
"""The public methods, properties and constants of each exported class; enumerations and errors aside."""


def shown(kind: type) -> set[str]:
    """The public names in a class and its bases, without its fields that are set when one is made."""
    ours = [base for base in kind.__mro__ if base.__module__.startswith("robotiq_async")]
    return {name for base in ours for name in vars(base) if not name.startswith("_")}


def methods() -> Iterator[tuple[str, object]]:
    """The public methods and properties, by their full names; those that dataclasses and enums make aside."""
    for module in (robotiq_async, simulator, fleet, sync):
        for kind in (each for name in module.__all__ if isinstance(each := getattr(module, name), type)):
            for name in shown(kind):
                member = inspect.getattr_static(kind, name)
                function = (
                    member.fget if isinstance(member, property) else getattr(member, "__func__", member)
                )
                if isinstance(function, FunctionType):
                    yield f"{kind.__qualname__}.{name}", member


def test_the_package_exports_the_contract_and_the_extras_and_nothing_else_once() -> None:
    assert sorted(robotiq_async.__all__) == sorted([*CONTRACT, *EXTRAS])
    assert dir(robotiq_async) == sorted([*robotiq_async.__all__, "__version__"])
    assert {name for name in vars(robotiq_async) if name[0].isupper()} <= set(robotiq_async.__all__)
    names: dict[str, object] = {}
    exec("from robotiq_async import *", names)
    assert set(names) - {"__builtins__"} == set(robotiq_async.__all__)


def test_the_map_of_the_package_names_every_room() -> None:
    root = Path(robotiq_async.__file__).parent
    rooms = {path.parent.name for path in root.glob("[a-z]*/__init__.py")}
    assert robotiq_async.__doc__ is not None
    assert rooms <= set(re.findall(r"\w+", robotiq_async.__doc__))


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


def test_every_public_method_and_attribute_is_described() -> None:
    assert [name for name, method in methods() if not (method.__doc__ or "").strip()] == []
    for name in robotiq_async.__all__:
        value = getattr(robotiq_async, name)
        for field in dataclasses.fields(value) if dataclasses.is_dataclass(value) else ():
            if not field.name.startswith("_"):
                assert f"{field.name}:" in value.__doc__, f"{name}.{field.name} is not in its docstring"


def test_a_class_shows_what_users_may_call_and_nothing_else() -> None:
    """A helper of the library is private, a function, or stands on a class that is not exported.

    The blocking hand and its stream have the names of the others: tests/sync/test_signatures.py.
    """
    for module in (robotiq_async, simulator, fleet):
        for name in module.__all__:
            kind = getattr(module, name)
            if isinstance(kind, type) and not issubclass(kind, Enum):
                names = ERROR if issubclass(kind, robotiq_async.RobotiqError) else SHOWN[name]
                assert shown(kind) == set(names.split()), name


def test_the_calls_for_programs_that_serve_a_hand_are_told_as_theirs() -> None:
    page = (Path(__file__).parents[1] / "docs" / "reference.md").read_text(encoding="utf-8")
    _, _, section = page.partition("\n## A hand that you serve to others\n")
    told = set(re.findall(r"^- `(\w+)\(", section.partition("\n## ")[0], re.MULTILINE))
    hand = robotiq_async.RobotiqHand
    serve = {
        name for name in shown(hand) if "serves the hand to others" in (getattr(hand, name).__doc__ or "")
    }
    assert told == serve == set(SERVING.split())


def test_every_error_that_a_docstring_names_is_exported() -> None:
    errors = {
        name for room in (robotiq_async.values, fleet) for name in vars(room.errors) if name.endswith("Error")
    }
    described = [*methods()]
    for module in (robotiq_async, simulator, fleet, sync):
        described += [(name, getattr(module, name)) for name in module.__all__]
        ours = {*module.__all__, *robotiq_async.__all__}
        for name, each in described:
            named = set(re.findall(r"\b[A-Z]\w+Error\b", each.__doc__ or "")) & errors
            if name.partition(".")[0] in module.__all__:
                assert named <= ours, f"{name} names {named - ours}"


def test_the_parameters_of_the_calls_are_those_of_the_contract() -> None:
    hand = robotiq_async.RobotiqHand

    def parameters(name: str) -> list[tuple[str, object, bool]]:
        """Name, default and whether it is keyword-only."""
        given = list(inspect.signature(getattr(hand, name)).parameters.values())[1:]
        return [(each.name, each.default, each.kind is each.KEYWORD_ONLY) for each in given]

    abc, every = robotiq_async.Finger.ABC, robotiq_async.Finger.ALL
    assert parameters("__init__")[0] == ("address", "sim://", False)
    assert all(keyword for _, _, keyword in parameters("__init__")[1:])
    options = {name: default for name, default, _ in parameters("__init__")}
    assert {"device_id": None, "poll_interval": 0.005, "speed": 128, "force": 64}.items() <= options.items()
    assert {"response_timeout", "activation_timeout", "reconnect"} <= options.keys()
    assert parameters("start") == [("activate", True, False), ("wait", 0.0, True)]
    value, position = ("value", None, False), ("position", None, False)
    openings = [(name, None, True) for name in ("mm", "open_fraction")]
    assert parameters("set_position") == [value, ("fingers", abc, False), *openings]
    assert parameters("set_speed") == [value, ("fingers", every, False), ("mm_per_s", None, True)]
    assert parameters("set_force") == [value, ("fingers", every, False), ("label_n", None, True)]
    changes = [(name, None, True) for name in ("position", "speed", "force")]
    units = [*openings, ("mm_per_s", None, True), ("label_n", None, True)]
    assert parameters("command") == [("fingers", abc, False), *changes, *units]
    motion = [(name, None, True) for name in ("speed", "mm_per_s", "force", "label_n", "timeout")]
    assert parameters("move") == [position, ("fingers", abc, False), *openings, *motion]
    assert parameters("open") == parameters("close") == [("fingers", abc, False), *motion]
    calls = ("set_position", "set_speed", "set_force", "command", "move", "open", "close", "grasp")
    given = {name for call in calls for name, _, _ in parameters(call)}
    assert given - UNITS == {"fingers", "value", "position", "speed", "force", "timeout", "at_least"}
    assert given >= UNITS
    assert parameters("statuses") == [("buffer", 1, False), ("lost_after", None, True)]
    assert parameters("transitions") == parameters("halt") == parameters("atr") == parameters("reset") == []
    assert parameters("wait_for_state")[-1] == ("timeout", None, True)
