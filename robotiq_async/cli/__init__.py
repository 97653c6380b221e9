"""The command line ``robotiq-async``; its dependencies come with the extra ``cli``.

There is one file per sub-command; :mod:`.app` lists them. A sub-command is a function, or a coroutine
function if it uses a gripper. cyclopts makes options and help from its signature and docstring. :mod:`.run`
runs it, ends it on a signal and turns its errors into exit codes. A sub-command that moves a gripper asks
first (:mod:`.consent`)::

    0  success
    1  the gripper or the link failed, or the answer was not yes: one line on stderr
    2  wrong usage; also a command that moves, without a terminal and without --yes
    128 + N  ended by signal N (130: Ctrl-C)
"""

from __future__ import annotations

import signal
import sys
from collections.abc import Sequence


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line and return its exit code; the arguments default to the process's."""
    try:
        from .run import run
    except ModuleNotFoundError as error:
        if error.name != "cyclopts":
            raise
        from ..runtime import install

        print(f"robotiq-async: the command line needs cyclopts: {install('cli')}", file=sys.stderr)
        return 1
    except KeyboardInterrupt:
        # A Ctrl-C during the imports, which take 0.25 s.
        print("robotiq-async: interrupted", file=sys.stderr)
        return 128 + signal.SIGINT
    return run(sys.argv[1:] if arguments is None else arguments)
