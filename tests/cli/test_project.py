"""The project's own files."""

from __future__ import annotations

import re
import tomllib
from importlib.metadata import EntryPoint, packages_distributions
from pathlib import Path

import robotiq_async
from robotiq_async.cli import main
from robotiq_async.cli.app import build

ROOT = Path(__file__).parents[2]
SETTINGS = tomllib.loads((ROOT / "pyproject.toml").read_text())
PROJECT, HATCH = SETTINGS["project"], SETTINGS["tool"]["hatch"]


def test_one_version() -> None:
    """It is in version.py; files that cannot take it from there are compared."""
    version, settings = robotiq_async.__version__, HATCH["version"]
    found = re.search(settings["pattern"], (ROOT / settings["path"]).read_text())
    assert found is not None
    assert found["version"] == version
    assert "version" not in PROJECT
    assert f"<version>{version}</version>" in (ROOT / "packaging" / "ros2" / "package.xml").read_text()
    changes = (ROOT / "CHANGELOG.md").read_text()
    assert f"## [{version}]" in changes
    # As long as nothing is released there is none to cite.
    released = re.findall(r"^## \[(.+)\] - \d{4}-\d\d-\d\d$", changes, re.MULTILINE)
    assert re.findall(r"^version: (.+)$", (ROOT / "CITATION.cff").read_text(), re.MULTILINE) == released[:1]


def test_the_metadata_are_of_a_version_that_the_package_index_is_known_to_take() -> None:
    """Hatchling's default follows the newest standard; uploads have been refused for that."""
    for target in ("wheel", "sdist"):
        assert HATCH["build"]["targets"][target]["core-metadata-version"] == "2.4"


def test_the_script_is_the_command_line() -> None:
    script = EntryPoint("robotiq-async", PROJECT["scripts"]["robotiq-async"], "console_scripts")
    assert script.load() is main


def test_constraints_pin_versions_and_name_no_place() -> None:
    lines = (ROOT / "constraints.txt").read_text().splitlines()
    assert lines
    for line in lines:
        assert re.fullmatch(r"[a-z0-9.-]+==[0-9][a-z0-9.]*( ; .*)?", line), line
        assert "://" not in line


def test_every_dependency_is_pinned() -> None:
    pinned = {line.partition("==")[0] for line in (ROOT / "constraints.txt").read_text().splitlines()}
    wanted = [
        *PROJECT["dependencies"],
        *(d for extra in PROJECT["optional-dependencies"].values() for d in extra),
    ]
    names = {re.split(r"[\[<>=~! ]", text)[0].lower() for text in wanted}
    assert names - {"robotiq-async"} <= pinned


EXTRAS: dict[str, list[str]] = PROJECT["optional-dependencies"]
NEED = re.compile(r'need\("(\w+)", "(\w+)"')
"""A command refuses to run without a module of an extra."""
ADVICE = re.compile(r"needs? ([a-z-]+): \{install\('(\w+)'\)\}")
"""A module of the package does."""


def packages_of(extra: str) -> set[str]:
    """The packages that an extra brings, also by another one that it names."""
    found: set[str] = set()
    for text in EXTRAS[extra]:
        name, _, rest = re.split(r"[<>=~! ]", text)[0].partition("[")
        found |= {name} if not rest else set().union(*map(packages_of, rest.rstrip("]").split(",")))
    return found


def test_a_missing_module_names_the_extra_that_brings_it() -> None:
    package = {module: names[0] for module, names in packages_distributions().items()}
    sources = [file.read_text() for file in sorted((ROOT / "robotiq_async").rglob("*.py"))]
    needs = {found for source in sources for found in NEED.findall(source)}
    assert {extra for _, extra in needs} == {"fleet", "monitor", "plot", "record", "serial", "view", "web"}
    for module, extra in needs:
        assert package[module] in packages_of(extra), f"{extra} does not bring {module}"
    advised = {found for source in sources for found in ADVICE.findall(source)}
    assert {extra for _, extra in advised} == {
        "cli",
        "fleet",
        "grpc",
        "metrics",
        "physics",
        "plot",
        "record",
        "serial",
        "view",
        "web",
    }
    for name, extra in advised:
        assert {name, package.get(name, name)} & packages_of(extra), f"{extra} does not bring {name}"


def test_the_first_help_fits_60_columns_and_every_example_80() -> None:
    assert [
        line for line in str(build().help).splitlines() if line.startswith("    ") and len(line) > 60
    ] == []
    for file in (ROOT / "robotiq_async" / "cli" / "commands").rglob("*.py"):
        examples = re.findall(r"^ {8}(robotiq-async .*)$", file.read_text(encoding="utf-8"), re.MULTILINE)
        assert [line for line in examples if len(line) + 4 > 80] == [], file


def test_the_help_says_which_extra_each_command_needs() -> None:
    lines = (line.split(maxsplit=1) for line in re.sub(r"\n {6,}", " ", str(build().help)).splitlines())
    advised = {words[0]: words[1] for words in lines if len(words) == 2}
    commands = ROOT / "robotiq_async" / "cli" / "commands"
    for file in commands.rglob("*.py"):
        needed = {extra for _, extra in NEED.findall(file.read_text())}
        names = {"recordings": "replay"}
        assert all(names.get(file.stem, file.stem) in advised[extra] for extra in needed - {"plot"}), file
    for extra, words in {"record": "record replay export plot recover", "plot": "plot measure"}.items():
        assert set(words.split()) <= set(re.findall(r"\w+", advised[extra]))
    assert "rtu://" in advised["serial"]


def test_the_extra_that_is_a_command_brings_the_command_line() -> None:
    assert packages_of("monitor") > packages_of("cli") > {"cyclopts"}


def test_no_package_index_is_named() -> None:
    for name in ("pyproject.toml", "Makefile", "mkdocs.yml", ".ci/run"):
        assert not re.search(r"index-url|find-links|simple/|://[^\s]*pypi", (ROOT / name).read_text()), name
