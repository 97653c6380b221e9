"""Carries out the commands of the pages, and holds the axes when a page has gone.

A command is a service: called by name, with arguments in a JSON object.
"""

from __future__ import annotations

import asyncio
import json
import reprlib
from collections.abc import Awaitable, Callable, Mapping, Sequence
from dataclasses import dataclass
from time import monotonic
from types import MappingProxyType
from typing import Any, Final

from ...values.checks import parse_fingers
from ...values.enums import Finger, State
from ...values.errors import RobotiqError
from ..actions import ACTIONS, Action, Operator
from ..recording.payloads import Fields
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
FRESH_S: Final = 1.5
"""Maximum age of a command; a halt is never too old."""
Arguments = Mapping[str, Any]

_BYTE: Final = {"type": "integer", "minimum": 0, "maximum": 255}
_FINGERS: Final = {"type": "string", "description": "ABC, or A,B, or scissor, or all"}
RESPONSE: Final = {"type": "object", "properties": {"outcome": {"type": "string"}}}
"""JSON Schema of every response: a description of the outcome."""


@dataclass(frozen=True, slots=True)
class Service:
    """A command that other programs can call."""

    name: str  # for example /gripper/move
    arguments: Mapping[str, object]  # each with its JSON Schema
    required: tuple[str, ...]  # names of the required arguments
    run: Callable[[Operator, Arguments], Awaitable[str]]  # returns a description of the outcome

    @property
    def schema(self) -> dict[str, object]:
        """JSON Schema of a request."""
        return {
            "type": "object",
            "properties": dict(self.arguments),
            "required": list(self.required),
            "additionalProperties": False,
        }

    async def call(self, operator: Operator, payload: bytes) -> str:
        """Carry out a request; returns a description of the outcome.

        The payload is a JSON object with the arguments; empty for none.

        Raises:
            ValueError: malformed, or an argument that is missing, unknown or outside its range.
            TypeError: an argument of the wrong type.
            RobotiqError: it could not be carried out.
        """
        return await self.run(operator, self._checked(payload))

    def _checked(self, payload: bytes) -> Arguments:
        try:
            arguments = json.loads(payload.strip() or b"{}")
        except (ValueError, RecursionError) as error:
            raise ValueError(f"{self.name} takes a JSON object: {error}") from None
        if not isinstance(arguments, dict):
            raise ValueError(f"{self.name} takes a JSON object, got {reprlib.repr(arguments)}")
        for name in arguments:
            if name not in self.arguments:
                known = ", ".join(self.arguments) or "none"
                raise ValueError(f"{self.name} has no argument {reprlib.repr(name)}; it has: {known}")
        for name in self.required:
            if name not in arguments:
                raise ValueError(f"{self.name} needs the argument {name!r}")
        return arguments


def _of(action: Action) -> Service:
    async def run(operator: Operator, arguments: Arguments) -> str:
        if action.warning and arguments["confirm"] is not True:
            raise ValueError(f"{action.name} needs confirm = true: {action.warning}")
        return await operator.act(action)

    confirm = {"confirm": {"type": "boolean", "description": action.warning}} if action.warning else {}
    return Service(f"/gripper/{action.name}", confirm, tuple(confirm), run)


async def _move(operator: Operator, arguments: Arguments) -> str:
    axes = _fingers(arguments, "ABC")
    speed, force = arguments.get("speed"), arguments.get("force")
    return await operator.move(arguments["position"], axes, speed=speed, force=force)


async def _set_speed(operator: Operator, arguments: Arguments) -> str:
    await operator.hand.set_speed(arguments["value"], _fingers(arguments, "ALL"))
    return "set"


async def _set_force(operator: Operator, arguments: Arguments) -> str:
    await operator.hand.set_force(arguments["value"], _fingers(arguments, "ALL"))
    return "set"


def _fingers(arguments: Arguments, usual: str) -> Finger:
    words = arguments.get("fingers", usual)
    if not isinstance(words, str):
        raise TypeError(f"fingers must be a text like ABC, or scissor, got {reprlib.repr(words)}")
    return parse_fingers("fingers", words)


_MOVE: Final = {"position": _BYTE, "fingers": _FINGERS, "speed": _BYTE, "force": _BYTE}
_ALL: Final = (
    *(_of(action) for action in ACTIONS.values()),
    Service("/gripper/move", _MOVE, ("position",), _move),
    Service("/gripper/set_speed", {"value": _BYTE, "fingers": _FINGERS}, ("value",), _set_speed),
    Service("/gripper/set_force", {"value": _BYTE, "fingers": _FINGERS}, ("value",), _set_force),
)
SERVICES: Final = MappingProxyType({service.name: service for service in _ALL})
"""The services by name."""


class PageCommands:
    """Carries out commands, and keeps those that run by page.

    When a page has gone, its commands are cancelled, which holds the axes that still move. An activation, a
    release and a reset continue, as they do whenever they are cancelled.

    There is an operator for each hand; without any, every command is refused. ``answer`` is called with the
    outcome of each command.
    """

    def __init__(self, operators: Sequence[Operator], answer: Callable[[Fields], None]) -> None:
        self._operators = operators
        self._answer = answer
        self._tasks: dict[str, set[asyncio.Task[str]]] = {}
        self._halts: set[asyncio.Task[str]] = set()
        self.is_ending = False  # whether all commands but halts are refused

    @property
    def under_way(self) -> bool:
        """Whether a command has not ended yet."""
        return any(not task.done() for tasks in self._tasks.values() for task in tasks)

    def do(self, request: Fields) -> None:
        """Start a command; its answer comes later.

        A request has ``page``, ``number``, ``hand``, ``name`` and ``arguments`` of a service, and ``at``: the
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
        # A callback, because a task that is cancelled before its first step runs no code of its own.
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

    async def _carry_out(self, request: Fields, page: str, name: str) -> str:
        if not self._operators:
            raise ValueError("this page only watches; to command from a page: robotiq-async web --control")
        if name != HALT and self.is_ending:
            raise ValueError("the page is closing: it takes no command but halt")
        if name != HALT and not 0 <= monotonic() - request["at"] <= FRESH_S:
            raise ValueError("this arrived too late and was not carried out: the connection was delayed")
        if name != HALT and len(self._tasks.get(page, ())) > MAX_COMMANDS:
            raise ValueError(f"{MAX_COMMANDS} commands of this page are already under way")
        service = SERVICES.get(f"/gripper/{name}")
        if service is None or not 0 <= request["hand"] < len(self._operators):
            raise ValueError(f"there is no {name} of hand {request['hand']}")
        operator = self._operators[request["hand"]]
        return await service.call(operator, json.dumps(request["arguments"]).encode())


def _outcome(task: asyncio.Task[str]) -> tuple[bool, str]:
    try:
        return True, task.result()
    except asyncio.CancelledError:
        return False, "the page is gone: the axes are held"
    except RobotiqError as error:
        return False, refusal_words(error, BUTTONS)
    except (ValueError, TypeError) as error:
        return False, str(error)
