"""Decisions of the releases' programs; the rest they try themselves: make dist, pythons, canary."""

from __future__ import annotations

import re
import sys
import tomllib
from pathlib import Path

import pytest

from docs.site.absolute import absolute
from docs.site.versions import version
from tests.release.canary import news, pinned, unlimited
from tests.release.dist import relative
from tests.release.environments import ROOT, FailedError, run
from tests.release.tag import check, notes, repositories


def test_a_failed_program_is_reported_with_its_output() -> None:
    with pytest.raises(FailedError, match=r"ended with 3:\nwords"):
        run(sys.executable, "-c", "print('words'); raise SystemExit(3)")
    assert run(sys.executable, "-c", "raise SystemExit(3)", code=3) == ""


def test_a_program_is_lent_no_modules(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONPATH", "/nowhere")
    assert "/nowhere" not in run(sys.executable, "-c", "import sys; print(sys.path)")


def test_versions_newer_than_the_constraints_are_named() -> None:
    (version,) = pinned()["pymodbus"]
    assert news([f"pymodbus=={version}", "anyio==99.0", "stranger==1.0"]) == [
        f"anyio {next(iter(pinned()['anyio']))} -> 99.0",
        "stranger nothing -> 1.0",
    ]


def test_a_package_that_is_pinned_twice_may_be_either() -> None:
    versions = pinned()["numpy"]
    assert len(versions) == 2
    assert news(f"numpy=={each}" for each in versions) == []


# -- a tag ---------------------------------------------------------------------------------------------------


def test_every_file_names_the_same_repository() -> None:
    (repository,) = set(repositories().values())
    parts = re.fullmatch(r"https://github\.com/([\w-]+)/([\w-]+)", repository)
    assert parts is not None
    urls = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]["urls"]
    pages = "https://{}.github.io/{}/".format(*parts.groups())
    assert all(url.startswith(repository) or url == pages for url in urls.values())


def test_no_address_is_an_example() -> None:
    for name in ("pyproject.toml", "CITATION.cff", "packaging/ros2/package.xml", "README.md", "SECURITY.md"):
        assert not re.search(r"example\.(org|com)", (ROOT / name).read_text(encoding="utf-8")), name


def test_a_tag_of_another_version_or_another_repository_is_no_release() -> None:
    repository = repositories()["pyproject.toml"]
    with pytest.raises(FailedError, match=f"the tag is v99.0, and .*version.py has {version()}"):
        check("v99.0", repository)
    with pytest.raises(
        FailedError, match=r"this repository is https://github\.com/other/name, and not as in"
    ):
        check(f"v{version()}", "https://github.com/other/name")


def test_the_notes_of_a_release_are_what_the_changelog_says_of_it() -> None:
    changelog = (
        "# Changelog\n\n## [0.2.0] - 2026-12-01\n\n### Added\n\n- More.\n\n## [0.1.0] - unreleased\n\nOld.\n"
    )
    assert notes(changelog, "0.2.0") == "### Added\n\n- More."
    for missing in ("0.1.0", "0.3.0"):
        with pytest.raises(FailedError, match=f"has no heading ## .{missing}. - YYYY-MM-DD"):
            notes(changelog, missing)


# -- the description on the package index --------------------------------------------------------------------


def test_links_of_the_description_lead_to_the_tag() -> None:
    page = "![a\nb](docs/a.webp) [c [d]](docs/c.md#e) [f](https://f.org) [g](#g)"
    assert absolute(page, "https://github.com/me/it", "1.2.3") == (
        "![a\nb](https://github.com/me/it/raw/v1.2.3/docs/a.webp)"
        " [c [d]](https://github.com/me/it/blob/v1.2.3/docs/c.md#e) [f](https://f.org) [g](#g)"
    )
    readme = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(relative(readme)) > 40
    assert relative(absolute(readme, "https://github.com/me/it", "1.2.3")) == []


# -- the workflows -------------------------------------------------------------------------------------------

WORKFLOWS = {
    path.name: path.read_text(encoding="utf-8") for path in (ROOT / ".github" / "workflows").glob("*.yml")
}


def test_the_workflow_has_the_steps_of_ci() -> None:
    ours = re.findall(r"^make (\S+)$", (ROOT / ".ci" / "run").read_text(encoding="utf-8"), re.MULTILINE)
    (steps,) = re.findall(r"^ +step: \[(.*)\]$", WORKFLOWS["ci.yml"], re.MULTILINE)
    # Other Pythons have jobs of their own there.
    assert steps.split(", ") == [step for step in ours if step != "pythons"]


def test_the_workflow_has_the_pythons_of_the_classifiers() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    known = re.findall(r"Python :: (3\.\d+)", "\n".join(project["classifiers"]))
    (pythons,) = re.findall(r"python: \[(.*)\]\n +step:", WORKFLOWS["ci.yml"])
    assert pythons.replace('"', "").split(", ") == known


@pytest.mark.parametrize("name", WORKFLOWS)
def test_a_workflow_may_read_and_its_jobs_take_what_they_need(name: str) -> None:
    assert "\npermissions:\n  contents: read\n\njobs:\n" in WORKFLOWS[name]
    writes = re.findall(r"^ +(\S+): write$", WORKFLOWS[name], re.MULTILINE)
    assert (
        sorted(writes)
        == {
            "ci.yml": [],
            "scorecard.yml": ["security-events"],
            "release.yml": ["contents", "id-token", "id-token", "pages"],
            "site.yml": ["id-token", "pages"],
        }[name]
    )
    assert "secrets" not in WORKFLOWS[name]


@pytest.mark.parametrize("name", WORKFLOWS)
def test_actions_are_pinned(name: str) -> None:
    """By commit: a tag can be moved. The comment has the version, which dependabot keeps, too."""
    for action in re.findall(r"uses: (.+)$", WORKFLOWS[name], re.MULTILINE):
        if action.startswith("./"):
            assert (ROOT / action).is_file()
        else:
            assert re.fullmatch(r"[\w-]+/[\w/-]+@[0-9a-f]{40} # v\d+\.\d+\.\d+", action)


def test_an_action_has_one_commit_in_all_workflows() -> None:
    used = {found for text in WORKFLOWS.values() for found in re.findall(r"uses: ([^.\s]\S+)@(\w+)", text)}
    assert len(used) == len({name for name, _ in used})


# -- what is pinned ------------------------------------------------------------------------------------------

PINNED = (ROOT / "tests" / "release" / "requirements.txt").read_text(encoding="utf-8")


def test_each_tool_of_the_release_has_a_hash_and_none_an_index() -> None:
    tools = re.findall(
        r"^(\w[\w.-]*)==(\S+).*((?:\n    --hash=sha256:[0-9a-f]{64}(?: \\)?)+)$", PINNED, re.MULTILINE
    )
    assert {"hatchling", "pyinstaller", "twine", "uv"} <= {name for name, _, _ in tools}
    assert len(tools) == len(re.findall(r"^\w", PINNED, re.MULTILINE))
    assert "http" not in PINNED


def test_groups_are_what_the_files_ask_for() -> None:
    groups = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["dependency-groups"]
    for group, file in (("docs", "docs/site/requirements.in"), ("release", "tests/release/requirements.in")):
        lines = (ROOT / file).read_text(encoding="utf-8").splitlines()
        assert groups[group] == [line for line in lines if not line.startswith("#")]
    assert groups["dev"] == ["robotiq-async[dev]"]


# -- what of pymodbus 3 is used ------------------------------------------------------------------------------


def test_the_page_names_every_module_that_uses_pymodbus() -> None:
    page = (ROOT / "docs" / "dependencies.md").read_text(encoding="utf-8")
    package = ROOT / "robotiq_async"
    using = [
        path
        for path in package.rglob("*.py")
        if re.search(r"^(from|import) pymodbus", path.read_text(encoding="utf-8"), re.MULTILINE)
    ]
    assert using
    assert [path.name for path in using if f"`{path.relative_to(package).as_posix()}`" not in page] == []


def test_what_of_pymodbus_is_not_documented_is_in_one_module_of_the_link() -> None:
    inside = re.compile(r"\bctx\b|call_create|sync_serial|intern_read_ready|pymodbus\.transport")
    link = (ROOT / "robotiq_async" / "link").rglob("*.py")
    assert [path.name for path in link if inside.search(path.read_text(encoding="utf-8"))] == ["wires.py"]


def test_a_canary_may_leave_out_the_limit_of_pymodbus(tmp_path: Path) -> None:
    assert unlimited("", tmp_path) == []
    _, overrides, *_ = unlimited("pymodbus>=4.0.0.dev0", tmp_path)
    assert Path(overrides).read_text() == "pymodbus>=4.0.0.dev0\n"
