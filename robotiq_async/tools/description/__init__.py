"""The grippers in three dimensions: one description of each, and the URDF and MJCF written from it."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from ...values.model import HAND_E, THREE_FINGER, Model, model_of
from .geometry import Pose
from .hand_e import hand_e
from .model import HandModel, Joint, Link, Mimic, Shape, Tendon
from .three_finger import three_finger
from .two_finger import two_finger

__all__ = ["HandModel", "Joint", "Link", "Mimic", "Pose", "Shape", "Tendon", "hand_model", "mjcf", "urdf"]


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
