"""Carries out the commands of the pages, and holds the axes when a page has gone."""

from __future__ import annotations

import asyncio
import reprlib
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from time import monotonic
from types import MappingProxyType
from typing import Any, Final

from ...values import Inhibit, RobotiqError, State, parse_fingers
from ..actions import ACTIONS, Action, Operator
from ..recording.payloads import Properties
from ..wording import refusal_words

MAX_COMMANDS: Final = 16
"""Commands of one page at a time; a halt is never refused."""
HALT: Final = "halt"
BUTTONS: Final = {
    State.FAULT: "press recover",
    State.ATR_DONE: "press reset",
    State.RESET: "press activate",
}
"""The button that helps in a state."""
COMMAND_AGE_S: Final = 1.5
"""Maximum age of a command; a halt is never too old."""
Arguments = Mapping[str, Any]
RunCommand = Callable[[Operator, Arguments], Awaitable[str]]
"""Carries out a command; returns a description of the outcome."""


@dataclass(frozen=True, slots=True)
class PageCommand:
    """A command of a page."""

    run: RunCommand
    takes: frozenset[str] = frozenset()  # names of the arguments, all of which are needed


async def call(operator: Operator, name: str, arguments: Arguments) -> str:
    """Carry out a command; returns a description of the outcome.

    Raises:
        ValueError: an unknown command, other arguments than its own, or one outside its range.
        TypeError: an argument of the wrong type.
        RobotiqError: it could not be carried out.
    """
    command = PAGE_COMMANDS.get(name)
    if command is None:
        raise ValueError(f"there is no command {reprlib.repr(name)}")
    if arguments.keys() != command.takes:
        takes = ", ".join(sorted(command.takes)) or "no arguments"
        raise ValueError(f"{name} takes {takes}, got {reprlib.repr(dict(arguments))}")
    return await command.run(operator, arguments)


def _of(action: Action) -> PageCommand:
    async def run(operator: Operator, arguments: Arguments) -> str:
        if action.warning:
            _check_confirmed(action, arguments)
        return await operator.act(action)

    return PageCommand(run, frozenset({"confirm"} if action.warning else ()))


def _check_confirmed(action: Action, arguments: Arguments) -> None:
    if arguments["confirm"] is not True:
        raise ValueError(f"{action.name} needs confirm = true: {action.warning}")


async def _permit(operator: Operator, arguments: Arguments) -> str:
    """Permit motion after the halt that the question showed."""
    _check_confirmed(ACTIONS["permit"], arguments)
    seen = arguments["seen"]
    if not isinstance(seen, Mapping):
        raise TypeError(f"seen must be the inhibit that was shown, got {reprlib.repr(seen)}")
    return await operator.permit(Inhibit(**seen))


async def _move(operator: Operator, arguments: Arguments) -> str:
    fingers = arguments["fingers"]
    if not isinstance(fingers, str):
        raise TypeError(f"fingers must be a text like ABC, or scissor, got {reprlib.repr(fingers)}")
    return await operator.move(arguments["position"], parse_fingers("fingers", fingers))


def _set(setting: Callable[[Operator, int], Awaitable[str]]) -> RunCommand:
    async def run(operator: Operator, arguments: Arguments) -> str:
        await setting(operator, arguments["value"])
        return "set"

    return run


PAGE_COMMANDS: Final = MappingProxyType(
    {
        **{name: _of(action) for name, action in ACTIONS.items()},
        "permit": PageCommand(_permit, frozenset({"confirm", "seen"})),
        "move": PageCommand(_move, frozenset({"position", "fingers"})),
        "set_speed": PageCommand(_set(Operator.set_speed), frozenset({"value"})),
        "set_force": PageCommand(_set(Operator.set_force), frozenset({"value"})),
    }
)
"""The commands by name."""


class PageCommands:
    """Carries out commands, and keeps the running commands of each page.

    When a page has gone, its commands are cancelled, which holds the axes that still move. An activation, a
    release and a reset continue, as after any cancellation.

    There is an operator for each hand; without any, every command is refused. ``answer`` is called with the
    outcome of each command.
    """

    def __init__(self, operators: Sequence[Operator], answer: Callable[[Properties], None]) -> None:
        self._operators = operators
        self._answer = answer
        self._tasks: dict[str, set[asyncio.Task[str]]] = {}
        self._halts: set[asyncio.Task[str]] = set()
        self.is_ending: bool = False  # whether all commands but halts are refused

    @property
    def under_way(self) -> bool:
        """Whether a command has not ended yet."""
        return any(not task.done() for tasks in self._tasks.values() for task in tasks)

    def do(self, request: Properties) -> None:
        """Start a command; its answer comes later.

        A request has ``page``, ``number``, ``hand``, ``name`` and ``arguments`` of a command, and ``at``: the
        moment when the user gave it, in ``time.monotonic()`` of this machine, the same in every process.
        """
        page, name = str(request["page"]), str(request["name"])
        tasks = self._halts if name == HALT else self._tasks.setdefault(page, set())

        def ended(task: asyncio.Task[str]) -> None:
            tasks.discard(task)
            ok, words = _outcome(task)
            self._answer({"page": page, "number": request["number"], "name": name, "ok": ok, "words": words})

        task = asyncio.get_running_loop().create_task(self._carry_out(request, page, name))
        tasks.add(task)
        # A callback, because a task that is cancelled before its first step runs no code.
        task.add_done_callback(ended)

    def gone(self, page: str) -> None:
        """Hold the motions of a page that has ended or lost contact. A halt continues."""
        for task in self._tasks.pop(page, ()):
            task.cancel()

    def all_gone(self) -> None:
        """Hold the motions of all pages."""
        for page in list(self._tasks):
            self.gone(page)

    def refuse(self) -> None:
        """Refuse all commands but halts from now on: the hands are about to be stopped."""
        self.is_ending = True

    async def close(self) -> None:
        """Hold the axes of commands that run, refuse new commands, and wait until all have ended."""
        self.refuse()
        tasks = [task for tasks in self._tasks.values() for task in tasks]
        self.all_gone()
        await asyncio.gather(*tasks, *self._halts, return_exceptions=True)

    async def _carry_out(self, request: Properties, page: str, name: str) -> str:
        if not self._operators:
            raise ValueError("this page only watches; to command from a page: robotiq-async web --control")
        if name != HALT and self.is_ending:
            raise ValueError("the page is closing: it takes no command but halt")
        if name != HALT and not 0 <= monotonic() - request["at"] <= COMMAND_AGE_S:
            raise ValueError("this arrived too late and was not carried out: the connection was delayed")
        if name != HALT and len(self._tasks.get(page, ())) > MAX_COMMANDS:
            raise ValueError(f"{MAX_COMMANDS} commands of this page are already running")
        if not 0 <= request["hand"] < len(self._operators):
            raise ValueError(f"there is no hand {request['hand']}")
        return await call(self._operators[request["hand"]], name, request["arguments"])


def _outcome(task: asyncio.Task[str]) -> tuple[bool, str]:
    try:
        return True, task.result()
    except asyncio.CancelledError:
        return False, "the page is gone: the axes are held"
    except RobotiqError as error:
        return False, refusal_words(error, BUTTONS)
    except (ValueError, TypeError) as error:
        return False, str(error)
