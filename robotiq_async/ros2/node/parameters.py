"""The parameters in ROS: declares, reads and guards them."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rcl_interfaces.msg import FloatingPointRange, IntegerRange, ParameterDescriptor, SetParametersResult
from rclpy.exceptions import InvalidParameterTypeException, InvalidParameterValueException
from rclpy.node import Node
from rclpy.parameter import Parameter as RosParameter

from ..translation.settings import PARAMETERS, NodeSettings, Parameter, check_parameter, check_settings


def declare(node: Node) -> None:
    """Declare all parameters, also with a wrong value from the start, which fails the configuration.

    Types are checked here, not by ROS, which would reject the integer 50 for publish_rate and not start the
    node.
    """
    for name, parameter in PARAMETERS.items():
        try:
            node.declare_parameter(name, parameter.default, _descriptor(parameter))
        except (InvalidParameterValueException, InvalidParameterTypeException):
            plain = ParameterDescriptor(description=parameter.description, dynamic_typing=True)
            node.declare_parameter(name, parameter.default, plain)


def read(node: Node) -> NodeSettings:
    """The checked parameters."""
    return check_settings({name: node.get_parameter(name).value for name in PARAMETERS})


def guard(
    node: Node, is_configured: Callable[[], bool], changed: Callable[[dict[str, object]], object]
) -> None:
    """Reject invalid values, and changes that need a new configuration; log the reason.

    ``changed`` is called with the parameters of one request, once all of them are accepted.
    """

    def check(given: Sequence[RosParameter]) -> SetParametersResult:
        for each in _ours(given):
            try:
                check_parameter(each.name, each.value)
            except ValueError as error:
                return _refused(node, str(error))
            if is_configured() and not PARAMETERS[each.name].live:
                return _refused(node, f"{each.name} is read when the node is configured: clean it up first")
        return SetParametersResult(successful=True)

    def take(given: Sequence[RosParameter]) -> None:
        changed({each.name: check_parameter(each.name, each.value) for each in _ours(given)})

    node.add_on_set_parameters_callback(check)
    node.add_post_set_parameters_callback(take)


def warn_of_unknown(node: Node) -> None:
    # A misspelled parameter would silently leave the default.
    unknown = [name for name in getattr(node, "_parameter_overrides", ()) if not node.has_parameter(name)]
    if unknown:
        node.get_logger().warning(f"this node has no parameter {', '.join(sorted(unknown))}")


def _ours(given: Sequence[RosParameter]) -> list[RosParameter]:
    # Without the parameters of ROS, such as use_sim_time.
    return [each for each in given if each.name in PARAMETERS]


def _refused(node: Node, reason: str) -> SetParametersResult:
    node.get_logger().warning(f"parameter rejected: {reason}")
    return SetParametersResult(successful=False, reason=reason)


def _descriptor(parameter: Parameter) -> ParameterDescriptor:
    descriptor = ParameterDescriptor(description=parameter.description, dynamic_typing=True)
    if isinstance(parameter.default, float):
        bounds = FloatingPointRange(from_value=parameter.low, to_value=parameter.high)
        descriptor.floating_point_range = [bounds]
    elif isinstance(parameter.default, int) and not isinstance(parameter.default, bool):
        descriptor.integer_range = [
            IntegerRange(from_value=int(parameter.low), to_value=int(parameter.high), step=1)
        ]
    return descriptor
