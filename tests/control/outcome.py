"""A caller that waits, in the shape of a future."""

from __future__ import annotations

from robotiq_async.values.errors import RobotiqError
from robotiq_async.values.move_result import MoveResult


class Outcome:
    """A caller that waits, and what it was told; told twice is a failure."""

    def __init__(self) -> None:
        self.told: list[object] = []

    def done(self) -> bool:
        return bool(self.told)

    def set_result(self, result: object) -> None:
        self.told.append(result)
        assert len(self.told) == 1, f"told twice: {self.told}"

    set_exception = set_result

    @property
    def is_told(self) -> bool:
        return bool(self.told)

    @property
    def result(self) -> MoveResult:
        assert isinstance(self.told[0], MoveResult), self.told
        return self.told[0]

    @property
    def error(self) -> RobotiqError:
        assert isinstance(self.told[0], RobotiqError), self.told
        return self.told[0]
