"""``robotiq-async record``, ``replay``, ``recover`` and ``plot``."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Iterator
from contextlib import suppress
from heapq import heappop, heappush
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...log import printable
from ..addresses import gripper_words
from ..arguments import USUAL, Address, Flag, Link, need
from ..failures import CommandError, UsageError
from ..output.text import FORMATTERS, clock

if TYPE_CHECKING:
    from ...protocol import Hand
    from ...telemetry.recorder import Recorder
    from ...telemetry.recordings import Entry

WHOLE = "robotiq-async recover makes a whole file of it"
NEARBY = 100
"""Number of entries that are sorted by time together."""


async def record(
    file: Path,
    address: Address = "sim://",
    /,
    *,
    seconds: Annotated[float | None, Parameter(metavar="SECONDS")] = None,
    ros2: Flag = False,
    link: Link = USUAL,
) -> None:
    """Record every poll, command, transition and fault in an MCAP file, until Ctrl-C.

    It only looks: nothing moves and nothing is written to the gripper. The file is
    for viewers of MCAP (Foxglove, PlotJuggler), and for replay and plot. Tools of
    ROS 2 open only one made with --ros2. Commands are those of this program, so that a
    recording made by this command has none: record from your own program with
    robotiq_async.telemetry.recorder.Recorder. A killed recording loses at most the last
    second; recover makes its file whole.

    For example:

        robotiq-async record grasp.mcap tcp://192.168.1.11
        robotiq-async record --seconds 60 minute.mcap
        robotiq-async record --ros2 joints.mcap tcp://192.168.1.11

    Args:
        file: The recording; it must not be there yet.
        seconds: End by itself after so long.
        ros2: Record /joint_states alone, in a file with the profile ros2.
    """
    need("mcap", "record")
    from ...telemetry.recorder import Recorder
    from ..connect import connected

    if seconds is not None and not 0 < seconds < 1e9:
        raise UsageError(f"--seconds must be seconds above 0, got {seconds:g}")
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
        pass  # Being told to stop is how this command ends well.


def _tell_figures(recorder: Recorder, hand: Hand) -> None:
    polls, overruns = recorder.recorded, f"{hand.statistics.overruns} not polled in time"
    # What was not polled is not in the file and not missed either: the polling tells of it.
    if not recorder.has_failed:
        words = f"{polls} polls, {recorder.missed} lost, {overruns}, {recorder.size} bytes"
    elif recorder.saved:
        words = (
            f"The recording ended early: {recorder.saved} of {polls} polls at least are in the file; {WHOLE}"
        )
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


def replay(file: Path, /, *, as_picture: Annotated[Flag, Parameter(name="--plot")] = False) -> None:
    """Print what a recording holds: states, faults, commands, and what the fingers did.

    A line for each event and command, and one for each status in which a finger has
    come to another position or has begun or ended a contact.

    For example:

        robotiq-async replay grasp.mcap

    Args:
        file: The recording; a truncated one is read up to where it breaks off.
        as_picture: Draw a plot instead, as the command plot does.
    """
    need("mcap", "record")
    from ...telemetry.recordings import read_recording

    if as_picture:
        plot(file)
        return
    shown, is_empty = "", True
    for entry in _in_order(entry for entry in read_recording(file) if entry.is_json):
        if entry.topic not in FORMATTERS:
            continue
        line = printable(entry.read(FORMATTERS[entry.topic]))
        if entry.topic == "/gripper/status":
            if line == shown:
                continue
            shown = line
        print(clock(entry.nanoseconds / 1e9), line)
        is_empty = False
    if is_empty:
        raise CommandError(f"{file}: there is nothing in it that this command shows")


def _in_order(entries: Iterator[Entry]) -> Iterator[Entry]:
    """Sorted by time: messages of different streams are some milliseconds out of order in the file."""
    waiting: list[tuple[int, int, Entry]] = []
    for number, entry in enumerate(entries):
        heappush(waiting, (entry.nanoseconds, number, entry))
        if len(waiting) > NEARBY:
            yield heappop(waiting)[2]
    while waiting:
        yield heappop(waiting)[2]


def recover(file: Path, target: Path | None = None, /) -> None:
    """Repair a recording whose program was killed.

    For example:

        robotiq-async recover grasp.mcap

    Args:
        file: The truncated recording; it is not changed.
        target: The repaired one (default: FILE.recovered.mcap).
    """
    need("mcap", "record")
    from ...telemetry.recordings import recover as save

    whole = target or file.with_name(f"{file.stem}.recovered.mcap")
    found = save(file, whole)
    if found.is_whole:
        print(f"{file} was whole; {whole} is a copy of it")
    print(f"{found.messages} messages in {whole}")


def plot(file: Path, picture: Path | None = None, /) -> None:
    """Draw positions, currents and events of a recording over time, as PNG and SVG.

    For example:

        robotiq-async plot grasp.mcap

    Args:
        file: The recording.
        picture: Name of the plot without suffix (default: that of the recording).
    """
    need("mcap", "record")
    need("matplotlib", "plot")
    from ...measure.plots import plot_recording
    from ...telemetry.recordings import read_recording

    target = picture or file
    if target.suffix in (".mcap", ".png", ".svg"):
        target = target.with_suffix("")
    try:
        pictures = plot_recording(target, (entry for entry in read_recording(file) if entry.is_json))
    except OSError as error:
        raise CommandError(f"{target}: {error.strerror}") from error
    if not pictures:
        raise CommandError(f"{file}: there is no status in it")
    for written in pictures:
        print(written)
