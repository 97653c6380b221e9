"""Every surface that offers options of a hand has those of the one table, and no others."""

from __future__ import annotations

import inspect
import re
from dataclasses import fields
from pathlib import Path
from typing import Any, Final

import pytest

from docs import make_tables
from robotiq_async import RobotiqHand, sync
from robotiq_async.cli.agent_file import AgentFileError, read_agent_file
from robotiq_async.cli.arguments import USUAL_LINK, LinkOptions
from robotiq_async.hands.options import OPTIONS, HandOptions, Option, Place, offered
from robotiq_async.ros2.translation.settings import PARAMETERS, check_parameter, check_settings
from robotiq_async.values.model import Model

make: Final[Any] = HandOptions
NUMBERS = {name: option for name, option in OPTIONS.items() if option.high}
DEFAULTS = {name: option.default for name, option in OPTIONS.items()}


LISTS = str.maketrans("()", "[]")


def beyond(option: Option) -> float:
    """A number just above the range."""
    return option.high + (1 if isinstance(option.default, int | None) else 0.001)


@pytest.mark.parametrize("hand", [RobotiqHand, sync.RobotiqHand], ids=["async", "blocking"])
def test_a_hand_takes_every_option_with_its_default(hand: type) -> None:
    parameters = inspect.signature(hand).parameters
    assert {name: each.default for name, each in parameters.items()} == DEFAULTS
    assert list(parameters) == list(OPTIONS)


def test_the_hand_documents_every_option_and_the_ends_of_its_range() -> None:
    text = f"{inspect.getdoc(RobotiqHand)}\n{inspect.getdoc(RobotiqHand.__init__)}"
    for name, option in OPTIONS.items():
        found = re.search(rf"^    {name}: ((?:.*\n?)(?:^     +.*\n?)*)", text, re.MULTILINE)
        assert found is not None, name
        if option.tcp is None and option.high:
            assert f"{option.low:g}..{option.high:g}" in found[1], name


@pytest.mark.parametrize("name", NUMBERS)
def test_the_range_is_what_a_hand_accepts(name: str) -> None:
    option = OPTIONS[name]
    for value in (option.low, option.high):
        make("tcp://127.0.0.1", **{name: int(value) if option.tcp is not None else value})
    hands: tuple[Any, ...] = (RobotiqHand, make)
    for hand in hands:
        with pytest.raises(ValueError, match=rf"^{name} must be .*{option.low:g}\.?0?\.\.{option.high:g}"):
            hand("tcp://127.0.0.1", **{name: beyond(option)})


def test_the_help_is_a_sentence() -> None:
    for option in OPTIONS.values():
        assert option.help[0].isupper()
        assert not option.help.endswith(".")


def test_the_keys_of_a_gripper_in_the_agent_file(tmp_path: Path) -> None:
    path = tmp_path / "FLEET.toml"
    for name, option in OPTIONS.items():
        if name == "address":
            continue
        value = option.low if option.default is None else str(option.default).lower()
        value = f'"{option.choices[1]}"' if option.choices else value
        value = "((3, 85.0), (228, 0.0))" if option.is_file else value
        path.write_text(
            f'site = "lab"\n[grippers.left]\naddress = "127.0.0.1"\n{name} = {str(value).translate(LISTS)}\n',
            encoding="utf-8",
        )
        if Place.FILE in option.places:
            given = getattr(read_agent_file(path).grippers["left"], name)
            assert (given.name if isinstance(given, Model) else str(given).lower()) == str(value).strip('"')
        else:
            with pytest.raises(AgentFileError, match=f"'{name}'"):
                read_agent_file(path)


def test_the_parameters_of_ros() -> None:
    settings = check_settings({name: each.default for name, each in PARAMETERS.items()})
    for name, option in OPTIONS.items():
        assert (name in PARAMETERS) == (Place.ROS in option.places), name
        if name not in PARAMETERS:
            continue
        parameter = PARAMETERS[name]
        given = settings.options[name] if name in settings.options else getattr(settings, name)
        assert given == option.default
        if option.high:
            assert parameter.description.startswith(option.help)
            assert (parameter.low if option.default is not None else option.low, parameter.high) == (
                option.low,
                option.high,
            )
            with pytest.raises(ValueError, match=f"^{name} must be"):
                check_parameter(name, beyond(option))


def test_the_arguments_of_the_command_line() -> None:
    there = offered(Place.COMMAND_LINE)
    assert [each.name for each in fields(LinkOptions)] == list(there)
    assert USUAL_LINK.options() == {name: DEFAULTS[name] for name in there}
    for each in fields(LinkOptions):
        (parameter,) = each.type.__metadata__  # type: ignore[union-attr]
        assert parameter.help.startswith(there[each.name].help)


def test_the_reference_names_each() -> None:
    assert re.findall(r"`(\w+)=", make_tables.options()) == list(OPTIONS)
