"""Machines that have walked to a state."""

from __future__ import annotations

from collections import deque

from robotiq_async.control.state_machine import TABLE, StateMachine
from robotiq_async.values.enums import State, Trigger

Change = tuple[State, State, Trigger]


def path_to(target: State, start: State = State.DISCONNECTED) -> list[Trigger] | None:
    """The shortest way through the table, or None."""
    ways: dict[State, list[Trigger]] = {start: []}
    queue = deque([start])
    while queue:
        state = queue.popleft()
        for trigger, following in TABLE[state].items():
            if isinstance(following, State) and following not in ways:
                ways[following] = [*ways[state], trigger]
                queue.append(following)
    return ways.get(target)


class Recorded:
    """A machine that has walked to a state, and the changes it has told since."""

    def __init__(self, state: State) -> None:
        self.changes: list[Change] = []
        self.machine = StateMachine(lambda *change: self.changes.append(change))
        path = path_to(state)
        assert path is not None, f"{state} is out of reach"
        for trigger in path:
            self.machine.fire(trigger)
        assert self.machine.state is state
        self.changes.clear()
