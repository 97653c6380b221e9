"""For mkdocstrings: puts the docstrings into Markdown as they are read. It alone needs griffe.

The sources are read and not run. So what decorators of the library do to docstrings is done here by the same
functions, and a default that is the name of a constant gets its value.
"""

from __future__ import annotations

import ast
import re
import runpy
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from griffe import Attribute, Class, Docstring, Extension, Function, Module, Object

sys.path.insert(0, str(Path(__file__).parents[2]))

from docs.site.docstrings import in_markdown

ROOT: Final = Path(__file__).parents[2]
ARGUMENTS: Final = runpy.run_path(str(ROOT / "robotiq_async" / "hands" / "arguments.py"))
DESCRIBES: Final = "describes_arguments("
COPIES: Final = re.compile(r"_documented_as\((\w+)\)")


class Markdown(Extension):
    """Rewrites each docstring, and each default that is a name."""

    def on_package(self, *, pkg: Module, **_: object) -> None:
        """Called once the package is read."""
        every = [*_inside(pkg)]
        for each in every:
            if isinstance(each, Function):
                _describe(each)
                for parameter in each.parameters:
                    parameter.default = _shown(each, parameter.default)
            elif isinstance(each, Attribute) and isinstance(each.parent, Class):
                each.value = _shown(each.parent, each.value)
        for each in every:
            if isinstance(each, Class):
                _copy(each)
        for each in every:
            if each.docstring is not None:
                each.docstring.value = in_markdown(each.docstring.value)


def _inside(obj: Object) -> Iterator[Object]:
    yield obj
    for member in obj.members.values():
        if isinstance(member, Object):  # and no alias
            yield from _inside(member)


def _describe(call: Function) -> None:
    """Add the arguments, as their decorator does it."""
    for decorator in call.decorators:
        if (words := str(decorator.value)).startswith(DESCRIBES) and call.docstring is not None:
            names = [parameter.name for parameter in call.parameters if parameter.name != "self"]
            same = dict(re.findall(r"(\w+)=['\"](\w+)['\"]", words))
            call.docstring.value = ARGUMENTS["with_arguments"](call.docstring.value, names, same)


def _copy(kind: Class) -> None:
    """Document a class as another, as its decorator does it."""
    for decorator in kind.decorators:
        if (found := COPIES.fullmatch(str(decorator.value))) and kind.docstring is not None:
            original = kind.modules_collection[kind.resolve(found[1])]
            kind.docstring.value = ARGUMENTS["with_arguments_of"](
                kind.docstring.value, original.docstring.value
            )
            for name, member in kind.members.items():
                if not name.startswith("_") and (docstring := original.all_members[name].docstring):
                    member.docstring = Docstring(
                        docstring.value, parent=member, parser=docstring.parser, lineno=docstring.lineno
                    )


def _shown(where: Object, default: object) -> object:
    """A default for the reader: the value of a constant, and anything else as the source has it."""
    if re.fullmatch(r"[A-Z]\w+\.[A-Z_]+", words := str(default)):
        return words  # as an expression it would be shown without its class
    if not re.fullmatch(r"[A-Z_]+", words):
        return default
    value = str(where.modules_collection[where.resolve(words)].value)
    inner = re.fullmatch(r"\w+\((.*)\)", value)  # a number or a text with a type of its own
    try:
        return repr(ast.literal_eval(inner[1] if inner else value))
    except (SyntaxError, ValueError):
        return default
