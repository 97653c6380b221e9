"""May a tag be released from a repository? The workflow checks before it builds.

    python -m tests.release.tag v0.1.0 https://github.com/OWNER/robotiq_async

Prints the changelog of the version: the notes of the release. A release is refused whose tag is not
the version, whose heading in the changelog has no date, or whose addresses are those of another repository.
"""

from __future__ import annotations

import re
import sys
import tomllib
import xml.etree.ElementTree as ET

from docs.site.absolute import absolute
from docs.site.versions import version
from tests.release.environments import ROOT, FailedError, exit_code


def repositories() -> dict[str, str]:
    """The repository named in the project's files, by file."""
    urls = tomllib.loads(_read("pyproject.toml"))["project"]["urls"]
    package = ET.fromstring(_read("packaging/ros2/package.xml"))
    citation = re.search(r"^repository-code: (\S+)$", _read("CITATION.cff"), re.MULTILINE)
    return {
        "pyproject.toml": urls["Repository"],
        "CITATION.cff": citation[1] if citation else "",
        "packaging/ros2/package.xml": package.findtext("url[@type='repository']", ""),
    }


def _read(name: str) -> str:
    return (ROOT / name).read_text(encoding="utf-8")


def notes(changelog: str, wanted: str) -> str:
    """The notes in a changelog on a version that has a date.

    Raises:
        FailedError: there is no such version, or it has no date.
    """
    found = re.search(
        rf"^## \[{re.escape(wanted)}\] - \d{{4}}-\d\d-\d\d\n(.*?)(?=^## |\Z)",
        changelog,
        re.MULTILINE | re.DOTALL,
    )
    if found is None:
        raise FailedError(f"CHANGELOG.md has no heading ## [{wanted}] - YYYY-MM-DD")
    return found[1].strip()


def check(tag: str, repository: str) -> str:
    """The notes of the release of this tag from this repository.

    Raises:
        FailedError: it must not be released.
    """
    if tag != f"v{version()}":
        raise FailedError(f"the tag is {tag}, and robotiq_async/runtime/version.py has {version()}")
    wrong = {file: found for file, found in repositories().items() if found != repository}
    if wrong:
        raise FailedError(f"this repository is {repository}, and not as in {wrong}")
    return absolute(notes(_read("CHANGELOG.md"), version()), repository, version())


def main() -> None:
    """Check, and print the notes."""
    tag, repository = sys.argv[1:]
    print(check(tag, repository))


if __name__ == "__main__":
    sys.exit(exit_code(main))
