"""The pages of the API: which names are public, and where each is described.

Only the source is read: the environment of the site holds nothing of the library.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable
from pathlib import Path
from typing import Final, NamedTuple

ROOT: Final = Path(__file__).parents[2]
PACKAGE: Final = "robotiq_async"


class Part(NamedTuple):
    """A page of the API.

    Attributes:
        title: what stands above it.
        about: a sentence or two.
        names: the objects on it, with the modules that programs import them from.
        is_plain: whether members without a docstring are shown, too: those of enums say all by their names.
    """

    title: str
    about: str
    names: tuple[str, ...]
    is_plain: bool = False


def exports(module: str) -> list[str]:
    """What a module's ``__all__`` holds, with the module's name."""
    for node in _body(module):
        if isinstance(node, ast.Assign) and [ast.unparse(each) for each in node.targets] == ["__all__"]:
            return [f"{module}.{name}" for name in ast.literal_eval(node.value)]
    raise ValueError(f"{module} has no __all__")


def origins(module: str) -> dict[str, str]:
    """Where a module's ``from ... import`` takes each name from, without leading dots."""
    return {
        f"{module}.{alias.asname or alias.name}": node.module or ""
        for node in _body(module)
        if isinstance(node, ast.ImportFrom)
        for alias in node.names
    }


def classes(module: str) -> list[str]:
    """The public classes that a module defines, in their order."""
    defined = (node.name for node in _body(module) if isinstance(node, ast.ClassDef))
    return [f"{module}.{name}" for name in defined if not name.startswith("_")]


def _body(module: str) -> list[ast.stmt]:
    path = ROOT.joinpath(*module.split("."))
    file = path / "__init__.py" if path.is_dir() else path.with_suffix(".py")
    return ast.parse(file.read_text(encoding="utf-8")).body


def parts() -> dict[str, Part]:
    """Every page of the API, by its file's name."""
    origin = origins(PACKAGE)
    names = exports(PACKAGE)
    enums = [name for name in names if origin[name] == "values.enums"]
    hand = [name for name in names if origin[name].split(".")[0] == "hand"]
    errors = [name for name in names if origin[name] == "values.errors"]
    values = [name for name in names if name not in {*enums, *hand, *errors}]
    fleet = origins(f"{PACKAGE}.fleet")
    return {
        "hand.md": Part(
            "The hand", "One gripper, for the program that moves it.", (*hand, f"{PACKAGE}.hand.Hand")
        ),
        "sync.md": Part(
            "The hand without await",
            "For scripts and notebooks: the calls of the async one, which describes them.",
            tuple(exports(f"{PACKAGE}.sync")),
        ),
        "values.md": Part(
            "Readings, results, options",
            "What a hand hands out, and what it takes beside numbers.",
            tuple(values),
        ),
        "enums.md": Part(
            "Names and numbers",
            "Axes, states, faults, and the values of the registers.",
            tuple(enums),
            is_plain=True,
        ),
        "errors.md": Part(
            "Errors",
            "Those of gripper and link are in `robotiq_async` itself, others in the room that raises them.",
            tuple(classes(f"{PACKAGE}.values.errors")),
        ),
        "simulator.md": Part(
            "The simulator",
            "A gripper in memory, servers that put it on a wire, and fixtures for the tests of applications.",
            (*exports(f"{PACKAGE}.simulator"), f"pytest_{PACKAGE}.plugin"),
        ),
        "fleet.md": Part(
            "Hands on other hosts",
            "Extra `fleet`, which is needed when a session is opened.",
            tuple(name for name in exports(f"{PACKAGE}.fleet") if fleet[name] != "errors"),
        ),
        "meaning.md": Part(
            "What the values mean",
            "Millimetres, newtons and seconds; joint angles; the hand in three dimensions.",
            (
                *exports(f"{PACKAGE}.values.calibration"),
                f"{PACKAGE}.tools.description.kinematics",
                *exports(f"{PACKAGE}.tools.description"),
            ),
        ),
        "tools.md": Part(
            "Around a hand",
            "Each behind its extra. They listen; only what is asked through an `Operator` moves anything.",
            (
                f"{PACKAGE}.tools.actions.Operator",
                f"{PACKAGE}.tools.recording.recorder.Recorder",
                f"{PACKAGE}.tools.recording.recordings.read_recording",
                f"{PACKAGE}.tools.recording.recordings.recover",
                f"{PACKAGE}.tools.viewer.Viewer",
                f"{PACKAGE}.tools.metrics.serve_metrics",
                f"{PACKAGE}.tools.web.server.PageServer",
            ),
        ),
    }


def api_pages() -> dict[str, str]:
    """The text of each page, by its place on the site."""
    found = parts()
    pages = {f"api/{file}": _page(part) for file, part in found.items()}
    return {"api/index.md": _index(found), **pages}


def _index(found: dict[str, Part]) -> str:
    lines = [
        "# API",
        "Signatures and docstrings, made from the source. Nothing of this has run on real hardware yet.",
        "[The reference](../reference.md) has a line for each; [stability](../stability.md): for how long.",
    ]
    lines += [
        f"## [{part.title}]({file})\n\n{part.about}\n\n{_list(part.names, file)}"
        for file, part in found.items()
    ]
    return "\n\n".join(lines) + "\n"


def _list(names: Iterable[str], file: str) -> str:
    return ", ".join(f"[`{name.rpartition('.')[2]}`]({file}#{name})" for name in names)


def _page(part: Part) -> str:
    options = "\n    options:\n      show_if_no_docstring: true" if part.is_plain else ""
    return (
        "\n\n".join([f"# {part.title}", part.about, *(f"::: {name}{options}" for name in part.names)]) + "\n"
    )
