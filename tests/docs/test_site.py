"""The site: every page is on it, its links lead somewhere, and nothing would come from another host."""

from __future__ import annotations

import json
import pkgutil
import re
import zlib
from pathlib import Path

import pytest

import robotiq_async
from docs.site import check, versions
from docs.site.docstrings import in_markdown
from docs.site.pages import EXTRAS, PROJECT, described, places, stage, staged
from robotiq_async import fleet, simulator, sync
from tests.docs.pages import DOCS, PAGES, ROOT, prose, read

CONFIGURATION = read(ROOT / "mkdocs.yml")
NAVIGATION = re.findall(r"^ +- (?:.*: )?(\S+\.md)$", CONFIGURATION.partition("\nnav:\n")[2], re.MULTILINE)


# -- which pages there are ---------------------------------------------------------------------------------


def test_every_page_is_in_the_navigation_once() -> None:
    pages = {place for place in places().values() if place.endswith(".md")}
    assert pages - {*NAVIGATION} == set(), "not in mkdocs.yml, under nav"
    assert {*NAVIGATION} - pages == set(), "in mkdocs.yml, under nav, and no page"
    assert len(NAVIGATION) == len(pages)


def test_every_picture_is_on_a_page() -> None:
    shown = "".join(map(read, [*PAGES, ROOT / "README.md"]))
    pictures = [path for path in DOCS.rglob("*") if path.suffix in (".svg", ".webp")]
    assert pictures
    assert [path.name for path in pictures if f"{path.parent.name}/{path.name}" not in shown] == []


def test_sources_of_the_site_are_not_published() -> None:
    assert not [source for source in places() if source.endswith(".py") or source.startswith("docs/site/")]
    assert places()["docs/decisions/one-owner.md"] == "decisions/one-owner.md"


def test_a_page_is_the_same_in_every_dialect() -> None:
    """The site's Markdown is stricter: a list or a table after a line of prose is prose to it."""
    for page in [*PAGES, *(ROOT / name for name in PROJECT)]:
        text = read(page)
        for fence in re.findall(r"^( *)```\w*$", text, re.MULTILINE):
            assert len(fence) % 4 == 0, f"{page}: code within a list is indented by four"
        before = ""
        for line in prose(text).splitlines():
            if re.match(r"([-*]|1\.) |\|", line) and before.strip():
                assert re.match(r"\s*([-*]|\d+\.) |\||\s", before), f"{page}: {line!r} needs an empty line"
            before = line


# -- links -------------------------------------------------------------------------------------------------

KNOWN = {
    "README.md": "index.md",
    "docs/tutorial.md": "tutorial.md",
    "docs/how-to/fleet.md": "how-to/fleet.md",
    "docs/decisions/README.md": "decisions/README.md",
    "docs/measured/web.webp": "measured/web.webp",
}


@pytest.mark.parametrize(
    ("source", "text", "expected"),
    [
        ("docs/tutorial.md", "[a](how-to/fleet.md#b)", "[a](how-to/fleet.md#b)"),
        ("docs/how-to/fleet.md", "[a](../../README.md#b)", "[a](../index.md#b)"),
        ("README.md", "[a](docs/how-to/fleet.md)", "[a](how-to/fleet.md)"),
        ("README.md", "[a](docs/decisions/)", "[a](decisions/README.md)"),
        ("README.md", "![a](docs/measured/web.webp)", "![a](measured/web.webp)"),
        ("docs/tutorial.md", "[`hand`](../robotiq_async/local/robotiq_hand.py)", "`hand`"),
        ("docs/tutorial.md", "[a](gone.md)", "[a](gone.md)"),
        (
            "docs/tutorial.md",
            "[a](#b), [c](https://example.org/d.md)",
            "[a](#b), [c](https://example.org/d.md)",
        ),
        ("docs/tutorial.md", "```\n[a](../README.md)\n```", "```\n[a](../README.md)\n```"),
        ("docs/tutorial.md", "<!-- begin b -->", "<!-- begin b -->"),
    ],
)
def test_a_link_leads_to_the_same_page_from_its_place_on_the_site(
    source: str, text: str, expected: str
) -> None:
    assert staged(text, source, KNOWN) == expected


def test_a_picture_that_is_not_on_the_site_is_an_error() -> None:
    with pytest.raises(ValueError, match=r"docs/tutorial.md: ../ros2/a.png is not on the site"):
        staged("![a](../ros2/a.png)", "docs/tutorial.md", KNOWN)


def test_all_pages_are_gathered(tmp_path: Path) -> None:
    (tmp_path / "pages").mkdir()
    (tmp_path / "pages" / "left-over.md").touch()
    stage(tmp_path / "pages")
    gathered = {path.relative_to(tmp_path / "pages").as_posix() for path in (tmp_path / "pages").rglob("*.*")}
    assert gathered == {*places().values(), *(each.name for each in EXTRAS)}


# -- the API -----------------------------------------------------------------------------------------------

DESCRIBED = [name for names in described().values() for name in names]


@pytest.mark.parametrize("module", [robotiq_async, simulator, fleet, sync])
def test_every_public_name_is_described(module: object) -> None:
    names = {each.rpartition(".")[2] for each in DESCRIBED}
    assert {*module.__all__} <= names  # type: ignore[attr-defined]


def test_every_documented_name_exists_and_is_listed_once() -> None:
    assert len(DESCRIBED) == len(set(DESCRIBED))
    assert [name for name in DESCRIBED if pkgutil.resolve_name(name) is None] == []


@pytest.mark.parametrize(
    ("docstring", "expected"),
    [
        ("See :meth:`stop`.", "See `stop`."),
        ("See :class:`~robotiq_async.RobotiqHand`.", "See `RobotiqHand`."),
        ("as :attr:`Hand.statistics` does", "as `Hand.statistics` does"),
        ("(:mod:`.feed`)", "(`feed`)"),
        ("in :mod:`robotiq_async.calibration.scales`", "in `scales`"),
        ("Like this::\n\n    code", "Like this:\n\n    code"),
        ("``a::b`` and [::1]", "``a::b`` and [::1]"),
    ],
)
def test_a_docstring_is_put_into_markdown(docstring: str, expected: str) -> None:
    assert in_markdown(docstring) == expected


# -- what is wrong with a built site -----------------------------------------------------------------------

GOOD = """<html><head>
<link rel="canonical" href="https://example.org/"><link rel="stylesheet" href="a.css">
<style>body { background: url(data:image/png;base64,AAAA) }</style>
</head><body><h1 id="b">b</h1>
<a href="#b">b</a> <a href="folder/">f</a> <a href="https://example.org">out</a>
<a href="mailto:a@example.org">m</a>
<img src="a.svg" srcset="a.svg 1x, a.svg 2x"><script src="a.js"></script>
</body></html>
"""


@pytest.fixture
def site(tmp_path: Path) -> Path:
    (tmp_path / "folder").mkdir()
    (tmp_path / "folder" / "index.html").write_text('<a href="../index.html#b">up</a>', encoding="utf-8")
    (tmp_path / "index.html").write_text(GOOD, encoding="utf-8")
    for name in ("a.css", "a.svg", "a.js"):
        (tmp_path / name).write_text("/* url(a.svg) */", encoding="utf-8")
    return tmp_path


def test_a_good_site_has_no_problems(site: Path) -> None:
    assert check.problems(site) == []


FOREIGN = [
    '<script src="https://cdn.example.org/a.js"></script>',
    '<script src="//cdn.example.org/a.js"></script>',
    '<link rel="stylesheet" href="https://fonts.example.org/css">',
    '<link rel="preconnect" href="https://fonts.example.org">',
    '<link rel="icon" href="https://example.org/a.png">',
    '<img src="https://img.example.org/badge.svg">',
    '<img srcset="a.svg 1x, https://img.example.org/a.svg 2x">',
    '<iframe src="https://example.org"></iframe>',
    '<video poster="https://example.org/a.png"></video>',
    '<svg><image href="https://example.org/a.png"/></svg>',
    '<p style="background: url(https://example.org/a.png)"></p>',
    "<style>@import 'https://example.org/a.css';</style>",
    "<style>@font-face { src: url(//example.org/a.woff2) }</style>",
    '<div class="mermaid">graph</div>',
]


def test_resources_from_another_host_are_found(site: Path) -> None:
    for line in FOREIGN:
        (site / "index.html").write_text(GOOD.replace("</body>", f"{line}</body>"), encoding="utf-8")
        (problem,) = check.problems(site)
        assert problem.startswith("index.html: ")
        assert "another host" in problem


def test_so_is_what_a_style_or_a_picture_would_fetch(site: Path) -> None:
    (site / "a.css").write_text("@import url('https://example.org/a.css');", encoding="utf-8")
    (site / "a.svg").write_text("<style>@import url(https://example.org/b.css)</style>", encoding="utf-8")
    assert check.problems(site) == [
        "a.css: from another host: https://example.org/a.css",
        "a.svg: from another host: https://example.org/b.css",
    ]


DEAD = [
    ("gone.html", "leads nowhere"),
    ("a.md", "leads nowhere"),
    ("folder/gone/", "leads nowhere"),
    ("#gone", "has no such anchor"),
    ("folder/#gone", "has no such anchor"),
    ("../gone.html", "leads out of the site"),
    ("/a.css", "leads out of the site"),
]


def test_a_dead_link_is_found(site: Path) -> None:
    for link, why in DEAD:
        (site / "index.html").write_text(f'{GOOD}<a href="{link}">x</a>', encoding="utf-8")
        assert check.problems(site) == [f"index.html: {link} {why}"]


def test_an_empty_site_is_a_problem(tmp_path: Path) -> None:
    assert check.problems(tmp_path) == [f"{tmp_path}: no page"]


def test_a_name_that_the_api_does_not_describe_is_found(site: Path) -> None:
    wanted = {"index.html": ["b", "c"], "gone.html": ["d"]}
    assert [*check.missing(site, wanted)] == ["index.html: nothing about c", "gone.html: nothing about d"]


def test_a_default_that_is_a_name_is_found() -> None:
    page = (
        "<code>move(\n  <b>wait</b>: float = LONG_S,\n  model: Model | None = HAND_E,\n  n: int = 5\n)</code>"
    )
    assert [*check.named_defaults(page, ["HAND_E"])] == ["the default LONG_S is a name, and no value"]


def test_a_name_that_sphinx_would_not_find_is_found() -> None:
    listed = b"# Sphinx inventory version 2\n# Project: a\n# Version: 1\n# zlib\n" + zlib.compress(
        b"a.B py:class 1 api.html#$ -\na.B.c py:method 1 api.html#$ -\n"
    )
    assert [*check.unlisted(listed, ["a.B", "a.D"])] == ["objects.inv: nothing about a.D"]


# -- versions ----------------------------------------------------------------------------------------------


def test_a_version_takes_the_place_of_its_last_build_and_leaves_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    site = tmp_path / "site"
    for version, words in (("0.9.3", "a"), ("0.10.0", "b"), ("0.10.1", "c")):
        built = tmp_path / "built"
        built.mkdir()
        (built / "index.html").write_text(words, encoding="utf-8")
        monkeypatch.setattr(versions, "version", lambda version=version: version)
        assert versions.collect(built, site) == site / version.rpartition(".")[0]
    assert [read(path) for path in sorted(site.glob("*/index.html"))] == ["c", "a"]
    assert json.loads(read(site / "versions.json")) == [
        {"version": "0.10", "title": "0.10.1 (unreleased)", "aliases": ["latest"]},
        {"version": "0.9", "title": "0.9.3 (unreleased)", "aliases": []},
    ]
    assert "url=0.10/index.html" in read(site / "index.html")


def test_the_version_of_the_site_is_the_librarys() -> None:
    assert versions.version() == robotiq_async.__version__


def test_the_environment_of_the_site_is_pinned_and_names_no_place() -> None:
    lines = read("site/requirements.txt").splitlines()
    assert {"zensical", "mkdocstrings", "mkdocstrings-python"} <= {line.partition("==")[0] for line in lines}
    for line in lines:
        assert re.fullmatch(r"[a-z0-9.-]+==[0-9][a-z0-9.]*( ; .*)?", line), line
