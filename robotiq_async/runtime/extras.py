"""The command that installs an extra, for each way to install the library.

``pip install "robotiq-async[web]"`` works only where a package index has the library. Installing the packages
of the extra works everywhere: from a clone, a wheel or an index.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator, Sequence
from typing import Final

from .shell import quoted

DISTRIBUTION: Final = "robotiq-async"
_NESTED: Final = re.compile(rf"{DISTRIBUTION}\[(.+)\]$")


def install(extra: str) -> str:
    """The command that installs an extra, for the end of a message."""
    from importlib import metadata  # noqa: PLC0415  # a tenth of the time that a command needs to begin

    try:
        command = pip_command(extra, metadata.requires(DISTRIBUTION) or [])
    except metadata.PackageNotFoundError:  # runs from a clone that is not installed
        command = f"pip install {quoted(f'.[{extra}]')} in the clone"
    return f"{command}, where this program is frozen, and freeze it again" if is_frozen() else command


def is_frozen() -> bool:
    """Whether the program was packed with its interpreter, by PyInstaller or the like.

    ``sys.executable`` is then the program itself, and no Python to start another module with.
    """
    return bool(getattr(sys, "frozen", False))


def pip_command(extra: str, requirements: Sequence[str]) -> str:
    """The command, from the requirements in a distribution's metadata."""
    packages = [quoted(each) for each in dict.fromkeys(_packages(extra, requirements))]
    if not packages:
        raise ValueError(f"there is no extra {extra!r}")
    return f"pip install {' '.join(packages)} (the extra {extra})"


def _packages(extra: str, requirements: Sequence[str]) -> Iterator[str]:
    marker = re.compile(rf"""\bextra\s*==\s*['"]{re.escape(extra)}['"]""")
    for requirement in requirements:
        package, _, condition = requirement.partition(";")
        if not marker.search(condition):
            continue
        nested = _NESTED.match(package.strip())
        if nested is None:
            yield package.strip()
            continue
        for other in nested[1].split(","):
            yield from _packages(other.strip(), requirements)
