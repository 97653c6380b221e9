"""The gripper server of polymetis: its three calls, what it refuses, and gRPC's own client at the process."""

from __future__ import annotations

import asyncio
import math
import os
import socket
import sys
import time
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from collections.abc import AsyncIterator, Callable, Iterator, Mapping
from contextlib import asynccontextmanager, contextmanager
from functools import partial
from typing import Any, NamedTuple

import pytest
from hypothesis import given
from hypothesis import strategies as st

import robotiq_async
from robotiq_async import JAW, THREE_FINGER, TWO_FINGER_85
from robotiq_async.dropins.protobuf import decoded, encoded
from robotiq_async.simulator import SimulatorServer, Trouble
from robotiq_async.sync import RobotiqHand
from tests.dropins.lockstep import WIRES, Line, bad, inside, line, rest
from tests.dropins.race import Tally, Watched, sweep
from tests.forked import ROOT
from tests.grippers import active_gripper
from tests.patience import patience

grpc = pytest.importorskip("grpc", reason="needs grpcio (extra grpc)")
from robotiq_async.dropins.polymetis import GripperService, main  # noqa: E402  # needs grpc


class Aborted(Exception):  # noqa: N818  # as gRPC's own
    """The error that abort() raises in a handler."""

    def __init__(self, code: Any, words: str) -> None:
        super().__init__(code.name, words)
        self.code = code


class Context:
    """The part of gRPC's context that handlers use."""

    def abort(self, code: Any, words: str) -> None:
        raise Aborted(code, words)


CONTEXT = Context()


@contextmanager
def served(here: Line) -> Iterator[GripperService]:
    hand = RobotiqHand(here.address, keep_grip=True, response_timeout=0.1)
    service = GripperService(hand)
    hand.start()
    service.is_ready.set()
    yield service
    here.server.policy = bad(0, 0)
    hand.stop()


def command(width: float, speed: float = 0.05, force: float = 0.1, **more: Any) -> bytes:
    """A ``GripperCommand``, as DROID sends it."""
    stamp = encoded({1: 1700000000, 2: 5})
    return encoded({1: stamp, 2: width, 3: speed, 4: force, **({5: True} if more.get("grasp") else {})})


def seen(service: GripperService) -> Mapping[int, Any]:
    return decoded(service.state(b"", CONTEXT))


def at_rest(service: GripperService) -> Mapping[int, Any]:
    while (state := seen(service)).get(4):
        rest(0.01)
    return state


# -- messages ----------------------------------------------------------------------------------------------


@given(
    st.dictionaries(
        st.integers(1, 2000),
        st.integers(0, 2**63) | st.floats(width=32, allow_nan=False) | st.binary(max_size=300),
    )
)
def test_messages_there_and_back(fields: dict[int, Any]) -> None:
    assert decoded(encoded(fields)) == fields


@given(st.binary(max_size=60))
def test_any_bytes_are_a_message_or_a_value_error(message: bytes) -> None:
    try:
        decoded(message)
    except ValueError:
        return


def test_messages_are_those_of_protocol_buffers() -> None:
    """Made with protobuf 6: a float, a negative zero, a bool, a text, a message inside."""
    assert encoded({2: 0.085}) == bytes.fromhex("157b14ae3d")
    assert encoded({1: b"ab", 2: 300}) == bytes.fromhex("0a02616210ac02")
    assert decoded(bytes.fromhex("0900000000000008401801")) == {3: 1}, "a double is passed over"
    for cut in ("15", "1500", "0a05", "80"):
        with pytest.raises(ValueError, match="cut off"):
            decoded(bytes.fromhex(cut))
    with pytest.raises(ValueError, match="kind 3"):
        decoded(b"\x0b")


# -- the three calls ---------------------------------------------------------------------------------------


def test_the_numbers_are_droids() -> None:
    with line("rtu") as here, served(here) as service:
        about = decoded(service.metadata(b"", CONTEXT))
        assert about[3] == pytest.approx(0.085)
        assert seen(service)[2] == pytest.approx(0.085, abs=0.004)
        assert service.goto(command(0.085 / 2), CONTEXT) == b""
        state = at_rest(service)
        assert state[2] == pytest.approx(0.0425, abs=0.001)
        assert here.gripper.position(JAW) == pytest.approx((3 + 228) / 2, abs=3), "linear in counts"
        (word,) = {each.registers[2] for each in here.gripper.writes[-1:]}
        assert (word >> 8, word & 0xFF) == (146, 0), "0.05 and 0.1, by polymetis' formulas"


def test_beyond_the_range_is_the_end_and_a_grasp_closes() -> None:
    with line("tcp") as here, served(here) as service:
        for width, target in ((-1.0, 255), (5.0, 0)):
            service.goto(command(width, 9, 900), CONTEXT)
            at_rest(service)
            assert TWO_FINGER_85.has_reached(target, round(here.gripper.position(JAW)))
        here.gripper.place_object(JAW, position=100)
        service.goto(command(0.085, grasp=True), CONTEXT)
        state = at_rest(service)
        assert state[3] == 1, "is_grasped"
        assert here.gripper.position(JAW) == pytest.approx(100, abs=15)


def test_a_3_finger_has_its_own_width() -> None:
    with line("tcp", model=THREE_FINGER) as here, served(here) as service:
        assert decoded(service.metadata(b"", CONTEXT))[3] == pytest.approx(0.155)
        service.goto(command(0.0), CONTEXT)
        assert at_rest(service)[2] == 0


def test_the_stamp_is_the_time_of_the_status() -> None:
    with line("tcp") as here, served(here) as service:
        stamp: Mapping[int, Any] = decoded(seen(service)[1])
        assert abs(stamp[1] + stamp[2] / 1e9 - time.time()) < 5


# -- what does not come, and what is refused ---------------------------------------------------------


@pytest.mark.parametrize("wire", WIRES)
def test_a_line_that_loses_replies_and_brings_them_late_costs_waits_alone(wire: str) -> None:
    with line(wire, kind=Watched) as here, served(here) as service:
        here.server.policy = bad(0.01, 0.3)
        tally = droid(service, here.gripper, 500)
        assert not tally.exceptions
        assert tally.wrong == 0
        assert tally.longest < 2.0


def droid(service: GripperService, gripper: Watched, exchanges: int) -> Tally:
    """DROID's loop, at 15 Hz: the state, a command."""
    tally, targets = Tally(), sweep(16)
    while gripper.exchanges < exchanges:
        tally.call(
            lambda: 228 - 225 * seen(service).get(2, 0.0) / 0.085,
            gripper.has_shown,
        )
        width = 0.085 * (1 - next(targets) / 255)
        tally.call(partial(service.goto, command(width), CONTEXT), lambda answer, _: answer == b"")
        rest(1 / 15)
    return tally


def test_a_dead_line_is_unavailable_after_two_seconds_and_never_the_last_value() -> None:
    with line("tcp") as here, served(here) as service:
        here.server.policy = lambda _: ()
        rest(0.1)
        calls: list[Callable[[], bytes]] = [
            lambda: service.state(b"", CONTEXT),
            lambda: service.goto(command(0), CONTEXT),
        ]
        for call in calls:
            began = time.monotonic()
            with pytest.raises(Aborted) as caught:
                call()
            assert caught.value.code is grpc.StatusCode.UNAVAILABLE
            assert time.monotonic() - began <= 2.01


@pytest.mark.parametrize(
    "request_", [command(math.nan), command(0.0, math.inf), b"\x15\x00", encoded({2: b"x"})]
)
def test_what_is_no_command_is_refused(request_: bytes) -> None:
    with line("tcp") as here, served(here) as service:
        before = len(here.gripper.writes)
        with pytest.raises(Aborted) as caught:
            service.goto(request_, CONTEXT)
        assert caught.value.code is grpc.StatusCode.INVALID_ARGUMENT
        rest(0.1)
        assert len(here.gripper.writes) == before


def test_a_gripper_in_fault_refuses_a_command() -> None:
    with line("tcp") as here, served(here) as service:
        inside(lambda: here.server.fault_injector.begin(Trouble("fault", 0x0E)))
        rest(0.1)
        with pytest.raises(Aborted) as caught:
            service.goto(command(0), CONTEXT)
        assert caught.value.code is grpc.StatusCode.FAILED_PRECONDITION
        assert seen(service)[5] == 0x0E


# -- the process ---------------------------------------------------------------------------------------------


class Program(NamedTuple):
    """The server, its port, and a way to call it."""

    process: asyncio.subprocess.Process
    port: int
    call: Callable[..., Any]


@asynccontextmanager
async def program(*arguments: str) -> AsyncIterator[Program]:
    port = free_port()
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "robotiq_async.dropins.polymetis", "--port", str(port), *arguments),
        env=os.environ | {"PYTHONPATH": str(ROOT)},
        stdin=DEVNULL,
        stdout=PIPE,
        stderr=STDOUT,
    )

    def call(name: str, request: bytes = b"") -> dict[int, Any]:
        """With gRPC's own client, for calls without generated code."""
        with grpc.insecure_channel(f"localhost:{port}") as channel:
            reply = channel.unary_unary(f"/GripperServer/{name}")
            return decoded(reply(request, timeout=patience(30), wait_for_ready=True))

    try:
        yield Program(process, port, lambda *given: asyncio.to_thread(call, *given))
    finally:
        if process.returncode is None:
            process.kill()
            await process.communicate()


def free_port() -> int:
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return int(found.getsockname()[1])


async def test_a_client_of_grpc_drives_the_process_and_what_is_held_at_its_start_and_end_stays_held() -> None:
    gripper = active_gripper(10, model=TWO_FINGER_85)
    gripper.place_object(JAW, position=120)
    async with SimulatorServer(gripper) as server:
        async with robotiq_async.RobotiqHand(server.address, keep_grip=True) as hand:
            assert (await hand.close()).contacts
        travelled = gripper.travel(JAW)
        async with program("--yes", server.address) as (process, _, call):
            assert (await call("GetRobotClientMetadata"))[3] == pytest.approx(0.085)
            state = await call("GetState")
            assert state[3] == 1, "it is held"
            with pytest.raises(grpc.RpcError) as caught:
                await call("ControlUpdate")
            assert caught.value.code() is grpc.StatusCode.UNIMPLEMENTED
            assert gripper.travel(JAW) == travelled
            process.terminate()
            printed, _ = await process.communicate()
            assert process.returncode == 0, printed.decode()
            assert gripper.travel(JAW) == travelled


async def test_a_second_server_on_the_port_is_refused() -> None:
    """GRPC would share it, and half of the commands would go to the other gripper."""
    async with program("sim://?model=2f85&speedup=50") as (_, number, call):
        await call("GetState")
        port = str(number)
        done = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "robotiq_async.dropins.polymetis", "--port", port, "sim://?model=2f85"),
            env=os.environ | {"PYTHONPATH": str(ROOT)},
            stdout=PIPE,
            stderr=STDOUT,
        )
        printed, _ = await done.communicate()
        assert done.returncode == 1
        assert f"port {port} of localhost is taken" in printed.decode()


def test_it_asks_before_fingers_move(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(sys, "stdin", None)
    with pytest.raises(SystemExit) as ended:
        main(["tcp://127.0.0.1:1?model=2f85"])
    assert ended.value.code == 2
    assert "needs --yes" in capsys.readouterr().err
