"""The message about a missing extra: a command that works, wherever the library is from."""

from __future__ import annotations

import re
import shlex
import tomllib
from importlib import metadata
from pathlib import Path

import pytest
from packaging.requirements import Requirement

from robotiq_async import __version__
from robotiq_async.runtime.extras import install, pip_command
from tests.cli.test_project import EXTRAS, packages_of

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "how-to" / "install.md"


@pytest.mark.parametrize("extra", sorted(EXTRAS))
def test_the_command_installs_everything_of_the_extra_and_nothing_else(extra: str) -> None:
    command, _, rest = install(extra).partition(" (")
    pip, verb, *asked = shlex.split(command)
    assert (pip, verb, rest) == ("pip", "install", f"the extra {extra})")
    # Metadata have the names in small letters.
    names = {re.split(r"[<>=!~ ]", each)[0].lower() for each in asked}
    assert names == {name.lower() for name in packages_of(extra)}


def test_the_library_itself_is_not_asked_for() -> None:
    """An index that has none would end the command, and a clone in use would be replaced."""
    assert not any("robotiq-async" in install(extra) for extra in EXTRAS)


def test_the_versions_are_those_that_the_library_needs() -> None:
    requirements = ["anyio>=4.5", "nicegui<4,>=3.18; extra == 'web'", 'robotiq-async[web]; extra == "all"']
    for extra in ("web", "all"):
        assert pip_command(extra, requirements) == f'pip install "nicegui<4,>=3.18" (the extra {extra})'


def test_an_extra_that_there_is_not() -> None:
    with pytest.raises(ValueError, match="there is no extra 'wbe'"):
        pip_command("wbe", metadata.requires("robotiq-async") or [])


def test_no_message_asks_an_index_for_the_library() -> None:
    """It works only where it is published."""
    written = {
        path.relative_to(ROOT): path.read_text()
        for path in (ROOT / "robotiq_async").rglob("*.py")
        if path.name != "extras.py"
    }
    assert [str(path) for path, text in written.items() if "robotiq-async[" in text] == []


def test_the_page_lists_every_extra_and_the_wheel_that_there_is() -> None:
    page = PAGE.read_text()
    listed = re.findall(r"^\| `(\w+)` \|", page, re.MULTILINE)
    assert sorted(listed) == sorted(EXTRAS.keys() - {"dev"})
    assert set(re.findall(r"robotiq_async-([\d.]+)-py3-none-any.whl", page)) == {__version__}
    assert install("web") in page


def test_a_project_that_depends_on_it_as_the_page_says_is_one_that_pip_reads() -> None:
    block = re.search(r"```toml\n(.*?)```", PAGE.read_text(), re.DOTALL)
    assert block is not None
    (dependency,) = tomllib.loads(block[1])["project"]["dependencies"]
    requirement = Requirement(dependency)
    assert (requirement.name, requirement.extras) == ("robotiq-async", {"serial", "web"})
    assert requirement.extras <= EXTRAS.keys()
    assert str(requirement.url).startswith("file:///")
