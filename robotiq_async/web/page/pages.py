"""The pages: one hand, or a tile for each of many; and how long a browser looks at them."""

from __future__ import annotations

from collections.abc import Callable
from datetime import datetime
from time import monotonic
from typing import Final

from nicegui import Client, ui

from .controls import Controls
from .mirror import HandMirror, Mirror
from .panels import AxesPanel, Curves, Events, StatePanel, StatisticsPanel
from .scene import HandScene
from .touch import BEAT_MS, SCRIPT, Touch

REFRESH_S: Final = 0.05
STAGE: Final = "h-[42vh] lg:h-[calc(100vh-13rem)] lg:sticky lg:top-16 min-h-[280px]"
"""How large the scene is: a part of a phone, and all that is left of a wide window."""
STYLE: Final = """
<style>
.rq-axes { display: grid; gap: .35rem; width: 100%; }
.rq-axis { display: grid; grid-template-columns: 4.2rem 1fr 2.2rem 3.6rem 4.2rem; gap: .1rem .6rem;
  align-items: center;
  border-left: 4px solid transparent; padding-left: .4rem; font-variant-numeric: tabular-nums; }
.rq-bar { position: relative; height: .8rem; border-radius: .4rem; background: #8883; overflow: hidden; }
.rq-bar i { position: absolute; inset: 0 auto 0 0; }
.rq-bar u { position: absolute; top: 0; bottom: 0; width: 3px; margin-left: -1px; background: currentColor; }
.rq-number { text-align: right; }
.rq-does { grid-column: 2 / -1; font-size: .75rem; opacity: .75; min-height: 1rem; }
.rq-contact { border-color: #ff5a1f; }
.rq-contact .rq-does { color: #ff5a1f; opacity: 1; font-weight: 600; }
.rq-stale { opacity: .45; }
.rq-halt { min-height: 4rem; font-size: 1.5rem !important; font-weight: 700; letter-spacing: .1em; }
.nicegui-content { padding: .75rem; padding-bottom: 6rem; }
</style>
"""


class Visits:
    """Who looks: counts the browsers, and notices when one is gone."""

    def __init__(self, mirror: Mirror) -> None:
        """Nobody does yet."""
        self._mirror = mirror
        self._present: set[str] = set()

    def begin(self, client: Client) -> Touch:
        """A page is being made."""
        touch = Touch()
        client.on_connect(lambda: self._arrive(client.id, touch))
        client.on_disconnect(lambda: self._leave(client))
        client.on_delete(lambda: self._leave(client))
        ui.on("beat", lambda event: touch.heard(event.args))

        def look() -> None:
            ui.run_javascript(Touch.now())
            if touch.check():
                self._mirror.gone(client.id)

        ui.timer(BEAT_MS / 1000, look)
        return touch

    def _arrive(self, page: str, touch: Touch) -> None:
        touch.begin()
        self._present.add(page)
        self._mirror.count(len(self._present))

    def _leave(self, client: Client) -> None:
        self._mirror.gone(client.id)
        # A browser that came back may be heard of before its old connection is found to have ended.
        if not client.has_socket_connection:
            self._present.discard(client.id)
        self._mirror.count(len(self._present))


def register(mirror: Mirror) -> None:
    """Make the pages known to NiceGUI."""
    visits = Visits(mirror)

    @ui.page("/")
    def front(client: Client) -> None:
        if len(mirror.hands) == 1:
            _hand_page(mirror, mirror.hands[0], client, visits)
        else:
            _tiles(mirror, client, visits)

    @ui.page("/hand/{index}")
    def one(client: Client, index: int) -> None:
        if 0 <= index < len(mirror.hands):
            _hand_page(mirror, mirror.hands[index], client, visits)
        else:
            ui.label(f"There is no hand {index}: there are {len(mirror.hands)}.")


def _frame(title: str, *, home: bool) -> None:
    ui.add_head_html(STYLE)
    ui.add_body_html(SCRIPT)
    dark = ui.dark_mode(None)
    with ui.header().classes("items-center no-wrap gap-3 py-2 px-4 bg-slate-800"):
        if home:
            ui.button(icon="arrow_back", on_click=lambda: ui.navigate.to("/")).props(
                "flat round dense color=white"
            )
        ui.label("Robotiq 3-Finger").classes("text-base font-bold whitespace-nowrap")
        ui.label(title).classes("text-sm opacity-80 truncate").props("data-testid=address")
        ui.space()
        with ui.button_group().props("flat"):
            for icon, value in (("light_mode", False), ("brightness_auto", None), ("dark_mode", True)):
                button = ui.button(icon=icon, on_click=lambda value=value: dark.set_value(value))
                button.props(f"flat dense color=white data-testid={icon}")


def _hand_page(mirror: Mirror, hand: HandMirror, client: Client, visits: Visits) -> None:
    _frame(hand.address, home=len(mirror.hands) > 1)
    touch = visits.begin(client)
    shown: list[Callable[[], None]] = []
    with ui.element("div").classes("grid w-full gap-3 grid-cols-1 lg:grid-cols-2"):
        with ui.column().classes("w-full gap-2"):
            with ui.row().classes("w-full items-center gap-3"):
                state = StatePanel()
            with ui.element("div").classes(f"{STAGE} w-full rounded overflow-hidden"):
                scene = HandScene()
        with ui.column().classes("w-full gap-3"):
            axes = AxesPanel()
            place = ui.column().classes("w-full gap-3")
            curves = Curves()
            events, statistics = Events(), StatisticsPanel()
    shown += [
        lambda: state.show(hand, is_quiet=mirror.is_quiet),
        lambda: scene.show(hand),
        lambda: axes.show(hand),
        lambda: curves.show(hand),
        lambda: events.show(hand),
        lambda: statistics.show(hand),
    ]
    if mirror.control:
        with place:
            controls = Controls(mirror, hand, client.id, touch, lambda words: events.add(_timed(words)))
        _halt_button("halt", "stops every axis", controls.halt)
    else:
        with place:
            hint = ui.label("This page only looks: start it with --control to command from here.")
            hint.classes("text-sm opacity-70").props("data-testid=read-only")
    ui.timer(REFRESH_S, lambda: [show() for show in shown])


def _halt_button(name: str, what: str, halt: Callable[[], None]) -> None:
    """At the foot of the window, wherever the page is scrolled to."""
    ui.on("space", halt)
    with ui.footer().classes("p-2 bg-transparent"):
        button = ui.button(name, on_click=halt, color="red-8").classes("w-full rq-halt")
        button.props("data-testid=halt").tooltip(f"{what}; the space bar does it too")


def _timed(words: str) -> str:
    return f"{datetime.now().astimezone():%H:%M:%S.%f}"[:-4] + f"  {words}"


def _tiles(mirror: Mirror, client: Client, visits: Visits) -> None:
    _frame(f"{len(mirror.hands)} hands", home=False)
    visits.begin(client)
    with ui.element("div").classes("grid w-full gap-3 grid-cols-1 sm:grid-cols-2 xl:grid-cols-3"):
        shown = [_tile(mirror, hand) for hand in mirror.hands]
    if mirror.control:
        _halt_button("halt all", "stops every axis of every hand", lambda: _halt_all(mirror, client.id))
    ui.timer(2 * REFRESH_S, lambda: [show() for show in shown])


def _halt_all(mirror: Mirror, page: str) -> None:
    for hand in mirror.hands:
        mirror.ask(page, hand.index, "halt", {}, lambda *_: None, at=monotonic())


def _tile(mirror: Mirror, hand: HandMirror) -> Callable[[], None]:
    with ui.card().classes("w-full cursor-pointer").props(f"data-testid=tile-{hand.index}") as card:
        card.on("click", lambda: ui.navigate.to(f"/hand/{hand.index}"))
        ui.label(hand.address).classes("font-bold")
        with ui.row().classes("w-full items-center gap-3"):
            state = StatePanel()
        with ui.element("div").classes("w-full h-56 pointer-events-none"):
            scene = HandScene(compact=True)
        axes = AxesPanel()

    def show() -> None:
        state.show(hand, is_quiet=mirror.is_quiet)
        scene.show(hand)
        axes.show(hand)

    return show
