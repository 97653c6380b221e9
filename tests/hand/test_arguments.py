"""What a call takes is in its docstring: each parameter once, in the order of the signature."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.hand.arguments import ARGUMENTS, describes_arguments
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.sync import RobotiqHand as BlockingHand

MOTIONS = ("set_position", "set_speed", "set_force", "command", "move", "open", "close", "grasp", "hold")
HANDS = {"async": RobotiqHand, "blocking": BlockingHand}
CONSTRUCTORS = (RobotiqHand, SimulatedGripper, SimulatorServer, SerialSimulatorServer)


def described(text: str | None) -> list[str]:
    """The names in the section of the arguments."""
    section = re.search(r"^Args:\n(.*?)(?=^\S|\Z)", inspect.cleandoc(text or ""), re.MULTILINE | re.DOTALL)
    return re.findall(r"^    (\w+): ", section[1], re.MULTILINE) if section else []


def assert_describes(call: Callable[..., object]) -> None:
    parameters = [each for each in inspect.signature(call).parameters if each != "self"]
    assert described(call.__doc__) == parameters != []


def assert_constructor_describes(kind: type) -> None:
    names = described(kind.__doc__) or described(inspect.getattr_static(kind, "__init__").__doc__)
    assert sorted(names) == sorted(inspect.signature(kind).parameters)


@pytest.mark.parametrize("hand", HANDS)
@pytest.mark.parametrize("name", MOTIONS)
def test_a_motion_describes_what_it_takes(hand: str, name: str) -> None:
    assert_describes(getattr(HANDS[hand], name))


@pytest.mark.parametrize("kind", CONSTRUCTORS)
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
