"""The robot description: a URDF as text."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Final

from ...tools.description import urdf

_REFERENCES: Final = {"parent": "link", "child": "link", "mimic": "joint"}
"""Elements of a joint that name another part, and how."""


def robot_description(path: str, prefix: str) -> str:
    """The URDF of a file as it is, or the packaged one with the prefix before its links and joints.

    Args:
        path: of a file; empty for the packaged one.
        prefix: of the joints.

    Raises:
        OSError: the file cannot be read.
        ValueError: the file is no URDF.
    """
    if not path:
        return prefixed(urdf(), prefix)
    text = Path(path).read_text(encoding="utf-8")
    _parse(text, path)
    return text


def prefixed(text: str, prefix: str) -> str:
    """A URDF whose links and joints have a prefix before their names.

    Raises:
        ValueError: it is no URDF.
    """
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
