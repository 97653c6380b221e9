"""Extras that only the processes of a test import."""

from __future__ import annotations

from importlib.util import find_spec

import pytest


def needs(package: str, reason: str) -> None:
    """Skip this file without a package, which is not imported here: NiceGUI takes most of a second."""
    if find_spec(package) is None:
        pytest.skip(reason, allow_module_level=True)
