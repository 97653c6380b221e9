"""Stage 7: something soft between the fingers, at the slowest speed and the weakest force."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Final

from ....values import CLOSED, SPEED_MAX, Finger, ObjectStatus, RobotiqStatus
from ..bench import Bench
from ..catalogue import EndError, Figure
from ..motions import MARGIN, are_near, in_place, resting_envelope
from ..watch import ENTER, AxesAtRest, StageWatch

SOFT_PART_S: Final = 60.0
FOAM_CLOSE_S: Final = 15.0
LEFT_S: Final = 5.0
STANDS_S: Final = 0.5

PLACE: Final = (
    "Put a block of foam between the fingers, nearly as wide as they open, so that it lies there by itself. "
    "Take your hand away. Then press Enter: the fingers close on it."
)
RELEASE: Final = "The fingers open now, and the foam falls. Keep your hands away. Enter opens them."
AGAIN: Final = "Put the foam back as it lay. Take your hand away. Enter closes the jaw on it AT FULL SPEED."
GO_OR_SKIP: Final = {ENTER: "done, continue", "s": "skip this"}
OVERRUN: Final = 10
"""Counts: one 2F-85 read a part at 91 at the slowest speed, and at 96 to 99 at full speed."""
EARLY: Final = 2
"""Counts: one 2F-85 showed a contact with or before its last motion in 3 of 9, once by 13 counts, which may
come from reading its position first."""
HELD_QUESTION: Final = "rGTO has been 0 for some seconds. Is the foam still held?"
ANSWERS: Final = {"y": "yes, it is held", "n": "no, it is loose or has fallen"}


async def soft_part(bench: Bench) -> None:
    """Close on it, stop with it held, and open."""
    person = bench.person
    if not await person.consents(PLACE):
        raise EndError("declined", "the foam was not confirmed: the fingers did not close")
    watch = bench.watch(SOFT_PART_S)
    start = await watch.look()
    home = {finger: start.position(finger) for finger in bench.fingers}
    watch.confine(resting_envelope(start, bench.fingers))
    closing = await _close(bench, watch, start)
    held = closing.end
    _judge_contact(bench, held)
    _judge_standstill(bench, closing)
    await watch.write(replace(in_place(held)).with_positions(dict.fromkeys(bench.fingers, CLOSED)))
    left = await watch.watch_for(LEFT_S)
    answer = await person.chooses(HELD_QUESTION, ANSWERS) if held.contacts else "?"
    if answer is None or not await person.consents(RELEASE):
        raise EndError("declined", "the fingers were not opened: they are still closed, with rGTO = 0")
    _judge_halt(bench, answer, held, left)
    await _open(bench, home)
    if len(bench.fingers) == 1:
        await _at_speed(bench, home, held)


async def _open(bench: Bench, home: dict[Finger, int]) -> None:
    watch = bench.watch(SOFT_PART_S)
    now = await watch.look()
    await watch.write(replace(in_place(now), go=True).with_positions(home))
    if await watch.until(lambda status: are_near(status, home, MARGIN), FOAM_CLOSE_S) is None:
        raise EndError("time", f"the fingers did not open within {FOAM_CLOSE_S:g} s")
    await watch.until_still(2.0)


async def _at_speed(bench: Bench, home: dict[Finger, int], slowly: RobotiqStatus) -> None:
    """Close a jaw on the part at full speed, if the person puts it back: it overruns a little."""
    answer = await bench.person.chooses(AGAIN, GO_OR_SKIP)
    if answer == "s" or not slowly.contacts:
        bench.inconclusive("soft.speed", "skipped" if answer == "s" else "nothing was held before")
        return
    if answer is None:
        raise EndError("declined", "the question about the foam was not answered")
    watch = bench.watch(SOFT_PART_S)
    start = await watch.look()
    watch.confine(resting_envelope(start, bench.fingers))
    held = (await _close(bench, watch, start, SPEED_MAX)).end
    if not await bench.person.consents(RELEASE):
        raise EndError("declined", "the jaw was not opened: it is still closed, with rGTO = 0")
    jaw = bench.fingers[0]
    slow, fast = slowly.position(jaw), held.position(jaw)
    figures: dict[str, Figure] = {"speed_0": slow, "speed_255": fast}
    if not held.contacts:
        bench.inconclusive("soft.speed", "nothing was held at full speed", **figures)
    else:
        words = f"it is read at {slow} at the slowest speed, and at {fast} at full speed"
        follows = "A width by a reading is that much too small: grip slowly to measure. Please report this."
        bench.judge("soft.speed", 0 <= fast - slow <= OVERRUN, words, follows, **figures)
    await _open(bench, home)


@dataclass
class _Closing:
    """Fingers that close: the time at which gDT shows rest, beside the time at which they stand.

    Attributes:
        rest: the standstill by positions.
        shown: the first of the statuses since which every gDT shows rest; None while one does not.
        end: the newest status.
    """

    fingers: tuple[Finger, ...]
    end: RobotiqStatus
    shown: RobotiqStatus | None = None
    rest: AxesAtRest = field(init=False)

    def __post_init__(self) -> None:
        self.rest = AxesAtRest(self.fingers)

    def is_over(self, status: RobotiqStatus) -> bool:
        """Take in a status; returns whether they have stood for a while, and gDT shows it."""
        stands = self.rest.lasts(status, STANDS_S)
        moves = any(status.finger_status(finger) is ObjectStatus.IN_MOTION for finger in self.fingers)
        self.shown, self.end = None if moves else self.shown or status, status
        return stands and not moves


async def _close(bench: Bench, watch: StageWatch, start: RobotiqStatus, speed: int = 0) -> _Closing:
    """Close, and wait until every finger rests."""
    image = in_place(start, speed=speed)
    await watch.write(image)
    await watch.write(replace(image, go=True).with_positions(dict.fromkeys(bench.fingers, CLOSED)))
    # gDT just after a write may be from before it.
    closing = _Closing(bench.fingers, await watch.watch_for(0.3))
    if await watch.until(closing.is_over, FOAM_CLOSE_S) is None:
        raise EndError("time", f"the fingers did not come to rest within {FOAM_CLOSE_S:g} s")
    return closing


def _judge_standstill(bench: Bench, closing: _Closing) -> None:
    """Compare the first contact that was shown with the last motion."""
    shown, end = closing.shown, closing.end
    if shown is None or not end.contacts:
        bench.inconclusive("soft.standstill", "nothing was held")
        return
    counts = max(abs(end.position(finger) - shown.position(finger)) for finger in bench.fingers)
    seconds = shown.timestamp - closing.rest.moved_at
    when = "before" if seconds < 0 else "after"
    words = f"gDT showed it {1000 * abs(seconds):.0f} ms {when} the last count; {counts} counts followed"
    follows = "A width by the result of a grasp is that much too large. Please report this."
    figures: dict[str, Figure] = {"counts": counts, "seconds": seconds}
    bench.judge("soft.standstill", counts <= EARLY, words, follows, **figures)


def _judge_contact(bench: Bench, held: RobotiqStatus) -> None:
    shown = {finger: held.finger_status(finger) for finger in bench.fingers}
    words = ", ".join(f"{finger.name} {what.name}" for finger, what in shown.items())
    if ObjectStatus.CONTACT_OPENING in shown.values():
        follows = "The codes of gDT are swapped: outcomes of moves would be wrong. Report this."
        bench.differs("soft.contact", words, follows)
    elif ObjectStatus.CONTACT_CLOSING in shown.values():
        bench.as_assumed("soft.contact", words)
    else:
        bench.inconclusive("soft.contact", f"no finger touched anything: {words}")
    currents = [held.current_ma(finger) for finger in bench.fingers]
    drawn = max(current or 0 for current in currents)
    if None in currents:
        bench.inconclusive("soft.current", "this text port does not tell the current")
    elif not held.contacts:
        bench.inconclusive("soft.current", "nothing was held")
    else:
        words = f"up to {drawn} mA while it is held" if drawn else "0 mA while it is held"
        follows = "No option is needed: a hand does not judge a grip by currents."
        bench.judge("soft.current", drawn == 0, words, follows, milliampere=drawn)


def _judge_halt(bench: Bench, answer: str, held: RobotiqStatus, left: RobotiqStatus) -> None:
    moved = max(abs(left.position(finger) - held.position(finger)) for finger in bench.fingers)
    if answer not in ANSWERS:
        bench.inconclusive("soft.halt", "nothing was held")
        return
    what = f"held for {LEFT_S:g} s" if answer == "y" else "the part came loose"
    follows = "A stop, and the end of a program without keep_grip, lets go of the part."
    bench.judge("soft.halt", answer == "y", f"{what}; fingers moved by {moved} counts", follows, counts=moved)
