"""``python -m robotiq_async``: the command line."""

import sys

from .cli import main

code = main()
# A KeyboardInterrupt inside exec(), with which dataclasses are made, leaves a mark in CPython even if it is
# caught: a module run with -m then ends by SIGINT, without its exit code. Another exec() removes the mark.
exec("")
sys.exit(code)
