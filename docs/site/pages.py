"""The pages of the site: those of docs/ and those at the root of the project.

They are gathered in a folder of their own, with links that are right there: on the site README.md and its
like are pages too, and files of the source are not. So one link does for both, the site and the repository.
"""

from __future__ import annotations

import posixpath
import re
import shutil
from collections.abc import Mapping
from pathlib import Path, PurePosixPath
from typing import Final

ROOT: Final = Path(__file__).parents[2]
DOCS: Final = ROOT / "docs"
PROJECT: Final = {
    "README.md": "index.md",
    "CHANGELOG.md": "project/changes.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "SECURITY.md": "project/security.md",
    "LICENSE": "project/license.md",
}
"""The pages at the root, and where they are on the site."""
EXTRAS: Final = [Path(__file__).parent / name for name in ("site.css", "diagrams.js")]

_FENCE: Final = re.compile(r"^ *```.*?^ *```$", re.MULTILINE | re.DOTALL)
_LINK: Final = re.compile(r"(!?)\[((?:[^\[\]]|\[[^\]]*\])*)\]\(([^)\s]+)\)")
_DESCRIBED: Final = re.compile(r"^::: (\S+)", re.MULTILINE)


def places() -> dict[str, str]:
    """The place of each file of the project on the site; both paths from their roots."""
    files = sorted(path for path in DOCS.rglob("*") if path.is_file() and not _is_code(path))
    found = {path.relative_to(ROOT).as_posix(): path.relative_to(DOCS).as_posix() for path in files}
    return found | PROJECT


def _is_code(path: Path) -> bool:
    """Programs that make the pages: they are no part of them."""
    return path.suffix in (".py", ".pyc") or path.is_relative_to(DOCS / "site")


def stage(folder: Path) -> None:
    """Write all pages, and what they show, into a folder that is emptied before.

    Raises:
        ValueError: a picture is not on the site.
    """
    shutil.rmtree(folder, ignore_errors=True)
    known = places()
    for source, place in known.items():
        target = folder / place
        target.parent.mkdir(parents=True, exist_ok=True)
        if target.suffix == ".md":
            text = (ROOT / source).read_text(encoding="utf-8")
            target.write_text(staged(text, source, known), encoding="utf-8")
        else:
            shutil.copyfile(ROOT / source, target)
    for extra in EXTRAS:
        shutil.copyfile(extra, folder / extra.name)


def described() -> dict[str, list[str]]:
    """The objects on each page of the API, by the page's place on the built site."""
    pages = sorted((DOCS / "api").glob("*.md"))
    return {f"api/{page.stem}.html": _DESCRIBED.findall(page.read_text(encoding="utf-8")) for page in pages}


def staged(text: str, source: str, known: Mapping[str, str]) -> str:
    """A page as it is on the site.

    Args:
        text: of the page.
        source: its path in the project.
        known: where each file of the project is on the site.

    Raises:
        ValueError: a picture is not on the site.
    """
    if source == "LICENSE":
        text = f"# {text}"
    pieces, end = [], 0
    for fence in _FENCE.finditer(text):
        pieces += [_relinked(text[end : fence.start()], source, known), fence[0]]
        end = fence.end()
    return "".join([*pieces, _relinked(text[end:], source, known)])


def _relinked(text: str, source: str, known: Mapping[str, str]) -> str:
    return _LINK.sub(lambda link: _link(link, PurePosixPath(source), known), text)


def _link(link: re.Match[str], source: PurePosixPath, known: Mapping[str, str]) -> str:
    """A link that leads there from the page's place on the site; the words alone where there is nothing."""
    mark, words, target = link.groups()
    path, hash_sign, anchor = target.partition("#")
    here = PurePosixPath(known[str(source)])
    if not path or re.match(r"[a-z]+:", path):
        return link[0]
    wanted = posixpath.normpath(source.parent / path)
    place = known.get(wanted) or known.get(f"{wanted}/README.md")
    if place is not None:
        return f"{mark}[{words}]({posixpath.relpath(place, here.parent)}{hash_sign}{anchor})"
    if mark:
        raise ValueError(f"{source}: {path} is not on the site")
    # What exists is a file of the source, which has no page; what does not is left for the build to find.
    return words if (ROOT / wanted).exists() else link[0]
