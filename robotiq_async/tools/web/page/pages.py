"""The pages: one hand, or a tile for each of several; and the sessions of browsers."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from time import monotonic
from typing import Final

from nicegui import Client, ui
from nicegui.events import GenericEventArguments

from .heartbeat import BEAT_MS, SCRIPT, Heartbeat
from .mirror import HandMirror, PageMirror
from .widgets.controls import Controls
from .widgets.panels import AxesPanel, Banner, Curves, Events, StatePanel, StatisticsPanel
from .widgets.scene import HandScene
from .widgets.words import timed

REFRESH_S: Final = 0.05
STAGE_CLASSES: Final = "h-[36vh] lg:h-[calc(100dvh-14rem)] lg:sticky lg:top-0 min-h-[250px]"
"""Size of the scene: part of a phone, the free height of a wide window."""
SCENES_MAX: Final = 12
"""Tiles with a scene: with more than about sixteen, browsers drop the first ones."""
THEME: Final = {"primary": "#1a5fb4", "positive": "#1b7a34", "negative": "#b3261e", "warning": "#7d5200"}
"""Backgrounds of white text: a contrast of 4.5 and more."""
STYLE: Final = """
<style>
.rq-axes { display: grid; gap: .35rem; width: 100%; }
.rq-axis { display: grid; grid-template-columns: 4.2rem 1fr 2.2rem 3.6rem 4.2rem; gap: .1rem .6rem;
  align-items: center;
  border-left: 4px solid transparent; padding-left: .4rem; font-variant-numeric: tabular-nums; }
.rq-bar { position: relative; height: .8rem; border-radius: .4rem; background: #8883; }
.rq-bar i { position: absolute; inset: 0 auto 0 0; border-radius: .4rem; }
.rq-bar u { position: absolute; top: -3px; bottom: -3px; width: 3px; background: currentColor; }
.rq-number { text-align: right; }
.rq-does { grid-column: 2 / -1; font-size: .75rem; opacity: .75; min-height: 1rem; }
.rq-patch { display: inline-block; width: .7rem; height: .7rem; border-radius: 2px; margin-right: .35rem; }
.rq-name { border-left: .7rem solid transparent; padding-left: .35rem; line-height: 1; }
.rq-contact { border-color: #ff5a1f; }
.rq-contact .rq-does { color: #b93c0c; opacity: 1; font-weight: 600; }
.body--dark .rq-contact .rq-does { color: #ff8a5c; }
.rq-banner { background: #b00020; color: #fff; padding: .5rem .75rem; border-radius: 4px; }
.rq-helps { background: #fff !important; color: #8c0019 !important; font-weight: 700; }
.rq-chart text { fill: currentColor; opacity: .75; }
.rq-stale { opacity: .66; filter: grayscale(1); }
.rq-stale .rq-does { opacity: 1; }
@media (min-width: 1200px) {
  .rq-line .rq-axis { grid-template-columns: 4.2rem 1fr 2.2rem 3.6rem 4.2rem 8.5rem; min-height: 1.7rem; }
  .rq-line .rq-does { grid-column: auto; min-height: 0; }
}
/* The foot covers nothing: the part above it scrolls by itself. */
.rq-foot { z-index: 7000; height: 5rem; background: #fff; }
.body--dark .rq-foot { background: #121212; }
.rq-halt { min-height: 4rem; font-size: 1.5rem !important; font-weight: 700; letter-spacing: .1em;
  background: #b3121d !important; color: #fff !important; }
.rq-halt.rq-vain { background: #5b6169 !important; font-size: 1.1rem !important; letter-spacing: 0; }
.rq-stage { border-radius: 4px; overflow: hidden; }
.body--dark .rq-stage { filter: brightness(.8); }
.rq-red { color: #c10015; }
.body--dark .rq-red { color: #ff7b72; }
.rq-cut-words { display: none; position: fixed; top: 3.5rem; left: 50%; translate: -50%; z-index: 7000;
  width: max-content; max-width: calc(100vw - 1.5rem); padding: .6rem 1rem; border-radius: 4px;
  background: #b00020; color: #fff; font-weight: 600; box-shadow: 0 2px 8px #0008; }
.rq-cut .rq-cut-words { display: block; }
.rq-cut .nicegui-content { opacity: .4; filter: grayscale(1); }
.rq-cut .rq-halt { filter: grayscale(1); }
#popup { display: none; }
.nicegui-content { padding: .75rem; height: calc(100dvh - 3.25rem); overflow-y: auto; }
body:has(.rq-foot) .nicegui-content { height: calc(100dvh - 8.25rem); }
.q-header { height: 3.25rem; }
</style>
"""
CUT: Final = """
<div class="rq-cut-words" role="alert" data-testid="cut">
No connection to robotiq-async: what is shown is old{}.</div>
"""
HALTS: Final = (
    "stops every axis, and motion stays refused until a person permits it; the space bar does it, too"
)
PRESSED: Final = ", and nothing that is pressed here arrives, HALT neither"


class PageSessions:
    """Counts the browsers, notices a lost browser, and resends everything to a browser that returns."""

    def __init__(self, mirror: PageMirror) -> None:
        self._mirror = mirror
        self._present: set[str] = set()

    def begin(self, client: Client) -> Heartbeat:
        """Start the session of a page that is being built."""
        heartbeat = Heartbeat()
        client.on_connect(lambda: self._arrive(client.id, heartbeat))
        client.on_disconnect(lambda: self._leave(client))
        client.on_delete(lambda: self._leave(client))

        def beat(event: GenericEventArguments) -> None:
            heartbeat.heard(event.args)
            if heartbeat.has_caught_up():
                for element in list(client.elements.values()):
                    element.update()

        def look() -> None:
            ui.run_javascript(Heartbeat.now())
            if heartbeat.check():
                self._mirror.gone(client.id)

        ui.on("beat", beat)
        ui.timer(BEAT_MS / 1000, look)
        return heartbeat

    def _arrive(self, page: str, heartbeat: Heartbeat) -> None:
        heartbeat.begin()
        self._present.add(page)
        self._mirror.count(len(self._present))

    def _leave(self, client: Client) -> None:
        self._mirror.gone(client.id)
        # A browser may connect again before its old connection is known to have ended.
        if not client.has_socket_connection:
            self._present.discard(client.id)
        self._mirror.count(len(self._present))


def register(mirror: PageMirror) -> None:
    """Register the pages with NiceGUI."""
    sessions = PageSessions(mirror)

    @ui.page("/")
    def front(client: Client) -> None:
        if len(mirror.hands) == 1:
            _hand_page(mirror, mirror.hands[0], client, sessions)
        else:
            _tiles(mirror, client, sessions)

    @ui.page("/hand/{index}")
    def one(client: Client, index: int) -> None:
        if 0 <= index < len(mirror.hands):
            _hand_page(mirror, mirror.hands[index], client, sessions)
        else:
            ui.label(f"There is no hand {index}: there are {len(mirror.hands)}.")


def _frame(title: str, mirror: PageMirror, *, home: bool) -> None:
    ui.colors(**THEME)
    ui.add_head_html(STYLE)
    ui.add_body_html(CUT.format(PRESSED if mirror.control else "") + SCRIPT)
    dark = ui.dark_mode(None)
    with ui.header().classes("items-center no-wrap gap-3 py-2 px-4 bg-slate-800"):
        if home:
            ui.button(icon="arrow_back", on_click=lambda: ui.navigate.to("/")).props(
                "flat round dense color=white"
            )
        ui.label("Robotiq gripper").classes("text-base font-bold whitespace-nowrap max-sm:hidden")
        ui.label(title).classes("text-sm opacity-80 truncate").props("data-testid=address")
        ui.space()
        with ui.button_group().props("flat"):
            for icon, value in (("light_mode", False), ("brightness_auto", None), ("dark_mode", True)):
                button = ui.button(icon=icon, on_click=lambda value=value: dark.set_value(value))
                button.props(f"flat dense color=white data-testid={icon}")


def _hand_page(mirror: PageMirror, hand: HandMirror, client: Client, sessions: PageSessions) -> None:
    _frame(hand.address, mirror, home=len(mirror.hands) > 1)
    heartbeat = sessions.begin(client)
    shown: list[Callable[[], None]] = []
    controls: list[Controls] = []
    with ui.element("div").classes("grid w-full gap-3 grid-cols-1 lg:grid-cols-2"):
        with ui.column().classes("w-full gap-2"):
            banner = Banner((lambda name: controls[0].ask(name)) if mirror.control else None)
            with ui.row().classes("w-full items-center gap-3"):
                state = StatePanel()
            with ui.element("div").classes(f"{STAGE_CLASSES} w-full rq-stage"):
                scene = HandScene()
        with ui.column().classes("w-full gap-3"):
            axes = AxesPanel(wide=True)
            place = ui.column().classes("w-full gap-3")
            curves = Curves()
            events, statistics = Events(), StatisticsPanel()
    shown += [
        lambda: banner.show(hand, is_quiet=mirror.is_quiet),
        lambda: state.show(hand, is_quiet=mirror.is_quiet),
        lambda: scene.show(hand),
        lambda: axes.show(hand),
        lambda: curves.show(hand),
        lambda: events.show(hand),
        lambda: statistics.show(hand),
    ]
    if mirror.control:
        with place:
            of_hand = Controls(mirror, hand, client.id, heartbeat, lambda words: events.add(timed(words)))
        controls.append(of_hand)
        shown.append(of_hand.show)
        shown.append(_halt_button("halt", of_hand.halt, mirror, [hand]))
    else:
        with place:
            hint = ui.label("This page only watches. To command from a page: robotiq-async web --control")
            hint.classes("text-sm opacity-70").props("data-testid=read-only")
    ui.timer(REFRESH_S, lambda: [show() for show in shown])


def _halt_button(
    name: str, halt: Callable[[], None], mirror: PageMirror, hands: Sequence[HandMirror]
) -> Callable[[], None]:
    # At the foot of the window, also on a scrolled page, and above an open question.
    ui.on("space", halt)
    with ui.footer().classes("p-2 rq-foot"):
        button = ui.button(name, on_click=halt, color=None).classes("w-full rq-halt")
        button.props(f'data-testid=halt title="{HALTS}"')
    shown: list[str] = [name]

    def show() -> None:
        # A press still counts: moving axes are held once the link is back, and motion stays refused.
        arrives = not mirror.is_quiet and not all(hand.is_lost or hand.problem for hand in hands)
        words = name if arrives else f"{name}: does not arrive now"
        if words != shown[0]:
            shown[0] = words
            button.set_text(words)
            button.classes(add="" if arrives else "rq-vain", remove="rq-vain" if arrives else "")

    return show


def _tiles(mirror: PageMirror, client: Client, sessions: PageSessions) -> None:
    _frame(f"{len(mirror.hands)} hands", mirror, home=False)
    sessions.begin(client)
    with ui.element("div").classes("grid w-full gap-3 grid-cols-1 sm:grid-cols-2 xl:grid-cols-3"):
        shown = [_tile(mirror, hand) for hand in mirror.hands]
    if mirror.control:
        shown.append(_halt_button("halt all", lambda: _halt_all(mirror, client.id), mirror, mirror.hands))
    ui.timer(2 * REFRESH_S, lambda: [show() for show in shown])


def _halt_all(mirror: PageMirror, page: str) -> None:
    for hand in mirror.hands:
        mirror.ask(page, hand.index, "halt", {}, lambda *_: None, at=monotonic())


def _tile(mirror: PageMirror, hand: HandMirror) -> Callable[[], None]:
    # A link, so that it can be opened in another tab and by keyboard.
    link = ui.link(target=f"/hand/{hand.index}").classes(replace="w-full text-inherit no-underline")
    with link.props(f"data-testid=tile-{hand.index}"), ui.card().classes("w-full"):
        ui.label(hand.address).classes("font-bold")
        with ui.row().classes("w-full items-center gap-3"):
            state = StatePanel()
        scene = None
        if len(mirror.hands) <= SCENES_MAX:
            with ui.element("div").classes("w-full h-56 pointer-events-none rq-stage"):
                scene = HandScene(compact=True)
        axes = AxesPanel()

    def show() -> None:
        state.show(hand, is_quiet=mirror.is_quiet)
        if scene is not None:
            scene.show(hand)
        axes.show(hand)

    return show
