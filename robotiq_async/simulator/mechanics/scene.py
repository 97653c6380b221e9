"""The scene before the gripper, as text: ``box:40x60x80,0.3``, ``table`` or the path of an MJCF."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final

_EDGES: Final = {"box": 3, "cylinder": 2, "rod": 2, "sphere": 1}
"""The lengths that each kind of part has."""
_PART_FORM: Final = "KIND:SIZE,MASS in millimetres and kilograms, as in box:40x60x80,0.3"
_PART_TEXT: Final = re.compile(r"(?P<kind>[a-z]+):(?P<size>[0-9.x]+),(?P<mass>[0-9.]+)(@(?P<at>[0-9.]+))?")
_MOST_MM: Final = 1000.0
_MOST_KG: Final = 100.0


@dataclass(frozen=True, slots=True)
class ScenePart:
    """One rigid part.

    Attributes:
        kind: "box" (along the closing direction, across it, up), "cylinder" (diameter, height; it stands),
            "rod" (diameter, length; it lies across the fingers) or "sphere" (diameter).
        size: its lengths in millimetres.
        mass: in kilograms.
        at: None for a part that stands on the table. Else it is held, with its middle so many millimetres
            from the mounting face of the gripper, until the gripper holds it.
    """

    kind: str
    size: tuple[float, ...]
    mass: float
    at: float | None = None

    def __str__(self) -> str:
        return f"{self.kind} of {'x'.join(f'{each:g}' for each in self.size)} mm"

    @property
    def height(self) -> float:
        """The height of the part as it lies, in millimetres."""
        return self.size[0] if self.kind == "rod" else self.size[-1]


@dataclass(frozen=True, slots=True)
class Scene:
    """A table with at most one part, or a world of the user's own.

    Attributes:
        part: on the table.
        file: an MJCF with a site named ``gripper`` where the gripper is mounted; None for the table.
    """

    part: ScenePart | None = None
    file: str | None = None


def parse_scene(text: str) -> Scene:
    """Parse ``table``, a part, or the path of a file that ends in ``.xml``.

    Raises:
        ValueError: it is none of these, or a length or a mass is not above 0 and sensible.
    """
    if text == "table":
        return Scene()
    if text.endswith(".xml"):
        return Scene(file=text)
    found = _PART_TEXT.fullmatch(text)
    if found is None or found["kind"] not in _EDGES:
        kinds = ", ".join(_EDGES)
        raise ValueError(f"physics must be table, FILE.xml or {_PART_FORM} ({kinds}), got {text!r:.100}")
    kind = found["kind"]
    size = tuple(_number("size", each, _MOST_MM) for each in found["size"].split("x"))
    if len(size) != _EDGES[kind]:
        raise ValueError(f"physics: a {kind} has {_EDGES[kind]} lengths, got {found['size']}")
    at = None if found["at"] is None else _number("place", found["at"], _MOST_MM)
    return Scene(ScenePart(kind, size, _number("mass", found["mass"], _MOST_KG), at))


def _number(name: str, text: str, most: float) -> float:
    if not re.fullmatch(r"[0-9]{1,6}(\.[0-9]{1,6})?", text) or not 0 < float(text) <= most:
        raise ValueError(f"physics: {name} must be a number above 0 and at most {most:g}, got {text!r}")
    return float(text)
