"""The doctor's findings through a tunnel."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from robotiq_async.simulator import RtuOverTcpSimulatorServer, Trouble
from robotiq_async.tools.doctor import Level
from tests.arms import arm_with_jaw, install_schemes
from tests.tools.test_doctor import findings

pytestmark = pytest.mark.virtual_time


@pytest.fixture(autouse=True)
def schemes(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    install_schemes(monkeypatch, tmp_path)


@pytest.mark.parametrize("name", ["XArm", "Dobot", "Doosan"])
async def test_a_healthy_one(name: str) -> None:
    async with arm_with_jaw(name) as (there, server, _):
        written = len(server.gripper.writes)
        found = await findings(f"{name.lower()}://127.0.0.1:{there.port}?model=2f85")
        assert len(server.gripper.writes) == written
    assert [*found] == [
        *("tunnel", "Modbus", "unit id", "registers", "round trip", "rate"),
        *("model", "activation", "fault", "other clients"),
    ]
    bad = {finding.what for finding in found.values() if finding.level is not Level.GOOD}
    assert bad <= {"round trip", "rate"}, "an arm takes its time"


async def test_the_gripper_has_another_unit_id() -> None:
    async with arm_with_jaw("XArm", device_id=1) as (there, _, _):
        found = await findings(f"xarm://127.0.0.1:{there.port}?model=2f85", seconds=60)
    assert found["unit id"].found == "1, not 9"


async def test_no_arm_is_there() -> None:
    async with arm_with_jaw("XArm") as (there, _, _):
        pass
    found = await findings(f"xarm://127.0.0.1:{there.port}?model=2f85")
    assert found["tunnel"].level is Level.BAD
    assert "connection refused" in found["tunnel"].found
    assert "Is the arm switched on" in found["tunnel"].advice


async def test_the_tool_has_no_power() -> None:
    async with arm_with_jaw("XArm") as (there, _, _):
        there.has_power = False
        found = await findings(f"xarm://127.0.0.1:{there.port}?model=2f85", seconds=60)
    assert found["tunnel"].found == "opens"
    assert found["Modbus"].level is Level.BAD
    assert "the voltage and the rate that the arm gives its tool" in found["Modbus"].advice


async def test_damaged_answers_are_counted() -> None:
    async with arm_with_jaw("Doosan") as (there, server, _):
        damage = Trouble("wrong-checksum", every=0.5, at=0.2)
        plan = asyncio.create_task(server.fault_injector.run([damage], lambda _: None))
        found = await findings(f"doosan://127.0.0.1:{there.port}?model=2f85", seconds=60)
        plan.cancel()
        await asyncio.wait({plan})
    assert "had to be repeated" in found["line"].found


async def test_an_earlier_client_keeps_the_line_behind_a_forwarding() -> None:
    """A UR's forwarding lets the next client connect, and leaves the line to the first until that is gone."""
    async with RtuOverTcpSimulatorServer() as server:
        server.policy = lambda _: []
        found = await findings(server.address, seconds=120)
    assert found["port"].level is Level.GOOD
    assert "stop the forwarding in its URCap and start it again" in found["Modbus"].advice
