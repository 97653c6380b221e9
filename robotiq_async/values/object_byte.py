"""ObjectByte: the byte of a status that has the object status of all axes."""

from __future__ import annotations

from functools import cache
from typing import NamedTuple

from .enums import Finger, ObjectStatus, names_of
from .model import Model


class ObjectByte(NamedTuple):
    """The byte with the object status of a model. Each table has an entry for each value of the byte.

    Attributes:
        shift: of the byte in register 0.
        moving: the axes that move.
        contacts: the axes that a contact stopped.
        holding: the fingers that a contact stopped while closing.
        contact_names: the names of ``contacts``.
    """

    shift: int
    moving: tuple[Finger, ...]
    contacts: tuple[Finger, ...]
    holding: tuple[Finger, ...]
    contact_names: tuple[tuple[str, ...], ...]


@cache
def object_byte_of(model: Model) -> ObjectByte:
    """The byte of a model, worked out once: statuses are decoded at every poll."""
    contacts = _masks(model, {what for what in ObjectStatus if what.is_contact})
    closing = _masks(model, {ObjectStatus.CONTACT_CLOSING})
    names = {axes: tuple(names_of(axes)) for axes in set(contacts)}
    return ObjectByte(
        shift=0 if model.object_status[0].byte else 8,
        moving=_masks(model, {ObjectStatus.IN_MOTION}),
        contacts=contacts,
        holding=tuple(axes & Finger.ABC for axes in closing),
        contact_names=tuple(names[axes] for axes in contacts),
    )


def _masks(model: Model, wanted: set[ObjectStatus]) -> tuple[Finger, ...]:
    """For each value of the byte: the axes in one of the wanted states."""
    # With numbers: the first poll waits for this, and an enumeration takes 1 us for each.
    of_axes = [(int(axis), field.shift) for axis, field in zip(model.axes, model.object_status, strict=True)]
    masks = [sum(axis for axis, shift in of_axes if byte >> shift & 3 in wanted) for byte in range(256)]
    of = {mask: Finger(mask) for mask in set(masks)}
    return tuple(of[mask] for mask in masks)
