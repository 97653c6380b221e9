"""The action ``~/gripper_cmd`` of ``control_msgs/action/ParallelGripperCommand``.

Callbacks run in the executor's thread and reach the hand across the bridge. An exception in a callback would
end the executor, so each one catches all.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final

from action_msgs.msg import GoalStatusArray
from control_msgs.action import ParallelGripperCommand
from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.action.server import ServerGoalHandle
from rclpy.callback_groups import CallbackGroup
from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.qos import qos_profile_action_status_default

from ...runtime import now
from ...values import NotStartedError
from ..gripper.connection import GripperConnection, RefusedError
from ..gripper.goals import GoalEnding, GoalOutcome
from ..translation.joints import GoalError, Targets, targets
from ..translation.settings import NodeSettings
from .bridge import Bridge, ClosedError
from .publishing import JointStates
from .unasked import UnaskedGoals

Configured = tuple[GripperConnection, JointStates, NodeSettings]
RECEIPT_S: Final = 3.0  # seconds for clients to receive results: milliseconds, unless one has crashed
RECEIPT_LOOK_S: Final = 0.01  # seconds between two checks of the receipt


class _ResultServer(ActionServer):  # type: ignore[misc]  # rclpy is not here
    """Calls a function, in the executor's thread, when a client has requested the result of a goal."""

    _requested: Callable[[bytes], object]

    def when_requested(self, call: Callable[[bytes], object]) -> None:
        """Say which function: it takes the key of the goal."""
        self._requested = call

    async def execute(self, taken_data: dict[str, Any]) -> None:
        await super().execute(taken_data)
        if "result" in taken_data:
            _, request = taken_data["result"]
            self._requested(bytes(request.goal_id.uuid))


class GripperAction:
    """Accepts goals, runs them on the present connection, and reports feedback and results."""

    def __init__(
        self, node: Node, group: CallbackGroup, bridge: Bridge, configured: Callable[[], Configured]
    ) -> None:
        """Offer the action; the callbacks of ``group`` may overlap.

        ``configured`` returns the configuration of the node; it raises RefusedError if the node has none.
        """
        self._log = node.get_logger()
        self._bridge = bridge
        self._configured = configured
        self._warned = False
        self._accepted: dict[bytes, tuple[Configured, int]] = {}
        """The configuration for each accepted goal by its key, and the number of stops at that time."""
        # ROS does not tell whether a result has been received, but it does for a topic. Every client of an
        # action reads this one, and receives in order: who has its last message has the results, too.
        self._last = node.create_publisher(
            GoalStatusArray, "~/gripper_cmd/_action/status", qos_profile_action_status_default
        )
        self._unasked = unasked = UnaskedGoals()
        self._server = _ResultServer(
            node,
            ParallelGripperCommand,
            "~/gripper_cmd",
            execute_callback=self._execute,
            goal_callback=self._check,
            handle_accepted_callback=self._begin,
            cancel_callback=self._cancel,
            callback_group=group,
        )
        self._server.when_requested(lambda key: bridge.tell(unasked.requested, key))

    async def results_requested(self) -> None:
        """Wait, in the loop, until clients have requested the results of their goals, for seconds at most."""
        if number := self._unasked.number:
            self._log.info(f"results that no client has requested yet: {number}; the node waits for that")
        await self._unasked.wait()
        self._last.publish(GoalStatusArray())

    async def results_received(self) -> None:
        """Wait, in the loop, until clients have the results, for seconds at most: one may have crashed."""
        if self._is_received():
            return
        self._log.info("a client has not received the last messages yet; the node waits for that")
        until = now() + RECEIPT_S
        while not self._is_received() and now() < until:  # noqa: ASYNC110  # ROS has no event for it
            await asyncio.sleep(RECEIPT_LOOK_S)

    def _is_received(self) -> bool:
        try:
            return bool(self._last.wait_for_all_acked(Duration()))
        except Exception:  # noqa: BLE001  # a middleware that cannot tell
            return True

    async def _check(self, request: ParallelGripperCommand.Goal) -> GoalResponse:
        # A rejection has no text in ROS, so the log gives the reason.
        try:
            connection, _, settings = self._configured()
            _targets(request, connection, settings)
            await self._bridge.ask(connection.check_goal())
        except (GoalError, RefusedError, ClosedError) as error:
            self._log.warning(f"goal rejected: {error}")
            return GoalResponse.REJECT
        except Exception as error:  # noqa: BLE001  # would end the executor
            self._log.error(f"goal rejected: {error!r}")
            return GoalResponse.REJECT
        self._warn_of_limits(request)
        return GoalResponse.ACCEPT

    def _begin(self, handle: ServerGoalHandle) -> None:
        # The goal belongs to the present connection and number of stops: a later stop ends it before it
        # begins.
        try:
            self._bridge.tell(self._unasked.accepted, _key(handle))
            configured = self._configured()
            self._accepted[_key(handle)] = configured, configured[0].stops
        except Exception as error:  # noqa: BLE001  # would end the executor
            self._log.error(f"a goal that was accepted cannot begin: {error}")
        handle.execute()

    def _cancel(self, handle: ServerGoalHandle) -> CancelResponse:
        # Always accept: if a request cancels several goals, rclpy skips the goal after a goal that refuses.
        # Submitted, not awaited: this thread must mark the goal as canceling before it ends.
        try:
            connection, _, _ = self._configured()
            self._bridge.submit(connection.cancel_goal(_key(handle)))
        except Exception as error:  # noqa: BLE001  # would end the executor
            self._log.warning(f"cancel of a goal that ends anyway: {error}")
        return CancelResponse.ACCEPT

    async def _execute(self, handle: ServerGoalHandle) -> ParallelGripperCommand.Result:
        result = ParallelGripperCommand.Result()
        try:
            if handle.is_cancel_requested:  # since it was accepted
                outcome = GoalOutcome(
                    GoalEnding.CANCELED, stalled=False, reached=False, reason="canceled at once"
                )
            else:
                outcome = await self._run(handle, result)
        except Exception as error:  # noqa: BLE001  # would leave the client without a result
            outcome = GoalOutcome(
                GoalEnding.ABORTED, stalled=False, reached=False, reason=str(error) or repr(error)
            )
        self._accepted.pop(_key(handle), None)
        result.stalled, result.reached_goal = outcome.stalled, outcome.reached
        self._finish(handle, outcome)
        self._bridge.tell(self._unasked.ended, _key(handle))
        return result

    async def _run(self, handle: ServerGoalHandle, result: ParallelGripperCommand.Result) -> GoalOutcome:
        if _key(handle) not in self._accepted:
            raise RefusedError("the node is not configured")
        (connection, joints, settings), stops = self._accepted[_key(handle)]
        targets = _targets(handle.request, connection, settings)

        def feedback() -> None:
            state = joints.message(connection.hand.status)
            handle.publish_feedback(ParallelGripperCommand.Feedback(state=state))

        async def work() -> GoalOutcome:
            try:
                return await connection.run_goal(_key(handle), targets, settings, feedback, stops)
            finally:
                with suppress(NotStartedError):  # no status has been read
                    result.state = joints.message(connection.hand.status)

        return await self._bridge.ask(work())

    def _finish(self, handle: ServerGoalHandle, outcome: GoalOutcome) -> None:
        # ROS permits the state canceled only if the client requested it.
        if outcome.ending is GoalEnding.SUCCEEDED:
            self._log.info(f"goal succeeded: {outcome.reason}")
            handle.succeed()
        elif outcome.ending is GoalEnding.CANCELED and handle.is_cancel_requested:
            self._log.info(f"goal canceled: {outcome.reason}")
            handle.canceled()
        else:
            self._log.warning(f"goal aborted: {outcome.reason}")
            handle.abort()

    def _warn_of_limits(self, request: ParallelGripperCommand.Goal) -> None:
        if not self._warned and (any(request.command.velocity) or any(request.command.effort)):
            self._warned = True
            self._log.warning(
                "velocity and effort in goals are ignored; set the parameters speed and force (logged once)"
            )


def _key(handle: ServerGoalHandle) -> bytes:
    return bytes(handle.goal_id.uuid)


def _targets(
    request: ParallelGripperCommand.Goal, connection: GripperConnection, settings: NodeSettings
) -> Targets:
    command, model = request.command, connection.hand.model
    return targets(command.name, command.position, settings.joint_prefix, model)
