"""Replays a recording of ``verify`` against the simulator and the decoder: where do they differ?

    python -m tests.hardware FOLDER/recording.mcap

What was written is written to a simulated gripper at the same times, from where the recorded one stood. What
hands did (foam, cables, switches) is not in a recording, and whether a write is forgotten is a matter of less
time than a recording has: stages 7, 8 and 9 are left out, but for the decoder.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.simulator.physics.habits import Habits
from robotiq_async.tools.recording.recordings import read_recording
from robotiq_async.values import registers as reg
from robotiq_async.values.model import Model, model_of
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus

LEFT_OUT: Final = (7, 8, 9)
APART_S: Final = 0.02
"""Times that are so far apart count as the same: a frame is stamped when its answer came."""
ROUNDING_S: Final = 1e-6
COUNTS: Final = 3
"""Positions, too."""
EARLIER_S: Final = 100.0
"""Seconds that the simulated gripper has before a stage to come to the place of the recorded one."""
LIKE_HARDWARE: Final = Habits(12.0, status_lag=0.05, silence_fault=1 - 2 * APART_S, write_spacing=0.01)
"""Those of ``simulate``; the silence is a little shorter, for looking around a frame ends it."""
EXACT: Final = {
    "gACT": reg.gACT,
    "gGTO": reg.gGTO,
    "gIMC": reg.gIMC,
    "gSTA": reg.gSTA,
    "gFLT": reg.gFLT,
    **{f"gDT{name}": field for name, field in zip("ABCS", reg.gDT, strict=True)},
    **{f"gPR{name}": field for name, field in zip("ABCS", reg.gPR, strict=True)},
}
EXACT_OF_A_JAW: Final = {name: EXACT[name] for name in ("gACT", "gGTO", "gIMC", "gFLT", "gPRA")} | {
    "gOBJ": reg.gOBJ
}
NEAR: Final = {f"gPO{name}": field for name, field in zip("ABCS", reg.gPO, strict=True)}


class Difference(NamedTuple):
    """A field of a frame that differs."""

    stage: int  # in which it was recorded
    seconds: float  # since the stage began
    field: str  # its name; "decoder" for a status that is understood otherwise now
    recorded: object
    simulated: object  # the simulator's status about then


@dataclass
class Segment:
    """The frames of a stage: seconds and the recorded object."""

    stage: int
    began: float
    model: Model
    statuses: list[tuple[float, dict[str, Any]]] = field(default_factory=list)
    commands: list[tuple[float, dict[str, Any]]] = field(default_factory=list)


def segments(path: str) -> list[Segment]:
    """The stages of a recording, in their order."""
    found: list[Segment] = []
    for entry in read_recording(path):
        fields, seconds = json.loads(entry.data), entry.nanoseconds / 1e9
        if entry.topic == "/gripper/event" and str(fields.get("target", "")).startswith("verify stage "):
            model = model_of(fields.get("model"))
            found.append(Segment(int(fields["target"].rpartition(" ")[2]), seconds, model))
        elif found and entry.topic == "/gripper/status":
            found[-1].statuses.append((seconds, fields))
        elif found and entry.topic == "/gripper/command":
            found[-1].commands.append((seconds, fields))
    return found


def differences(path: str, habits: Habits) -> Iterator[Difference]:
    """Every field of every frame that differs."""
    stages = segments(path)
    for stage in stages:
        yield from _decoded(stage)
    compared = [stage for stage in stages if stage.statuses and stage.stage not in LEFT_OUT]
    if compared:
        yield from _simulated(compared, habits)


def _decoded(stage: Segment) -> Iterator[Difference]:
    for seconds, fields in stage.statuses:
        registers = tuple(fields["registers"])
        status = RobotiqStatus(registers, fields["timestamp"], fields["sequence"], stage.model)
        now = status.as_dict()
        wrong = {name: fields.get(name) for name in now if now[name] != fields.get(name)}
        if wrong:
            shown = {name: now[name] for name in wrong}
            yield Difference(stage.stage, seconds - stage.began, "decoder", wrong, shown)


def _simulated(stages: list[Segment], habits: Habits) -> Iterator[Difference]:
    """The stages are in one piece: the status of an axis at the beginning of one is from the one before."""
    times = [seconds for stage in stages for seconds, _ in stage.statuses]
    moment = [times[0] - EARLIER_S]
    model = stages[0].model
    gripper = SimulatedGripper(lambda: moment[0], habits=habits, model=model)
    first_status = RobotiqStatus(tuple(stages[0].statuses[0][1]["registers"]), model=model)
    _bring(gripper, moment, first_status, times[0])
    looks = {seconds + apart for seconds in times for apart in (-APART_S, 0.0, APART_S)}
    events: list[tuple[float, Sequence[int] | None]] = [(look, None) for look in looks if look >= times[0]]
    events += [(seconds, fields["registers"]) for stage in stages for seconds, fields in stage.commands]
    shown: list[tuple[float, reg.Registers]] = []
    for seconds, image in sorted(events, key=lambda event: event[0]):
        moment[0] = max(moment[0], seconds)
        if image is None:
            shown.append((seconds, gripper.status_registers()))
        else:
            gripper.write(0, image)
    first = 0
    for stage in stages:
        for seconds, fields in stage.statuses:
            while shown[first][0] < seconds - APART_S - ROUNDING_S:
                first += 1
            near = [
                registers for at, registers in _from(shown, first) if at <= seconds + APART_S + ROUNDING_S
            ]
            yield from _compare(stage, seconds - stage.began, fields["registers"], near)


def _from(shown: list[tuple[float, reg.Registers]], first: int) -> Iterator[tuple[float, reg.Registers]]:
    last = shown[first][0] + 3 * APART_S
    for number in range(first, len(shown)):
        if shown[number][0] > last:
            return
        yield shown[number]


def _bring(gripper: SimulatedGripper, moment: list[float], status: RobotiqStatus, until: float) -> None:
    """Let the gripper stand where a recorded one stood."""
    asked = tuple(AxisRequest(status.requested_position(axis), 255) for axis in status.model.axes)
    here = tuple(AxisRequest(status.position(axis), 255) for axis in status.model.axes)
    if status.activation_echo:
        gripper.write(0, Request(activate=True, mode=status.mode, model=status.model).registers)
        moment[0] += EARLIER_S / 2
        if any(abs(gripper.position(axis) - status.position(axis)) > COUNTS for axis in status.model.axes):
            image = Request(activate=True, go=True, mode=status.mode, axes=here, model=status.model)
            gripper.write(0, image.registers)
            moment[0] += EARLIER_S / 4
    image = Request(
        activate=status.activation_echo, go=status.go_echo, mode=status.mode, axes=asked, model=status.model
    )
    gripper.write(0, image.registers)
    moment[0] = until


def _compare(
    stage: Segment, seconds: float, recorded: Sequence[int], near: list[reg.Registers]
) -> Iterator[Difference]:
    for name, where in (EXACT if len(stage.model.axes) > 1 else EXACT_OF_A_JAW).items():
        shown = [where.read(registers) for registers in near]
        if where.read(recorded) not in shown:
            yield Difference(stage.stage, seconds, name, where.read(recorded), shown[len(shown) // 2])
    for name, where in NEAR.items():
        shown = [where.read(registers) for registers in near]
        if all(abs(where.read(recorded) - each) > COUNTS for each in shown):
            yield Difference(stage.stage, seconds, name, where.read(recorded), shown[len(shown) // 2])


def main(arguments: Sequence[str] | None = None) -> int:
    """List the differences; 1 if there are some."""
    parser = argparse.ArgumentParser(prog="python -m tests.hardware", description=__doc__.partition("\n")[0])
    parser.add_argument("recording", help="the recording.mcap of a report")
    parser.add_argument("--plain", action="store_true", help="against a gripper without habits")
    given = parser.parse_args(arguments)
    habits = Habits() if given.plain else LIKE_HARDWARE
    count = 0
    for count, each in enumerate(differences(given.recording, habits), 1):  # noqa: B007
        where = f"stage {each.stage}, {each.seconds:8.3f} s, {each.field}"
        print(f"{where}: recorded {each.recorded}, simulated {each.simulated}")  # noqa: T201
    print(f"{count} fields differ")  # noqa: T201
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
