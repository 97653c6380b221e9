"""``robotiq-async demo``."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Coroutine
from contextlib import asynccontextmanager, nullcontext
from importlib import import_module
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from types import ModuleType
from typing import Final

from ...hands import Hand
from ..arguments import AddressArgument, Flag, Yes, need
from ..browser import opened
from ..consent import consent
from ..failures import CommandError

DEMO_PATIENCE_S: Final = 60.0
"""Seconds for which the demo waits for a browser."""
DEMO_LOOK_S: Final = 2.0
"""Seconds for the user to find the window."""


def demo(
    address: AddressArgument = "sim://", /, *, yes: Yes = False, show: Flag = False
) -> Coroutine[None, None, None]:
    """Show the library, call by call. THE FINGERS MOVE.

    Four parts: movements, speeds, forces, status and faults. Unless the gripper is
    simulated it asks first; without a terminal it needs --yes.

    For example:

        robotiq-async demo
        robotiq-async demo --show
        robotiq-async demo tcp://192.168.1.11

    Args:
        yes: Do not ask.
        show: Show the hand on a page in the browser while it moves; it only watches.
    """
    program = _program()
    if show:
        need("nicegui", "web")
    # Asked here and not in the coroutine: a question would block the event loop.
    consent(address, program.WARNING, yes=yes)
    run: Coroutine[None, None, None] = program.run(address, _shown if show else nullcontext)
    return run


@asynccontextmanager
async def _shown(hand: Hand) -> AsyncIterator[None]:
    from ...tools.recording.payloads import title
    from ...tools.web.server import PageServer
    from ...tools.web.settings import PageSettings

    async with (
        PageServer([hand], PageSettings(port=0, addresses=(title(hand),))) as page,
        opened(page.url) as is_opened,
    ):
        print(f"Watch it move: {page.url}")
        where = "Your browser opens it; if none does" if is_opened else "No browser could be opened here"
        print(f"{where}: open it yourself. The demo begins then, or in {DEMO_PATIENCE_S:g} s.", flush=True)
        try:
            async with asyncio.timeout(DEMO_PATIENCE_S):
                await page.seen()
            await asyncio.sleep(DEMO_LOOK_S)
        except TimeoutError:
            print("No browser has opened the page; it begins.", flush=True)
        yield
        await asyncio.sleep(DEMO_LOOK_S)  # time to see the end


def _program() -> ModuleType:
    name = "robotiq_async._demo"
    if find_spec(name) is not None:  # in a wheel; also in a zip or a frozen program, where it is no file
        return import_module(name)
    source = Path(__file__).parents[3] / "demo" / "demo.py"
    if not source.is_file():
        raise CommandError("this program was frozen without the demo: freeze it where the wheel is installed")
    spec = spec_from_file_location(name, source)
    assert spec is not None
    assert spec.loader is not None
    program = module_from_spec(spec)
    spec.loader.exec_module(program)
    return program
