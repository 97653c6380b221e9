"""The library without its files: frozen by PyInstaller, and imported from a zip.

Both are tried with the wheel and the extra ``cli``, and with no other extra: what needs one must say so in
one line. A program that grips a simulated part is written and frozen. The zip is the wheel itself.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from tests.release.environments import CONSTRAINTS, ROOT, FailedError, make, run, uv

FREEZER: Final = ("--constraints", str(ROOT / "tests" / "release" / "requirements.txt"), "pyinstaller")
PROGRAM: Final = """
import asyncio, sys
from robotiq_async import RobotiqHand
from robotiq_async.cli import main
from robotiq_async.calibration import SpeedCalibration

async def grip():
    async with RobotiqHand("sim://?model=2f85&object=120&speedup=20") as hand:
        grasp = await hand.grasp()
        print("holds" if grasp else "misses", f"{grasp.width_mm:.0f} mm")

if __name__ == "__main__":
    if sys.argv[1:]:
        sys.exit(main())
    SpeedCalibration.thesis()
    asyncio.run(grip())
"""
HOLDS: Final = "holds 43 mm"
NEEDS: Final = {"web": "nicegui", "view": "foxglove", "ports": "serial"}
"""The extras that commands name without them."""


def try_frozen(wheel: Path, folder: Path) -> str:
    """Freeze a program that grips a part, and run it; gives its size."""
    python = make(folder / "frozen", *CONSTRAINTS, *FREEZER, f"robotiq-async[cli] @ {wheel.as_uri()}")
    (folder / "grip.py").write_text(PROGRAM, encoding="utf-8")
    run(str(python), "-m", "PyInstaller", "--noconfirm", "--log-level", "WARN", "grip.py", folder=folder)
    program = folder / "dist" / "grip" / "grip"
    _try(folder, (str(program),), {}, "freeze it again")
    size = sum(each.stat().st_size for each in program.parent.rglob("*") if each.is_file())
    return f"a program frozen by PyInstaller grips a part: {size >> 20} MiB"


def try_zip(wheel: Path, folder: Path) -> str:
    """Run the same program with the wheel as a zip, beside what the library needs."""
    python = make(folder / "zipped", *CONSTRAINTS, f"robotiq-async[cli] @ {wheel.as_uri()}")
    uv("pip", "uninstall", "--quiet", "--python", str(python), "robotiq-async")
    (folder / "zipped.py").write_text(PROGRAM, encoding="utf-8")
    _try(folder, (str(python), "zipped.py"), {"PYTHONPATH": str(wheel)}, "pip install")
    return "the wheel grips a part as a zip"


def _try(folder: Path, program: tuple[str, ...], variables: dict[str, str], advice: str) -> None:
    bare = {"PATH": "/usr/bin:/bin", "HOME": str(folder), **variables}
    if (said := run(*program, folder=folder, variables=bare).strip()) != HOLDS:
        raise FailedError(f"{program[-1]} says {said}, and not {HOLDS}")
    said = run(*program, "demo", folder=folder, variables=bare)
    if "What the hand went through" not in said:
        raise FailedError(f"{program[-1]} demo did not end well:\n{said}")
    for command, missing in NEEDS.items():
        said = run(*program, command, folder=folder, variables=bare, code=1)
        if missing not in said or advice not in said or said.count("\n") != 1:
            raise FailedError(f"{program[-1]} {command} says {said}")
