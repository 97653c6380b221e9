"""Tables of a status and of the outcome of a move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

from rich import box
from rich.console import Console
from rich.table import Table

from ...tools.wording import axis_name
from ...values import Fault, Finger
from .lines import axis_words

if TYPE_CHECKING:
    from ... import MoveResult, RobotiqStatus
    from ...hands import Hand

TABLE_WIDTH: Final = 80
"""Columns that a table may have in any window, as in a pipe."""


def print_status(hand: Hand) -> None:
    """Print state and fault, one line each, then a row for every axis."""
    last = hand.status
    print(f"{hand.state.name}: {_activation(last)}, {'moving' if last.is_moving else 'not moving'}")
    if last.fault is not Fault.NONE:
        print(f"{last.fault.severity.value} fault 0x{int(last.fault):02X}: {last.fault.description}")
    if last.controller_fault:
        print(last.controller_fault_text)
    if last.part is not None:
        width = last.part.width_mm
        print(f"a part is held{'' if width is None else f', {width:.1f} mm wide ({last.stroke.source})'}")
    rows = [
        (
            last.position(axis),
            _opening(last, axis),
            last.requested_position(axis),
            axis_words(last.axis_state(axis)),
            _current(last.current_ma(axis)),
        )
        for axis in last.model.axes
    ]
    _print_table(_heads(last, "requested", "state", "mA"), last, last.model.axes, rows)


def _heads(status: RobotiqStatus, *others: str) -> tuple[str, ...]:
    return "position", f"{status.stroke.source} mm", *others


def _opening(status: RobotiqStatus, axis: Finger) -> str:
    return "-" if axis is Finger.SCISSOR else f"{status.opening_mm(axis):.1f}"


def _activation(status: RobotiqStatus) -> str:
    if status.is_activated:
        return "active"
    return "reset" if status.is_reset else "activating or changing mode"


def print_outcomes(result: MoveResult) -> None:
    """Print a row for every axis of the move, then its duration."""
    axes = list(result.outcomes)
    rows = [
        (
            result.positions[each],
            _opening(result.status, each),
            result.outcomes[each].name,
            _current(result.peak_current_ma[each]),
        )
        for each in axes
    ]
    _print_table(_heads(result.status, "outcome", "peak mA"), result.status, axes, rows)
    print(f"{result.duration:.2f} s, {'an object is in the way' if result.object_detected else 'no contact'}")


def _current(milliampere: int | None) -> str:
    return "-" if milliampere is None else str(milliampere)


def _print_table(
    heads: Sequence[str], status: RobotiqStatus, axes: Sequence[Finger], rows: Sequence[Sequence[object]]
) -> None:
    table = Table("axis", box=box.SIMPLE_HEAD)
    for head in heads:
        table.add_column(head, justify="left" if head in ("state", "outcome") else "right")
    for axis, row in zip(axes, rows, strict=True):
        table.add_row(axis_name(axis, status.model), *map(str, row))
    console = Console()
    # In a narrow window the terminal breaks the lines: an elided number would look like another one.
    console.width = max(console.width, TABLE_WIDTH)
    console.print(table)
