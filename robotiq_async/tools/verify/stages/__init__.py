"""The ten stages, with the text for the person before each."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Final, NamedTuple

from ....values import THREE_FINGER, Model
from ..bench import Bench
from ..catalogue import HARMLESS
from . import first_motions, full_strokes, loss, reading, soak, soft_part, stopping, writing


class Stage(NamedTuple):
    """One stage."""

    number: int  # 0..9
    title: str  # a few words
    run: Callable[[Bench], Awaitable[None]]  # runs it; raises to end the run
    moves: str  # the parts that move
    how_far: str  # the distance
    how_fast: str  # the speed
    clear: str  # the place that must be clear
    lasts: str  # the duration
    jaw_moves: str = ""  # the same of a gripper with a jaw, if that is something else

    @property
    def is_moving(self) -> bool:
        """Whether fingers move."""
        return self.number > HARMLESS

    @property
    def needs_active(self) -> bool:
        """Whether the gripper must be active before."""
        return self.number > ACTIVATION

    def as_text(self, model: Model = THREE_FINGER) -> str:
        """The text for a person before it."""
        moves = self.moves if len(model.axes) > 1 else self.jaw_moves or self.moves
        lines = [f"Stage {self.number}: {self.title}", f"  moves:    {moves}"]
        if self.is_moving:
            lines += [
                f"  how far:  {self.how_far}",
                f"  how fast: {self.how_fast}",
                f"  clear:    {self.clear}",
            ]
        return "\n".join([*lines, f"  takes:    {self.lasts}"])


ACTIVATION: Final = 3  # the stage that activates
_MOVES_NOTHING: Final = ("nothing", "", "", "")
_WAY: Final = "the fingers' whole way, and the way of anything that they could push; no hand, no cable"
_GENTLY: Final = "the slowest speed (20 to 30 mm/s by the manuals), the weakest force"

STAGES: Final = (
    Stage(0, "this computer", reading.host, *_MOVES_NOTHING, "1 s"),
    Stage(1, "reading only", reading.reading, *_MOVES_NOTHING, "3 minutes"),
    Stage(
        *(2, "writing with rGTO = 0", writing.writing),
        "nothing should; stay clear: the stage checks this",
        *("", "", "", "20 s"),
    ),
    Stage(
        *(3, "activation", first_motions.activation),
        "ALL FINGERS AND THE SCISSOR; a held part falls",
        "open and close to their stops",
        "the gripper's own pace; no option sets it",
        _WAY,
        "5 to 30 s",
        jaw_moves="THE JAW; a held part falls",
    ),
    Stage(
        *(4, "one axis at a time", first_motions.single_axis),
        "A, then B, then C, then the scissor, each there and back; you say which one moved",
        "30 counts of 255, about an eighth of the way",
        *(_GENTLY, _WAY, "1 minute"),
        jaw_moves="the jaw, there and back; you say whether it moved",
    ),
    Stage(
        *(5, "stopping", stopping.stopping),
        "A, B and C together, stopped half way and turned back",
        "80 counts of 255, about a third of the way",
        "speed 64 of 255, the weakest force",
        *(_WAY, "20 s"),
        jaw_moves="the jaw, stopped half way and turned back",
    ),
    Stage(
        *(6, "full strokes", full_strokes.full_strokes),
        "the scissor to both ends, then A, B and C closed and open three times",
        "the whole way",
        "slowest, speed 64, and last the FASTEST (2 s, a jaw under 1 s), the weakest force",
        *("everything; nothing may be between the fingers", "1 minute"),
        jaw_moves="the jaw, closed and open three times, and again at speed 64 with the STRONGEST FORCE",
    ),
    Stage(
        *(7, "something soft", soft_part.soft_part),
        "A, B and C close on a block of foam that you put there, and open again",
        "until they touch it",
        *(_GENTLY, "your hands, once the foam lies there", "2 minutes"),
        jaw_moves="the jaw closes on a block of foam that you put there, and opens again; a second time FAST",
    ),
    Stage(
        *(8, "loss of client, cable and power; emergency stop", loss.loss),
        "finger A there and back, and ALL FINGERS in activations that the stage requests",
        "60 counts of 255; the activations to the stops",
        *(_GENTLY, _WAY, "10 minutes, with your hands on cable and switches"),
        jaw_moves="THE JAW, there and back, and in activations that the stage requests",
    ),
    Stage(
        *(9, "soak", soak.soak),
        "nothing for 10 minutes, then finger A back and forth",
        "15 counts of 255, about a sixteenth of the way",
        *("speed 64 of 255, the weakest force", _WAY, "11 minutes"),
        jaw_moves="nothing for 10 minutes, then the jaw back and forth",
    ),
)
"""The stages in their order."""
