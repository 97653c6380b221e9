"""The hand in three dimensions: its URDF, and the poses of its links at given joint angles."""

from __future__ import annotations

from functools import cache
from importlib.resources import files

from .geometry import Pose
from .model import HandModel, Joint, Link, Shape

__all__ = ["HandModel", "Joint", "Link", "Pose", "Shape", "hand_model", "urdf"]


@cache
def urdf() -> str:
    """The URDF as text, which ROS calls ``/robot_description``."""
    return (files("robotiq_async") / "data" / "robotiq_3f.urdf").read_text(encoding="utf-8")


@cache
def hand_model() -> HandModel:
    """The parsed URDF."""
    return HandModel.parse(urdf())
