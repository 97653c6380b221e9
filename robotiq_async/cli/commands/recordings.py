"""``robotiq-async record``, and the commands that use a recording: replay, export, plot, recover."""

from __future__ import annotations

import asyncio
import math
import sys
from collections.abc import Iterable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from cyclopts import Parameter

from ...calibration import CONVENTIONS, Convention
from ...runtime import printable
from ..addresses import gripper_words
from ..arguments import USUAL_LINK, AddressArgument, Flag, LinkOptions, need
from ..failures import CommandError, UsageError, file_errors, normal_end
from ..output.lines import FORMATTERS, brief_line, clock

if TYPE_CHECKING:
    from ...hands import Hand
    from ...tools.recording.recorder import Recorder
    from ...tools.recording.recordings import RecordedMessage

Overwrite = Annotated[Flag, Parameter(help="Replace an existing file.")]
COUNTS_COLUMNS: Final = "COUNTS"  # the numbers that a table has anyway
TOPIC_KINDS: Final = {"statuses": "status", "commands": "command", "events": "event"}


def replay(
    file: Path,
    /,
    *,
    brief: Flag = False,
    as_picture: Annotated[Flag, Parameter(name="--plot")] = False,
    overwrite: Overwrite = False,
) -> None:
    """Print the states, faults, commands and finger motions of a recording.

    A line for each event and command, and for each status in which a finger has another
    position, or a contact has begun or ended. With --brief a line for each state, fault
    and contact, and a summary at the end.

    For example:

        robotiq-async replay grasp.mcap
        robotiq-async replay --brief grasp.mcap

    Args:
        file: The recording; a truncated one is read as far as it goes.
        brief: Print states, faults and contacts only.
        as_picture: Draw a plot instead, as the command plot does.
    """
    if as_picture:
        plot(file, overwrite=overwrite)
        return
    entries = _entries(file)
    from ...tools.recording.table import in_order

    lines = (_brief if brief else _lines)(in_order(entries))
    is_empty = True
    for line in lines:
        print(line)
        is_empty = False
    if is_empty:
        raise CommandError(f"{file}: it contains nothing for this command")


def _entries(file: Path) -> Iterator[RecordedMessage]:
    need("mcap", "record")
    from ...tools.recording.recordings import read_recording

    return (entry for entry in read_recording(file) if entry.is_json)


def _lines(entries: Iterable[RecordedMessage]) -> Iterator[str]:
    shown = ""
    for entry in entries:
        if entry.topic not in FORMATTERS:
            continue
        line = printable(entry.read(FORMATTERS[entry.topic]))
        if entry.topic == "/gripper/status":
            if line == shown:
                continue
            shown = line
        yield _stamped(entry, line)


def _brief(entries: Iterable[RecordedMessage]) -> Iterator[str]:
    polls, commands, began, ended = 0, 0, 0, 0
    contacts: dict[str, Any] = {}
    for entry in entries:
        if entry.topic not in FORMATTERS:
            continue
        began, ended = began or entry.nanoseconds, entry.nanoseconds
        polls += entry.topic == "/gripper/status"
        commands += entry.topic == "/gripper/command"
        if line := entry.read(lambda fields: brief_line(fields, contacts)):
            yield _stamped(entry, printable(line))
    if began:
        yield f"{polls} polls and {commands} commands in {(ended - began) / 1e9:.1f} s"


def _stamped(entry: RecordedMessage, line: str) -> str:
    return f"{clock(entry.nanoseconds / 1e9)} {line}"


def export(
    file: Path,
    target: Path | None = None,
    /,
    *,
    of: Literal["statuses", "commands", "events"] = "statuses",
    convention: str | None = None,
    overwrite: Overwrite = False,
) -> None:
    """Write a recording as a table, CSV, for spreadsheets and pandas.

    A row for each poll, with the time of the wall clock in UTC. With --of a row for each
    command or event. Columns that have no value in any row are left out, and named on
    stderr: the axes that a model lacks, label and values where there are no marks. Stacks
    differ in the sign of an opening, so a table of polls says whose numbers it has: COUNTS
    are the gripper's own, 0 open .. 255 closed, and any other adds a column of its name.

    For example:

        robotiq-async export grasp.mcap --convention COUNTS
        robotiq-async export grasp.mcap --convention DROID
        robotiq-async export grasp.mcap events.csv --of events

    Args:
        file: The recording.
        target: The table, named .csv (default: named as the recording).
        of: The records that become rows.
        convention: COUNTS, or a learning stack, such as DROID or LEROBOT; needed for statuses.
    """
    named = _convention(convention, of)
    entries = _entries(file)
    from ...tools.recording.table import export as write

    table = target or file.with_suffix(".csv")
    if table.suffix.lower() != ".csv":
        raise UsageError(f"the table must be a file named .csv, got {table}")
    if table.resolve() == file.resolve():
        raise UsageError(f"{file} is the table itself: name the recording")
    _keep(table, overwrite=overwrite)
    with file_errors(table):
        written = write(entries, TOPIC_KINDS[of], table, named)
    if not written.rows:
        raise CommandError(f"{file}: it contains no {of}")
    print(f"{written.rows} {of} in {table}")
    if written.left_out:
        print(f"Left out, without a value in any row: {', '.join(written.left_out)}", file=sys.stderr)


def _convention(name: str | None, of: str) -> Convention | None:
    """The convention whose column is added; None for the numbers that a table has anyway."""
    if of != "statuses":
        if name is not None:
            raise UsageError(f"--convention is for statuses: {of} have no opening")
        return None
    if name is None or name.upper() not in (COUNTS_COLUMNS, *CONVENTIONS):
        known = f"{COUNTS_COLUMNS} (the gripper's own, 0 open .. 255 closed), {', '.join(CONVENTIONS)}"
        got = "none: nobody should guess a sign" if name is None else name
        raise UsageError(f"--convention must be one of {known}; got {got}")
    return CONVENTIONS.get(name.upper())


def _keep(*files: Path, overwrite: bool) -> None:
    """Refuse to replace an existing file."""
    for file in files:
        if not overwrite and file.exists():
            raise CommandError(f"{file}: File exists; --overwrite replaces it")


def plot(
    *files: Path,
    picture: Annotated[Path | None, Parameter(metavar="NAME", show_default=False)] = None,
    begin: Annotated[float, Parameter(name="--from", metavar="SECONDS", show_default=False)] = 0.0,
    end: Annotated[float, Parameter(name="--to", metavar="SECONDS", show_default=False)] = math.inf,
    overwrite: Overwrite = False,
) -> None:
    """Draw openings, currents, events and marks of recordings over time, as PNG and SVG.

    Several stand side by side in the same scales, at most six. Contacts, faults and lost links
    are shaded. Where there are more polls than the picture has columns, a current is drawn as
    its range and its mean in each.

    For example:

        robotiq-async plot grasp.mcap
        robotiq-async plot grasp.mcap --picture first --from 2 --to 7.5
        robotiq-async plot cup.mcap ball.mcap

    Args:
        files: The recordings.
        picture: Name of the plot without suffix (default: the first recording's; cup+1 if one more follows).
        begin: Draw from this time on; the time axis begins with the recording.
        end: Draw up to this time.
    """
    if not 0 <= begin < end:
        raise UsageError(f"--from must be 0 or more and less than --to, got {begin:g} and {end:g}")
    need("mcap", "record")
    need("matplotlib", "plot")
    from ...tools.measure.recording_plot import MOST_BESIDE, plot_recordings
    from ...tools.recording.curves import read_curves
    from ...tools.recording.recordings import read_recording

    if not 1 <= len(files) <= MOST_BESIDE:
        raise UsageError(f"name 1 to {MOST_BESIDE} recordings for a picture, got {len(files)}")
    target = picture or files[0]
    if target.suffix in (".mcap", ".png", ".svg"):
        target = target.with_suffix("")
    if len(files) > 1 and picture is None:
        target = target.with_name(f"{target.name}+{len(files) - 1}")
    _keep(*(target.with_name(f"{target.name}.{suffix}") for suffix in ("png", "svg")), overwrite=overwrite)
    recordings = []
    for each in files:
        curves = read_curves(each.name, read_recording(each), begin=begin, end=end)
        if curves is None:
            is_part = begin > 0 or end < math.inf
            raise CommandError(
                f"{each}: it contains no status{' between --from and --to' if is_part else ''}"
            )
        recordings.append(curves)
    with file_errors(target):
        for written in plot_recordings(target, recordings):
            print(written)


def recover(file: Path, target: Path | None = None, /) -> None:
    """Repair a recording whose program was killed.

    For example:

        robotiq-async recover grasp.mcap

    Args:
        file: The truncated recording; it is not changed.
        target: The repaired one (default: FILE.recovered.mcap).
    """
    need("mcap", "record")
    from ...tools.recording.recordings import recover as save

    whole = target or file.with_name(f"{file.stem}.recovered.mcap")
    found = save(file, whole)
    if found.is_whole:
        print(f"{file} was complete; {whole} is a copy of it")
    print(f"{found.messages} messages in {whole}")


WHOLE = "robotiq-async recover makes a complete file of it"


async def record(
    file: Path,
    address: AddressArgument = "sim://",
    /,
    *,
    seconds: Annotated[float | None, Parameter(metavar="SECONDS")] = None,
    ros2: Flag = False,
    as_csv: Annotated[Flag, Parameter(name="--csv")] = False,
    link: LinkOptions = USUAL_LINK,
) -> None:
    """Record every poll, command, transition and fault in a file, until Ctrl-C.

    It only watches: nothing moves and nothing is written to the gripper. The file is
    MCAP, for viewers (Foxglove, PlotJuggler), and for replay, plot and export. Tools of
    ROS 2 open it only if it was made with --ros2. A file named .csv is a table with a row for each
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
    from ...tools.recording.recorder import Recorder, is_table
    from ..connect import connected

    if seconds is not None and not 0 < seconds < 1e9:
        raise UsageError(f"--seconds must be seconds above 0, got {seconds:g}")
    if as_csv and not is_table(file):
        raise UsageError(f"--csv records a table: name the file .csv, got {file}")
    if ros2 and is_table(file):
        raise UsageError(f"--ros2 records an MCAP file, and {file} is a table")
    if not is_table(file):
        need("mcap", "record", ", or record a table, .csv")
    print(gripper_words(address), flush=True)
    with normal_end():
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


def _tell_figures(recorder: Recorder, hand: Hand) -> None:
    polls, overruns = recorder.recorded, f"{hand.statistics.overruns} not polled in time"
    # Late polls are missing from the file, but not among the missed ones: the statistics have them.
    if not recorder.has_failed:
        words = f"{polls} polls, {recorder.missed} lost, {overruns}, {recorder.size} bytes"
    elif recorder.saved:
        words = f"The recording ended early: at least {recorder.saved} of {polls} polls are in the file"
        words += f"; {WHOLE}" * (recorder.path.suffix != ".csv")
    else:
        words = f"The recording is lost: none of its {polls} polls is in the file for certain"
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
