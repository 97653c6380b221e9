"""The docstring of a call has its arguments: each parameter once, in the order of the signature."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Iterator

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.hands.arguments import ARGUMENTS, describes_arguments
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.sync import RobotiqHand as BlockingHand

HANDS = {"async": RobotiqHand, "blocking": BlockingHand}
CONSTRUCTORS = (*HANDS.values(), SimulatedGripper, SimulatorServer, SerialSimulatorServer)


def described(text: str | None) -> list[str]:
    """The names in the section of the arguments."""
    section = re.search(r"^Args:\n(.*?)(?=^\S|\Z)", inspect.cleandoc(text or ""), re.MULTILINE | re.DOTALL)
    return re.findall(r"^    (\w+): ", section[1], re.MULTILINE) if section else []


def calls(kind: type) -> Iterator[tuple[str, Callable[..., object]]]:
    """The public calls of a hand that take something."""
    for name, call in inspect.getmembers(kind, inspect.isfunction):
        if not name.startswith("_") and len(inspect.signature(call).parameters) > 1:
            yield name, call


def assert_calls_describe(kind: type) -> None:
    found = dict(calls(kind))
    assert {"start", "stop", "move", "grasp", "command", "hold", "recover", "wait_for_state"} <= found.keys()
    for name, call in found.items():
        _, *parameters = inspect.signature(call).parameters
        assert described(call.__doc__) == parameters, name


def assert_constructor_describes(kind: type) -> None:
    names = described(kind.__doc__) or described(inspect.getattr_static(kind, "__init__").__doc__)
    assert sorted(names) == sorted(inspect.signature(kind).parameters)


@pytest.mark.parametrize("hand", HANDS)
def test_a_call_describes_what_it_takes(hand: str) -> None:
    assert_calls_describe(HANDS[hand])


@pytest.mark.parametrize("kind", CONSTRUCTORS, ids=lambda kind: f"{kind.__module__}.{kind.__name__}")
def test_a_constructor_describes_what_it_takes(kind: type) -> None:
    assert_constructor_describes(kind)


def test_the_section_stands_before_what_is_raised_and_has_ranges() -> None:
    text = RobotiqHand.move.__doc__ or ""
    assert text.index("\nArgs:\n") < text.index("\nRaises:\n")
    for name in ("fingers", "position", "mm", "open_fraction", "speed", "force", "timeout", "at_least"):
        assert re.search(
            r"\d ?\.\.|\(open\) \.\.|\(the (least|slowest).*\.\.|above 0|\d\.\.", ARGUMENTS[name]
        ), name


def test_a_parameter_that_is_not_described_is_no_parameter() -> None:
    with pytest.raises(KeyError, match="turbo"):

        @describes_arguments()
        def move(self: object, turbo: int) -> None:
            """Move."""
