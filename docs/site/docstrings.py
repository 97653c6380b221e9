"""The docstrings are reStructuredText where they refer to something, and the site is Markdown."""

from __future__ import annotations

import re
from typing import Final

_ROLE: Final = re.compile(r":(?:attr|class|data|exc|func|meth|mod|obj):`~?([^`]+)`")
_LITERAL: Final = re.compile(r"::$", re.MULTILINE)


def in_markdown(text: str) -> str:
    """A docstring with references as code, and without the second colon before an indented block."""
    return _LITERAL.sub(":", _ROLE.sub(lambda role: f"`{_shown(role[1])}`", text))


def _shown(target: str) -> str:
    """The last part of a path, with the class before it where there is one."""
    path = target.lstrip(".").split(".")
    is_member = len(path) > 1 and path[-2][:1].isupper()
    return ".".join(path[-2:] if is_member else path[-1:])
