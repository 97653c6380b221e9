"""Outcomes of requests without an answer. A dialogue decides by the kind, and by nothing else.

======== ============================================ ===================================
outcome  meaning                                      may still come
======== ============================================ ===================================
Refused  a whole exception reply                      nothing
Noise    bytes that cannot become the answer          the rest of them, or the answer
Stray    bytes without a request; nothing was sent    more of them
Silent   nothing, or half an answer, in time          the answer
Lost     the wire has ended, or was never there       nothing
======== ============================================ ===================================
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ..values.errors import RobotiqConnectionError

PASSING: Final = (5, 6, 11)
"""The exceptions of a device that may answer the next time: it works, is busy, or was not reached in time."""
UNKNOWN_FUNCTION: Final = 1
"""The exception of a device that does not serve the function: nothing was carried out."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """An end without an answer; users see its ``error``."""

    error: RobotiqConnectionError


@dataclass(frozen=True, slots=True)
class Refused(Outcome):
    """A whole reply that refuses the request, with its exception code."""

    code: int


class Noise(Outcome):
    """Bytes that are not the answer; a lost or damaged byte can cause that."""


class Stray(Noise):
    """Bytes without a request."""


class Silent(Outcome):
    """No whole answer in time."""


class Lost(Outcome):
    """There is no wire, or none any more."""


Answer = bytes | Outcome
"""The answer to a request, or the outcome of a request without an answer."""


def check(answer: Answer) -> bytes:
    """Return an answer.

    Raises:
        RobotiqConnectionError: there is no answer.
    """
    if isinstance(answer, Outcome):
        raise answer.error
    return answer
