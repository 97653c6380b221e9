"""``robotiq-async replay``, ``export``, ``plot`` and ``recover``: the commands that use a recording."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Final, Literal

from cyclopts import Parameter

from ....runtime.log import printable
from ...arguments import Flag, need
from ...failures import CommandError, UsageError
from ...output.text import FORMATTERS, brief_line, clock

if TYPE_CHECKING:
    from ....tools.recording.recordings import Entry

Overwrite = Annotated[Flag, Parameter(help="Replace an existing file.")]
KINDS: Final = {"statuses": "status", "commands": "command", "events": "event"}


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
    lines = (_brief if brief else _lines)(_in_order(file))
    is_empty = True
    for line in lines:
        print(line)
        is_empty = False
    if is_empty:
        raise CommandError(f"{file}: it contains nothing that this command shows")


def _in_order(file: Path) -> Iterator[Entry]:
    need("mcap", "record")
    from ....tools.recording.export import in_order
    from ....tools.recording.recordings import read_recording

    return in_order(entry for entry in read_recording(file) if entry.is_json)


def _lines(entries: Iterable[Entry]) -> Iterator[str]:
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


def _brief(entries: Iterable[Entry]) -> Iterator[str]:
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


def _stamped(entry: Entry, line: str) -> str:
    return f"{clock(entry.nanoseconds / 1e9)} {line}"


def export(
    file: Path,
    target: Path | None = None,
    /,
    *,
    of: Literal["statuses", "commands", "events"] = "statuses",
    overwrite: Overwrite = False,
) -> None:
    """Write a recording as a table, CSV, for spreadsheets and pandas.

    A row for each poll, with the time of the wall clock in UTC. With --of a row for each
    command or event.

    For example:

        robotiq-async export grasp.mcap
        robotiq-async export grasp.mcap events.csv --of events

    Args:
        file: The recording.
        target: The table, named .csv (default: named as the recording).
        of: What has a row.
    """
    need("mcap", "record")
    from ....tools.recording.export import export as write
    from ....tools.recording.recordings import read_recording

    table = target or file.with_suffix(".csv")
    if table.suffix.lower() != ".csv":
        raise UsageError(f"the table must be a file named .csv, got {table}")
    if table.resolve() == file.resolve():
        raise UsageError(f"{file} is the table itself: name the recording")
    _keep(table, overwrite=overwrite)
    entries = (entry for entry in read_recording(file) if entry.is_json)
    try:
        rows = write(entries, KINDS[of], table)
    except OSError as error:
        raise CommandError(f"{table}: {error.strerror}") from error
    if not rows:
        raise CommandError(f"{file}: it contains no {of}")
    print(f"{rows} {of} in {table}")


def _keep(*files: Path, overwrite: bool) -> None:
    """Refuse to replace an existing file."""
    for file in files:
        if not overwrite and file.exists():
            raise CommandError(f"{file}: File exists; --overwrite replaces it")


def plot(file: Path, picture: Path | None = None, /, *, overwrite: Overwrite = False) -> None:
    """Draw positions, currents and events of a recording over time, as PNG and SVG.

    For example:

        robotiq-async plot grasp.mcap

    Args:
        file: The recording.
        picture: Name of the plot without suffix (default: that of the recording).
    """
    need("mcap", "record")
    need("matplotlib", "plot")
    from ....tools.measure.plots import plot_recording
    from ....tools.recording.recordings import read_recording

    target = picture or file
    if target.suffix in (".mcap", ".png", ".svg"):
        target = target.with_suffix("")
    _keep(*(target.with_name(f"{target.name}.{suffix}") for suffix in ("png", "svg")), overwrite=overwrite)
    try:
        pictures = plot_recording(target, (entry for entry in read_recording(file) if entry.is_json))
    except OSError as error:
        raise CommandError(f"{target}: {error.strerror}") from error
    if not pictures:
        raise CommandError(f"{file}: it contains no status")
    for written in pictures:
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
    from ....tools.recording.recordings import recover as save

    whole = target or file.with_name(f"{file.stem}.recovered.mcap")
    found = save(file, whole)
    if found.is_whole:
        print(f"{file} was complete; {whole} is a copy of it")
    print(f"{found.messages} messages in {whole}")
