"""Other processes: the node, clients that are killed, and their logs. No ROS is imported here."""

from __future__ import annotations

import os
import signal
import socket
import subprocess
import sys
import threading
from pathlib import Path
from typing import Any, Final, Self

ROOT: Final = Path(__file__).parents[3]
PATIENCE_S: Final = 20.0
"""Seconds for anything. The machine may be busy with something else."""
BOOTSTRAP: Final = ("LD_LIBRARY_PATH", "_ROS_WHEELS_BOOTSTRAP_COMPLETE")
"""Variables that the wheels leave in the environment; a child has to begin without them."""
DOMAINS: Final = range(1, 102)
"""The domains of ROS for which Linux has ports, without the one that everybody has."""
_claims: Final[list[socket.socket]] = []
OF_ROS: Final = "module 'sre_"
"""Beginnings of warnings that its parser causes."""


def isolate() -> None:
    """Keep the messages of this process and its children among themselves. Before ROS is initialized."""
    os.environ["ROS_DOMAIN_ID"] = str(_claim_domain())
    os.environ["ROS_AUTOMATIC_DISCOVERY_RANGE"] = "LOCALHOST"


def _claim_domain() -> int:
    """A domain for this process alone: another run beside this one would give its goals to our node."""
    for offset in range(len(DOMAINS)):
        # Not the same one after the other: nodes that were killed are seen for 20 s.
        number = DOMAINS[(os.getpid() + offset) % len(DOMAINS)]
        claim = socket.socket(socket.AF_UNIX)
        try:
            claim.bind(f"\0robotiq_async ros domain {number}")  # abstract: it ends with the process
        except OSError:
            claim.close()
        else:
            _claims.append(claim)
            return number
    raise RuntimeError(f"{len(DOMAINS)} runs of these tests have all domains")


class Process:
    """A child of the tests, and what it prints."""

    def __init__(self, *arguments: str, program: str = sys.executable) -> None:
        """Start a program with arguments: this interpreter, unless another one is named."""
        environment = {name: value for name, value in os.environ.items() if name not in BOOTSTRAP}
        self._child = subprocess.Popen(
            [program, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            cwd=ROOT,
            env=environment | {"PYTHONUNBUFFERED": "1", "RCUTILS_COLORIZED_OUTPUT": "0"},
        )
        self.lines: list[str] = []
        self._news = threading.Condition()
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, kind: object = None, *_: object) -> None:
        if kind is not None:  # needed to find the reason
            print(self.text)  # noqa: T201
        if self._child.poll() is None:
            self._child.kill()
        self._child.wait()
        self._reader.join()
        assert self._child.stdout is not None
        self._child.stdout.close()

    @property
    def pid(self) -> int:
        return self._child.pid

    @property
    def is_running(self) -> bool:
        return self._child.poll() is None

    @property
    def text(self) -> str:
        return "".join(self.lines)

    def prints(self, words: str, *, times: int = 1) -> str:
        """Wait for a line with these words, and return it."""

        def found() -> list[str]:
            return [line for line in self.lines if words in line]

        with self._news:
            in_time = self._news.wait_for(lambda: len(found()) >= times, PATIENCE_S)
        assert in_time, f"{words!r} was not printed:\n{self.text}"
        return found()[-1]

    def send(self, number: signal.Signals) -> None:
        self._child.send_signal(number)

    def ends(self) -> int:
        """Wait for the end, and return the exit code."""
        try:
            code = self._child.wait(PATIENCE_S)
        except subprocess.TimeoutExpired:
            raise AssertionError(f"the process goes on:\n{self.text}") from None
        self._reader.join()
        return code

    def _read(self) -> None:
        assert self._child.stdout is not None
        for line in self._child.stdout:
            with self._news:
                self.lines.append(line)
                self._news.notify_all()


def node(*remaps: str, namespace: str = "/", **parameters: Any) -> Process:
    """A node with parameters."""
    options = [f"{name}:={_yaml(value)}" for name, value in parameters.items()]
    pairs = [word for option in options for word in ("-p", option)]
    pairs += [word for remap in (f"__ns:={namespace}", *remaps) for word in ("-r", remap)]
    warnings = ("-W", "error", "-W", f"ignore:{OF_ROS}:DeprecationWarning")
    return Process(*warnings, "-m", "robotiq_async.ros2", "--ros-args", *pairs)


def _yaml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    return f"'{value}'" if isinstance(value, str) else str(value)
