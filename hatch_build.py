"""The description that the package index shows: README.md, whose links are absolute there.

In the repository and on the site the links are relative, and so right in every clone. The index has no files
to lead to: a link leads to the repository at the release's tag instead.
"""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

sys.path.insert(0, str(Path(__file__).parent))

from docs.site.absolute import absolute


class Readme(MetadataHookInterface):
    """Asked by hatchling, whatever it builds."""

    def update(self, metadata: dict[str, Any]) -> None:
        """Add the description."""
        text = Path(self.root, "README.md").read_text(encoding="utf-8")
        text = absolute(text, metadata["urls"]["Repository"], metadata["version"])
        metadata["readme"] = {"content-type": "text/markdown", "text": text}
