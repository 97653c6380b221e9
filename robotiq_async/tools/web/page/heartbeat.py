"""The contact between a page and its browser, in both directions.

The server sends its time four times a second. The browser sends the last time it received back: with its
heartbeat, and with every press of a button. So a stale press (delayed on its way, or made on a page that
shows old values) differs from a fresh one on the whole way to the hand, and the clocks need not agree.

It also notices when a returning browser has caught up. NiceGUI 3 first sends the newest values, then again
the messages that were on their way when the connection was lost: these old values would stay on the screen.
"""

from __future__ import annotations

from time import monotonic
from typing import Final

BEAT_MS: Final = 250
CUT_MS: Final = 1500
"""Silence in ms after which a page warns that its values are old."""
PAGE_LOST_S: Final = 2.0
"""Silence in seconds after which a browser counts as lost. It wakes up a background tab once a second."""
SCRIPT: Final = f"""
<script>
window.robotiqTime = 0;
window.robotiqHeard = performance.now();
window.robotiqHear = (time) => {{ robotiqTime = time; robotiqHeard = performance.now(); }};
setInterval(() => {{
  document.body.classList.toggle('rq-cut', performance.now() - robotiqHeard > {CUT_MS});
  if (window.socket && window.socket.connected) emitEvent('beat', window.robotiqTime);
}}, {BEAT_MS});
for (const kind of ['keydown', 'keyup']) {{
  // Before any button that has the focus: the space bar halts, and does nothing else.
  document.addEventListener(kind, (event) => {{
    if (event.code !== 'Space') return;
    event.preventDefault();
    event.stopImmediatePropagation();
    if (kind === 'keydown' && !event.repeat) emitEvent('space');
  }}, true);
}}
</script>
"""
PRESS: Final = "() => emit(window.robotiqTime)"
"""The handler of a button."""
PRESS_WITH_VALUE: Final = "(value) => emit(window.robotiqTime, value)"
"""The handler of a slider. It sends the final value, which the server may not have yet."""


class Heartbeat:
    """The time that one browser has sent back."""

    def __init__(self) -> None:
        self.is_lost: bool = False  # whether the browser counts as out of touch
        self._newest = monotonic()
        self._has_been_here = False
        self._came_back_at: float | None = None

    def begin(self) -> None:
        """Note that the browser has connected, for the first time or again."""
        self.is_lost, self._newest = False, monotonic()
        if self._has_been_here:
            self._came_back_at = self._newest
        self._has_been_here = True

    def has_caught_up(self) -> bool:
        """Whether a returning browser has caught up; true once.

        It has sent back a time from after its return. Messages keep their order, so it has received the older
        ones.
        """
        if self._came_back_at is None or self._newest <= self._came_back_at:
            return False
        self._came_back_at = None
        return True

    @staticmethod
    def now() -> str:
        """The script that sends the time to the browser."""
        return f"robotiqHear({monotonic():.6f})"

    def heard(self, sent_back: object) -> float:
        """Note a heartbeat or a press; returns the time that was sent back."""
        at = _time(sent_back)
        self._newest = max(self._newest, at)
        if self.is_lost and monotonic() - self._newest < PAGE_LOST_S:
            self.is_lost = False
        return at

    def check(self) -> bool:
        """Whether the browser has just been lost."""
        was_lost, self.is_lost = self.is_lost, self.is_lost or monotonic() - self._newest > PAGE_LOST_S
        return self.is_lost and not was_lost


def _time(sent_back: object) -> float:
    # A browser may send anything.
    if isinstance(sent_back, bool) or not isinstance(sent_back, int | float):
        return 0.0
    return float(sent_back) if 0 <= sent_back <= monotonic() else 0.0
