"""The command line, built from its sub-commands."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Sequence
from functools import partial
from itertools import groupby
from typing import Final

from cyclopts import App

from .. import __version__
from .commands.agent import agent
from .commands.demo import demo
from .commands.doctor import doctor
from .commands.fleet import fleet, halt, keys, permit
from .commands.measure import speed
from .commands.measure_force import force
from .commands.measure_stroke import stroke
from .commands.monitor import monitor, status
from .commands.move import move
from .commands.ports import ports
from .commands.recordings import export, plot, record, recover, replay
from .commands.simulate import simulate
from .commands.verify import verify
from .commands.view import view
from .commands.web import web

SUBCOMMANDS: Final = (
    *(demo, simulate, status, move, monitor, web, view, ports, doctor, verify),
    *(record, replay, export, plot, recover, agent),
)
"""A new sub-command is a module with a function of its name, and an entry here."""

_HELP = """Control a Robotiq 3-Finger, 2F-85, 2F-140 or Hand-E gripper, or a simulated one.

Every command that talks to a gripper takes its address as the last argument, and names it first:

    tcp://192.168.1.11    Modbus TCP; 192.168.1.11 will do
    rtu:///dev/ttyUSB0    Modbus RTU on a serial line
    rtu+tcp://HOST:PORT   Modbus RTU, a serial server
    urcap://HOST          Robotiq's URCap on a UR
    zenoh://lab/cell/left an agent on another host
    sim://                simulated inside the command

A gripper other than the 3-Finger is named at the end: tcp://192.168.1.11?model=2f85 (2f140, hand-e).

Without an address it is sim://; doctor, verify and measure want one.

The extras beside cli:

    monitor   monitor
    web       web, demo --show
    view      view
    record    record (but not .csv), replay, export,
              plot, recover, verify
    plot      plot, the pictures of measure
    fleet     agent, fleet, doctor and all others with
              zenoh:// addresses
    serial    ports, rtu:// addresses

Nothing here has run on real hardware yet.
"""


def build(arguments: Sequence[str] = ()) -> App:
    """The command line. Each sub-command imports its slow dependencies itself.

    Args:
        arguments: If the first is a sub-command, only that one is added, because all of them take 7 ms.
    """
    app = _app("robotiq-async", _HELP)
    ways: dict[str, Callable[[], object]] = {each.__name__: partial(_add, app, each) for each in SUBCOMMANDS}
    ways |= {"measure": lambda: app.command(_measure()), "fleet": lambda: app.command(_fleet())}
    named = next(iter(arguments), "")
    for add in [ways[named]] if named in ways else ways.values():
        add()
    return app


def _app(name: str, words: str) -> App:
    return App(name=name, help=_reflow(words), help_format="plaintext", version=__version__)


def _add(app: App, command: Callable[..., object]) -> None:
    app.command(command, help=_reflow(command.__doc__ or ""))


def _fleet() -> App:
    app = _app("fleet", fleet.__doc__ or "")
    app.default(fleet)
    _add(app, halt)
    _add(app, permit)
    _add(app, keys)
    return app


def _measure() -> App:
    app = _app("measure", "Measure the meaning of the values 0..255 on your gripper. THE FINGERS MOVE.")
    _add(app, speed)
    _add(app, force)
    _add(app, stroke)
    return app


def _reflow(text: str) -> str:
    """Join the lines of each paragraph; a terminal wraps them to its own width.

    Indented lines, such as examples, stay as they are.
    """
    lines = inspect.cleandoc(text).splitlines()
    return "\n".join(
        line
        for is_prose, block in groupby(lines, key=_is_prose)
        for line in ([" ".join(block)] if is_prose else block)
    )


def _is_prose(line: str) -> bool:
    return bool(line.strip()) and not line.startswith(" ")
