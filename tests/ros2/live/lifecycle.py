"""The life of the node: transitions, parameters, what is refused when, and how signals end it."""

from __future__ import annotations

import json
import signal

import pytest
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState

from robotiq_async.ros2.translation.settings import PARAMETERS
from tests.ros2.live.bench import ABORTED, SUCCEEDED, Client, Goal, active, waited
from tests.ros2.live.goals import begun, position
from tests.ros2.live.processes import Process, node
from tests.ros2.live.simulated import Simulator


def writes(simulator: Simulator) -> int:
    return len(simulator.read("writes"))


def test_a_life(simulator: Simulator) -> None:
    with node(address=simulator.address) as process, Client() as client:
        assert client.state() == "unconfigured"
        assert "the node is not configured" in client.call("halt").message
        assert not client.change("activate"), "that is not possible yet"
        assert client.change("configure")
        process.prints("connected to tcp://127.0.0.1")
        assert client.state() == "inactive"
        client.joint_states().wait()  # also while inactive
        assert "the node is not active" in client.call("activate").message
        assert client.send(["fingers"], [0.0]) is None
        process.prints("goal rejected: the node is not active")
        assert client.call("halt").success, "a halt is always taken"
        assert client.change("activate")
        assert client.send(["fingers"], [0.0]) is None
        process.prints("goal rejected: the gripper is not activated")
        assert writes(simulator) == 0, "nothing was written so far"
        assert client.call("activate").success
        goal = begun(client.move(2.8))
        assert client.change("deactivate")
        assert goal.ends()[0] == ABORTED
        process.prints("goal aborted: the node was deactivated")
        there = position(simulator)
        assert there < 230
        assert client.send(["fingers"], [0.0]) is None
        assert client.change("activate")
        assert position(simulator) == there, "activating moves nothing"
        assert client.move(0.0).ends()[0] == SUCCEEDED
        assert client.change("deactivate")
        assert client.change("cleanup")
        assert client.state() == "unconfigured"
        shown = json.loads(client.status().wait(new=False).data)  # what is kept for new subscribers
        assert shown == {
            "state": "SHUTDOWN",
            "connected": False,
            "takes_commands": False,
            "inhibited": None,
        }
        assert client.change("configure")
        process.prints("connected to", times=2)
        assert client.change("shutdown")
        assert client.state() == "finalized"
        process.send(signal.SIGTERM)
        assert process.ends() == 0


def test_a_person_halts_and_the_halt_stays(simulator: Simulator) -> None:
    with node(address=simulator.address) as process, Client() as client:
        assert client.change("configure")
        assert client.change("activate")
        assert client.call("activate").success
        goal = begun(client.move(2.8))
        assert client.call("inhibit").success
        assert goal.ends()[0] == ABORTED
        there = position(simulator)
        assert there < 230
        again = client.send(["fingers"], [0.0])
        assert again is None or again.ends()[0] == ABORTED
        assert not client.call("activate").success
        assert client.change("deactivate")
        assert client.change("cleanup")
        assert client.change("configure")
        assert client.change("activate")
        again = client.send(["fingers"], [0.0])
        assert again is None or again.ends()[0] == ABORTED, "it stays over a cleanup"
        assert position(simulator) == there
        assert client.call("permit").success
        assert position(simulator) == there, "a permit moves nothing"
        assert client.move(0.0).ends()[0] == SUCCEEDED
        process.send(signal.SIGTERM)
        assert process.ends() == 0


def test_a_node_that_only_watches_leaves_the_fingers_alone(simulator: Simulator) -> None:
    with node(address=simulator.address) as process, Client() as client:
        assert client.change("configure")
        client.joint_states().wait()
        process.send(signal.SIGINT)
        assert process.ends() == 0
    assert writes(simulator) == 0


def test_parameters(simulator: Simulator) -> None:
    with (
        node(address="tcp://", publish_rate=20, poll_interval=7, autostart=True) as process,
        Client() as client,
    ):
        process.prints("cannot configure: malformed address 'tcp://'")
        assert client.state() == "unconfigured"
        assert client.set("address", simulator.address).successful
        assert not client.change("configure")
        process.prints("cannot configure: poll_interval must be seconds in 0.001..0.1, got 7")
        for name, value, reason in (
            ("publish_rate", "fast", "publish_rate must be a number in 1.0..200.0, got 'fast'"),
            ("speed", 256, "256"),
            ("address", "tcp://127.1", "malformed address"),
        ):
            refused = client.set(name, value)
            assert not refused.successful
            assert reason in refused.reason
        process.prints("parameter rejected: publish_rate must be a number")
        assert client.set("poll_interval", 0.01).successful
        assert client.set("address", "tcp://127.0.0.1:9").successful
        assert not client.change("configure")
        process.prints("cannot configure: cannot connect to tcp://127.0.0.1:9")
        assert client.set("address", simulator.address).successful
        assert client.change("configure")
        refused = client.set("address", "sim://")
        assert "address is read when the node is configured: clean it up first" in refused.reason
        assert client.set("force", 20).successful
        for name, described in zip(PARAMETERS, client.describe(*PARAMETERS), strict=True):
            assert described.description == PARAMETERS[name].description
        (rate,) = client.describe("publish_rate")
        assert (rate.floating_point_range[0].from_value, rate.floating_point_range[0].to_value) == (1, 200)
        assert process.is_running


def test_of_parameters_that_are_set_together_none_counts_if_one_is_refused(simulator: Simulator) -> None:
    with active(simulator.address, adress="tcp://192.0.2.1") as (process, client):
        assert "this node has no parameter adress" in process.text
        assert not client.set_together(speed=7, force=999).successful
        assert client.move(0.3).ends()[0] == SUCCEEDED
        assert simulator.request.axes[0].speed == 128
        assert client.set_together(speed=9, force=11).successful
        assert client.move(0.4).ends()[0] == SUCCEEDED
        assert simulator.request.axes[0].speed == 9


@pytest.mark.parametrize(
    ("number", "shuts_down"), [(signal.SIGINT, False), (signal.SIGTERM, False), (signal.SIGINT, True)]
)
def test_a_signal_during_a_goal(simulator: Simulator, number: signal.Signals, shuts_down: bool) -> None:
    """A launch ends its nodes with the transition and the signal at once."""
    with active(simulator.address) as (process, client):
        goal = begun(client.move(2.8))
        if shuts_down:
            shutdown = ChangeState.Request(transition=Transition(label="shutdown"))
            client.begin("change_state", ChangeState, shutdown)
        process.send(number)
        process.send(number)  # launchers send several
        assert goal.ends()[0] == ABORTED
        assert process.ends() == 0
        there = position(simulator)
        assert there < 230
        assert not simulator.request.go, "rGTO"
        assert position(simulator) == there
        assert "Traceback" not in process.text


def test_a_client_that_asks_for_the_result_while_the_node_ends(simulator: Simulator) -> None:
    """On a busy machine the request came 0.1 s after the end of the goal, and the client waited forever."""
    with active(simulator.address) as (process, client):
        accepting, feedback = client.begin_goal(["fingers"], [2.8])
        handle = waited(accepting)
        feedback.wait(new=False)
        process.send(signal.SIGINT)
        process.prints("results that no client has requested yet: 1")
        assert client.send(["fingers"], [0.0]) is None
        assert client.call("activate").message == "the node is shutting down"
        assert not client.change("shutdown")
        assert Goal(client, handle, feedback).ends()[0] == ABORTED
        assert process.ends() == 0
        assert "goal rejected: the node is shutting down" in process.text
        assert "cannot shut down: the node is shutting down" in process.text
        assert "[ERROR]" not in process.text


def test_a_client_that_is_held_up_while_the_node_ends(simulator: Simulator) -> None:
    """Results that it had not read when the node was gone were lost."""
    other = ("-m", "tests.ros2.live.client", "goal", "2.8")
    with active(simulator.address) as (process, _), Process(*other) as held:
        held.prints("under way")
        held.send(signal.SIGSTOP)
        process.send(signal.SIGINT)
        process.prints("a client has not received the last messages yet")
        held.send(signal.SIGCONT)
        held.prints(f"ended: {ABORTED}")
        assert process.ends() == 0
