"""Contradictions: status registers that a model cannot have, so that another device has sent them."""

from __future__ import annotations

from . import registers as reg
from .model import MODELS, Model
from .registers import Registers


def contradiction(model: Model, registers: Registers) -> str:
    """The status registers that a model cannot have, as a text; empty without a contradiction.

    They are found by :func:`wrong_axes`, or set reserved bits, which are 0.
    """
    if wrong := wrong_axes(model, registers):
        return wrong
    if any(field.read(registers) for field in reg.status_reserved(model.has_modes)):
        return "bits that are always 0 in it"
    return ""


def wrong_axes(model: Model, registers: Registers) -> str:
    """The status registers that only a model with other axes has, as a text; empty if there are none.

    A sibling leaves byte 1 and bytes 6 to 14 at 0. On a 3-Finger the positions of B, C and the scissor lie
    there, which are never 0 together. All zeros prove nothing: a gateway may send them before its gripper
    answers.
    """
    has_one = not registers[0] & 0xFF and not any(registers[3:7]) and not registers[7] >> 8
    if has_one and len(model.axes) > 1 and registers[2] >> 8:
        return "one axis alone, as a 2F or a Hand-E: bytes 1 and 6 to 14 are 0"
    if not has_one and len(model.axes) == 1:
        return "more than one axis, as a 3-Finger: bytes 1 and 6 to 14 are not all 0"
    return ""


def why_stranger(registers: Registers) -> str:
    """The reason why status registers fit no model; empty if they may fit one."""
    if not all(contradiction(model, registers) for model in MODELS.values()):
        return ""
    words = " ".join(f"{word:04X}" for word in registers)
    return f"its registers {words} have bits set that are 0 in a gripper"


def names_that_fit(registers: Registers) -> str:
    """Advice to name a model that status registers do not contradict, for messages."""
    fitting = [model.name for model in MODELS.values() if not contradiction(model, registers)]
    return f"name its model: {' or '.join(f'?model={name}' for name in fitting)} at the end of the address"
