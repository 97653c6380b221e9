"""The grippers in three dimensions: one description of each, and the URDF, SRDF and MJCF written from it."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from ...values import HAND_E, THREE_FINGER, Model, model_of
from .geometry import Pose
from .hand_e import hand_e
from .kinematics import named_states
from .model import HandModel, Joint, Mimic, RigidLink, Shape, Tendon
from .srdf_writer import write_srdf
from .three_finger import three_finger
from .two_finger import two_finger

__all__ = [
    "HandModel",
    "Joint",
    "Mimic",
    "Pose",
    "RigidLink",
    "Shape",
    "Tendon",
    "hand_model",
    "mjcf",
    "srdf",
    "urdf",
]


def hand_model(model: Model | str | None = None) -> HandModel:
    """The description of a model; None for a 3-Finger.

    Raises:
        TypeError: not a Model or a name.
        ValueError: no model has this name.
    """
    kind = model_of(model)
    if kind is THREE_FINGER:
        return three_finger()
    return hand_e() if kind is HAND_E else two_finger(kind)


def urdf(model: Model | str | None = None) -> str:
    """The URDF of a model as text, which ROS calls ``/robot_description``; None for a 3-Finger.

    Raises:
        TypeError: not a Model or a name.
        ValueError: no model has this name.
    """
    return _packaged(model_of(model), "urdf")


def srdf(model: Model | str | None = None, prefix: str = "") -> str:
    """The SRDF of a model as text, which MoveIt wants beside the URDF; None for a 3-Finger.

    The group ``gripper`` has the states ``open`` and ``closed``. Collisions between links of the gripper are
    disabled. Joints that no motor drives are passive.

    Args:
        model: or its name.
        prefix: stands before the names of links, joints and the group, as ``joint_prefix`` of the ROS 2 node.

    Raises:
        TypeError: not a Model or a name.
        ValueError: no model has this name.
    """
    kind = model_of(model)
    return write_srdf(hand_model(kind), named_states(kind), prefix)


def mjcf(model: Model | str | None = None) -> str:
    """The MJCF of a model as text, for MuJoCo; None for a 3-Finger.

    Raises:
        TypeError: not a Model or a name.
        ValueError: no model has this name.
    """
    return _packaged(model_of(model), "xml")


@cache
def _packaged(model: Model, ending: str) -> str:
    name = f"robotiq_{model.name.replace('-', '_')}.{ending}"
    return (files("robotiq_async") / "data" / name).read_text(encoding="utf-8")
