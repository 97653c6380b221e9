"""``robotiq-async measure speed``, and the parts that all of ``measure`` share."""

from __future__ import annotations

import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Iterator
from contextlib import asynccontextmanager, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...link import Simulation, parse_address
from ...tools.errors import MeasuringError
from ...values import Finger
from ..addresses import full_address, gripper_words, is_simulated, named_model
from ..arguments import AddressArgument, FingersArgument, Flag, Runs, StepCounts, Yes, need
from ..consent import consent
from ..failures import CommandError, UsageError

if TYPE_CHECKING:
    from ...hands import Hand
    from ...simulator import SimulatedGripper
    from ...tools.measure.campaigns import Campaign
    from ...values import Model

SPEEDUP = 15.0
"""Speedup of the simulated gripper of sim:// over real time, by default."""
POLL_S = 0.001
"""Poll interval with a simulated gripper that is faster than real time: to keep the resolution."""

Speedup = Annotated[float | None, Parameter(metavar="FACTOR")]
NoPlot = Annotated[Flag, Parameter(name="--no-plot")]


def check(address: str, output: Path, speedup: float | None, *, plot: bool) -> float:
    """Check the arguments before anything moves; returns the speedup of the gripper's time."""
    simulated = is_simulated(address)
    if output.suffix != ".csv":
        raise UsageError(f"--output must be a file named .csv, got {str(output)!r}")
    if speedup is not None and not simulated:
        raise UsageError("--speedup is for sim:// only: the time of a real gripper cannot be changed")
    if simulated and parse_address(address).simulation != Simulation():
        raise UsageError(
            f"the gripper to measure at {address} takes no option but ?model=; there is --speedup"
        )
    if speedup is not None and not 1 <= speedup <= 50:
        raise UsageError(f"--speedup must be a number in 1..50, got {speedup:g}")
    if plot:
        need("matplotlib", "plot", ", or pass --no-plot")
    if not simulated:
        return 1.0
    return SPEEDUP if speedup is None else speedup


@asynccontextmanager
async def gripper_to_measure(
    address: str, speedup: float, prepare: Callable[[SimulatedGripper], None] = lambda _: None
) -> AsyncIterator[Hand]:
    """An active hand; sim:// runs in its own, faster time."""
    from ..connect import make_hand

    if not is_simulated(address):
        async with make_hand(address) as hand:
            yield hand
        return
    from ...simulator import SimulatedGripper, SimulatorServer

    simulated = SimulatedGripper(speedup=speedup, model=named_model(address))
    interval = POLL_S if speedup > 1 else 5 * POLL_S
    async with (
        SimulatorServer(simulated) as server,
        make_hand(server.address, poll_interval=interval) as hand,
    ):
        prepare(simulated)
        yield hand


async def measure_left(
    address: str,
    speedup: float,
    campaign: Campaign,
    measure_run: Callable[[Hand, int, int], Awaitable[int]],
    seconds_of: Callable[[Model, int], float],
    what: str,
    *,
    prepare: Callable[[SimulatedGripper], None] = lambda _: None,
    bar: bool = True,
) -> None:
    """Measure the remaining values, with a progress bar that knows the duration of each row.

    Without ``bar`` there is no bar: it would overwrite the user's input.
    """
    if not campaign.left:
        print(f"{campaign.path} is complete: nothing is measured again.")
        return
    print(gripper_words(address), flush=True)
    import rich.progress  # noqa: F401  # now: that takes 0.1 s, in which a hand could not poll

    async with gripper_to_measure(address, speedup, prepare) as hand:
        await _carry_out(hand, campaign, measure_run, seconds_of, what, bar=bar)


async def _carry_out(
    hand: Hand,
    campaign: Campaign,
    measure_run: Callable[[Hand, int, int], Awaitable[int]],
    seconds_of: Callable[[Model, int], float],
    what: str,
    *,
    bar: bool,
) -> None:
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

    from ...calibration import TableError

    if done := len(campaign.table):
        print(f"Continuing {campaign.path}: {done} rows are there, {len(campaign.left)} remain.", flush=True)
    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %"),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
    )
    with Progress(
        *columns, console=Console(stderr=True), disable=not (bar and sys.stderr.isatty())
    ) as progress:
        seconds = {value: seconds_of(hand.model, value) for value in campaign.left}
        task = progress.add_task(what, total=campaign.runs * sum(seconds.values()))

        readings: list[str] = []

        async def run(value: int, number: int) -> int:
            progress.update(task, description=f"{what} {value}, run {number}")
            reading = await measure_run(hand, value, number)
            progress.advance(task, seconds[value])
            readings.append(str(reading))
            if number == campaign.runs:
                row = f"{what} {value}: {', '.join(readings)} {campaign.layout.unit}"
                if progress.disable:
                    print(row, flush=True)
                else:
                    progress.console.print(row, highlight=False)
                readings.clear()
            return reading

        try:
            await campaign.measure(run, hand.model)
        except (MeasuringError, TableError, OSError) as error:
            rows = len(campaign.table)
            kept = f"{rows} rows are in {campaign.path}" if rows else "nothing was written"
            raise CommandError(f"{error}; {kept}") from error


@contextmanager
def table_errors() -> Iterator[None]:
    """Turn TableError and OSError of tables and pictures into CommandError."""
    from ...calibration import TableError

    try:
        yield
    except (TableError, OSError) as error:
        raise CommandError(str(error)) from error


def print_files(files: list[Path]) -> None:
    for file in files:
        print(file)


SPEED_WARNING = """the fingers MOVE: they open and close fully, {count} times. Nothing may be between them.
If it is not active yet it is activated first, and a held part drops."""


def speed(
    address: AddressArgument,
    /,
    *,
    output: Annotated[Path, Parameter(metavar="FILE.csv")] = Path("closing_time_ms.csv"),
    step: StepCounts = 4,
    runs: Runs = 3,
    fingers: FingersArgument = Finger.ABC,
    speedup: Speedup = None,
    no_plot: NoPlot = False,
    yes: Yes = False,
) -> Coroutine[None, None, None]:
    """Measure the time of a full closing at each speed value. THE FINGERS MOVE.

    As the thesis did (Pekonen 2012, table A1.1): every 4th value from 0, and 255, slowest first,
    three runs, from the command until nothing moves. It takes 20 minutes. The file is
    written after every row; started again, it continues there. Beside it a plot is drawn
    (PNG and SVG) with the thesis's own curve. Unless the gripper is simulated it asks
    first; without a terminal it needs --yes.

    For example:

        robotiq-async measure speed sim://
        robotiq-async measure speed 192.168.1.11 --step 25 --runs 1

    Args:
        output: The table; the plot is named after it.
        step: Distance between speed values.
        runs: Closings at each speed value.
        fingers: The axes that move: ABC, A,B, all.
        speedup: Speed of sim:// over real time (default: 15); times are simulated ones.
        no_plot: Draw no plot.
        yes: Do not ask.
    """
    if Finger.SCISSOR in fingers:
        raise UsageError("--fingers takes A, B and C only: the scissor has a different stroke")
    factor = check(address, output, speedup, plot=not no_plot)
    from ...tools.measure.campaigns import speed_campaign

    with table_errors():
        origin = {"gripper": full_address(address), "fingers": str(fingers.name)}
        campaign = speed_campaign(output, step, runs, **origin)
    if campaign.left:
        consent(address, SPEED_WARNING.format(count=runs * len(campaign.left)), yes=yes)
    return _measure(address, campaign, fingers, factor, not no_plot)


async def _measure(address: str, campaign: Campaign, fingers: Finger, speedup: float, plot: bool) -> None:
    from ...tools.measure.campaigns import expected_seconds, time_closing

    async def run(hand: Hand, value: int, _: int) -> int:
        return round(1000 * await time_closing(hand, value, fingers, speedup))

    output = campaign.path

    def seconds_of(model: Model, value: int) -> float:
        return expected_seconds(model, value) / speedup

    await measure_left(address, speedup, campaign, run, seconds_of, "speed")
    print(output)
    if plot:
        from ...tools.measure.plots import plot_speed

        label = "simulated" if is_simulated(address) else "measured"
        with table_errors():
            print_files(plot_speed(output.with_suffix(""), campaign.table, label))
