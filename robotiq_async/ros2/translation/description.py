"""The robot description: a URDF as text."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Final

from ...tools.description import urdf
from ...values import Model

_REFERENCES: Final = {"parent": "link", "child": "link", "mimic": "joint"}
"""Elements of a joint that refer to another part, with the attribute that has its name."""


def robot_description(path: str, prefix: str, model: Model | str | None = None) -> str:
    """The URDF in a file, unchanged; without a path the model's URDF, with the prefix on all names.

    Raises:
        OSError: the file cannot be read.
        ValueError: it is not a URDF.
    """
    if not path:
        return prefixed(urdf(model), prefix)
    text = Path(path).read_text(encoding="utf-8")
    _parse(text, path)
    return text


def prefixed(text: str, prefix: str) -> str:
    """A URDF with a prefix on the names of its links and joints."""
    if not prefix:
        return text
    robot = _parse(text, "the description")
    for part in (*robot.findall("link"), *robot.findall("joint")):
        part.set("name", prefix + part.get("name", ""))
        for element, attribute in _REFERENCES.items():
            for reference in part.findall(element):
                reference.set(attribute, prefix + reference.get(attribute, ""))
    return ET.tostring(robot, encoding="unicode")


def _parse(text: str, where: str) -> ET.Element:
    try:
        robot = ET.fromstring(text)
    except ET.ParseError as error:
        raise ValueError(f"{where} is no URDF: {error}") from None
    if robot.tag != "robot":
        raise ValueError(f"{where} is no URDF: its root is <{robot.tag}>")
    return robot
