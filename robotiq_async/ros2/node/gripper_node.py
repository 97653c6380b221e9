"""GripperNode: the lifecycle node, with its transitions and services.

Configure connects and reads, activate permits commands and moves nothing, deactivate halts, cleanup
disconnects. All callbacks run in the executor's thread; the hand belongs to the loop, across the bridge.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Final

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.context import Context
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.qos import QoSProfile
from std_srvs.srv import Trigger

from ...values import RobotiqError
from ..gripper.connection import NODE_COMMANDS, GripperConnection, HandMaker, RefusedError
from ..translation.description import robot_description
from . import parameters
from .bridge import Bridge, ClosedError
from .gripper_action import Configured, GripperAction
from .publishing import JointStates, Publishing

NODE_NAME: Final = "gripper"
_CALLS: Final = QoSProfile(depth=100)
"""Calls that may wait for the executor. With ROS's default of 10 a busy client displaces other calls."""
_CALLBACK_DONE, _CALLBACK_FAILED = TransitionCallbackReturn.SUCCESS, TransitionCallbackReturn.FAILURE


class GripperNode(LifecycleNode):  # type: ignore[misc]  # rclpy is not here
    """A gripper as a ROS 2 lifecycle node. It begins unconfigured, without a hand.

    ``failed`` is called, in the loop, with an error that must end the process.
    """

    def __init__(self, context: Context, bridge: Bridge, failed: Callable[[BaseException], object]) -> None:
        super().__init__(NODE_NAME, context=context)
        self._bridge = bridge
        self._current: Configured | None = None  # set while the node is configured; the loop reads it too
        self._hands = HandMaker()
        parameters.declare(self)
        parameters.guard(self, lambda: self._current is not None, self._apply_live_parameters)
        parameters.warn_of_unknown(self)
        # In the default group a halt would wait until an activation has ended.
        group = ReentrantCallbackGroup()
        self._publishing = Publishing(self, failed)
        self._action = GripperAction(self, group, bridge, self._configured)
        for name in NODE_COMMANDS:
            serve = partial(self._serve, name)
            self.create_service(Trigger, f"~/{name}", serve, qos_profile=_CALLS, callback_group=group)
        self._answer_illegal_transitions()

    # -- transitions -----------------------------------------------------------------------------------

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Connect and read. A failure leaves the node unconfigured."""
        return self._transition("configure", self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Accept commands. Moves nothing."""
        return self._transition("activate", self._activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Halt, and refuse commands."""
        return self._transition("deactivate", self._deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Disconnect; halt first if commands were accepted."""
        return self._transition("clean up", self._clean_up)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Disconnect; halt first if commands were accepted. The process continues until a signal ends it."""
        return self._transition("shut down", self._clean_up)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:  # noqa: ARG002
        """Disconnect; the node is unconfigured then."""
        return self._transition("clean up after an error", self._clean_up)

    def start_automatically(self) -> None:
        """Configure and activate if the parameter ``autostart`` is set. Call it in the executor's thread."""
        try:
            wanted = parameters.read(self).autostart
        except ValueError:
            wanted = True  # the configuration fails and reports the error
        if wanted and self.trigger_configure() == _CALLBACK_DONE:
            self.trigger_activate()

    async def close(self) -> None:
        """Disconnect, in the loop, because the process ends. Goals are aborted and the fingers stop."""
        if self._current is not None:
            await self._disconnect(self._current[0], "the node is shutting down")

    async def results_requested(self) -> None:
        """Wait, in the loop, until clients have requested the results of their goals, for seconds at most."""
        await self._action.results_requested()

    async def results_received(self) -> None:
        """Wait, in the loop, until clients have the results that were sent, for seconds at most."""
        await self._action.results_received()

    def _transition(self, what: str, work: Callable[[], str]) -> TransitionCallbackReturn:
        # ROS would swallow the error of a transition.
        try:
            self.get_logger().info(work())
        except ClosedError as error:  # no error: a launch requests the shutdown, and sends a signal at once
            self.get_logger().warning(f"cannot {what}: {error}")
            return _CALLBACK_FAILED
        except (RobotiqError, ValueError, OSError) as error:
            self.get_logger().error(f"cannot {what}: {error}")
            return _CALLBACK_FAILED
        except Exception as error:  # noqa: BLE001  # ROS would swallow it
            self.get_logger().error(f"cannot {what}: {error!r}")
            return _CALLBACK_FAILED
        return _CALLBACK_DONE

    def _configure(self) -> str:
        settings = parameters.read(self)
        given = robot_description(settings.urdf, settings.joint_prefix) if settings.urdf else ""
        connection = GripperConnection(self._hands.make(settings), settings)
        joints = JointStates(self.get_clock(), settings.joint_prefix, settings.frame_id)
        self._current = connection, joints, settings
        try:
            self._bridge.wait(self._connect(connection, joints, settings.publish_rate))
        except BaseException:
            self._current = None
            raise
        own = robot_description("", settings.joint_prefix, connection.hand.model)
        self._publishing.describe(given or own)
        return f"connected to {connection.hand.address}: {connection.hand.state.name}"

    def _activate(self) -> str:
        connection, _, _ = self._configured()
        self._bridge.wait(connection.permit())
        return "commands are taken; nothing has been moved"

    def _deactivate(self) -> str:
        connection, _, _ = self._configured()
        is_halted = self._bridge.wait(connection.forbid("the node was deactivated"))
        return f"no commands are taken; {'halted' if is_halted else 'NOT halted'}"

    def _clean_up(self) -> str:
        if self._current is None:
            return "not connected"
        self._bridge.wait(self._disconnect(self._current[0], "the node was cleaned up"))
        # Not earlier: if the process ends before, close() must stop the hand.
        self._current = None
        return "disconnected"

    async def _connect(self, connection: GripperConnection, joints: JointStates, rate: float) -> None:
        try:
            await connection.open()
            await self._publishing.start(connection, joints, rate)
        except BaseException:
            await self._disconnect(connection, "the configuration failed")
            raise

    async def _disconnect(self, connection: GripperConnection, reason: str) -> None:
        connection.refuse(reason)  # first: nothing must begin during the stop
        await self._publishing.stop()
        await connection.close(reason)
        self._publishing.publish_status(connection)  # the last message is kept for late subscribers

    # -- services --------------------------------------------------------------------------------------

    async def _serve(self, name: str, _: Trigger.Request, response: Trigger.Response) -> Trigger.Response:
        # The response has the outcome; a failure is also logged.
        try:
            connection, _, _ = self._configured()
            response.message = await self._bridge.ask(connection.command(name))
            response.success = True
        except Exception as error:  # noqa: BLE001  # would end the executor
            known = isinstance(error, RobotiqError | ClosedError)
            response.message = str(error) if known else repr(error)
            self.get_logger().warning(f"{name}: {response.message}")
        return response

    # -- inside ----------------------------------------------------------------------------------------

    def _configured(self) -> Configured:
        if self._current is None:
            raise RefusedError("the node is not configured")
        return self._current

    def _apply_live_parameters(self, values: dict[str, object]) -> None:
        if self._current is not None:
            connection, joints, settings = self._current
            self._current = connection, joints, replace(settings, **values)  # type: ignore[arg-type]

    def _answer_illegal_transitions(self) -> None:
        # Before Kilted, rclpy raises in the executor for a transition that is not possible now, and its
        # client waits forever. This answers with a failure.
        service = self._service_change_state
        answer = service.callback

        def guarded(request: object, response: object) -> object:
            try:
                return answer(request, response)
            except Exception as error:  # noqa: BLE001  # would end the executor
                self.get_logger().warning(f"transition rejected: {' '.join(str(error).split())}")
                response.success = False  # type: ignore[attr-defined]
                return response

        service.callback = guarded
