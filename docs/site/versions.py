"""A built site beside those of other versions: a folder each, a list that the theme shows, and a door.

    site/index.html       leads to the newest
    site/versions.json    the list, in the form that mike writes and the theme reads
    site/0.1/             all patches of one minor version share a folder

Nothing is uploaded. Who publishes a version keeps the folders of those before it: what is here stays.
"""

from __future__ import annotations

import json
import re
import shutil
from pathlib import Path
from typing import Final

ROOT: Final = Path(__file__).parents[2]
DOOR: Final = """<!doctype html>
<meta charset="utf-8">
<title>robotiq_async</title>
<meta http-equiv="refresh" content="0; url={place}/index.html">
<a href="{place}/index.html">robotiq_async {title}</a>
"""


def version() -> str:
    """That of the package, as its source has it."""
    text = (ROOT / "robotiq_async" / "runtime" / "version.py").read_text(encoding="utf-8")
    found = re.search(r'^__version__: Final = "([^"]+)"$', text, re.MULTILINE)
    if found is None:
        raise ValueError("robotiq_async/runtime/version.py has no version")
    return found[1]


def title() -> str:
    """The version, and whether it is out."""
    changes = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    is_out = re.search(rf"^## \[{re.escape(version())}\] - \d", changes, re.MULTILINE)
    return version() if is_out else f"{version()} (unreleased)"


def collect(built: Path, site: Path) -> Path:
    """Take a built site among the others, in place of one of the same version; gives its folder.

    Args:
        built: the site; it is moved.
        site: the folder of all versions.
    """
    place = ".".join(version().split(".")[:2])
    folder, listed = site / place, site / "versions.json"
    shutil.rmtree(folder, ignore_errors=True)
    site.mkdir(parents=True, exist_ok=True)
    shutil.move(built, folder)
    others = json.loads(listed.read_text(encoding="utf-8")) if listed.exists() else []
    known = {each["version"]: each for each in others if (site / each["version"]).is_dir()}
    known[place] = {"version": place, "title": title()}
    newest_first = sorted(
        known.values(), key=lambda each: [int(n) for n in each["version"].split(".")], reverse=True
    )
    for each in newest_first:
        each["aliases"] = ["latest"] if each is newest_first[0] else []
    listed.write_text(json.dumps(newest_first, indent=1) + "\n", encoding="utf-8")
    newest = newest_first[0]
    (site / "index.html").write_text(
        DOOR.format(place=newest["version"], title=newest["title"]), encoding="utf-8"
    )
    return folder
