"""``robotiq-async demo``."""

from __future__ import annotations

from collections.abc import Coroutine
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Annotated

from cyclopts import Parameter

from ..address import parse_address
from .arguments import Address, usage


def demo(
    address: Address = "sim://",
    /,
    *,
    yes: Annotated[bool, Parameter(name=("--yes", "-y"), negative=())] = False,
) -> Coroutine[None, None, None] | None:
    """Show what the library does, call by call. THE FINGERS MOVE.

    Four parts: movements, speeds, forces, status and faults. With a real gripper it
    says first what it is about to do and, at a terminal, asks before it moves.

    For example:

        robotiq-async demo
        robotiq-async demo tcp://192.168.1.11

    Args:
        yes: Do not ask.
    """
    with usage():
        parse_address(address)  # A malformed one is refused before the question.
    program = _program()
    # Asked here and not in the coroutine: a question would block the event loop.
    run: Coroutine[None, None, None] | None = program.run(address) if program.consent(address, yes) else None
    return run


def _program() -> ModuleType:
    """The demo program: a file of the installed package, or demo/demo.py beside it in the source tree."""
    package = Path(__file__).parents[1]
    installed, source = package / "_demo.py", package.parent / "demo" / "demo.py"
    spec = spec_from_file_location("robotiq_async._demo", installed if installed.exists() else source)
    assert spec is not None
    assert spec.loader is not None
    program = module_from_spec(spec)
    spec.loader.exec_module(program)
    return program
