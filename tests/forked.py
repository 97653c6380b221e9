"""Programs in processes of their own, without the third of a second of a CPU that their imports take.

A process that has imported the library (``python -m tests.forked``) forks for each of them. What begins then
has its own streams, signals, environment and end, as a process that is started has; only where a test is
about an import it has to be started (``Shell.python`` of tests/cli). Linux makes such a process a child of
who asked for it; elsewhere each is started.
"""

from __future__ import annotations

import atexit
import ctypes
import gc
import importlib
import inspect
import json
import os
import runpy
import socket
import subprocess
import sys
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from subprocess import Popen
from types import ModuleType
from typing import Any, ClassVar

if sys.platform != "win32":
    import fcntl
    import termios

ROOT = Path(__file__).parents[1]
CAN_FORK = sys.platform == "linux"
PR_SET_CHILD_SUBREAPER = 36
CORE = ("robotiq_async.simulator", "anyio._backends._asyncio")
RUN = "robotiq_async.cli.run"
COMMAND_LINE = (
    *(*CORE, RUN, "robotiq_async.cli.connect", "robotiq_async.cli.output.tables"),
    "robotiq_async.tools.verify",
    *("cyclopts.help", "mcap.reader", "mcap.writer", "rich.console", "rich.table"),
    *("textual.app", "textual.drivers.linux_driver", "textual.widgets"),
)
"""Modules of the command line, imported before."""
PAGE = (
    *(*CORE, "aiohttp", "fastapi", "socketio", "jinja2", "h11", "httpx"),
    *("uvicorn.lifespan.on", "uvicorn.protocols.http.h11_impl", "uvicorn.protocols.websockets.auto"),
)
"""Modules that NiceGUI imports. It itself is not imported before: it reads the environment."""
MOST = 1 << 20
"""Bytes of a request."""


# -- here --------------------------------------------------------------------------------------------------


@cache
def _nursery(imported: tuple[str, ...], variables: tuple[tuple[str, str], ...]) -> socket.socket:
    """The end here of the connection to the process that forks; it ends with this one."""
    ctypes.CDLL(None).prctl(PR_SET_CHILD_SUBREAPER, 1, 0, 0, 0)
    here, there = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
    with there:
        command = [sys.executable, "-m", "tests.forked", str(there.fileno()), *imported]
        environment = os.environ | {"PYTHONPATH": str(ROOT)} | dict(variables)
        process = Popen(command, pass_fds=[there.fileno()], env=environment)
    atexit.register(_end, here, process)
    return here


def _end(connection: socket.socket, process: Popen[bytes]) -> None:
    connection.close()
    process.wait()


def fork(
    arguments: Sequence[str],
    environment: Mapping[str, str],
    streams: Sequence[int],
    *,
    terminal: bool = False,
    folder: str = "",
    imported: tuple[str, ...] = COMMAND_LINE,
    variables: tuple[tuple[str, str], ...] = (),
) -> int:
    """Run Python with these arguments (``-m module``, ``-c code`` or a file); return its process ID."""
    what = {"arguments": arguments, "environment": dict(environment), "folder": folder or os.getcwd()}
    request = json.dumps({**what, "terminal": terminal}).encode()
    nursery = _nursery(imported, variables)
    socket.send_fds(nursery, [request], streams)
    process = int(nursery.recv(20))
    nursery.recv(1)  # from now on it is a child of this one
    return process


class Forked(Popen[Any]):
    """A process that is forked in place of started. Streams that are not given are those of this one."""

    imported: ClassVar[tuple[str, ...]] = COMMAND_LINE
    variables: ClassVar[tuple[tuple[str, str], ...]] = ()
    """Those of the environment that an interpreter, or what is imported, reads only once."""

    def _execute_child(self, *arguments: object) -> None:
        of = inspect.signature(super()._execute_child).bind(*arguments).arguments  # type: ignore[misc]
        pipes = ("p2cread", "p2cwrite", "c2pread", "c2pwrite", "errread", "errwrite")
        try:
            streams = [of[each] for each in (pipes[0], *pipes[3::2])]
            streams = [number if each == -1 else each for number, each in enumerate(streams)]
            self.pid = fork(
                of["args"][1:],
                of["env"],
                streams,
                folder=str(of["cwd"] or ""),
                imported=self.imported,
                variables=self.variables,
            )
            self._child_created = True
        finally:
            self._close_pipe_fds(*(of[each] for each in pipes))  # type: ignore[attr-defined]


@contextmanager
def forking(
    imported: tuple[str, ...] = COMMAND_LINE, variables: Mapping[str, str] | None = None
) -> Iterator[None]:
    """Fork in place of starting processes in this block, asyncio's too, where that can be."""
    before = subprocess.Popen
    if CAN_FORK:
        of = {"imported": imported, "variables": tuple((variables or {}).items())}
        subprocess.Popen = type("_Forked", (Forked,), of)  # type: ignore[misc, assignment]
    try:
        yield
    finally:
        subprocess.Popen = before  # type: ignore[misc]


# -- in the process that forks -----------------------------------------------------------------------------


def _next(connection: socket.socket) -> tuple[dict[str, Any], list[int]] | None:
    """Fork for each request. Returns in each child with its request, and here at the end with None."""
    while True:
        message, streams, _, _ = socket.recv_fds(connection, MOST, 3)
        if not message:
            return None
        # The first child ends at once, and whoever asked inherits the second.
        if (between := os.fork()) == 0:
            if (process := os.fork()) == 0:
                connection.close()
                return json.loads(message), streams
            connection.send(str(process).encode())
            os._exit(0)
        os.waitpid(between, 0)
        connection.send(b".")
        for stream in streams:
            os.close(stream)


def _take(streams: list[int], *, terminal: bool) -> None:
    """Take them in place of the standard streams, as an interpreter does that starts."""
    if terminal:
        os.setsid()
    for number, stream in enumerate(streams):
        os.dup2(stream, number)
    for stream in {*streams} - {0, 1, 2}:
        os.close(stream)
    if terminal:
        fcntl.ioctl(0, termios.TIOCSCTTY, 0)
    sys.stdin = open(0, encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stdout = open(1, "w", encoding="utf-8", closefd=False)  # noqa: SIM115
    sys.stderr = open(  # noqa: SIM115
        2, "w", buffering=1, encoding="utf-8", errors="backslashreplace", closefd=False
    )


def _run(arguments: list[str]) -> None:
    match arguments:
        case ["-P", *arguments]:
            _run(arguments)
        case ["-m", module, *_]:
            sys.argv = arguments[1:]
            runpy.run_module(module, run_name="__main__", alter_sys=True)
        case ["-c", code, *_]:
            sys.argv = ["-c", *arguments[2:]]
            # What a program leaves in its module is there until the interpreter ends.
            sys.modules["__main__"] = ModuleType("__main__")
            exec(code, vars(sys.modules["__main__"]))
        case [file, *_]:
            sys.argv = arguments
            runpy.run_path(file, run_name="__main__")


def _keep(modules: dict[str, ModuleType]) -> None:
    """Let the interpreter end without what was imported before: to take that apart takes 20 ms."""
    apart = {*sys.builtin_module_names, "__main__"}
    for name, module in modules.items():
        if name not in apart:
            ctypes.pythonapi.Py_IncRef(ctypes.py_object(module))
            sys.modules.pop(name, None)


def _main() -> None:
    modules: dict[str, ModuleType] = {}
    atexit.register(_keep, modules)  # the first one is called last
    for module in sys.argv[2:]:
        importlib.import_module(module)
    if RUN in sys.modules:  # the end of others is what their tests look at
        modules |= sys.modules
    gc.collect()
    gc.freeze()
    request = _next(socket.socket(fileno=int(sys.argv[1])))
    if request is None:
        return
    what, streams = request
    os.environ.clear()
    os.environ.update(what["environment"])
    os.chdir(what["folder"])
    _take(streams, terminal=what["terminal"])
    _run(what["arguments"])


if __name__ == "__main__":
    _main()
