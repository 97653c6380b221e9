"""For mkdocstrings: puts the docstrings into Markdown as they are read. It alone needs griffe.

The sources are read and not run, so the arguments of motions are added as their decorator does it.
"""

from __future__ import annotations

import re
import runpy
import sys
from pathlib import Path
from typing import Final

from griffe import Alias, Extension, Object

sys.path.insert(0, str(Path(__file__).parents[2]))

from docs.site.docstrings import in_markdown

ROOT: Final = Path(__file__).parents[2]
DECORATOR: Final = "describes_arguments("
WITH_ARGUMENTS: Final = runpy.run_path(str(ROOT / "robotiq_async" / "hand" / "arguments.py"))[
    "with_arguments"
]


class Markdown(Extension):
    """Rewrites each docstring."""

    def on_object(self, *, obj: Object | Alias, **_: object) -> None:
        """Called for each object of the package, once it and its members are read."""
        if not obj.is_alias and obj.docstring is not None:
            text = obj.docstring.value
            for decorator in obj.decorators if obj.is_function else ():
                if (call := str(decorator.value)).startswith(DECORATOR):
                    names = [parameter.name for parameter in obj.parameters if parameter.name != "self"]
                    text = WITH_ARGUMENTS(text, names, dict(re.findall(r"(\w+)=['\"](\w+)['\"]", call)))
            obj.docstring.value = in_markdown(text)
