"""``python -m docs.site``: gather, build strictly, check, and put the site beside those of other versions."""

from __future__ import annotations

import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Final

from .check import missing, named_defaults, problems, unlisted
from .pages import ROOT, described, stage
from .versions import collect

PAGES: Final = ROOT / "build" / "pages"
"""``docs_dir`` of mkdocs.yml."""
BUILT: Final = ROOT / "build" / "site"
"""Its ``site_dir``."""
SITE: Final = ROOT / "site"
MERMAID: Final = Path(sysconfig.get_path("purelib"), "nicegui", "elements", "mermaid", "dist")
"""Draws the diagrams in the reader's browser; NiceGUI's wheel has it as files."""


def main() -> int:
    """Make the site; gives the exit code."""
    stage(PAGES)
    shutil.copytree(MERMAID, PAGES / "mermaid")
    build = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--clean", "--strict"], cwd=ROOT, check=False
    )
    if build.returncode:
        return build.returncode
    # Its links are absolute, and where the site will be is not known.
    (BUILT / "404.html").unlink()
    names = [name for page in described().values() for name in page]
    listed = unlisted((BUILT / "objects.inv").read_bytes(), names)
    found = [*problems(BUILT), *missing(BUILT, described()), *listed]
    known = {name.rpartition(".")[2] for name in names}
    for page in sorted((BUILT / "api").glob("*.html")):
        found += [f"{page.name}: {each}" for each in named_defaults(page.read_text(encoding="utf-8"), known)]
    for line in found:
        print(line, file=sys.stderr)
    if found:
        print(f"The site has {len(found)} problem(s).", file=sys.stderr)
        return 1
    folder = collect(BUILT, SITE)
    print(
        f"{folder.relative_to(ROOT)}/index.html; with the search: python3 -m http.server -d site -b 127.0.0.1"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
