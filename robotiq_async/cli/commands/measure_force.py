"""``robotiq-async measure force``."""

from __future__ import annotations

import asyncio
import re
from collections.abc import Awaitable, Callable, Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from ...runtime import in_a_thread
from ...values import DEFAULT_SPEED, THREE_FINGER, Finger
from ..addresses import full_address, is_simulated, named_model
from ..arguments import AddressArgument, Byte, Runs, StepCounts, Yes
from ..consent import consent, read_line
from ..failures import CommandError, UsageError
from .measure import NoPlot, Speedup, check, measure_left, print_files, table_errors

if TYPE_CHECKING:
    from ...calibration import RunsTable
    from ...hands import Hand
    from ...simulator import SimulatedGripper
    from ...tools.measure.campaigns import Campaign, Currents

FORCE_WARNING = """the fingers MOVE: they open and close on anything between them, {count} times.
If it is not active yet it is activated first, and a held part drops."""
MOST_GRAMS = 100_000


def force(
    address: AddressArgument,
    /,
    *,
    surface: Literal["foam", "rigid"] = "foam",
    output: Annotated[Path | None, Parameter(metavar="FILE.csv")] = None,
    scale: Annotated[Path | None, Parameter(metavar="FILE.csv")] = None,
    step: StepCounts = 25,
    runs: Runs = 3,
    speed: Byte = DEFAULT_SPEED,
    speedup: Speedup = None,
    no_plot: NoPlot = False,
    yes: Yes = False,
) -> Coroutine[None, None, None]:
    """Measure force and current of a grasp at each force value. THE FINGERS MOVE.

    As the thesis did (Pekonen 2012, chapter 6): a scale lies between the fingers, every 25th
    value is set, up by 50 and down by 50, and its reading in grams is typed in, or
    taken from a table. At sim:// a simulated scale gives the thesis's readings. The
    currents of the fingers are recorded at every poll. Both files are written after every
    row; started again, it continues there. Unless the gripper is simulated it asks
    first; without a terminal it needs --yes.

    For example:

        robotiq-async measure force sim:// --surface rigid
        robotiq-async measure force 192.168.1.11 --runs 1

    Args:
        surface: Surface that the fingers touch: the scale itself, or foam around it.
        output: The readings (default: force_SURFACE_grams.csv); currents and plots have its name.
        scale: A table of readings, instead of typing them.
        step: Distance between force values.
        runs: Grasps at each force value.
        speed: Speed of the closing.
        speedup: Speed of sim:// over real time (default: 15); times are simulated ones.
        no_plot: Draw no plots.
        yes: Do not ask.
    """
    path = output or Path(f"force_{surface}_grams.csv")
    if scale is not None and scale.resolve() == path.resolve():
        raise UsageError("--scale must be another file than --output")
    if (model := named_model(address)) is not THREE_FINGER:
        raise UsageError(f"forces are measured with three fingers; {address} names a {model}")
    factor = check(address, path, speedup, plot=not no_plot)
    from ...calibration import FORCE, read_table
    from ...tools.measure.campaigns import force_campaign

    with table_errors():
        readings = None if scale is None else read_table(scale, FORCE)
        origin = {"gripper": full_address(address), "surface": surface, "speed": str(speed)}
        campaign = force_campaign(path, step, runs, **origin)
        currents = _currents_of(campaign)
    read_scale = _scale(address, surface, readings, campaign.left, runs)
    typed_in = readings is None and not is_simulated(address)
    if campaign.left:
        consent(address, FORCE_WARNING.format(count=runs * len(campaign.left)), yes=yes)
    return _measure(
        address, surface, campaign, currents, read_scale, speed, factor, bar=not typed_in, plot=not no_plot
    )


async def _measure(
    address: str,
    surface: Literal["foam", "rigid"],
    campaign: Campaign,
    currents: Currents,
    read_scale: Callable[[int, int], Awaitable[int]],
    speed: int,
    speedup: float,
    *,
    bar: bool,
    plot: bool,
) -> None:
    from ...calibration import closing_time
    from ...tools.measure.campaigns import GRASP_S, grasp, write_currents

    output = campaign.path
    currents_file = currents_beside(output)
    seconds = (closing_time(speed) + closing_time(255) + GRASP_S) / speedup

    def place_scale(simulated: SimulatedGripper) -> None:
        simulated.place_object(Finger.ABC, position=150, soft=40 if surface == "foam" else 0)

    async def run(hand: Hand, value: int, number: int) -> int:
        samples = await grasp(hand, value, speed, speedup)
        reading = await read_scale(value, number)
        currents[value] = [*(currents.get(value, []) if number > 1 else []), samples]
        if number == campaign.runs:
            # Before the row, so that every row has its currents.
            await asyncio.to_thread(write_currents, currents_file, currents)
        return reading

    await measure_left(
        address, speedup, campaign, run, lambda *_: seconds, "force", prepare=place_scale, bar=bar
    )
    print_files([output, currents_file])
    if plot:
        _plot(output, surface, campaign.table, "simulated" if is_simulated(address) else "measured")


def currents_beside(output: Path) -> Path:
    """The file with the currents, beside the readings."""
    return output.with_name(f"{output.stem}_currents.csv")


def _currents_of(campaign: Campaign) -> Currents:
    """The currents that are already in the file."""
    from ...tools.measure.campaigns import read_currents

    file = currents_beside(campaign.path)
    currents = read_currents(file) if campaign.table else {}
    lacking = [value for value in campaign.table if len(currents.get(value, ())) != campaign.runs]
    if lacking:
        raise CommandError(f"{file} lacks runs of the force values {lacking}; choose another file")
    return currents


def _scale(
    address: str, surface: Literal["foam", "rigid"], readings: RunsTable | None, values: list[int], runs: int
) -> Callable[[int, int], Awaitable[int]]:
    """The source of the readings."""
    if readings is not None:
        missing = [value for value in values if len(readings.get(value, ())) < runs]
        if missing:
            raise CommandError(f"the table of readings has no {runs} runs for the force values {missing}")

        async def from_table(value: int, run: int) -> int:
            return readings[value][run - 1]

        return from_table
    if not is_simulated(address):
        return _typed
    from ...simulator import SimulatedScale

    simulated = SimulatedScale(surface)

    async def shown(value: int, _: int) -> int:
        return simulated.reading(value)

    return shown


async def _typed(value: int, run: int) -> int:
    while True:
        text = await prompt(f"Force {value}, run {run}: what does the scale show, in grams?")
        if re.fullmatch("[0-9]{1,6}", text) and int(text) <= MOST_GRAMS:
            return int(text)
        print(f"An integer in 0..{MOST_GRAMS}, please.")


async def prompt(question: str) -> str:
    """A line that the user types; the event loop keeps running."""
    print(question, end=" ", flush=True)
    line = await in_a_thread(read_line)
    if not line:
        raise CommandError("no answer: the input ended")
    return line.strip()


def _plot(output: Path, surface: str, table: RunsTable, label: str) -> None:
    from ...tools.measure.campaigns import read_currents
    from ...tools.measure.plots import plot_current_over_time, plot_force, plot_peak_currents

    with table_errors():
        currents = read_currents(currents_beside(output))
        over_time = {surface: currents}
        other = "rigid" if surface == "foam" else "foam"
        beside = output.with_name(output.name.replace(surface, other))
        if beside != output and currents_beside(beside).exists():
            over_time[other] = read_currents(currents_beside(beside))
    stem = output.with_suffix("")
    base = output.with_name(currents_beside(output).stem)
    with table_errors():
        print_files(plot_force(stem, table, surface, label))
        print_files(plot_peak_currents(base.with_name(f"{base.name}_peak"), currents, surface, label))
        by_surface = dict(sorted(over_time.items()))
        print_files(plot_current_over_time(base.with_name(f"{base.name}_over_time"), by_surface, label))
