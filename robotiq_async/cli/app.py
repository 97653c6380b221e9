"""The command line, built from its sub-commands."""

from __future__ import annotations

from typing import Final

from cyclopts import App

from .. import __version__
from .commands.agent import agent
from .commands.demo import demo
from .commands.doctor import doctor
from .commands.fleet import fleet, halt
from .commands.fleet_keys import keys as fleet_keys
from .commands.measure_force import force as measure_force
from .commands.measure_speed import speed as measure_speed
from .commands.monitor import monitor
from .commands.move import move
from .commands.record import plot, record, recover, replay
from .commands.simulate import simulate
from .commands.status import status
from .commands.view import view
from .commands.web import web

COMMANDS: Final = (
    *(demo, simulate, status, move, monitor, web, view, doctor),
    *(record, replay, recover, plot, agent),
)
"""A new sub-command is a module with a function of its name, and an entry here."""

_HELP = """Control a Robotiq 3-Finger gripper, or a simulated one.

Every command that talks to a gripper takes its address as the last argument:

    tcp://192.168.1.11    Modbus TCP; tcp:// and the port (:502) may be left out
    rtu:///dev/ttyUSB0    Modbus RTU on a serial line (extra serial)
    zenoh://lab/cell/left one that an agent on another host serves (extra fleet)
    sim://                the default: a gripper simulated inside the command

Nothing here has run on real hardware yet.
"""


def build() -> App:
    """The command line; whatever is slow to import is imported by the sub-command that needs it."""
    app = App(name="robotiq-async", help=_HELP, help_format="plaintext", version=__version__)
    for command in COMMANDS:
        app.command(command)
    app.command(_measure())
    app.command(_fleet())
    return app


def _fleet() -> App:
    """The sub-command for hands on other hosts."""
    app = App(name="fleet", help_format="plaintext")
    app.default(fleet)
    app.command(halt)
    app.command(fleet_keys)
    return app


def _measure() -> App:
    """The sub-command that has sub-commands of its own."""
    app = App(
        name="measure",
        help="Measure what the values 0..255 mean on your own gripper. THE FINGERS MOVE.",
        help_format="plaintext",
    )
    app.command(measure_speed)
    app.command(measure_force)
    return app
