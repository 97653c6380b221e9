"""Values are pure: importing them opens no file of the package."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys
from pathlib import Path
opened = []
sys.addaudithook(lambda event, args: event == "open" and opened.append(str(args[0])))
import robotiq_async
room = Path(robotiq_async.__file__).parent
for each in opened:
    if room in Path(each).parents and not each.endswith((".py", ".pyc")):
        print(each)
"""


def test_importing_the_library_reads_no_table() -> None:
    """A program may import it in its event loop, from a zip, or frozen."""
    # -B: modules that were compiled just now would be written under names of their own.
    command = [sys.executable, "-B", "-c", PROGRAM]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    assert done.stdout == ""
