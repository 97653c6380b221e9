"""The command line, built from its sub-commands."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from cyclopts import App

from .. import __version__
from .commands.agent import agent
from .commands.demo import demo
from .commands.doctor import doctor
from .commands.fleet import fleet, halt
from .commands.fleet_keys import keys as fleet_keys
from .commands.measure.force import force as measure_force
from .commands.measure.speed import speed as measure_speed
from .commands.monitor import monitor
from .commands.move import move
from .commands.recording.record import record
from .commands.recording.recordings import export, plot, recover, replay
from .commands.simulate import simulate
from .commands.status import status
from .commands.verify import verify
from .commands.view import view
from .commands.web import web
from .output.reflow import reflow

COMMANDS: Final = (
    *(demo, simulate, status, move, monitor, web, view, doctor, verify),
    *(record, replay, export, plot, recover, agent),
)
"""A new sub-command is a module with a function of its name, and an entry here."""

_HELP = """Control a Robotiq 3-Finger, 2F-85, 2F-140 or Hand-E gripper, or a simulated one.

Every command that talks to a gripper takes its address as the last argument, and names it first:

    tcp://192.168.1.11    Modbus TCP; tcp:// and the port (:502) may be left out
    rtu:///dev/ttyUSB0    Modbus RTU on a serial line (extra serial)
    rtu+tcp://HOST:PORT   Modbus RTU through a serial server
    zenoh://lab/cell/left one that an agent on another host serves (extra fleet)
    sim://                a gripper simulated inside the command

A gripper other than the 3-Finger is named at the end: tcp://192.168.1.11?model=2f85 (2f140, hand-e).

Without an address it is sim://; doctor, verify and measure want one.

What the extras beside cli are for:

    monitor   monitor
    web       web, demo --show
    view      view
    record    record (not of a table, .csv), replay, export, plot, recover, verify
    plot      plot, the pictures of measure
    fleet     agent, fleet, doctor and all others with zenoh:// addresses
    serial    rtu:// addresses

Nothing here has run on real hardware yet.
"""


def build() -> App:
    """The command line. Each sub-command imports its slow dependencies itself."""
    app = _app("robotiq-async", _HELP)
    for command in COMMANDS:
        _add(app, command)
    app.command(_measure())
    app.command(_fleet())
    return app


def _app(name: str, words: str) -> App:
    return App(name=name, help=reflow(words), help_format="plaintext", version=__version__)


def _add(app: App, command: Callable[..., object]) -> None:
    app.command(command, help=reflow(command.__doc__ or ""))


def _fleet() -> App:
    app = _app("fleet", fleet.__doc__ or "")
    app.default(fleet)
    _add(app, halt)
    _add(app, fleet_keys)
    return app


def _measure() -> App:
    app = _app("measure", "Measure what the values 0..255 mean on your own gripper. THE FINGERS MOVE.")
    _add(app, measure_speed)
    _add(app, measure_force)
    return app
