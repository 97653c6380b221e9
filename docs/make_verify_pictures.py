"""Makes the pictures of ``verify`` at a terminal, with a simulated gripper. Takes three minutes.

    python docs/make_verify_pictures.py

They are made by hand when what they show has changed, and looked at: they hold times and figures of that day.
"""

from __future__ import annotations

import asyncio
import io
import re
import sys
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from rich.console import Console
from rich.text import Text

ROOT: Final = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from docs.make_pictures import FOLDER, FONT  # noqa: E402
from robotiq_async.simulator import SimulatedGripper, SimulatorServer  # noqa: E402
from robotiq_async.simulator.troubles.like_hardware import like_hardware, own_habits  # noqa: E402
from robotiq_async.values.model import THREE_FINGER  # noqa: E402
from tests.cli.terminal import Terminal  # noqa: E402

WIDTH: Final = 100
PORT: Final = 5020


async def main() -> None:
    """All of them."""
    gripper = SimulatedGripper(habits=own_habits(THREE_FINGER))
    with TemporaryDirectory() as folder:
        async with SimulatorServer(gripper, port=PORT) as server:
            for habit in like_hardware(THREE_FINGER):
                await server.fault_injector.begin(habit)
            await reading(f"{folder}/verify-1")
            await moving(f"{folder}/verify-2", gripper)


def verify(folder: str, *arguments: str) -> Terminal:
    """The command, on a terminal."""
    return Terminal(
        "-m", "robotiq_async", "verify", f"tcp://127.0.0.1:{PORT}", *arguments, "--report", folder
    )


async def reading(folder: str) -> None:
    """The beginning, and the end of a run in which nothing moved."""
    terminal = verify(folder, "--up-to", "2")
    for stage in (b"Stage 0", b"Stage 1", b"Stage 2"):
        if stage == b"Stage 2":
            await asyncio.sleep(110)  # the long part of stage 1 is silence
        await terminal.shows(b"> ", after=stage)
        if stage == b"Stage 1":
            save("verify_begin", terminal.out.decode(), folder)
        terminal.press("\n")
    await terminal.end()
    save("verify_report", terminal.out.decode().rpartition("> ")[2], folder)


async def moving(folder: str, gripper: SimulatedGripper) -> None:
    """A finger is asked for; a key stops three of them."""
    terminal = verify(folder, "--from", "3", "--up-to", "5")
    await terminal.shows(b"> ", after=b"Stage 3")
    terminal.press("\n")
    await terminal.shows(b"> ", after=b"Stage 4")
    terminal.press("\n")
    for number, key in enumerate("alrs", 1):
        while terminal.out.count(b"report so far\r\n> ") < number:  # noqa: ASYNC110  # a count of the terminal's
            await asyncio.sleep(0.05)
        if key == "a":
            save("verify_finger", "Stage 4" + terminal.out.decode().rpartition("Stage 4")[2], folder)
        terminal.press(key)
    await terminal.shows(b"> ", after=b"Stage 5")
    terminal.press("\n")
    while not gripper.is_moving:  # noqa: ASYNC110  # a gripper has no event for it
        await asyncio.sleep(0.05)
    await asyncio.sleep(0.5)
    terminal.press(" ")
    await terminal.end()
    save("verify_stopped", "Stage 5" + terminal.out.decode().rpartition("Stage 5")[2], folder)


def save(name: str, text: str, folder: str) -> None:
    """Write what stood on the terminal."""
    clean = re.sub(r"\x1b\[[0-9;]*m", "", text).replace("\r", "").replace(folder, Path(folder).name)
    console = Console(record=True, width=WIDTH, file=io.StringIO())
    console.print(Text(clean.strip("\n")))
    file = FOLDER / f"{name}.svg"
    file.write_text(FONT.sub("", console.export_svg(title="robotiq-async verify")), encoding="utf-8")
    sys.stdout.write(f"{file.relative_to(ROOT)}\n")


if __name__ == "__main__":
    asyncio.run(main())
