"""``python -m docs.site``: gather, build strictly, check, and put the site beside those of other versions."""

from __future__ import annotations

import subprocess
import sys
from typing import Final

from .api import parts
from .check import missing, problems
from .pages import ROOT, stage
from .versions import collect

PAGES: Final = ROOT / "build" / "pages"
"""``docs_dir`` of mkdocs.yml."""
BUILT: Final = ROOT / "build" / "site"
"""Its ``site_dir``."""
SITE: Final = ROOT / "site"


def main() -> int:
    """Make the site; gives the exit code."""
    stage(PAGES)
    build = subprocess.run(
        [sys.executable, "-m", "zensical", "build", "--clean", "--strict"], cwd=ROOT, check=False
    )
    if build.returncode:
        return build.returncode
    # Its links are absolute, and where the site will be is not known.
    (BUILT / "404.html").unlink()
    described = {f"api/{file.removesuffix('.md')}.html": part.names for file, part in parts().items()}
    found = [*problems(BUILT), *missing(BUILT, described)]
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
