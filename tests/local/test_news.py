"""The log of a service at WARNING names what happened: each fault once, and a reset, whoever it was."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterator

import pytest

from robotiq_async import (
    HAND_E,
    THREE_FINGER,
    TWO_FINGER_85,
    TWO_FINGER_140,
    Fault,
    Model,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.enums import Severity
from tests.grippers import activate_beforehand
from tests.virtual import virtual

HELPS = {Severity.MINOR: "nothing resumes", Severity.MAJOR: "recover()", Severity.PRIORITY: "delayed"}
MODELS = [THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, HAND_E]


def lines(caplog: pytest.LogCaptureFixture, level: int = logging.WARNING) -> Iterator[str]:
    """The messages of a level since the last look."""
    yield from [each.getMessage() for each in caplog.records if each.levelno == level]
    caplog.clear()


def gripper_of(model: Model) -> SimulatedGripper:
    clock = asyncio.get_running_loop().time
    return SimulatedGripper(clock, speedup=20, spread=False, model=model)


@pytest.mark.parametrize("model", MODELS, ids=lambda model: model.name)
@virtual
async def test_every_fault_of_every_model_once(model: Model, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "robotiq_async")
    gripper = gripper_of(model)
    async with SimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        async with RobotiqHand(server.address, name="cell", model=model) as hand:
            for code in range(1, 16):
                fault = model.fault(code)
                caplog.clear()
                gripper.inject_fault(code)
                await asyncio.sleep(0.5)
                level = logging.WARNING if fault.is_serious else logging.INFO
                (line,) = [each for each in lines(caplog, level) if f"0x{code:02X}" in each]
                assert line.startswith(f"cell: {fault.severity.value} fault 0x{code:02X} {fault.name}: ")
                assert fault.description in line
                assert "recover()" in line or HELPS[fault.severity] in line or "halt() ends it" in line
                gripper.clear_faults()
                if fault is Fault.AUTOMATIC_RELEASE_DONE:
                    await hand.recover()
                await hand.wait_for_state(State.RUNNING_IDLE)


@virtual
async def test_a_fault_of_the_controller(caplog: pytest.LogCaptureFixture) -> None:
    gripper = gripper_of(TWO_FINGER_85)
    async with SimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        async with RobotiqHand(server.address, model="2f85"):
            gripper.controller_fault = 0x0A
            await asyncio.sleep(0.1)
            (line,) = lines(caplog)
            assert "its controller reports: " in line
            assert "0x0A" in line
            gripper.inject_fault(Fault.OVER_CURRENT)
            await asyncio.sleep(0.1)
            gripper.controller_fault = 0x0C
            await asyncio.sleep(0.1)
            fault, controller = lines(caplog)
            assert "0x0E OVER_CURRENT" in fault
            assert "0x0C" in controller


@pytest.mark.parametrize("who", ["this program", "another client or for lack of power"])
@virtual
async def test_a_gripper_that_is_back_in_reset(who: str, caplog: pytest.LogCaptureFixture) -> None:
    gripper = gripper_of(THREE_FINGER)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        assert [each for each in lines(caplog) if "RESET" in each] == []  # found there, and activated
        if who == "this program":
            await hand.reset()
        else:
            gripper.write(0, [0] * 8)
        await hand.wait_for_state(State.RESET)
        (line,) = [each for each in lines(caplog) if "back in RESET" in each]
        assert f"by {who}; its part may have fallen" in line


@virtual
async def test_how_long_an_activation_and_a_recovery_took(caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "robotiq_async")
    gripper = gripper_of(THREE_FINGER)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        assert any("activated in " in each for each in lines(caplog, logging.INFO))
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await hand.wait_for_state(State.FAULT)
        await hand.recover()
        assert any("recovered in " in each for each in lines(caplog, logging.INFO))
