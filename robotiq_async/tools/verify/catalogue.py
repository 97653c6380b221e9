"""What is checked and how a check ends, and how a run ends."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from ...values.model import Model


class Assumption(NamedTuple):
    """One thing that the library takes for granted of every gripper."""

    stage: int  # the stage that checks it
    assumed: str  # what is assumed, in a sentence
    is_safety: bool = False  # whether nothing further is done when it does not hold
    of_several: bool = False  # whether it is about a gripper with several axes: a jaw has none of it


CATALOGUE: Final[dict[str, Assumption]] = {
    "host.timer": Assumption(0, "This computer's timers are at most 1 ms late."),
    "host.adapter": Assumption(0, "A USB adapter passes on what it hears within 2 ms."),
    "read.registers": Assumption(1, "Unit id, function and registers are the usual ones of the link."),
    "read.others": Assumption(1, "There are registers at the addresses of the manual, and nowhere else."),
    "read.counts": Assumption(1, "One to eight registers can be read at once."),
    "read.round_trip": Assumption(1, "A status is read within the usual poll interval."),
    "read.silence": Assumption(1, "The first read after a silence shows no fault."),
    "read.idle": Assumption(1, "It answers after a minute of silence, and has kept its activation."),
    "read.connections": Assumption(1, "A second and a third client are let in while the first reads."),
    "write.same": Assumption(2, "The image that is in force already changes nothing when written.", True),
    "write.still": Assumption(2, "With rGTO = 0 no position request moves anything.", True),
    "write.echo": Assumption(2, "A write is echoed within 20 ms of its acknowledgement."),
    "write.spacing": Assumption(2, "Of two writes the second acts, however soon it comes."),
    "activation.time": Assumption(3, "An activation takes at most 20 s."),
    "activation.words": Assumption(3, "After it no go is echoed, and every gDT is 0."),
    "axis.finger": Assumption(
        4, "A is the finger that stands alone, or the jaw; B, C and the scissor are as named.", True
    ),
    "axis.alone": Assumption(4, "An axis that is asked alone moves alone.", True, of_several=True),
    "axis.lag": Assumption(4, "gDT shows a motion as soon as its request is echoed."),
    "axis.end": Assumption(4, "An axis stops within 2 counts of its request."),
    "stop.halt": Assumption(5, "rGTO = 0 stops a motion within 10 counts.", True),
    "stop.resume": Assumption(5, "Setting rGTO again goes on to the same request."),
    "stop.target": Assumption(5, "A new request in the middle of a motion is followed at once."),
    "stop.hold": Assumption(5, "Requesting the present position stops within 10 counts.", True),
    "stroke.time": Assumption(
        6, "A full stroke takes what the thesis measured, or a sibling's manual says, within a fifth."
    ),
    "stroke.readings": Assumption(6, "Open and closed fingers read what those of the model read."),
    "stroke.scissor": Assumption(
        6, "The scissor echoes what it is asked, also beyond its limits.", of_several=True
    ),
    "soft.contact": Assumption(7, "A contact while closing is gDT = 2."),
    "soft.current": Assumption(7, "A finger at rest draws no current."),
    "soft.halt": Assumption(7, "rGTO = 0 leaves the part held."),
    "loss.client": Assumption(8, "A gripper that has lost its client goes on to its request."),
    "loss.wake": Assumption(8, "The first motion on a new connection is followed."),
    "loss.idle": Assumption(8, "The activation is kept while there is no client."),
    "loss.cable": Assumption(8, "The activation outlives a cable that was out for 5 s."),
    "loss.estop": Assumption(8, "After an emergency stop at most two resets are needed."),
    "loss.power": Assumption(8, "A gripper that comes back from a loss of power is reset."),
    "soak.reads": Assumption(9, "Fewer than one read in 10,000 fails."),
    "soak.commands": Assumption(9, "Commands at 10 to 100 Hz are followed to the last one."),
}
"""By name, in the order in which they are checked."""


def checks_of(model: Model) -> dict[str, Assumption]:
    """The assumptions about a model, by name."""
    several = len(model.axes) > 1
    return {name: each for name, each in CATALOGUE.items() if several or not each.of_several}


LAST: Final = 9  # the last stage
HARMLESS: Final = 2  # the last stage in which nothing moves
STAGE: Final = "verify stage "  # before the number, in the event that tells that a stage begins


Figure = int | float | str | bool | None | list[Any]  # what JSON takes, for the figures of a check
Options = Mapping[str, int | float]  # options of a hand, by the names of its constructor

NO_OPTIONS: Final[Options] = MappingProxyType({})


class Verdict(Enum):
    """How a check ended."""

    AS_ASSUMED = "as assumed"
    DIFFERS = "differs"
    UNTOLD = "could not be told"


@dataclass(frozen=True, slots=True)
class Check:
    """One check that was made, or could not be."""

    name: str  # of the assumption, see catalogue
    verdict: Verdict  # how it ended
    found: str  # what was found, in a sentence
    follows: str = ""  # what follows for the user, where it differs
    options: Options = field(default_factory=lambda: NO_OPTIONS)  # make the library right, where it differs
    figures: Mapping[str, Figure] = field(default_factory=dict)  # the unit ends each name

    def as_dict(self) -> dict[str, Any]:
        return {
            "name": self.name,
            "verdict": self.verdict.value,
            "found": self.found,
            "follows": self.follows,
            "options": dict(self.options),
            "figures": dict(self.figures),
        }


ENDINGS: Final = {
    "done": "every stage that was asked for has run",
    "declined": "the answer was not Enter",
    "stopped": "a key was pressed, or the terminal closed",
    "interrupted": "Ctrl-C, or a signal",
    "refused": "nothing was written: the gripper is not in a state for it",
    "link": "the link failed",
    "fault": "the gripper reports a fault",
    "envelope": "an axis left the range of its stage",
    "time": "the time of a stage was over",
    "foreign": "the gripper echoes what this program has not written",
    "inactive": "the gripper is not active, and the stage needs it",
    "deviation": "a check about safety differs",
    "disk": "the report cannot be written",
}
"""By the word in the report."""


class EndError(Exception):
    """The run ends here."""

    def __init__(self, why: str, words: str) -> None:
        assert why in ENDINGS
        super().__init__(why, words)
        self.why = why  # one of ENDINGS
        self.words = words  # what happened, in a sentence

    def __str__(self) -> str:
        return f"{self.why}: {self.words}"
