"""Whether a page and its browser are in touch, in both directions.

The server sends the time by its own clock four times a second, and the browser sends back what it got last:
with its heartbeat, and with every press of a button. So a press that was held up on its way, or made on a
page that shows what was long ago, is told apart from a fresh one (where the hand is, and the whole way behind
it), although the two clocks know nothing of each other.

It also tells when a browser that was away has got all that it missed. NiceGUI 3 sends what is newest first
then, and after it once more what was on its way when the connection was lost: that would go on being shown.
"""

from __future__ import annotations

from time import monotonic
from typing import Final

BEAT_MS: Final = 250
CUT_MS: Final = 1500
"""After this a page says that it hears nothing: what it shows is old."""
LOST_S: Final = 2.0
"""After this a page cannot be heard. A browser wakes up a tab in the background once a second."""
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
"""What a button sends."""
PRESS_WITH_VALUE: Final = "(value) => emit(window.robotiqTime, value)"
"""What a slider sends: the value that it was let go at, which is not always known here yet."""


class Heartbeat:
    """The time that one browser has sent back.

    Attributes:
        is_lost: whether it counts as out of touch.
    """

    def __init__(self) -> None:
        self.is_lost = False
        self._newest = monotonic()
        self._has_been_here = False
        self._came_back_at: float | None = None

    def begin(self) -> None:
        """It has just connected, for the first time or again."""
        self.is_lost, self._newest = False, monotonic()
        if self._has_been_here:
            self._came_back_at = self._newest
        self._has_been_here = True

    def has_caught_up(self) -> bool:
        """Whether a browser that came back has got all that it missed; true once.

        It knows a time then that it was told since: after everything else, for messages keep their order.
        """
        if self._came_back_at is None or self._newest <= self._came_back_at:
            return False
        self._came_back_at = None
        return True

    @staticmethod
    def now() -> str:
        """The script that tells the browser the time."""
        return f"robotiqHear({monotonic():.6f})"

    def heard(self, sent_back: object) -> float:
        """A heartbeat, or a press, after which it can be lost again. Returns the time that was sent back."""
        at = _time(sent_back)
        self._newest = max(self._newest, at)
        if self.is_lost and monotonic() - self._newest < LOST_S:
            self.is_lost = False
        return at

    def check(self) -> bool:
        """Whether the browser has just been lost."""
        was_lost, self.is_lost = self.is_lost, self.is_lost or monotonic() - self._newest > LOST_S
        return self.is_lost and not was_lost


def _time(sent_back: object) -> float:
    """What a browser may have sent is anything."""
    if isinstance(sent_back, bool) or not isinstance(sent_back, int | float):
        return 0.0
    return float(sent_back) if 0 <= sent_back <= monotonic() else 0.0
