"""Tables of a status and of the outcome of a move."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from rich import box
from rich.console import Console
from rich.table import Table

from ...values.enums import Fault, Finger
from .lines import axis_words

if TYPE_CHECKING:
    from ... import MoveResult, RobotiqStatus
    from ...hand import Hand


def print_status(hand: Hand) -> None:
    """Print state and fault, one line each, then a row for every axis."""
    last = hand.status
    print(f"{hand.state.name}: {_activation(last)}, {'moving' if last.is_moving else 'not moving'}")
    if last.fault is not Fault.NONE:
        print(f"{last.fault.severity.value} fault 0x{int(last.fault):02X}: {last.fault.description}")
    rows = [
        (
            last.position(axis),
            last.requested_position(axis),
            axis_words(last.axis_state(axis)),
            last.current_ma(axis),
        )
        for axis in last.model.axes
    ]
    _print_table(("position", "requested", "state", "mA"), last.model.axes, rows)


def _activation(status: RobotiqStatus) -> str:
    if status.is_activated:
        return "active"
    return "reset" if status.is_reset else "activating or changing mode"


def print_outcomes(result: MoveResult) -> None:
    """Print a row for every axis of the move, then its duration."""
    axes = list(result.outcomes)
    rows = [
        (result.positions[each], result.outcomes[each].name, result.peak_current_ma[each]) for each in axes
    ]
    _print_table(("position", "outcome", "peak mA"), axes, rows)
    print(f"{result.duration:.2f} s, {'an object is in the way' if result.object_detected else 'no contact'}")


def _print_table(heads: Sequence[str], axes: Sequence[Finger], rows: Sequence[Sequence[object]]) -> None:
    table = Table("axis", box=box.SIMPLE_HEAD)
    for head in heads:
        table.add_column(head, justify="left" if head in ("state", "outcome") else "right")
    for axis, row in zip(axes, rows, strict=True):
        table.add_row(axis.name, *map(str, row))
    Console().print(table)
