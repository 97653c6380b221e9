"""What the releases' programs decide; the rest they try themselves: make dist, pythons, canary."""

from __future__ import annotations

import sys

import pytest

from tests.release.canary import news, pinned
from tests.release.environments import FailedError, run


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
