"""Values are pure: importing them opens no file of the package."""

from __future__ import annotations

import subprocess
import sys

PROGRAM = """
import sys
opened = []
sys.addaudithook(lambda event, args: event == "open" and opened.append(str(args[0])))
import robotiq_async
print(*(each for each in opened if not each.endswith((".py", ".pyc"))), sep="\\n")
"""


def test_importing_the_library_reads_no_table() -> None:
    """A program may import it in its event loop, from a zip, or frozen."""
    done = subprocess.run([sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True)
    assert [each for each in done.stdout.split() if "robotiq_async" in each] == []
