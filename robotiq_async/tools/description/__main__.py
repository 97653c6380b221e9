"""Writes the URDF and the MJCF of every model into the package's data: ``python -m`` this package."""

from __future__ import annotations

from pathlib import Path
from typing import Final

from ...values import HAND_E, MODELS, THREE_FINGER, Model
from . import hand_model
from .kinematics import FINGER_NAMES
from .mjcf_writer import write_mjcf
from .urdf_writer import write_urdf

DATA: Final = Path(__file__).parents[2] / "data"


def written(model: Model) -> dict[str, str]:
    """The files of a model by name."""
    name, description = f"robotiq_{model.name.replace('-', '_')}", hand_model(model)
    note = _note(model)
    return {f"{name}.urdf": write_urdf(description, note), f"{name}.xml": write_mjcf(description, note)}


def _note(model: Model) -> str:
    where = "three_finger" if model is THREE_FINGER else "hand_e" if model is HAND_E else "two_finger"
    words = (
        f"The Robotiq {model.title} out of boxes, cylinders and spheres, written from"
        f" robotiq_async.tools.description.{where}, which has the source of every dimension. Nothing of it"
        " was measured on a gripper: look and simulate with it, and do not plan close to things. Metres,"
        " radians, kilograms."
    )
    if model is not THREE_FINGER:
        return words
    named = ", ".join(f"{name} is {finger.name}" for finger, name in FINGER_NAMES.items())
    return f"{words} {named}: docs/decisions/finger-names.md says why."


def main() -> None:
    """Write all of them."""
    for model in MODELS.values():
        for name, text in written(model).items():
            (DATA / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
