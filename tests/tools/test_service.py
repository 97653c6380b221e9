"""A program around hands: it ends on a signal, reports its health, and is watched by systemd."""

from __future__ import annotations

import asyncio
import signal
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from robotiq_async import Fault, Finger, RobotiqHand, State
from robotiq_async.runtime.signals import INSIST_S
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.sync import RobotiqHand as BlockingHand
from robotiq_async.sync.robotiq_hand import caller_of
from robotiq_async.tools.service import health, stops_on_signals, watched_by_systemd
from tests.grippers import activate_beforehand
from tests.virtual import until

pytestmark = pytest.mark.virtual_time

SIGNALS = [signal.SIGINT, signal.SIGTERM, signal.SIGHUP]


@pytest.fixture
async def server() -> SimulatorServer:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    await activate_beforehand(gripper)
    return SimulatorServer(gripper)


# -- signals -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("number", SIGNALS)
async def test_a_signal_stops_the_hand_and_then_leaves_the_block(
    number: signal.Signals, server: SimulatorServer
) -> None:
    before, order = signal.getsignal(number), list[str]()
    async with server:
        hand = RobotiqHand(server.address)
        async with stops_on_signals(hand) as signals:
            await hand.start()
            hand.command(position=255)
            await until(lambda: hand.status.position(Finger.A) > 20)
            signal.raise_signal(number)
            try:
                await asyncio.sleep(60)
            finally:
                order.append(hand.state.name)
        assert signals.received == number
        assert order == ["SHUTDOWN"], "stopped before the block was cancelled"
        assert not server.gripper.is_moving
    assert signal.getsignal(number) is before


async def test_all_hands_are_stopped_at_once(server: SimulatorServer) -> None:
    """One on a dead link takes its time; the other does not wait for it."""
    other = SimulatorServer(SimulatedGripper(asyncio.get_running_loop().time))
    await activate_beforehand(other.gripper)
    loop = asyncio.get_running_loop()
    async with server, other:
        left, right = RobotiqHand(server.address), RobotiqHand(other.address)
        async with stops_on_signals(left, right):
            await left.start()
            await right.start()
            right.command(position=255)
            await until(lambda: right.status.position(Finger.A) > 20)
            dead = await server.fault_injector.begin(Trouble("silence"))
            signal.raise_signal(signal.SIGTERM)
            began = loop.time()
            await until(lambda: not other.gripper.is_moving)
            assert loop.time() - began < 0.1
            await asyncio.sleep(60)
        assert loop.time() - began < 2.5
        await server.fault_injector.end(dead)


async def run_until_stopped(hand: RobotiqHand, error: Exception | None = None) -> None:
    await hand.start()
    try:
        while True:
            await hand.close(speed=0)
            await hand.open(speed=0)
    finally:
        if error is not None:
            raise error


@pytest.mark.parametrize("error", [None, OSError("the camera is gone")])
async def test_hands_in_a_group_of_tasks_end_as_quietly_as_one(
    error: OSError | None, server: SimulatorServer
) -> None:
    """Their errors made the program fail, and systemd started it again: the fingers moved."""
    other = SimulatorServer(SimulatedGripper(asyncio.get_running_loop().time))
    await activate_beforehand(other.gripper)
    async with server, other:
        left, right = RobotiqHand(server.address), RobotiqHand(other.address)
        caught: list[BaseException] = []
        try:
            async with stops_on_signals(left, right), asyncio.TaskGroup() as group:
                group.create_task(run_until_stopped(left))
                group.create_task(run_until_stopped(right, error))
                await until(lambda: min(each.gripper.position(Finger.A) for each in (server, other)) > 20)
                signal.raise_signal(signal.SIGTERM)
        except* OSError as others:
            caught += others.exceptions
        assert caught == ([] if error is None else [error])
        assert left.state is right.state is State.SHUTDOWN


async def test_further_signals_disturb_nothing_until_someone_insists(server: SimulatorServer) -> None:
    seen = list[int]()
    before = signal.signal(signal.SIGTERM, lambda number, _: seen.append(number))
    try:
        async with server, RobotiqHand(server.address) as hand:
            async with stops_on_signals(hand):
                for _ in range(5):
                    signal.raise_signal(signal.SIGTERM)
                assert not seen
                await asyncio.sleep(60)
            assert hand.state is State.SHUTDOWN
    finally:
        signal.signal(signal.SIGTERM, before)
    assert not seen


async def test_a_further_signal_disturbs_nothing_after_something_held_up_the_loop(
    server: SimulatorServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It ended the program before the stop was written."""
    seen, clock = list[int](), [100.0]
    monkeypatch.setattr("robotiq_async.tools.service.time.monotonic", lambda: clock[0])
    before = signal.signal(signal.SIGTERM, lambda number, _: seen.append(number))
    try:
        async with server, RobotiqHand(server.address) as hand:
            async with stops_on_signals(hand):
                signal.raise_signal(signal.SIGTERM)
                clock[0] += 5.0  # the loop does not run in it
                asyncio.get_running_loop().call_later(0.0, signal.raise_signal, signal.SIGTERM)
                await asyncio.sleep(60)
            assert hand.state is State.SHUTDOWN
    finally:
        signal.signal(signal.SIGTERM, before)
    assert not seen


async def test_an_insistent_signal_does_what_it_did_before(
    server: SimulatorServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The loop may be held up for good, and nothing can be stopped."""
    seen, clock = list[int](), [100.0]
    monkeypatch.setattr("time.monotonic", lambda: clock[0])
    before = signal.signal(signal.SIGTERM, lambda number, _: seen.append(number))
    try:
        async with stops_on_signals():
            signal.raise_signal(signal.SIGTERM)
            clock[0] += INSIST_S + 0.1
            signal.raise_signal(signal.SIGTERM)
            assert seen == [signal.SIGTERM]
            await asyncio.sleep(60)
    finally:
        signal.signal(signal.SIGTERM, before)


async def test_a_server_gets_its_signal_after_the_stop(server: SimulatorServer) -> None:
    seen = list[tuple[int, State]]()
    before = signal.signal(signal.SIGINT, lambda number, _: seen.append((number, hand.state)))
    try:
        async with server:
            hand = RobotiqHand(server.address)
            async with stops_on_signals(hand, forward=True):
                await hand.start()
                signal.raise_signal(signal.SIGINT)
                await until(lambda: bool(seen))
    finally:
        signal.signal(signal.SIGINT, before)
    assert seen == [(signal.SIGINT, State.SHUTDOWN)]


async def test_an_ignored_signal_stays_ignored(server: SimulatorServer) -> None:
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        async with server, RobotiqHand(server.address) as hand:
            async with stops_on_signals(hand) as signals:
                signal.raise_signal(signal.SIGHUP)
                await asyncio.sleep(0.1)
            assert not signals.received
            assert hand.state is State.RUNNING_IDLE
    finally:
        signal.signal(signal.SIGHUP, before)


async def test_a_start_is_taken_back() -> None:
    """The gripper is off, and the service waits for it."""
    hand = RobotiqHand("tcp://127.0.0.1:9")
    async with stops_on_signals(hand):
        asyncio.get_running_loop().call_later(5, signal.raise_signal, signal.SIGTERM)
        await hand.start(wait=3600)
    assert hand.state is State.SHUTDOWN


async def test_a_blocking_hand_is_refused_and_not_only_at_the_signal() -> None:
    """At the signal its stop was no coroutine: the block was never left."""
    before = signal.getsignal(signal.SIGTERM)
    with pytest.raises(TypeError, match="hands must be hands for asyncio, got <RobotiqHand sim://"):
        async with stops_on_signals(BlockingHand("sim://")):  # type: ignore[arg-type]
            pytest.fail("entered")
    assert signal.getsignal(signal.SIGTERM) is before


async def test_signals_reach_the_main_thread_alone() -> None:
    async def elsewhere() -> None:
        with pytest.raises(RuntimeError, match="the main thread alone"):
            async with stops_on_signals():
                pass

    failures = list[BaseException]()

    def run() -> None:
        try:
            asyncio.run(elsewhere())
        except BaseException as error:  # noqa: BLE001  # raised in the test
            failures.append(error)

    thread = threading.Thread(target=run)
    thread.start()
    thread.join()
    assert not failures


# -- health ------------------------------------------------------------------------------------------------


async def test_health_in_every_condition(server: SimulatorServer) -> None:
    async with server:
        hand = RobotiqHand(server.address, name="left")
        assert health(hand).as_dict() == {
            "name": "left",
            "is_ready": False,
            "problem": "no status has been read yet",
            "state": "DISCONNECTED",
            "status_age": None,
            "fault": "NONE",
            "fault_code": 0,
            "severity": "NONE",
            "description": Fault.NONE.description,
            "holds": [],
            "inhibited": None,
        }
        await hand.start()
        found = health(hand)
        assert found.is_ready
        assert found.status_age is not None
        assert found.status_age < 0.01
        server.gripper.place_object(Finger.ABC, 120)
        await hand.grasp()
        assert health(hand).holds == Finger.ABC
        assert health(hand).as_dict()["holds"] == ["A", "B", "C"], "as in the JSON of a status"
        async with server.fault_injector.making(Trouble("fault", 14)):
            await hand.wait_for_state(State.FAULT, timeout=1)
            assert health(hand).problem.startswith("fault 0x0E: ")
            assert hand.status.contacts == Finger.ABC
            assert health(hand).holds == Finger(0), "a contact in a fault is no grip"
        await hand.recover()
        async with server.fault_injector.making(Trouble("silence")):
            await hand.wait_for_state(State.DISCONNECTED, timeout=1)
            await asyncio.sleep(2)
            found = health(hand)
            assert found.problem == f"the link is down: no status for {found.status_age:.1f} s"
            assert found.status_age is not None
            assert found.status_age > 2
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=10)
        await hand.reset()
        assert health(hand).problem == "the hand is in RESET"
        await hand.activate()
        server.gripper.emergency_stop(2)
        await hand.wait_for_state(State.WF_ACTIVATION, timeout=5)
        assert health(hand).problem.startswith("the hand is in WF_ACTIVATION, fault 0x05: ")
        await hand.stop()
    assert health(hand).problem == "the hand is not started"


async def test_a_contact_that_is_left_over_is_no_grip(server: SimulatorServer) -> None:
    """After a stop the gripper still shows the contact, and presses no more."""
    server.gripper.place_object(Finger.ABC, 120)
    async with server, RobotiqHand(server.address) as hand:
        await hand.grasp()
        assert health(hand).holds == Finger.ABC
        await hand.halt()
        assert hand.status.contacts == Finger.ABC
        assert (health(hand).holds, hand.part) == (Finger(0), None)


def test_health_is_told_in_any_thread() -> None:
    """A blocking hand runs in another one, and a web framework calls plain functions in its own."""
    hand = BlockingHand("sim://?model=2f85&speedup=20&object=150", name="left")
    assert health(hand).problem == "no status has been read yet"
    with hand:
        for each in (hand, caller_of(hand).hand):
            found = health(each)
            assert found.is_ready
            assert found.status_age is not None
        hand.grasp()
        assert health(hand).as_dict()["holds"] == ["A"]
    assert health(hand).problem == "the hand is not started"


# -- systemd -----------------------------------------------------------------------------------------------


@pytest.fixture
def systemd(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[socket.socket]:
    """The socket of a service manager that wants a sign of life every 4 s."""
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as receiver:
        receiver.bind(str(tmp_path / "notify"))
        receiver.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(tmp_path / "notify"))
        monkeypatch.setenv("WATCHDOG_USEC", "4000000")
        yield receiver


def heard(receiver: socket.socket) -> list[str]:
    lines = list[str]()
    while True:
        try:
            lines += receiver.recv(4096).decode().splitlines()
        except BlockingIOError:
            return lines


async def test_systemd_is_told(server: SimulatorServer, systemd: socket.socket) -> None:
    async with server:
        hand = RobotiqHand(server.address, name="left")
        async with watched_by_systemd(hand):
            await asyncio.sleep(0.1)
            assert heard(systemd) == ["READY=1", "STATUS=left: no status has been read yet", "WATCHDOG=1"]
            async with hand:
                await asyncio.sleep(10)
                lines = heard(systemd)
                assert lines.count("WATCHDOG=1") == 5
                assert "STATUS=left: RUNNING_IDLE" in lines
                async with server.fault_injector.making(Trouble("silence")):
                    await asyncio.sleep(10)
                    assert heard(systemd).count("WATCHDOG=1") == 5, "a gripper that is off is no reason"
        assert heard(systemd)[-1] == "STOPPING=1"


async def test_a_hand_that_has_ended_is_no_sign_of_life(
    server: SimulatorServer, systemd: socket.socket
) -> None:
    async with server:
        hand = RobotiqHand(server.address, reconnect=False)
        async with watched_by_systemd(hand):
            await hand.start()
            await asyncio.sleep(3)
            server.cut()
            server.refuse()
            await hand.wait_for_state(State.SHUTDOWN, timeout=5)
            heard(systemd)
            await asyncio.sleep(10)
            assert "WATCHDOG=1" not in heard(systemd)


async def test_without_systemd_nothing_happens(
    server: SimulatorServer, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("NOTIFY_SOCKET", raising=False)
    async with server, watched_by_systemd(RobotiqHand(server.address)):
        await asyncio.sleep(1)


async def test_a_socket_that_is_gone_disturbs_nothing(systemd: socket.socket, tmp_path: Path) -> None:
    async with watched_by_systemd(RobotiqHand("sim://")):
        (tmp_path / "notify").unlink()
        await asyncio.sleep(5)
