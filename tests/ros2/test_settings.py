"""The parameters: what is accepted, and the errors for what is not. No ROS is needed here."""

from __future__ import annotations

import asyncio
import re

import pytest

from robotiq_async import RobotiqConnectionError, RobotiqHand
from robotiq_async.ros2.gripper.connection import make_hand
from robotiq_async.ros2.translation.settings import PARAMETERS, check_parameter, check_settings

USUAL = {name: parameter.default for name, parameter in PARAMETERS.items()}


def test_the_defaults_will_do() -> None:
    settings = check_settings(USUAL)
    assert settings.address == "sim://"
    assert settings.publish_rate == 50.0
    given = {
        **settings.options,
        **{each: getattr(settings, each) for each in PARAMETERS if hasattr(settings, each)},
    }
    assert {name: value for name, value in given.items() if value is not None} == {
        name: value
        for name, value in USUAL.items()
        if value != -1 and name not in ("model", "stroke")  # "" is the address's, or nominal
    }
    rate = check_settings(USUAL | {"publish_rate": 100}).publish_rate
    assert (rate, type(rate)) == (100.0, float), "an integer will do"
    for parameter in PARAMETERS.values():
        is_number = not isinstance(parameter.default, bool | str)
        assert is_number == (parameter.high > parameter.low)


@pytest.mark.parametrize(
    ("name", "value", "reason"),
    [
        ("address", "tcp://", "malformed address 'tcp://'; accepted: tcp://HOST"),
        ("address", "zenoh://lab", "malformed address 'zenoh://lab'"),
        ("address", 7, "address must be a string, got 7"),
        ("publish_rate", 0.0, "publish_rate must be a number in 1.0..200.0, got 0.0"),
        ("publish_rate", True, "must be a number"),
        ("poll_interval", 1, "poll_interval must be seconds in 0.001..0.1, got 1"),
        ("device_id", 256, "device_id must be in -1..255, got 256"),
        ("read_function", 0, "read_function must be -1 or in 3..4, got 0"),
        ("read_function", 5, "read_function must be in -1..4, got 5"),
        ("force", 64.0, "force must be an int in 0..255, got 64.0"),
        ("allow_stalling", 1, "allow_stalling must be true or false, got 1"),
        ("stroke", "none.csv", "none.csv: cannot be read: No such file or directory"),
        ("model", "2f99", "model must be one of 3f, 2f85, 2f140, hand-e, got '2f99'"),
        ("joint_prefix", "left <&", "joint_prefix may have letters, digits, _ . / and -, got 'left <&'"),
    ],
)
def test_bad_parameters_are_refused_with_the_reason(name: str, value: object, reason: str) -> None:
    with pytest.raises(ValueError, match=re.escape(reason)):
        check_parameter(name, value)


@pytest.mark.parametrize("kind", ["tcp", "rtu+tcp"])
@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, {"tcp": (2, 4), "rtu+tcp": (9, 3)}),
        ({"device_id": 7}, {"tcp": (7, 4), "rtu+tcp": (7, 3)}),
        ({"read_function": 3}, {"tcp": (2, 3), "rtu+tcp": (9, 3)}),
        ({"read_function": 4}, {"tcp": (2, 4), "rtu+tcp": (9, 4)}),
    ],
)
async def test_the_gripper_is_asked_as_the_parameters_say(
    given: dict[str, object], expected: dict[str, tuple[int, int]], kind: str
) -> None:
    """The unit and the function, which are the first bytes of a request; over TCP six others come before."""
    asked: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()

    async def listen(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        asked.set_result(await reader.readexactly(8))
        writer.close()

    async with await asyncio.start_server(listen, "127.0.0.1", 0) as server:
        address = f"{kind}://127.0.0.1:{server.sockets[0].getsockname()[1]}"
        hand = make_hand(check_settings({**USUAL, "address": address, **given}))
        assert isinstance(hand, RobotiqHand)
        transport = hand.options.make_transport()
        with pytest.raises(RobotiqConnectionError):
            await transport.open()
    request = (await asked)[6 if kind == "tcp" else 0 :]
    assert tuple(request[:2]) == expected[kind]


@pytest.mark.parametrize(
    ("given", "expected"),
    [
        ({}, (0.005, 0.4)),
        ({"response_timeout": 5.0}, (0.005, 5.0)),
        ({"address": "rtu:///dev/ttyUSB0"}, (0.005, 0.4)),
        ({"address": "rtu:///dev/ttyUSB0", "poll_interval": 0.01}, (0.01, 0.4)),
    ],
)
def test_the_times_of_the_parameters(given: dict[str, object], expected: tuple[float, float]) -> None:
    hand = make_hand(check_settings({**USUAL, "address": "tcp://192.168.1.11", **given}))
    assert isinstance(hand, RobotiqHand)
    assert (hand.options.poll_interval, hand.options.response_timeout) == expected
