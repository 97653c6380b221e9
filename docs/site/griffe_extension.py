"""For mkdocstrings: puts the docstrings into Markdown as they are read. It alone needs griffe."""

from __future__ import annotations

import sys
from pathlib import Path

from griffe import Alias, Extension, Object

sys.path.insert(0, str(Path(__file__).parents[2]))

from docs.site.docstrings import in_markdown


class Markdown(Extension):
    """Rewrites each docstring."""

    def on_object(self, *, obj: Object | Alias, **_: object) -> None:
        """Called for each object of the package, once it and its members are read."""
        if not obj.is_alias and obj.docstring is not None:
            obj.docstring.value = in_markdown(obj.docstring.value)
