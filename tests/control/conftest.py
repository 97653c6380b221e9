"""What most tests begin with: a scan, or a shadow of what the gripper was asked."""

from __future__ import annotations

import pytest

from tests.control.histories import Shadow, image, shows
from tests.control.scan import Scan, started


@pytest.fixture
def scan() -> Scan:
    return started()


@pytest.fixture
def shadow() -> Shadow:
    """Of a gripper that another client has brought to 100, and that the hand has found at 1.0."""
    shadow = Shadow()
    shadow.returned(shadow.shown(shows(100, 1.0), 1.0))
    return shadow


@pytest.fixture
def ours(shadow: Shadow) -> Shadow:
    """Of a gripper that we have sent from 100 to 200."""
    shadow.write(image(200))
    assert shadow.follows(shadow.shown(shows(200, 1.1), 1.1))
    return shadow
