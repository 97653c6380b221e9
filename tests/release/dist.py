"""``make dist``: the sdist and the wheels, each tried in an environment with nothing else.

    dist/robotiq_async-VERSION.tar.gz
    dist/robotiq_async-VERSION-py3-none-any.whl
    dist/lerobot_robot_robotiq-VERSION-py3-none-any.whl

Each goes into two new environments, outside the clone: the base install runs the demo as a module and says
what the command line needs; with the extra ``cli`` the command runs it. twine looks at what the package index
would show, strictly. Then the wheel is frozen into a program, and used as a zip (frozen.py). The second wheel
is for LeRobot, which finds the robot by its name; without LeRobot it says what is missing.
"""

from __future__ import annotations

import re
import shutil
import sys
import tarfile
import tempfile
import zipfile
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

from docs.site.versions import version
from tests.release.environments import CONSTRAINTS, ROOT, FailedError, exit_code, installed, make, run, uv
from tests.release.frozen import try_frozen, try_zip

DIST: Final = ROOT / "dist"
BILL: Final = "sboms/robotiq_async.cdx.json"
"""The bill of materials in the wheel's metadata; a copy lies in build/, for the release's page."""
BACKEND: Final = ("--build-constraints", str(ROOT / "tests" / "release" / "requirements.txt"))
IN_THE_SDIST: Final = (
    *("CHANGELOG.md", "CITATION.cff", "CONTRIBUTING.md", "LICENSE", "Makefile", "README.md", "SECURITY.md"),
    *(
        "constraints.txt",
        "mkdocs.yml",
        "demo/demo.py",
        "docs/tutorial.md",
        "hatch_build.py",
        "packaging/ros2/package.xml",
    ),
    *("robotiq_async/__init__.py", "tests/conftest.py"),
)
IN_THE_WHEEL: Final = (
    "robotiq_async/py.typed",
    "robotiq_async/__pyinstaller/hook-robotiq_async.py",
    "robotiq_async/_demo.py",
    "robotiq_async/data/robotiq_3f.urdf",
    "robotiq_async/data/robotiq_2f85.xml",
)
PLUGIN: Final = "lerobot_robot_robotiq"
"""The second distribution, and its module: LeRobot looks for the name as it is written here."""
METADATA: Final = "Metadata-Version: 2.4\n"
"""The version of metadata that everything understands that uploads and installs."""
LAST_PART: Final = "What the hand went through"
"""The demo's heading of its last part."""


def build() -> tuple[Path, Path, Path]:
    """All three, in a folder that is emptied before; they hold what they should."""
    shutil.rmtree(DIST, ignore_errors=True)
    for source, *what in ((ROOT,), (ROOT / "packaging" / PLUGIN, "--wheel")):
        uv("build", "--quiet", "--require-hashes", *BACKEND, *what, "--out-dir", str(DIST), str(source))
    name, plugin = f"robotiq_async-{version()}", f"{PLUGIN}-{version()}"
    sdist = DIST / f"{name}.tar.gz"
    wheel, second = (DIST / f"{each}-py3-none-any.whl" for each in (name, plugin))
    found = {path.name for path in DIST.iterdir() if path.suffix in (".gz", ".whl")}
    if found != {sdist.name, wheel.name, second.name}:
        raise FailedError(f"built {sorted(found)}, and not {sdist.name}, {wheel.name} and {second.name}")
    _look(sdist, wheel)
    described = _described(second)
    if f"\nName: {PLUGIN}\n" not in described:
        raise FailedError(f"{second.name} has a name that LeRobot does not look for:\n{described}")
    run(sys.executable, "-m", "twine", "check", "--strict", str(sdist), str(wheel), str(second))
    return sdist, wheel, second


def _look(sdist: Path, wheel: Path) -> None:
    """Look into the library's own two; keeps a copy of the bill of materials."""
    name = wheel.name.removesuffix("-py3-none-any.whl")
    with tarfile.open(sdist) as archive:
        files = {member.name.removeprefix(f"{name}/") for member in archive}
    _need(sdist, files, IN_THE_SDIST)
    with zipfile.ZipFile(wheel) as opened:
        files = {*opened.namelist()}
        _need(wheel, files, (*IN_THE_WHEEL, f"{name}.dist-info/licenses/LICENSE", f"{name}.dist-info/{BILL}"))
        copy = ROOT / "build" / f"{name}.cdx.json"
        copy.parent.mkdir(exist_ok=True)
        copy.write_bytes(opened.read(f"{name}.dist-info/{BILL}"))
    strange = [
        each for each in files if not each.startswith(("robotiq_async/", "pytest_robotiq_async/", f"{name}."))
    ]
    if strange:
        raise FailedError(f"{wheel.name} installs {strange}")
    if dead := relative(_described(wheel)):
        raise FailedError(f"the description has links that lead nowhere on the package index: {dead}")


def _described(wheel: Path) -> str:
    """The metadata of a wheel."""
    name = wheel.name.removesuffix("-py3-none-any.whl")
    with zipfile.ZipFile(wheel) as archive:
        described = archive.read(f"{name}.dist-info/METADATA").decode()
    if not described.startswith(METADATA):
        raise FailedError(
            f"{wheel.name} begins with {described.splitlines()[0]}, and not with {METADATA.strip()}"
        )
    return described


def relative(text: str) -> list[str]:
    """The links of a page that are right only beside its files."""
    return [link for link in re.findall(r"\]\(([^)\s]+)\)", text) if not re.match(r"[a-z]+://", link)]


def _need(archive: Path, files: set[str], wanted: tuple[str, ...]) -> None:
    if gone := [each for each in wanted if each not in files]:
        raise FailedError(f"{archive.name} has no {gone}")


def try_base(artifact: Path, folder: Path) -> list[str]:
    """The base install: the library, and the demo as a module. Gives what it has installed."""
    python = make(folder / "base", *CONSTRAINTS, str(artifact))
    code = "import robotiq_async as it; print(it.__version__, it.__file__)"
    said = run(str(python), "-c", code, folder=folder)
    if not said.startswith(f"{version()} {folder}"):
        raise FailedError(f"{artifact.name} installed {said}")
    _demo(str(python), "-m", "robotiq_async._demo", folder=folder)
    said = run(str(python), "-m", "robotiq_async", "demo", folder=folder, code=1)
    if 'pip install "cyclopts' not in said or said.count("\n") != 1:
        raise FailedError(f"{artifact.name} without cli says {said}")
    return installed(python)


def try_command(artifact: Path, folder: Path) -> None:
    """Try the command, with the extra ``cli``."""
    python = make(folder / "cli", *CONSTRAINTS, f"robotiq-async[cli] @ {artifact.as_uri()}")
    command = str(python.parent / "robotiq-async")
    if run(command, "--version", folder=folder).strip() != version():
        raise FailedError(f"{artifact.name}: {command} is of another version")
    _demo(command, "demo", folder=folder)


def try_plugin(plugin: Path, wheel: Path, folder: Path) -> str:
    """The second wheel without LeRobot: it says what is missing."""
    library = f"robotiq-async[serial] @ {wheel.as_uri()}"
    python = make(folder / "plugin", *CONSTRAINTS, library, str(plugin))
    said = run(str(python), "-c", f"import {PLUGIN}", folder=folder, code=1)
    if "the robot needs LeRobot" not in said:
        raise FailedError(f"{plugin.name} without LeRobot says {said}")
    return f"dist/{plugin.name}: {plugin.stat().st_size} bytes; says without LeRobot that it needs it"


def _demo(*command: str, folder: Path) -> None:
    printed = run(*command, folder=folder)
    if LAST_PART not in printed or "Traceback" in printed:
        raise FailedError(f"{' '.join(command)} did not end well:\n{printed}")


def main() -> None:
    """Build, and try."""
    with tempfile.TemporaryDirectory(prefix="robotiq_async_dist") as place, ThreadPoolExecutor(4) as pool:
        *artifacts, plugin = build()
        folders = [Path(place).resolve() / artifact.name for artifact in artifacts]
        for folder in folders:
            folder.mkdir()
        trying = pool.submit(try_plugin, plugin, artifacts[1], folders[1])
        commands = pool.map(try_command, artifacts, folders)
        for artifact, installs in zip(artifacts, pool.map(try_base, artifacts, folders), strict=True):
            size = artifact.stat().st_size >> 10
            print(f"dist/{artifact.name}: {size} KiB; installs {', '.join(installs)}")
        list(commands)
        print(trying.result())
        for line in pool.map(lambda tries: tries(artifacts[1], folders[1]), (try_frozen, try_zip)):
            print(line)


if __name__ == "__main__":
    sys.exit(exit_code(main))
