"""The commands of a hand as services: called by name, with arguments in a JSON object."""

from __future__ import annotations

import json
import reprlib
from collections.abc import Awaitable, Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Final

from ...values.checks import parse_fingers
from ...values.enums import Finger
from ..actions import ACTIONS, Action, Operator

Arguments = Mapping[str, Any]

_BYTE: Final = {"type": "integer", "minimum": 0, "maximum": 255}
_FINGERS: Final = {"type": "string", "description": "ABC, or A,B, or scissor, or all"}
RESPONSE: Final = {"type": "object", "properties": {"outcome": {"type": "string"}}}
"""JSON Schema of every response: a description of the outcome."""


@dataclass(frozen=True, slots=True)
class Service:
    """A command that other programs can call.

    Attributes:
        name: for example ``/gripper/move``.
        arguments: each with its JSON Schema.
        required: names of the required arguments.
        run: carries it out; returns a description of the outcome.
    """

    name: str
    arguments: Mapping[str, object]
    required: tuple[str, ...]
    run: Callable[[Operator, Arguments], Awaitable[str]]

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

        Args:
            operator: carries it out.
            payload: a JSON object with the arguments; empty for none.

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
