"""Commands of another client: counted, and told of once in a while."""

from __future__ import annotations

import math
from typing import Final

from ..log import log
from ..wire.status import RobotiqStatus

WARNING_S: Final = 1.0
"""At most one warning in this time."""


class ForeignCommands:
    """How often another client was seen to command the gripper.

    Attributes:
        count: so often.
    """

    def __init__(self) -> None:
        """Begin at zero."""
        self.count = 0
        self._warned = -math.inf

    def see(self, status: RobotiqStatus) -> None:
        """A status shows requests of another client."""
        self.count += 1
        if status.timestamp - self._warned >= WARNING_S:
            self._warned = status.timestamp
            log.warning("another client commands the gripper: %r", status)
