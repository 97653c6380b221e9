"""The patience of a line that several use: a silent gripper must not keep the others waiting.

A question has the line until it is answered. On a line that others use, too, it therefore waits for 60 ms at
most: ten answers of a jaw follow each other in that time. After a miss it waits for 24 ms, and now and then
for 60 ms again, for a gripper that answers slowly. The silence after it takes another 20 ms. After some
misses a user rests for a second between two questions, so a silent gripper costs the others 5 % of their
rate, and 80 ms at a time.

A write whose outcome no status shows has the whole response timeout, because a late acknowledgement
would cost the link. So a gripper that falls silent on it, on its own stop for example, keeps the others
waiting for that time, once: a link that is lost is opened again with questions.

A response timeout that is longer than the usual one means a slow line, and lengthens the questions alike. So
do answers that have just taken long, of any gripper: the adapter, a server or a busy machine is slow.
"""

# Misses in a row    The next question waits for    and comes, after the last one,
#
# 0                  QUESTION_S                     at once
# 1                  SHORT_S                        at once
# 2 to SOON          SHORT_S                        SOON_S later
# more               SHORT_S                        REST_S later
# a multiple of 8    QUESTION_S                     REST_S later

from __future__ import annotations

from typing import Final, NamedTuple
from weakref import WeakKeyDictionary

from ..outcome import Answer, Silent

USUAL_RESPONSE_S: Final = 0.4
"""A longer response timeout means a slow line."""
QUESTION_S: Final = 0.06
SHORT_S: Final = 0.024
"""An adapter may keep a reply for 16 ms (the usual latency timer of FTDI chips)."""
LONG_EVERY: Final = 8
TIMES_SLOWEST: Final = 4.0
"""A question waits for so many times as long as the slowest answer of late."""
FADES: Final = 0.98
"""The share of the slowest answer that is left after the next one."""
SOON: Final = 4
"""Misses of a link that is not lost yet."""
TURN_SOON_S: Final = 0.1
LINE_REST_S: Final = 1.0
"""A hand that stops has time for one try at least."""


class _SilentUser(NamedTuple):
    misses: int
    until: float
    """The time of the next question."""


class LinePatience:
    """The share of a line that each user may take. Users are told apart, and forgotten with their objects."""

    def __init__(self) -> None:
        self._silent: Final[WeakKeyDictionary[object, _SilentUser]] = WeakKeyDictionary()
        self._took: Final = WeakKeyDictionary[object, float]()
        """The seconds that the last answer of each user took."""
        self._slowest = 0.0
        """The slowest answer of late, in seconds. One alone is none: the loop may have been held up."""

    def seconds(self, user: object, response_s: float) -> float:
        """The longest time for the next answer; ``response_s`` is the response timeout."""
        misses = self._silent[user].misses if user in self._silent else 0
        usual = SHORT_S if misses % LONG_EVERY else QUESTION_S
        return min(
            response_s, max(usual * max(1.0, response_s / USUAL_RESPONSE_S), TIMES_SLOWEST * self._slowest)
        )

    def note(self, user: object, answer: Answer, asked: float, now: float) -> None:
        """Note the answer to a question that left at ``asked``."""
        if isinstance(answer, Silent):
            misses = 1 + (self._silent[user].misses if user in self._silent else 0)
            rest = 0.0 if misses == 1 else TURN_SOON_S if misses <= SOON else LINE_REST_S
            self._silent[user] = _SilentUser(misses, now + rest)
        elif isinstance(answer, bytes):
            before, self._took[user] = self._took.get(user, 0.0), now - asked
            self._slowest = max(min(before, now - asked), FADES * self._slowest)
            self._silent.pop(user, None)

    def until(self, user: object) -> float:
        """The time before which the user leaves the line to others."""
        return self._silent[user].until if user in self._silent else 0.0
