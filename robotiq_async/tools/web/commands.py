"""Carries out the commands of the pages, and holds the axes when a page has gone."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Sequence
from time import monotonic
from typing import Final

from ...values.enums import State
from ...values.errors import RobotiqError
from ..actions import Operator
from ..recording.payloads import Fields
from ..wording import refusal_words
from .services import SERVICES

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


class PageCommands:
    """Carries out commands, and keeps those under way by page.

    When a page has gone, its commands are cancelled, which holds the axes that still move. An activation, a
    release and a reset continue, as they do whenever they are cancelled.

    Attributes:
        is_ending: whether all commands but halts are refused.

    Args:
        operators: one for each hand; without any, every command is refused.
        answer: called with the outcome of each command.
    """

    def __init__(self, operators: Sequence[Operator], answer: Callable[[Fields], None]) -> None:
        self._operators = operators
        self._answer = answer
        self._tasks: dict[str, set[asyncio.Task[str]]] = {}
        self._halts: set[asyncio.Task[str]] = set()
        self.is_ending = False

    @property
    def under_way(self) -> bool:
        """Whether a command has not ended yet."""
        return any(not task.done() for tasks in self._tasks.values() for task in tasks)

    def do(self, request: Fields) -> None:
        """Start a command; its answer comes later.

        Args:
            request: ``page``, ``number``, ``hand``, ``name`` and ``arguments`` of a service, and ``at``, when
                the user gave it: ``time.monotonic()`` of this machine, which is the same in every process.
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
        """Hold what is under way, refuse new commands, and wait until all have ended."""
        self.refuse()
        tasks = [task for tasks in self._tasks.values() for task in tasks]
        self.all_gone()
        await asyncio.gather(*tasks, *self._halts, return_exceptions=True)

    async def _carry_out(self, request: Fields, page: str, name: str) -> str:
        if not self._operators:
            raise ValueError("this page only looks; to command from a page: robotiq-async web --control")
        if name != HALT and self.is_ending:
            raise ValueError("the page is ending: nothing is moved from here now")
        if name != HALT and not 0 <= monotonic() - request["at"] <= FRESH_S:
            raise ValueError("this came too late to be carried out: the connection was held up")
        if name != HALT and len(self._tasks.get(page, ())) > MAX_COMMANDS:
            raise ValueError(f"{MAX_COMMANDS} commands of this page are under way already")
        service = SERVICES.get(f"/gripper/{name}")
        if service is None or not 0 <= request["hand"] < len(self._operators):
            raise ValueError(f"there is no {name} of hand {request['hand']}")
        operator = self._operators[request["hand"]]
        return await service.call(operator, json.dumps(request["arguments"]).encode())


def _outcome(task: asyncio.Task[str]) -> tuple[bool, str]:
    try:
        return True, task.result()
    except asyncio.CancelledError:
        return False, "the page was gone: the axes are held"
    except RobotiqError as error:
        return False, refusal_words(error, BUTTONS)
    except (ValueError, TypeError) as error:
        return False, str(error)
