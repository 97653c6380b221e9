"""``robotiq-async record``."""

from __future__ import annotations

import asyncio
import sys
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...addresses import gripper_words
from ...arguments import USUAL, Address, Flag, Link, need
from ...failures import UsageError

if TYPE_CHECKING:
    from ....hand import Hand
    from ....tools.recording.recorder import Recorder

WHOLE = "robotiq-async recover makes a whole file of it"


async def record(
    file: Path,
    address: Address = "sim://",
    /,
    *,
    seconds: Annotated[float | None, Parameter(metavar="SECONDS")] = None,
    ros2: Flag = False,
    as_csv: Annotated[Flag, Parameter(name="--csv")] = False,
    link: Link = USUAL,
) -> None:
    """Record every poll, command, transition and fault in a file, until Ctrl-C.

    It only looks: nothing moves and nothing is written to the gripper. The file is
    MCAP, for viewers (Foxglove, PlotJuggler), and for replay, plot and export. Tools of
    ROS 2 open only one made with --ros2. A file named .csv is a table with a row for each
    poll, for spreadsheets and pandas; it needs no extra but cli. Commands are recorded only
    in the program that sends them, so this file has none: to record yours, use
    robotiq_async.tools.recording.recorder.Recorder in your program. A killed recording
    loses at most the last second; recover repairs its file.

    For example:

        robotiq-async record grasp.mcap tcp://192.168.1.11
        robotiq-async record --seconds 60 minute.mcap
        robotiq-async record --ros2 joints.mcap tcp://192.168.1.11
        robotiq-async record grasp.csv tcp://192.168.1.11

    Args:
        file: The recording; it must not exist yet.
        seconds: End after so many seconds.
        ros2: Record /joint_states alone, in a file with the profile ros2.
        as_csv: Record a table; the file must be named .csv, which alone is enough.
    """
    from ....tools.recording.recorder import Recorder, is_table
    from ...connect import connected

    if seconds is not None and not 0 < seconds < 1e9:
        raise UsageError(f"--seconds must be seconds above 0, got {seconds:g}")
    if as_csv and not is_table(file):
        raise UsageError(f"--csv records a table: name the file .csv, got {file}")
    if ros2 and is_table(file):
        raise UsageError(f"--ros2 records an MCAP file, and {file} is a table")
    if not is_table(file):
        need("mcap", "record", ", or record a table, .csv")
    print(gripper_words(address), flush=True)
    try:
        async with connected(address, link, halt=False) as hand:
            recorder = Recorder(hand, file, ros2=ros2)
            try:
                async with recorder:
                    print(f"Recording in {file}; Ctrl-C ends it.", flush=True)
                    with suppress(TimeoutError):
                        async with asyncio.timeout(seconds):
                            await _watch(recorder)
            finally:
                if recorder.recorded:
                    _tell_figures(recorder, hand)
    except asyncio.CancelledError:
        pass  # Ctrl-C is the normal end of this command.


def _tell_figures(recorder: Recorder, hand: Hand) -> None:
    polls, overruns = recorder.recorded, f"{hand.statistics.overruns} not polled in time"
    # Late polls are missing from the file, but not among the missed ones: the statistics have them.
    if not recorder.has_failed:
        words = f"{polls} polls, {recorder.missed} lost, {overruns}, {recorder.size} bytes"
    elif recorder.saved:
        words = f"The recording ended early: {recorder.saved} of {polls} polls at least are in the file"
        words += f"; {WHOLE}" * (recorder.path.suffix != ".csv")
    else:
        words = f"The recording is lost: of its {polls} polls none is in the file for certain"
    print(f"\n{words}", flush=True)


async def _watch(recorder: Recorder) -> None:
    """Show progress until the recording fails."""
    failing = asyncio.ensure_future(recorder.failure())
    try:
        while not failing.done():
            if sys.stderr.isatty():
                text = f"\r{recorder.recorded} polls, {recorder.size / 1e6:.1f} MB "
                print(text, end="", file=sys.stderr, flush=True)
            await asyncio.wait({failing}, timeout=0.5)
    finally:
        failing.cancel()
