"""The surroundings of a live test: a client of ROS, in a thread of this process, and its topics.

Everything here waits for what happens, and for PATIENCE_S at most.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future
from contextlib import contextmanager
from typing import Any, Final, Self, TypeVar

import rclpy
from action_msgs.msg import GoalStatus
from action_msgs.srv import CancelGoal
from control_msgs.action import ParallelGripperCommand
from diagnostic_msgs.msg import DiagnosticArray
from lifecycle_msgs.msg import Transition
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.srv import DescribeParameters, SetParameters, SetParametersAtomically
from rclpy.action import ActionClient
from rclpy.context import Context
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.qos import DurabilityPolicy, QoSProfile
from rclpy.signals import SignalHandlerOptions
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from std_srvs.srv import Trigger

from tests.ros2.live.processes import PATIENCE_S, Process, node

T = TypeVar("T")
SUCCEEDED: Final = GoalStatus.STATUS_SUCCEEDED
CANCELED: Final = GoalStatus.STATUS_CANCELED
ABORTED: Final = GoalStatus.STATUS_ABORTED
LATEST: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)


class Topic:
    """The messages of a topic, as they come."""

    def __init__(self) -> None:
        self.messages: list[Any] = []
        self._news = threading.Condition()

    def take(self, message: Any) -> None:
        with self._news:
            self.messages.append(message)
            self._news.notify_all()

    def wait(self, wanted: Callable[[Any], bool] = lambda _: True, *, new: bool = True) -> Any:
        """The first message that will do, of those that come from now on unless new is False."""
        with self._news:
            at = len(self.messages) if new else 0
            found: list[Any] = []

            def look() -> bool:
                nonlocal at
                fresh, at = self.messages[at:], len(self.messages)
                found.extend(each for each in fresh if wanted(each))
                return bool(found)

            assert self._news.wait_for(look, PATIENCE_S), f"not published; last: {self.messages[-1:]}"
        return found[0]


class Goal:
    """A goal that was accepted."""

    def __init__(self, client: Client, handle: Any, feedback: Topic) -> None:
        self._client = client
        self._handle = handle
        self.feedback = feedback
        self._result = client.inside(handle.get_result_async)

    def cancel(self) -> None:
        waited(self._client.inside(self._handle.cancel_goal_async))

    def ends(self) -> tuple[int, ParallelGripperCommand.Result]:
        answer = waited(self._result)
        return answer.status, answer.result


class Client:
    """A program that uses the node: its services, its action, its topics."""

    def __init__(self, name: str = "/gripper") -> None:
        self._name = name
        self._context = Context()
        rclpy.init(context=self._context, signal_handler_options=SignalHandlerOptions.NO)
        self.node = rclpy.create_node("client", context=self._context)
        self._executor = SingleThreadedExecutor(context=self._context)
        self._executor.add_node(self.node)
        self._action = ActionClient(self.node, ParallelGripperCommand, f"{name}/gripper_cmd")
        self._clients: dict[str, Any] = {}
        self._is_ending = threading.Event()
        self._thread = threading.Thread(target=self._spin, daemon=True)

    def __enter__(self) -> Self:
        self._thread.start()
        assert self._action.wait_for_server(PATIENCE_S)
        return self

    def __exit__(self, *_: object) -> None:
        # Shut down from here while it spins, an executor may fall over what has gone.
        self.inside(self._is_ending.set)
        self._thread.join(PATIENCE_S)
        self._executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self._context)

    def _spin(self) -> None:
        while not self._is_ending.is_set():
            self._executor.spin_once()

    def inside(self, work: Callable[[], T]) -> T:
        """Do something in the executor's thread: an action client elsewhere may miss its answer."""
        done: Future[T] = Future()
        self._executor.create_task(lambda: done.set_result(work()))
        return done.result(PATIENCE_S)

    # -- services ------------------------------------------------------------------------------------------

    def begin(self, name: str, kind: Any = Trigger, request: Any = None) -> Any:
        """Call a service of the node, without waiting for the answer."""
        if name not in self._clients:
            self._clients[name] = self.node.create_client(
                kind, f"{self._name}/{name}", qos_profile=QoSProfile(depth=1000)
            )
        assert self._clients[name].wait_for_service(PATIENCE_S), name
        return self._clients[name].call_async(kind.Request() if request is None else request)

    def call(self, name: str, kind: Any = Trigger, request: Any = None) -> Any:
        return waited(self.begin(name, kind, request))

    def change(self, transition: str) -> bool:
        """A transition of the life cycle, by its name; whether it succeeded."""
        request = ChangeState.Request(transition=Transition(label=transition))
        return bool(self.call("change_state", ChangeState, request).success)

    def state(self) -> str:
        return str(self.call("get_state", GetState).current_state.label)

    def set(self, name: str, value: object) -> Any:
        """Set a parameter; the result has a reason."""
        request = SetParameters.Request(parameters=[Parameter(name, value=value).to_parameter_msg()])
        return self.call("set_parameters", SetParameters, request).results[0]

    def set_together(self, **values: object) -> Any:
        """Set parameters, all or none; the result has a reason."""
        messages = [Parameter(name, value=value).to_parameter_msg() for name, value in values.items()]
        request = SetParametersAtomically.Request(parameters=messages)
        return self.call("set_parameters_atomically", SetParametersAtomically, request).result

    def describe(self, *names: str) -> Sequence[Any]:
        request = DescribeParameters.Request(names=list(names))
        return list(self.call("describe_parameters", DescribeParameters, request).descriptors)

    # -- goals and topics ----------------------------------------------------------------------------------

    def begin_goal(
        self, names: Sequence[str], positions: Sequence[float], **limits: Sequence[float]
    ) -> tuple[Any, Topic]:
        """Send a goal, without waiting for the answer; what is fed back goes to the topic."""
        feedback = Topic()
        command = JointState(name=list(names), position=[*map(float, positions)], **limits)
        goal = ParallelGripperCommand.Goal(command=command)
        took = lambda it: feedback.take(it.feedback)  # noqa: E731
        return self.inside(lambda: self._action.send_goal_async(goal, feedback_callback=took)), feedback

    def send(
        self, names: Sequence[str], positions: Sequence[float], **limits: Sequence[float]
    ) -> Goal | None:
        """Send a goal; None if it is rejected."""
        answer, feedback = self.begin_goal(names, positions, **limits)
        handle = waited(answer)
        return Goal(self, handle, feedback) if handle.accepted else None

    def cancel_all(self) -> Any:
        """Cancel whatever goals there are; a future of the answer."""
        return self.begin("gripper_cmd/_action/cancel_goal", CancelGoal)

    def move(self, *positions: float, names: Sequence[str] = ("fingers",)) -> Goal:
        goal = self.send(names, positions)
        assert goal is not None, "rejected: the node's log says why"
        return goal

    def joint_states(self, name: str = "/joint_states") -> Topic:
        return self.listen(JointState, name, 10)

    def status(self) -> Topic:
        return self.listen(String, f"{self._name}/status", LATEST)

    def diagnostics(self) -> Topic:
        return self.listen(DiagnosticArray, "/diagnostics", 10)

    def listen(self, kind: Any, name: str, qos: Any) -> Topic:
        topic = Topic()
        self.node.create_subscription(kind, name, topic.take, qos)
        return topic


def waited(future: Any) -> Any:
    """The result of a future of ROS, which another thread sets."""
    done: Future[None] = Future()
    future.add_done_callback(lambda _: done.set_result(None))
    done.result(PATIENCE_S)
    return future.result()


@contextmanager
def active(address: str, **parameters: Any) -> Iterator[tuple[Process, Client]]:
    """An active node at an active gripper."""
    with node(address=address, autostart=True, **parameters) as process, Client() as client:
        process.prints("commands are taken")
        answer = client.call("activate")
        assert answer.success, answer.message
        yield process, client
