"""Bad input is refused with its name, value and range before anything is sent."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from robotiq_async import ReconnectPolicy, RobotiqHand, State
from robotiq_async.simulator import SimulatorServer

pytestmark = pytest.mark.virtual_time

BAD_BYTES = [256, -1, 1.0, True, "7", None, 1e300, float("nan")]
BAD_MASKS = [0, 16, -1, True, 1.5, "A", None]


async def refused(server: SimulatorServer, value: object, call: Callable[[], Any], name: str) -> None:
    writes = len(server.gripper.writes)

    async def run() -> None:
        result = call()
        if result is not None:
            await result

    with pytest.raises((TypeError, ValueError)) as caught:
        await run()
    message = str(caught.value)
    assert name in message
    assert repr(value) in message or str(value) in message
    assert len(server.gripper.writes) == writes


@pytest.mark.parametrize("value", BAD_BYTES, ids=repr)
async def test_values(hand: RobotiqHand, server: SimulatorServer, value: Any) -> None:
    await refused(server, value, lambda: hand.set_position(value), "value")
    await refused(server, value, lambda: hand.set_speed(value), "value")
    await refused(server, value, lambda: hand.set_force(value), "value")
    await refused(server, value, lambda: hand.move(value), "position")
    if value is not None:
        await refused(server, value, lambda: hand.move(3, speed=value), "speed")
        await refused(server, value, lambda: hand.move(3, force=value), "force")
        await refused(server, value, lambda: hand.command(position=value), "position")
        await refused(server, value, lambda: hand.open(speed=value), "speed")
        await refused(server, value, lambda: hand.close(force=value), "force")
    assert hand.state is State.RUNNING_IDLE


@pytest.mark.parametrize("mask", BAD_MASKS, ids=repr)
async def test_masks(hand: RobotiqHand, server: SimulatorServer, mask: Any) -> None:
    await refused(server, mask, lambda: hand.set_position(3, mask), "fingers")
    await refused(server, mask, lambda: hand.move(3, mask), "fingers")
    await refused(server, mask, lambda: hand.command(mask, position=3), "fingers")
    await refused(server, mask, lambda: hand.hold(mask), "fingers")


@pytest.mark.parametrize("timeout", [0, -1, "1", True, float("inf"), float("nan")], ids=repr)
async def test_timeouts(hand: RobotiqHand, server: SimulatorServer, timeout: Any) -> None:
    await refused(server, timeout, lambda: hand.move(3, timeout=timeout), "timeout")
    await refused(server, timeout, lambda: hand.recover(timeout=timeout), "timeout")
    await refused(server, timeout, lambda: hand.wait_for_state(State.FAULT, timeout=timeout), "timeout")


async def test_a_command_without_a_field(hand: RobotiqHand) -> None:
    with pytest.raises(ValueError, match="at least one of position, speed and force"):
        hand.command()


async def test_states_and_buffers(hand: RobotiqHand) -> None:
    with pytest.raises(ValueError, match="states"):
        await hand.wait_for_state()
    with pytest.raises(TypeError, match="states"):
        await hand.wait_for_state("FAULT")  # type: ignore[arg-type]
    for buffer in (0, -1, True, 1.5, "1", None):
        with pytest.raises((TypeError, ValueError), match="buffer"):
            hand.statuses(buffer=buffer)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("option", "value"),
    [
        ("device_id", -1),
        ("device_id", 256),
        ("device_id", "2"),
        ("device_id", True),
        ("read_function", 6),
        ("read_function", "3"),
        ("read_function", 3.0),
        ("poll_interval", 0),
        ("poll_interval", 1.0),
        ("poll_interval", "5ms"),
        ("connect_timeout", 0),
        ("connect_timeout", float("nan")),
        ("response_timeout", -1),
        ("response_timeout", 5.1),
        ("activation_timeout", 0),
        ("reconnect", "yes"),
        ("reconnect", 1),
        ("keep_grip", 1),
        ("keep_grip", None),
        ("speed", 256),
        ("force", -1),
        ("force", 1.0),
        ("request_address", 65529),
        ("status_address", -1),
        ("status_address", "0"),
    ],
)
def test_options(option: str, value: Any) -> None:
    with pytest.raises((TypeError, ValueError), match=option) as caught:
        RobotiqHand("sim://", **{option: value})
    assert repr(value) in str(caught.value)


@pytest.mark.parametrize("address", ["rtu:///dev/ttyUSB0", "rtu+tcp://127.0.0.1:54321"])
@pytest.mark.parametrize("unit", [0, 248, 255])
def test_units_that_nobody_has_on_a_line(address: str, unit: int) -> None:
    with pytest.raises(ValueError, match=rf"device_id must be in 1\.\.247, got {unit}"):
        RobotiqHand(address, device_id=unit)


def test_intervals_and_time_outs_of_a_line_and_of_a_network() -> None:
    def figures(address: str, **given: Any) -> tuple[float, float]:
        options = RobotiqHand(address, **given)._options
        transport: Any = options.make_transport()
        return options.poll_interval, transport._response_timeout

    assert figures("tcp://192.168.1.11") == (0.005, 0.4)
    assert figures("tcp://192.168.1.11", response_timeout=5) == (0.005, 5.0)
    for line in ("rtu:///dev/ttyUSB0", "rtu+tcp://192.168.1.11:54321"):
        assert figures(line) == (0.015, 0.4)
        assert figures(line, poll_interval=0.005, response_timeout=0.3) == (0.005, 0.3), "as asked"
        assert figures(line, poll_interval=0.1) == (0.1, 0.4)


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
    options = hand._options
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
