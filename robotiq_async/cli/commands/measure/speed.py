"""``robotiq-async measure speed``."""

from __future__ import annotations

from collections.abc import Coroutine
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ....values.enums import Finger
from ...addresses import full_address, gripper_words, is_simulated
from ...arguments import Address, Fingers, Yes
from ...consent import consent
from ...failures import UsageError
from .campaign import NoPlot, Runs, Speedup, carry_out, check, file_errors, gripper, load_rich, print_files

if TYPE_CHECKING:
    from ....tools.measure.campaigns import Campaign

WARNING = """the fingers MOVE: they open and close fully, {count} times. Nothing may be between them.
If it is not active yet it is activated first, and what it holds drops."""


def speed(
    address: Address,
    /,
    *,
    output: Annotated[Path, Parameter(metavar="FILE.csv")] = Path("closing_time_ms.csv"),
    step: Annotated[int, Parameter(metavar="N")] = 4,
    runs: Runs = 3,
    fingers: Fingers = Finger.ABC,
    speedup: Speedup = None,
    no_plot: NoPlot = False,
    yes: Yes = False,
) -> Coroutine[None, None, None]:
    """Measure how long a full closing takes at each speed value. THE FINGERS MOVE.

    As the thesis did (Pekonen 2012, table A1.1): every 4th value from 0, and 255, slowest first,
    three runs, from the command until nothing moves. It takes 20 minutes. The file is
    written after every row; started again, it continues there. Beside it a plot is drawn
    (PNG and SVG) with the thesis's own curve. Unless the gripper is that of sim:// it asks
    first; without a terminal it needs --yes.

    For example:

        robotiq-async measure speed sim://
        robotiq-async measure speed 192.168.1.11 --step 25 --runs 1

    Args:
        output: The table; the plot is named after it.
        step: Distance between speed values.
        runs: Closings at each speed value.
        fingers: The axes that move: ABC, A,B, all.
        speedup: How much faster than real time sim:// runs (default: 15); times are simulated ones.
        no_plot: Draw no plot.
        yes: Do not ask.
    """
    if Finger.SCISSOR in fingers:
        raise UsageError("--fingers takes A, B and C only: the scissor has a different stroke")
    factor = check(address, output, speedup, runs, step, not no_plot)
    from ....tools.measure.campaigns import speed_campaign

    with file_errors():
        origin = {"gripper": full_address(address), "fingers": str(fingers.name)}
        campaign = speed_campaign(output, step, runs, **origin)
    if campaign.left:
        consent(address, WARNING.format(count=runs * len(campaign.left)), yes=yes)
    return _measure(address, campaign, fingers, factor, not no_plot)


async def _measure(address: str, campaign: Campaign, fingers: Finger, speedup: float, plot: bool) -> None:
    from ....tools.measure.campaigns import expected_seconds, time_closing

    output = campaign.path
    if not campaign.left:
        print(f"{output} is complete: nothing is measured again.")
    if campaign.left:
        print(gripper_words(address), flush=True)
        load_rich()
        async with gripper(address, speedup) as hand:

            async def run(value: int, _: int) -> int:
                return round(1000 * await time_closing(hand, value, fingers, speedup))

            await carry_out(campaign, run, lambda value: expected_seconds(value) / speedup, "speed")
    print_files([output])
    if plot:
        from ....tools.measure.plots import plot_speed

        label = "simulated" if is_simulated(address) else "measured"
        with file_errors():
            print_files(plot_speed(output.with_suffix(""), campaign.table, label))
