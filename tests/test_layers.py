"""Who may import whom: the map in robotiq_async/__init__.py, enforced."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import robotiq_async

PACKAGE = "robotiq_async"
ROOT = Path(robotiq_async.__file__).parent

PURE = [
    "version",
    "enums",
    "errors",
    "checks",
    "frozen",
    "registers",
    "status",
    "request",
    "log",
    "closing_time",
    "machine",
    "procedures",
    "echo",
    "adoption",
    "ledger",
    "desk",
    "compose",
    "kinematics",
    "motion",
    "core",
]
"""No I/O, no clock, no event loop."""
RUNTIME = [
    "clock",
    "address",
    "places",
    "claims",
    "reply",
    "messages",
    "ending",
    "names",
    "link",
    "worker",
    "guard",
    "simulated",
    "statistics",
    "event_loop",
    "streams",
    "timerfd",
    "tick",
    "owner",
    "runs",
    "calibration",
    "options",
    "waiting",
    "hand",
    "actions",
    "payloads",
    "jointstate",
    "feed",
    "recorder",
    "recording",
    "services",
    "viewer",
    "metrics",
    "doctor",
    "measuring",
    "plots",
]
BESIDE = ["simulator", "cli"]
ORDER = [*PURE, *RUNTIME]
"""Each module imports only what stands before it."""

SHARED_WITH_THE_SIMULATOR = {"enums", "checks", "registers", "status", "request", "closing_time"}
"""All that the simulator may import of the library: none of what it is there to test."""
IMPURE = {
    "anyio",
    "asyncio",
    "concurrent",
    "datetime",
    "io",
    "multiprocessing",
    "os",
    "pathlib",
    "pymodbus",
    "random",
    "select",
    "selectors",
    "serial",
    "signal",
    "socket",
    "subprocess",
    "threading",
    "time",
    "trio",
}


def imported(source: str, module: str) -> Iterator[str]:
    """The full names of the modules a module imports at run time, also inside functions.

    ``from x import y`` yields ``x.y`` where x is a package of ours and y a module of it. What stands below
    ``if TYPE_CHECKING:`` does not count.
    """
    package = module if (ROOT.parent / Path(*module.split("."))).is_dir() else module.rpartition(".")[0]
    queue: list[ast.AST] = [ast.parse(source)]
    while queue:
        node = queue.pop()
        match node:
            case ast.If(test=ast.Name("TYPE_CHECKING") | ast.Attribute(attr="TYPE_CHECKING")):
                queue += node.orelse
            case ast.Import():
                yield from (alias.name for alias in node.names)
            case ast.ImportFrom():
                parents = package.split(".")
                base = ".".join(parents[: len(parents) - node.level + 1]) if node.level else ""
                origin = ".".join(part for part in (base, node.module) if part)
                for alias in node.names:
                    inner = f"{origin}.{alias.name}"
                    yield inner if is_module(inner) else origin
            case _:
                queue += ast.iter_child_nodes(node)


def is_module(name: str) -> bool:
    """Whether a name is a module or a package of ours."""
    path = ROOT.parent.joinpath(*name.split("."))
    return name.startswith(f"{PACKAGE}.") and (path.with_suffix(".py").exists() or path.is_dir())


def layer(name: str) -> str | None:
    """The module of ours that a full name belongs to ("" for the package itself), or None for others."""
    if name == PACKAGE:
        return ""
    return name.split(".")[1] if name.startswith(f"{PACKAGE}.") else None


def complaints(source: str, module: str) -> list[str]:
    """What a module imports that it must not."""
    own = layer(module)
    assert own is not None
    found = []
    for name in imported(source, module):
        theirs, top = layer(name), name.partition(".")[0]
        if own in ("", "__main__"):
            allowed = top != "pymodbus" and (own == "__main__" or theirs not in BESIDE)
        elif top == "pymodbus":
            allowed = own in ("messages", "link", "simulator")
        elif own == "cli":
            allowed = True
        elif own == "simulator":
            allowed = theirs is None or theirs in {"simulator", *SHARED_WITH_THE_SIMULATOR}
        elif theirs is None:
            allowed = own not in PURE or top not in IMPURE
        elif theirs == "simulator":
            allowed = own == "simulated"
        else:
            allowed = theirs in ORDER[: ORDER.index(own)]
        if not allowed:
            found.append(f"{module} imports {name}")
    return found


def modules() -> dict[str, Path]:
    """Every module of the package by its full name."""
    found = {}
    for path in sorted(ROOT.rglob("*.py")):
        parts = path.relative_to(ROOT.parent).with_suffix("").parts
        found[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = path
    return found


# -- the package -------------------------------------------------------------------------------------------


@pytest.mark.parametrize("module", modules())
def test_a_module_imports_only_what_stands_above_it(module: str) -> None:
    assert complaints(modules()[module].read_text(encoding="utf-8"), module) == []


def test_every_module_has_its_place() -> None:
    top = {layer(module) for module in modules()} - {"", "__main__"}
    assert top == {*ORDER, *BESIDE}


def test_the_map_in_the_package_is_this_order() -> None:
    assert robotiq_async.__doc__ is not None
    names = re.findall(r"^ {4}(\w+)  ?", robotiq_async.__doc__, flags=re.MULTILINE)
    assert names == [*ORDER, *BESIDE]
    pure, _, _ = robotiq_async.__doc__.partition("    -----")
    assert re.findall(r"^ {4}(\w+)  ?", pure, flags=re.MULTILINE) == PURE


def test_only_the_link_and_the_simulator_use_pymodbus() -> None:
    users = {
        layer(module)
        for module, path in modules().items()
        for name in imported(path.read_text(encoding="utf-8"), module)
        if name.partition(".")[0] == "pymodbus"
    }
    assert users == {"messages", "link", "simulator"}


@pytest.mark.parametrize("module", ["gripper", "controller", "control", "axis", "faults", "report"])
def test_the_physics_of_the_simulator_know_neither_pymodbus_nor_an_event_loop(module: str) -> None:
    full = f"{PACKAGE}.simulator.{module}"
    tops = {name.partition(".")[0] for name in imported(modules()[full].read_text(encoding="utf-8"), full)}
    assert not tops & {"pymodbus", "asyncio", "anyio", "socket"}


def test_the_runtime_needs_the_simulator_only_when_a_simulated_gripper_is_opened() -> None:
    path = modules()["robotiq_async.link.simulated"]
    tree = ast.parse(path.read_text(encoding="utf-8"))
    lazy = (ast.ClassDef, ast.FunctionDef)
    outside = ast.Module([node for node in tree.body if not isinstance(node, lazy)], [])
    assert not [
        name for name in imported(ast.unparse(outside), "robotiq_async.link.simulated") if "simulator" in name
    ]


# -- the checker catches what it is there for --------------------------------------------------------------


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("status", "from .machine import look"),
        ("status", "from . import machine"),
        ("status", "from . import machine as m"),
        ("status", "import robotiq_async.control.state_machine"),
        ("status", "from robotiq_async.control.state_machine import look"),
        ("status", "from robotiq_async import RobotiqHand"),
        ("status", "from . import RobotiqHand"),
        ("status", "def f():\n    from .hand import RobotiqHand"),
        ("status", "try:\n    from .hand import RobotiqHand\nexcept ImportError:\n    pass"),
        ("status", "if TYPE_CHECKING:\n    pass\nelse:\n    from .hand import RobotiqHand"),
        ("status", "if sys.version_info > (3, 11):\n    from .hand import RobotiqHand"),
        ("status", "from .status import RobotiqStatus"),
        ("core", "import asyncio"),
        ("core", "import asyncio.events as e"),
        ("core", "from asyncio import sleep"),
        ("core", "import time"),
        ("core", "from time import monotonic"),
        ("core", "import anyio"),
        ("core", "import socket"),
        ("core", "from pymodbus.client import AsyncModbusTcpClient"),
        ("core", "from .address import parse_address"),
        ("machine", "def f():\n    import time"),
        ("hand", "import pymodbus"),
        ("hand", "from pymodbus.exceptions import ModbusException"),
        ("hand", "from .cli import main"),
        ("hand", "from .simulator import SimulatorServer"),
        ("options", "def f():\n    from .simulator.server import SimulatorServer"),
        ("link", "from .hand import RobotiqHand"),
        ("simulator.axis", "from robotiq_async.control.state_machine import Machine"),
        ("simulator.axis", "from robotiq_async import echo"),
        ("simulator.axis", "from .. import RobotiqHand"),
        ("simulator.axis", "from ..hand import RobotiqHand"),
        ("simulator.axis", "from ..errors import RobotiqError"),
        ("simulator", "from ..core import Core"),
        ("simulator", "from robotiq_async import RobotiqHand"),
        ("cli.move", "import pymodbus"),
    ],
)
def test_a_planted_violation_is_caught(module: str, source: str) -> None:
    assert len(complaints(source, f"{PACKAGE}.{module}")) == 1


def test_the_package_itself_must_not_import_the_simulator_or_the_command_line() -> None:
    assert complaints("from .simulator import SimulatedGripper", PACKAGE)
    assert complaints("from . import cli", PACKAGE)
    assert not complaints("from .hand import RobotiqHand", PACKAGE)


@pytest.mark.parametrize(
    ("module", "source"),
    [
        ("status", "from .enums import Finger"),
        ("status", "from . import registers as reg"),
        ("status", "import math, logging\nfrom collections import deque"),
        ("status", "if TYPE_CHECKING:\n    from .hand import RobotiqHand\n    import asyncio"),
        ("status", "if typing.TYPE_CHECKING:\n    from .hand import RobotiqHand"),
        ("link", "from pymodbus.client import AsyncModbusTcpClient\nimport asyncio, anyio"),
        ("simulated", "def f():\n    from .simulator import SimulatorServer"),
        ("hand", "from .waiting import StateWaiters\nfrom .enums import State\nimport asyncio, time"),
        ("simulator.axis", "from robotiq_async import registers as reg\nfrom ..request import Request"),
        (
            "simulator.server",
            "from pymodbus.server import ModbusTcpServer\nfrom .gripper import X\nimport asyncio",
        ),
        ("cli.move", "from ..simulator import SimulatorServer\nfrom .. import RobotiqHand"),
    ],
)
def test_what_the_map_allows_is_not_complained_about(module: str, source: str) -> None:
    assert complaints(source, f"{PACKAGE}.{module}") == []
