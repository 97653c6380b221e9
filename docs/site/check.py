"""Mistakes of a built site: dead links, and files that a browser would fetch from another host."""

from __future__ import annotations

import os
import re
import zlib
from collections.abc import Collection, Iterable, Iterator, Mapping
from html import unescape
from html.parser import HTMLParser
from pathlib import Path
from typing import Final
from urllib.parse import unquote, urlsplit

FETCHED: Final = {
    "audio": ("src",),
    "embed": ("src",),
    "iframe": ("src",),
    "image": ("href", "xlink:href"),
    "img": ("src", "srcset"),
    "input": ("src",),
    "link": ("href",),
    "object": ("data",),
    "script": ("src",),
    "source": ("src", "srcset"),
    "track": ("src",),
    "use": ("href", "xlink:href"),
    "video": ("src", "poster"),
}
"""Attributes that a browser loads by itself, by element."""
NOT_FETCHED: Final = {"alternate", "author", "canonical", "license", "next", "prev", "search"}
"""Relations of a ``<link>`` that only point somewhere."""
_IN_STYLES: Final = re.compile(r"""(?:@import\s+(?:url\(\s*)?|url\(\s*)["']?([^"')\s;]+)""")


class _Page(HTMLParser):
    """The links, the fetched files and the anchors of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.anchors: set[str] = set()
        self.links: list[str] = []
        self.fetched: list[str] = []
        self.classes: set[str] = set()
        self._is_style = False
        self.feed(text)
        self.close()

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        has = {name: value or "" for name, value in attrs}
        self.anchors |= {has[name] for name in ("id", "name") if name in has}
        self.classes |= set(has.get("class", "").split())
        self.fetched += _IN_STYLES.findall(has.get("style", ""))
        self._is_style = tag == "style"
        if tag == "a" and "href" in has:
            self.links.append(has["href"])
        elif tag == "link" and set(has.get("rel", "").split()) <= NOT_FETCHED:
            return
        for name in FETCHED.get(tag, ()):
            for each in has.get(name, "").split(",") if name == "srcset" else [has.get(name, "")]:
                self.fetched += each.split()[:1]

    def handle_data(self, data: str) -> None:
        if self._is_style:
            self.fetched += _IN_STYLES.findall(data)


def problems(site: Path) -> list[str]:
    """Everything that is wrong, a line each; an empty list is a good site."""
    pages = {path: _Page(path.read_text(encoding="utf-8")) for path in sorted(site.rglob("*.html"))}
    if not pages:
        return [f"{site}: no page"]
    found = []
    for path, page in pages.items():
        where = path.relative_to(site).as_posix()
        found += [f"{where}: from another host: {each}" for each in page.fetched if is_foreign(each)]
        # The theme's script fetches what draws these when it meets one.
        found += [f"{where}: needs a script of another host: {each}" for each in page.classes & {"mermaid"}]
        local = [
            each
            for each in [*page.links, *page.fetched]
            if not urlsplit(each).scheme and not is_foreign(each)
        ]
        found += [f"{where}: {each} {why}" for each in local if (why := _dead(each, path, site, pages))]
    for style in sorted(site.rglob("*.css")) + sorted(site.rglob("*.svg")):
        used = _IN_STYLES.findall(style.read_text(encoding="utf-8"))
        where = style.relative_to(site).as_posix()
        found += [f"{where}: from another host: {each}" for each in used if is_foreign(each)]
    return found


def is_foreign(address: str) -> bool:
    """Whether fetching it asks another host."""
    parts = urlsplit(address)
    return bool(parts.netloc) or parts.scheme not in ("", "data", "blob")


def _dead(link: str, source: Path, site: Path, pages: dict[Path, _Page]) -> str:
    """Why a link within the site leads nowhere; empty if it does not."""
    parts = urlsplit(link)
    target = Path(os.path.normpath(source.parent / unquote(parts.path))) if parts.path else source
    if parts.path.startswith("/") or not target.is_relative_to(site):
        return "leads out of the site"
    if target.is_dir():
        target /= "index.html"
    if not target.is_file():
        return "leads nowhere"
    anchor = unquote(parts.fragment)
    if anchor and target in pages and anchor not in _anchors(pages[target]):
        return "has no such anchor"
    return ""


def _anchors(page: _Page) -> Iterable[str]:
    return page.anchors | {"top", "__top"}


def missing(site: Path, wanted: Mapping[str, Iterable[str]]) -> Iterator[str]:
    """Which anchors a page should have and has not.

    Args:
        site: the folder of the built site.
        wanted: for each page the anchors.
    """
    for place, anchors in wanted.items():
        file = site / place
        has = _Page(file.read_text(encoding="utf-8")).anchors if file.is_file() else set()
        yield from (f"{place}: nothing about {each}" for each in anchors if each not in has)


def unlisted(inventory: bytes, names: Iterable[str]) -> Iterator[str]:
    """Which names Sphinx would not find: ``objects.inv`` has four lines of head, and the rest compressed."""
    lines = zlib.decompress(inventory.split(b"\n", 4)[4]).decode().splitlines()
    known = {line.partition(" ")[0] for line in lines}
    yield from (f"objects.inv: nothing about {name}" for name in names if name not in known)


def named_defaults(page: str, known: Collection[str]) -> Iterator[str]:
    """Defaults in the signatures of a page that are names of constants, and not among those known."""
    words = unescape(re.sub(r"<[^>]+>", "", page))
    found = set(re.findall(r"^\s*\w+: [^=\n]+ = ([A-Z][A-Z_]+),?$", words, re.MULTILINE))
    yield from (f"the default {name} is a name, and no value" for name in sorted(found - {*known}))
