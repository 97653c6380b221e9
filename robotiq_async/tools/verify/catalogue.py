"""The checks, their results, and the endings of a run."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from ...values import Model


class Assumption(NamedTuple):
    """One assumption of the library about every gripper."""

    stage: int  # the stage that checks it
    assumed: str  # the assumption, in a sentence
    is_safety: bool = False  # whether the run ends when it does not hold
    of_several: bool = False  # whether it is about several axes, and so not about a jaw
    of_lines: bool = False  # whether it is about serial lines alone
    of_registers: bool = False  # whether it is about registers, and so not about the variables of a URCap
    of_jaws: bool = False  # whether it is about a jaw alone


TCP: Final = "tcp"
URCAP: Final = "urcap"
"""Kinds of links, as addresses have them."""

CATALOGUE: Final[dict[str, Assumption]] = {
    "host.timer": Assumption(0, "This computer's timers are at most 1 ms late."),
    "host.adapter": Assumption(0, "A USB adapter passes on bytes within 2 ms."),
    "read.registers": Assumption(
        1, "Unit id, function and registers are the defaults of the link.", of_registers=True
    ),
    "read.others": Assumption(
        1, "There are registers at the addresses of the manual, and nowhere else.", of_registers=True
    ),
    "read.counts": Assumption(1, "One to eight registers can be read at once.", of_registers=True),
    "read.round_trip": Assumption(1, "A status is read within the usual poll interval."),
    "read.silence": Assumption(1, "The first read after a silence shows no fault."),
    "read.idle": Assumption(1, "It answers after a minute of silence, and is still activated."),
    "read.connections": Assumption(1, "A second and a third client can connect while the first reads."),
    "write.same": Assumption(2, "Writing the image that is already in force changes nothing.", True),
    "write.motion": Assumption(2, "With rGTO = 0 no position request moves anything.", True),
    "write.echo": Assumption(2, "A write is echoed within 20 ms of its acknowledgement."),
    "write.spacing": Assumption(2, "The second of two writes acts, even if it follows at once."),
    "write.function_23": Assumption(2, "Function 23 writes and reads in one exchange.", of_lines=True),
    "activation.time": Assumption(3, "An activation takes at most 20 s."),
    "activation.registers": Assumption(3, "After an activation gGTO is 0, and every gDT is 0."),
    "axis.finger": Assumption(
        4, "A is the single finger, or the jaw; B and C are the pair; the scissor spreads them.", True
    ),
    "axis.alone": Assumption(4, "An axis that is commanded alone moves alone.", True, of_several=True),
    "axis.lag": Assumption(4, "gDT shows a motion as soon as its request is echoed."),
    "axis.accuracy": Assumption(4, "An axis stops within 2 counts of its request."),
    "stop.halt": Assumption(5, "rGTO = 0 stops a motion within 10 counts and the way of one exchange.", True),
    "stop.resume": Assumption(5, "Setting rGTO again continues to the same target."),
    "stop.target": Assumption(5, "A new request in the middle of a motion is followed at once."),
    "stop.hold": Assumption(5, "A request for the present position stops as soon.", True),
    "stroke.time": Assumption(
        6, "A full closing takes the time of the thesis, or of a sibling's motion profile, within 20 %."
    ),
    "stroke.readings": Assumption(6, "Open and closed fingers show the usual positions of the model."),
    "stroke.opening": Assumption(
        6, "A full opening takes the time of the motion profile, within 20 %.", of_jaws=True
    ),
    "stroke.force": Assumption(
        6, "The closed stop reads at most 7 counts more at the greatest force.", of_jaws=True
    ),
    "stroke.scissor": Assumption(
        6, "The scissor echoes each request, even beyond its limits.", of_several=True
    ),
    "soft.contact": Assumption(7, "A contact while closing is gDT = 2."),
    "soft.current": Assumption(7, "A finger at rest draws no current."),
    "soft.standstill": Assumption(7, "A finger moves at most 2 counts after gDT shows its contact."),
    "soft.speed": Assumption(
        7, "A part reads at most 10 counts further at full speed than at the slowest.", of_jaws=True
    ),
    "soft.halt": Assumption(7, "rGTO = 0 leaves the part held."),
    "loss.client": Assumption(8, "A gripper that loses its client continues to its target."),
    "loss.first_motion": Assumption(8, "The gripper follows the first motion on a new connection."),
    "loss.idle": Assumption(8, "The gripper stays activated without a client."),
    "loss.cable": Assumption(8, "The gripper stays activated when the cable is out for 5 s."),
    "loss.estop": Assumption(
        8, "An emergency stop reaches the gripper; after it at most two resets are needed.", True
    ),
    "loss.power": Assumption(8, "After a loss of power the gripper is reset."),
    "soak.reads": Assumption(9, "Fewer than one read in 10,000 fails."),
    "soak.commands": Assumption(9, "The last of many commands at 10 to 100 Hz is followed."),
}
"""The assumptions by name, in the order in which they are checked."""


def checks_of(model: Model, link: str) -> dict[str, Assumption]:
    """The assumptions about a model on a kind of link, by name."""
    several, without = len(model.axes) > 1, left_out(link)
    return {
        name: each
        for name, each in CATALOGUE.items()
        if (several or not each.of_several) and not (several and each.of_jaws)
        if name not in without
    }


def left_out(link: str) -> dict[str, str]:
    """The assumptions that cannot be checked on a kind of link, by name, and why."""
    found = {}
    for name, each in CATALOGUE.items():
        if each.of_registers and link == URCAP:
            found[name] = "the text port has variables and no registers"
        elif each.of_lines and link == URCAP:
            found[name] = "the text port has no functions of Modbus"
        elif each.of_lines and link == TCP:
            found[name] = "it is about serial lines"
    return found


LAST: Final = 9  # the last stage
HARMLESS: Final = 2  # the last stage in which nothing moves
STAGE: Final = "verify stage "  # before the number, in the event at the beginning of a stage


Figure = int | float | str | bool | None | list[Any]  # types of JSON, for the figures of a check
Options = Mapping[str, int | float]  # options of a hand, by the names of its constructor

NO_OPTIONS: Final[Options] = MappingProxyType({})


class CheckVerdict(Enum):
    """The verdict of a check."""

    AS_ASSUMED = "as assumed"
    DIFFERS = "differs"
    INCONCLUSIVE = "inconclusive"


@dataclass(frozen=True, slots=True)
class Check:
    """One check that was made, or could not be."""

    name: str  # of the assumption, see catalogue
    verdict: CheckVerdict  # its verdict
    found: str  # the finding, in a sentence
    follows: str = ""  # the consequence for the user, where it differs
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
    "done": "all requested stages have run",
    "declined": "the answer was not Enter",
    "stopped": "a key was pressed, or the terminal closed",
    "interrupted": "Ctrl-C, or a signal",
    "refused": "the stage moved nothing: the device that answers, or its state, forbids it",
    "link": "the link failed",
    "fault": "the gripper reports a fault",
    "envelope": "an axis left the range that its stage allows",
    "time": "a stage took too long",
    "foreign": "the gripper echoes a request that this program did not write",
    "inactive": "the stage needs an active gripper",
    "deviation": "a safety check differs",
    "unstopped": "rGTO = 0 was not confirmed: the fingers may still move",
    "disk": "the report cannot be written",
}
"""Endings of a run by their words in the report."""


class EndError(Exception):
    """The run ends here."""

    def __init__(self, why: str, words: str) -> None:
        assert why in ENDINGS
        super().__init__(why, words)
        self.why = why  # one of ENDINGS
        self.words = words  # the event, in a sentence

    def __str__(self) -> str:
        return f"{self.why}: {self.words}"
