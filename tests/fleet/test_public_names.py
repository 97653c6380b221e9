"""What programs import of the room."""

from __future__ import annotations

import subprocess
import sys

import pytest

from robotiq_async import fleet
from robotiq_async.runtime.extras import install
from robotiq_async.values import errors

WITHOUT = """\
import sys

sys.modules["zenoh"] = sys.modules["cryptography"] = None
from robotiq_async.fleet import *
from robotiq_async.fleet import Agent, Fleet, RemoteHand

RemoteHand("zenoh://lab/cell/left")
Fleet("lab")
print(Agent.__name__)
"""


def test_the_names_are_there_without_zenoh_and_cryptography() -> None:
    done = subprocess.run([sys.executable, "-c", WITHOUT], capture_output=True, text=True, timeout=60)
    assert done.stdout == "Agent\n", done.stderr


@pytest.mark.parametrize("use", ['RemoteHand("zenoh://lab/cell/left")', 'Fleet("lab")'])
def test_what_needs_zenoh_names_the_extra_that_brings_it(use: str) -> None:
    program = f"""\
import asyncio, sys

sys.modules["zenoh"] = None
from robotiq_async.fleet import Fleet, RemoteHand

async def main():
    async with {use}:
        pass

asyncio.run(main())
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    last = done.stderr.splitlines()[-1]
    assert last == f"ImportError: hands on other hosts need zenoh: {install('fleet')}"


def test_they_are_sorted() -> None:
    assert sorted(fleet.__all__) == fleet.__all__


@pytest.mark.parametrize("name", [name for name in fleet.__all__ if name.endswith("Error")])
def test_its_errors_are_those_of_the_library(name: str) -> None:
    assert getattr(fleet, name) is getattr(errors, name)


@pytest.mark.parametrize("name", fleet.__all__)
def test_every_class_has_a_docstring_of_its_own(name: str) -> None:
    doc = vars(getattr(fleet, name)).get("__doc__")
    assert doc
    assert not doc.startswith(f"{name}(")
