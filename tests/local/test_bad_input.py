"""Arguments with which a hand cannot be made, started or used: refused with name, value and range."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from robotiq_async import ReconnectPolicy, RobotiqHand, State

pytestmark = pytest.mark.virtual_time


NO_VALUES: dict[str, list[Any]] = {
    "device_id": [-1, 256, "2", True],
    "read_function": [6, "3", 3.0],
    "poll_interval": [0, 1.0, "5ms"],
    "connect_timeout": [0, math.nan],
    "response_timeout": [-1, 5.1],
    "activation_timeout": [0],
    "reconnect": ["yes", 1],
    "keep_grip": [1, None],
    "speed": [256],
    "force": [-1, 1.0],
    "request_address": [65529],
    "status_address": [-1, "0"],
}


@pytest.mark.parametrize(
    ("option", "value"), [(option, value) for option, values in NO_VALUES.items() for value in values]
)
def test_options(option: str, value: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=option) as caught:
        RobotiqHand("sim://", **{option: value})
    assert repr(value) in str(caught.value)


@pytest.mark.parametrize("address", ["rtu:///dev/ttyUSB0", "rtu+tcp://127.0.0.1:54321"])
@pytest.mark.parametrize("unit", [0, 248, 255])
def test_reserved_unit_ids_on_a_serial_line(address: str, unit: int) -> None:
    with pytest.raises(ValueError, match=rf"device_id must be in 1\.\.247, got {unit}"):
        RobotiqHand(address, device_id=unit)


def test_intervals_and_time_outs_of_a_line_and_of_a_network() -> None:
    def figures(address: str, **given: Any) -> tuple[float, float]:
        options = RobotiqHand(address, **given).options
        transport: Any = options.make_transport()
        return options.poll_interval, transport.dialogues._usual.seconds

    assert figures("tcp://192.168.1.11") == (0.005, 0.4)
    assert figures("tcp://192.168.1.11", response_timeout=5) == (0.005, 5.0)
    for line in ("rtu:///dev/ttyUSB0", "rtu+tcp://192.168.1.11:54321"):
        assert figures(line) == (0.005, 0.4)
        assert figures(line, poll_interval=0.1, response_timeout=0.3) == (0.1, 0.3), "as asked"


@pytest.mark.parametrize("address", ["tcp://192.168.1.11", "rtu:///dev/ttyUSB0"])
def test_a_jaw_takes_writes_twice_as_often(address: str) -> None:
    def spacing(model: str, **given: Any) -> float:
        return RobotiqHand(address, model=model, **given).options.write_spacing

    assert spacing("3f") == 0.01
    assert spacing("2f85") == spacing("hand-e") == 0.005
    assert spacing("2f85", write_spacing=0.01) == 0.01, "as asked"
    assert spacing("2f85", write_spacing=0) == 0


@pytest.mark.parametrize("wait", [-1, 86401, math.inf, math.nan, "1", None, True])
async def test_how_long_a_start_waits(wait: Any) -> None:
    hand = RobotiqHand("sim://")
    with pytest.raises((TypeError, ValueError), match="wait"):
        await hand.start(wait=wait)
    assert hand.state is State.DISCONNECTED


def test_options_that_are_numbers_of_numpy() -> None:
    byte: Any = np.uint8(3)
    seconds: Any = np.float32(0.25)
    hand = RobotiqHand(
        "tcp://192.168.1.11",
        device_id=byte,
        poll_interval=np.float64(0.01),
        connect_timeout=seconds,
        response_timeout=seconds,
        activation_timeout=byte,
        reconnect=ReconnectPolicy(first_delay=seconds, max_delay=byte, give_up_after=byte),
        speed=byte,
        force=byte,
        request_address=byte,
        status_address=byte,
    )
    options = hand.options
    policy = options.policy
    assert policy is not None
    assert policy == ReconnectPolicy(first_delay=0.25, max_delay=3.0, give_up_after=3.0)
    kept = [options.poll_interval, options.activation_timeout, policy.first_delay, policy.give_up_after]
    assert {type(each) for each in kept} == {float}
    assert type(options.speed) is type(options.force) is int


@pytest.mark.parametrize(
    "address", ["", "tcp://", "http://x", "tcp://x:0", "rtu://", "sim://x", "a b", None, 7]
)
def test_addresses(address: Any) -> None:
    with pytest.raises((TypeError, ValueError), match="address"):
        RobotiqHand(address)


# -- 'async' forgotten --------------------------------------------------------------------------------------


def test_with_names_async_with_and_the_hand_that_blocks() -> None:
    hand: Any = RobotiqHand()
    with pytest.raises(TypeError, match=r"'async with'.*robotiq_async\.sync"), hand:
        pass


@pytest.mark.parametrize("name", ["statuses", "transitions", "requests", "grip_events"])
def test_for_names_async_for(name: str) -> None:
    stream: Any = getattr(RobotiqHand(), name)()
    with pytest.raises(TypeError, match="'async for'"):
        for _ in stream:
            pass
    with pytest.raises(TypeError, match="'async for'"):
        list(stream)
