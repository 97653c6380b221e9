"""The programs in C that the benchmarks need: a cheap gripper, and a thread that polls it."""

from __future__ import annotations

import contextlib
import shutil
import subprocess
from collections.abc import Iterator
from pathlib import Path

HERE = Path(__file__).parent


class MissingToolError(RuntimeError):
    """Something that is needed to build them is not there."""


def build(name: str, folder: Path, *libraries: str) -> Path:
    """Compile NAME.c into a folder.

    Raises:
        MissingToolError: no compiler, or a header or library is missing.
    """
    compiler = shutil.which("gcc") or shutil.which("cc")
    if compiler is None:
        raise MissingToolError("there is no C compiler (gcc)")
    program = folder / name
    options = [f"-l{library}" for library in libraries]
    built = subprocess.run(
        [compiler, "-O2", "-o", program, HERE / f"{name}.c", *options],
        capture_output=True,
        text=True,
        check=False,
    )
    if built.returncode:
        raise MissingToolError(f"{name}.c does not compile: {built.stderr.strip().splitlines()[0]}")
    return program


@contextlib.contextmanager
def grippers(program: Path, count: int) -> Iterator[list[int]]:
    """So many cheap grippers in a process of their own; gives the ports they listen on."""
    with subprocess.Popen([program, str(count)], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        yield [int(port) for port in process.stdout.readline().split()]
        process.stdin.close()
