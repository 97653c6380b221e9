"""``robotiq-async demo``."""

from __future__ import annotations

from collections.abc import Coroutine
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType

from ..arguments import Address, Yes
from ..consent import consent


def demo(address: Address = "sim://", /, *, yes: Yes = False) -> Coroutine[None, None, None]:
    """Show what the library does, call by call. THE FINGERS MOVE.

    Four parts: movements, speeds, forces, status and faults. Unless the gripper is
    that of sim:// it asks first; without a terminal it needs --yes.

    For example:

        robotiq-async demo
        robotiq-async demo tcp://192.168.1.11

    Args:
        yes: Do not ask.
    """
    program = _program()
    # Asked here and not in the coroutine: a question would block the event loop.
    consent(address, program.WARNING, yes=yes)
    run: Coroutine[None, None, None] = program.run(address)
    return run


def _program() -> ModuleType:
    """The demo program: a file of the installed package, or demo/demo.py beside it in the source tree."""
    package = Path(__file__).parents[2]
    installed, source = package / "_demo.py", package.parent / "demo" / "demo.py"
    spec = spec_from_file_location("robotiq_async._demo", installed if installed.exists() else source)
    assert spec is not None
    assert spec.loader is not None
    program = module_from_spec(spec)
    spec.loader.exec_module(program)
    return program
