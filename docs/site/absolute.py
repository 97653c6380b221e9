"""A page where its files are not, on the package index or in release notes: its links are absolute."""

from __future__ import annotations

import re
from typing import Final

_RELATIVE: Final = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\((?![a-z]+:|#)([^)\s]+)\)")


def absolute(text: str, repository: str, version: str) -> str:
    """A page at the root of the project with links that lead to the tag of a version in a repository."""

    def link(found: re.Match[str]) -> str:
        mark, words, path = found.groups()
        return f"{mark}[{words}]({repository}/{'raw' if mark else 'blob'}/v{version}/{path})"

    return _RELATIVE.sub(link, text)
