"""Fixtures that most tests begin with."""

from __future__ import annotations

import pytest

from tests.control.scan import Scan, started


@pytest.fixture
def scan() -> Scan:
    return started()
