"""The panels of a hand: state, axes, curves, events, statistics."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from time import monotonic
from typing import Any, Final

from nicegui import ui

from ..mirror import HISTORY_S, HandMirror
from .allowed import what_helps
from .words import (
    COLORS,
    NAMES,
    axis_title,
    axis_words,
    banner_words,
    event_words,
    fault_words,
    opening_words,
    state_words,
    timed,
)

CURVES_S: Final = 0.5
COLUMN_WIDTHS: Final = (6, 4, 2, 2)
"""Widths of the curves: fingers that move together overlap, and all of them stay visible."""
CURRENT_MAX: Final = 600
"""Minimum range of the axis of the currents, in mA."""


class StatePanel:
    """State and fault."""

    def __init__(self) -> None:
        self._state = ui.badge("", color="grey").classes("text-base px-3 py-1").props("data-testid=state")
        self._fault = ui.label("").classes("text-sm").props("data-testid=fault")

    def show(self, hand: HandMirror, *, is_quiet: bool) -> None:
        words, color = state_words(hand, is_quiet=is_quiet)
        self._state.set_text(words)
        self._state.props(f"color={color}")
        words, is_serious = fault_words(hand)
        self._fault.set_text(words)
        self._fault.classes(add="rq-red" if is_serious else "", remove="" if is_serious else "rq-red")


class Banner:
    """Calls for a person, above everything: an inhibit or a fault, and the button that helps.

    ``ask`` opens the question of an action; a page that only watches has no questions.
    """

    def __init__(self, ask: Callable[[str], None] | None) -> None:
        self._ask = ask
        self._shown: tuple[str, str] = ("", "")
        self._card = ui.row().classes("w-full items-center gap-3 rq-banner").props("data-testid=banner")
        with self._card:
            self._words = ui.label("").classes("grow min-w-0").style("flex-basis:12rem")
            self._button = ui.button("", on_click=self._press, color=None)
            self._button.props("no-caps unelevated data-testid=helps").classes("rq-helps")
        self._card.set_visibility(False)

    def show(self, hand: HandMirror, *, is_quiet: bool) -> None:
        helps = what_helps(hand, is_quiet=is_quiet)
        words = banner_words(hand) if helps else ""
        if (words, helps) != self._shown:
            self._shown = words, helps
            self._words.set_text(words)
            self._button.set_text(f"{helps}...")
            self._button.set_visibility(self._ask is not None)
            self._card.set_visibility(bool(words))

    def _press(self) -> None:
        if self._ask is not None and self._shown[1]:
            self._ask(self._shown[1])


class AxesPanel:
    """For each axis its position, its requested position, its object status, and its current.

    If wide, it has one line for each axis where there is room, instead of two.
    """

    def __init__(self, *, wide: bool = False) -> None:
        self._html = ui.html("", sanitize=False).classes("w-full").props("data-testid=axes")
        self._classes = "rq-axes rq-line" if wide else "rq-axes"
        self._shown = ""

    def show(self, hand: HandMirror) -> None:
        rows = "".join(_axis_row(hand, index) for index in range(len(hand.model.axes)))
        if rows != self._shown:
            self._shown = rows
            self._html.set_content(f'<div class="{self._classes}">{rows}</div>')


def _axis_row(hand: HandMirror, index: int) -> str:
    axis, status = hand.model.axes[index], hand.status
    if status is None:
        return f'<div class="rq-axis"><b>{axis_title(hand, index)}</b></div>'
    position, wanted, current = (
        status.position(axis),
        status.requested_position(axis),
        status.current_ma(axis),
    )
    contact = " rq-contact" if axis & status.contacts and not hand.is_lost else ""
    stale = " rq-stale" if hand.is_lost else ""
    color, name = COLORS[index], axis_title(hand, index)
    does = ", ".join(filter(None, (opening_words(hand, axis), axis_words(hand, axis))))
    return (
        f'<div class="rq-axis{contact}{stale}" data-axis="{name}" data-position="{position}">'
        f'<b><i class="rq-patch" style="background:{color}"></i>{name}</b>'
        f'<span class="rq-bar"><i style="width:{position / 2.55:.1f}%;background:{color}"></i>'
        f'<u style="left:calc((100% - 3px) * {wanted / 255:.3f})"></u></span>'
        f'<span class="rq-number">{position}</span><span class="rq-wanted">&rarr; {wanted}</span>'
        f'<span class="rq-number">{"" if current is None else f"{current} mA"}</span>'
        f'<span class="rq-does">{escape(does)}</span></div>'
    )


class Curves:
    """Positions and currents of the last 30 s, drawn twice a second."""

    def __init__(self) -> None:
        self._drawn_at = 0.0
        self._positions = _chart(_options("position / counts", 255, 51))
        self._currents = _chart(_options("current / mA", CURRENT_MAX, 200))

    def show(self, hand: HandMirror) -> None:
        now = monotonic()
        if now - self._drawn_at < CURVES_S or not hand.samples:
            return
        self._drawn_at = now
        ages = [round(sample.at - now, 2) for sample in hand.samples]
        for index in range(len(hand.model.axes)):
            # A gap in the curve where nothing was known.
            places = [None if each.positions is None else each.positions[index] for each in hand.samples]
            peaks = [None if each.currents is None else each.currents[index] for each in hand.samples]
            for chart, values in ((self._positions, places), (self._currents, peaks)):
                points = [list(point) for point in zip(ages, values, strict=True)]
                chart.options["series"][index]["data"] = points
        names = [axis_title(hand, index) for index in range(len(hand.model.axes))]
        for chart in (self._positions, self._currents):
            for index, name in enumerate(names):
                chart.options["series"][index]["name"] = name
            chart.options["legend"]["data"] = names
        highest = max((max(each.currents) for each in hand.samples if each.currents), default=0)
        self._currents.options["yAxis"]["max"] = max(CURRENT_MAX, -(-highest // 200) * 200)
        self._positions.update()
        self._currents.update()


def _chart(options: dict[str, Any]) -> ui.echart:
    # Not on a canvas: its text has the colour of the page's, which no grey can be read on in light and dark.
    return ui.echart(options, renderer="svg").classes("w-full h-40 rq-chart")


def _options(title: str, highest: int, step: int) -> dict[str, Any]:
    series = [
        {
            "type": "line",
            "name": name,
            "data": [],
            "showSymbol": False,
            "lineStyle": {"width": width},
            "color": color,
            "animation": False,
        }
        for name, color, width in zip(NAMES, COLORS, COLUMN_WIDTHS, strict=True)
    ]
    quiet = {"color": "#8a8f98"}
    return {
        "animation": False,
        "title": {"text": title, "textStyle": {"fontSize": 12, **quiet}, "left": 8, "top": 2},
        "legend": {
            "right": 8,
            "top": 2,
            "textStyle": quiet,
            "icon": "roundRect",
            "itemWidth": 16,
            "itemHeight": 5,
        },
        "grid": {"left": 44, "right": 12, "top": 28, "bottom": 22},
        "xAxis": {
            "type": "value",
            "min": -HISTORY_S,
            "max": 0,
            "axisLabel": {"formatter": "{value} s", **quiet},
            "splitLine": {"show": False},
        },
        "yAxis": {
            "type": "value",
            "min": 0,
            "max": highest,
            "interval": step,
            "axisLine": {"onZero": False, "show": False},
            "axisTick": {"show": False},
            "axisLabel": quiet,
            "splitLine": {"lineStyle": {"color": "#8883"}},
        },
        "series": series,
    }


class Events:
    """Events, the newest last."""

    def __init__(self) -> None:
        ui.label("events").classes("text-xs font-bold opacity-60 -mb-2")
        self._log = ui.log(max_lines=100).classes("w-full h-32 text-xs").props("data-testid=events")
        self._shown = -1

    def show(self, hand: HandMirror) -> None:
        """Add the new events; at first also the events from before the page was opened."""
        is_first, self._shown = self._shown < 0, max(self._shown, 0)
        for number, event in hand.events:
            if number > self._shown:
                self._shown = number
                self._log.push(event_words(event))
        if is_first:
            self._log.push(timed("this page was opened"))

    def add(self, words: str) -> None:
        """Add a line of this page."""
        self._log.push(words)


class StatisticsPanel:
    """Polling statistics."""

    def __init__(self) -> None:
        self._label = ui.label("").classes("text-xs opacity-70").props("data-testid=statistics")

    def show(self, hand: HandMirror) -> None:
        figures = hand.statistics
        if not figures:
            return
        moves = ", ".join(f"{name} {number}" for name, number in figures["moves"].items()) or "none"
        self._label.set_text(
            f"{figures['polls']} polls, period {1000 * figures['period_p50']:.2f} ms"
            f" (99 %: {1000 * figures['period_p99']:.2f}),"
            f" round trip {1000 * figures['round_trip_p50']:.2f} ms"
            f" (99 %: {1000 * figures['round_trip_p99']:.2f}); {figures['overruns']} overruns,"
            f" {figures['reconnects']} reconnects, {figures['foreign_commands']} commands of others,"
            f" {figures['faults']} faults; moves: {moves}"
        )
