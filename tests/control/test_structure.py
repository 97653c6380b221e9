"""The shape of what decides: the way of a status through it, and who may change what."""

from __future__ import annotations

import ast
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from types import FrameType

import pytest

from robotiq_async import Finger, control
from tests.control.scan import POLL_S, Scan

ROOM = Path(control.__file__).parent


def module_of(frame: FrameType | None) -> str:
    """The module of a frame if it is one of control, or nothing."""
    path = Path(frame.f_code.co_filename if frame else "")
    return path.stem if path.parent == ROOM else ""


def way_of_a_status(scan: Scan) -> list[str]:
    """The modules that a cycle goes to, and back to."""
    status, way = scan.status(), [""]

    def note(frame: FrameType, event: str, _: object) -> None:
        here = module_of(frame if event == "call" else frame.f_back if event == "return" else None)
        if here and here != way[-1]:
            way.append(here)

    before = sys.getprofile()
    sys.setprofile(note)
    try:
        scan.controller.see(status, scan.now)
        assert scan.controller.decide(scan.now) is None
    finally:
        sys.setprofile(before)
    return way[1:]


def idle(scan: Scan) -> None:
    scan.run(1.0)


def moving(scan: Scan) -> None:
    scan.move(255, speed=0)
    scan.run(1.0)


def streaming(scan: Scan) -> None:
    for position in range(0, 200, 2):
        scan.command(Finger.ABC, position, speed=20)
        scan.step()


def holding(scan: Scan) -> None:
    scan.gripper.place_object(Finger.ABC, 100)
    scan.moved(255)
    scan.run(1.0)


@pytest.mark.parametrize("begin", [idle, moving, streaming, holding])
def test_a_status_passes_few_modules_and_comes_back_seldom(scan: Scan, begin: Callable[[Scan], None]) -> None:
    begin(scan)
    scan.now += POLL_S
    way = way_of_a_status(scan)
    assert scan.latest.is_moving is (begin in (moving, streaming))
    assert len(set(way)) <= 6, way
    assert len(way) - len(set(way)) <= 6, way


def changed_from_outside(path: Path) -> Iterator[str]:
    """The fields of objects other than ``self`` that a module sets."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute) and isinstance(node.ctx, ast.Store):
            owner = ast.unparse(node.value)
            if owner != "self" and node.attr != "__cause__":
                yield f"{owner}.{node.attr}"


@pytest.mark.parametrize("path", sorted(ROOM.glob("*.py")), ids=lambda path: path.stem)
def test_no_class_changes_the_fields_of_another(path: Path) -> None:
    assert not {*changed_from_outside(path)}
