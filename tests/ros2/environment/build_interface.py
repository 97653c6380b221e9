"""Generate and compile a ROS 2 interface package in the environment whose interpreter runs this.

No package index has control_msgs, and the wheels bring all generators: so the package is made from its
definition, without cmake and ament. Needs a C and a C++ compiler ($CC, $CXX) and Python.h.

    .venv-ros2/bin/python tests/ros2/environment/build_interface.py FOLDER

FOLDER is named like the package and holds action/*.action and msg/*.msg.
"""

from __future__ import annotations

import json
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Final

import numpy as np
from rosidl_adapter import convert_to_idl
from rosidl_cli.command.helpers import generate_visibility_control_file
from rosidl_generator_c import generate_c
from rosidl_generator_py import generate_py
from rosidl_generator_type_description import generate_type_hash
from rosidl_typesupport_c import generate_c as generate_dispatch
from rosidl_typesupport_fastrtps_c import generate_typesupport_fastrtps_c
from rosidl_typesupport_introspection_c import generate_c as generate_introspection

PREFIX: Final = Path(sys.prefix)
PACKAGES: Final = Path(sysconfig.get_paths()["purelib"])
LIBRARIES: Final = PREFIX / "lib"
DISPATCH: Final = "rosidl_typesupport_c"
FASTRTPS: Final = "rosidl_typesupport_fastrtps_c"
INTROSPECTION: Final = "rosidl_typesupport_introspection_c"
"""Without it the middleware cannot register the type object."""
STRUCTURES: Final = "rosidl_generator_c"
PYTHON: Final = "rosidl_generator_py"
RUNTIME: Final = ("rosidl_runtime_c", DISPATCH, "rcutils", "rmw")
USED: Final = tuple(
    name
    for name in sorted(path.name for path in (PREFIX / "share").iterdir())
    if name.endswith("_msgs") or name == "builtin_interfaces"
    if next((PREFIX / "share" / name).glob("*/*.idl"), None)
)
"""Interface packages that are here: definitions may refer to them."""


class Package:
    """An interface package on its way from definitions to sources to libraries."""

    def __init__(self, source: Path, work: Path) -> None:
        """Take the definitions of a folder; everything on the way goes into another one."""
        self.name = source.name
        self.source = source
        self.work = work
        self.files = sorted(path.relative_to(source) for path in source.glob("*/*.*"))

    # -- sources -------------------------------------------------------------------------------------------

    def generate(self) -> None:
        """Call each generator. Their command line fails: two of them register under one name."""
        for file in self.files:
            folder = self.work / "idl" / file.parent
            folder.mkdir(parents=True, exist_ok=True)
            convert_to_idl(self.source, self.name, file, self.work / "idl")
        stems = [f"{file.parent}/{file.stem}" for file in self.files]
        structures = self.work / "c" / self.name
        generate_type_hash(
            self._arguments(
                "rosidl_generator_type_description",
                self.work / "hash",
                include_paths=[f"{used}:{PREFIX / 'share' / used}" for used in USED],
            )
        )
        for kind in (STRUCTURES, FASTRTPS, INTROSPECTION):
            name = f"{kind}__visibility_control.h"
            template = PREFIX / "share" / kind / "resource" / f"{name}.in"
            generate_visibility_control_file(
                package_name=self.name, template_path=template, output_path=structures / "msg" / name
            )
        described = {
            "type_description_tuples": [f"{stem}.idl:{self.work}/hash/{stem}.json" for stem in stems],
            "ros_interface_files": [str(self.source / file) for file in self.files],
        }
        generate_c(self._arguments(STRUCTURES, structures, **described))
        generate_typesupport_fastrtps_c(self._arguments(FASTRTPS, structures))
        generate_introspection(self._arguments(INTROSPECTION, self.work / "introspection" / self.name))
        supports = [FASTRTPS, INTROSPECTION]
        generate_dispatch(self._arguments(DISPATCH, self.work / "dispatch" / self.name), supports)
        generate_py(self._arguments(PYTHON, self.work / "python" / self.name), [DISPATCH])
        (self.work / "python" / self.name / "__init__.py").touch()

    def _arguments(self, generator: str, output: Path, **more: object) -> str:
        """The file with a generator's arguments."""
        output.mkdir(parents=True, exist_ok=True)
        path = self.work / f"{generator}.json"
        known = [f"{used}:{idl}" for used in USED for idl in (PREFIX / "share" / used).glob("*/*.idl")]
        arguments = {
            "package_name": self.name,
            "output_dir": str(output),
            "template_dir": str(PREFIX / "share" / generator / "resource"),
            "idl_tuples": [f"{self.work}/idl:{file.parent}/{file.stem}.idl" for file in self.files],
            "ros_interface_dependencies": sorted(known),
            "target_dependencies": [],
        }
        path.write_text(json.dumps(arguments | more), encoding="utf-8")
        return str(path)

    # -- libraries -----------------------------------------------------------------------------------------

    def build(self) -> None:
        """Compile and link: each library needs those before it."""
        python = self.work / "python"
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            sources = {
                STRUCTURES: (self.work / "c").rglob("*.c"),
                FASTRTPS: (self.work / "c").rglob("*.cpp"),
                INTROSPECTION: (self.work / "introspection").rglob("*.c"),
                DISPATCH: (self.work / "dispatch").rglob("*.c*"),
                PYTHON: python.rglob("*_s.c"),
                "entry": python.rglob(f"*.ep.{DISPATCH}.c"),
            }
            objects = {kind: list(pool.map(self._compile, files)) for kind, files in sources.items()}
        made: list[str] = []
        for kind, needs in (
            (STRUCTURES, ()),
            (FASTRTPS, ("rosidl_typesupport_fastrtps_c", "rosidl_typesupport_fastrtps_cpp", "fastcdr")),
            (INTROSPECTION, (INTROSPECTION,)),
            (DISPATCH, ()),
            (PYTHON, ()),
        ):
            name = f"{self.name}__{kind}"
            kinds = (kind,) if kind in (STRUCTURES, DISPATCH) else (kind, STRUCTURES)
            others = [f"{used}__{each}" for used in USED for each in kinds]
            self._link(LIBRARIES / f"lib{name}.so", objects[kind], [*made, *others, *needs, *RUNTIME])
            made.append(name)
        shutil.rmtree(PACKAGES / self.name, ignore_errors=True)
        shutil.copytree(python / self.name, PACKAGES / self.name)
        others = [f"{used}__{DISPATCH}" for used in USED]
        entry = PACKAGES / self.name / f"{self.name}_s__{DISPATCH}.so"
        self._link(entry, objects["entry"], [*made, *others, *RUNTIME])

    def _compile(self, source: Path) -> Path:
        """An object file."""
        compiler = ["CC", "cc", "-std=gnu11"] if source.suffix == ".c" else ["CXX", "c++", "-std=c++17"]
        output = source.with_name(f"{source.name}.o")
        headers = [self.work / "c", self.work / "introspection", PREFIX / "include"]
        headers += [path for path in (PREFIX / "include").iterdir() if path.is_dir()]
        headers += [Path(sysconfig.get_paths()["include"]), Path(np.get_include())]
        options = ["-O1", "-fPIC", "-w", *(f"-I{path}" for path in headers)]
        run(*_tool(*compiler[:2]), compiler[2], *options, "-c", str(source), "-o", str(output))
        return output

    @staticmethod
    def _link(output: Path, objects: Iterable[Path], libraries: Sequence[str]) -> None:
        """A library that finds the others beside it."""
        folders = [f"-L{LIBRARIES}", f"-Wl,-rpath,{LIBRARIES}", f"-Wl,-soname,{output.name}"]
        names = [f"-l{name}" for name in libraries]
        run(*_tool("CXX", "c++"), "-shared", "-o", str(output), *map(str, objects), *folders, *names)


def _tool(variable: str, usual: str) -> list[str]:
    return shlex.split(os.environ.get(variable, usual))


def run(*command: str) -> None:
    """Run a compiler; its messages go to the terminal.

    Raises:
        subprocess.CalledProcessError: it failed.
    """
    subprocess.run(command, check=True)


def main(folder: str) -> None:
    """Make the package of a folder."""
    with tempfile.TemporaryDirectory() as work:
        package = Package(Path(folder).resolve(), Path(work))
        package.generate()
        package.build()


if __name__ == "__main__":
    main(*sys.argv[1:])
