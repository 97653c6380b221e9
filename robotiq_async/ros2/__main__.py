"""``python -m robotiq_async.ros2``: the node, if ROS is there."""

from __future__ import annotations

import asyncio
import os
import sys

NEEDS = {
    "rclpy": (
        "the node needs rclpy, which comes with ROS 2 Jazzy or later: "
        "source /opt/ros/DISTRO/setup.bash in this shell, and run it with ROS's own Python "
        "(in a virtual environment: one made with --system-site-packages)"
    ),
    "control_msgs": (
        "the node needs control_msgs with ParallelGripperCommand, which ROS 2 has since Jazzy: "
        "sudo apt install ros-DISTRO-control-msgs"
    ),
}
"""Packages that may be missing, with advice."""


def main() -> int:
    """Run the node; returns the exit code: 0 after a signal, 1 after a failure; 130 if interrupted early."""
    try:
        return _run()
    except KeyboardInterrupt:  # before the node handles signals, or while the interpreter exits
        return 130


def _run() -> int:
    try:
        import rclpy.exceptions  # noqa: PLC0415  # may be missing
        from control_msgs.action import ParallelGripperCommand  # noqa: F401, PLC0415  # may be missing

        from .node.process import serve  # noqa: PLC0415  # imports the rest of ROS
    except ImportError as error:
        _print_error(_missing(error))
        return 1
    try:
        asyncio.run(serve(sys.argv))
    except rclpy.exceptions.ROSInterruptException:
        return 130
    except Exception as error:  # noqa: BLE001  # one line for the user; the node's log has the rest
        _print_error(" ".join(str(error).split()))
        return 1
    return 0


def _missing(error: ImportError) -> str:
    module = (error.name or "").partition(".")[0]
    advice = NEEDS.get(
        module, "a package of ROS 2 is missing: source /opt/ros/DISTRO/setup.bash in this shell"
    )
    return f"{advice.replace('DISTRO', os.environ.get('ROS_DISTRO', 'jazzy'))} ({error})"


def _print_error(words: str) -> None:
    print("robotiq_async.ros2:", words, file=sys.stderr, flush=True)  # noqa: T201  # for the user


if __name__ == "__main__":
    sys.exit(main())
