"""The mirror: what a client makes of what it hears, in whatever order it comes."""

from __future__ import annotations

import itertools
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import RobotiqStatus, State
from robotiq_async.fleet.remote.mirror import DRIFT, AgentClock, Mirror
from robotiq_async.fleet.wire.status_message import StatusMessage
from robotiq_async.hands.streams import Channels
from robotiq_async.values.enums import Trigger
from robotiq_async.values.errors import ProtocolError
from robotiq_async.values.events import Transition
from tests.virtual import virtual

MARK = 5
AHEAD = 1000.0
"""Our clock is so far ahead of the agent's."""
IDLE, BUSY = State.RUNNING_IDLE, State.RUNNING_CC


class Bench:
    """A mirror, and what it hands on."""

    def __init__(self, before: Mirror | None = None) -> None:
        channels = Channels()
        self.statuses = channels.statuses.open(None)
        self.transitions = channels.transitions.open(None)
        self.requests = channels.requests.open(None)
        self.entered: list[State] = []
        self.mirror = Mirror(MARK, channels, self.entered.append, before)

    def receive(
        self, stamp: float, sequence: int | None, *, delay: float = 0.0, in_turn: bool = True, **fields: Any
    ) -> None:
        self.mirror.receive(message(stamp, sequence, **fields), stamp + AHEAD + delay, in_turn=in_turn)

    def sequences(self) -> list[int]:
        return [status.sequence for status in self.statuses.drain()]

    def changes(self) -> list[tuple[State, State]]:
        return [(each.source, each.target) for each in self.transitions.drain()]


def message(
    stamp: float,
    sequence: int | None,
    *,
    epoch: int = 1,
    state: State = IDLE,
    events: int = 0,
    age: float = 0.0,
) -> StatusMessage:
    registers = None if sequence is None else (0x3900, sequence & 0xFFFF, 0, 0, 0, 0, 0, 0)
    status = None if registers is None else RobotiqStatus(registers, stamp - age, sequence or 0)
    return StatusMessage(MARK, epoch, stamp, state, 0, False, events, False, status)


def event(index: int, source: State, target: State, at: float = 0.0) -> dict[str, Any]:
    fields = Transition(source, target, Trigger.ASK_COMMAND, at).as_dict()
    return {"index": index, "kind": "transition", **fields}


# -- statuses ----------------------------------------------------------------------------------------------


def test_statuses_in_their_order_and_none_twice() -> None:
    here = Bench()
    for sequence in (3, 4, 4, 5, 4, 9):
        here.receive(10.0 + sequence / 100, sequence)
    assert here.sequences() == [3, 4, 5, 9]
    assert here.mirror.status is not None
    assert here.mirror.status.sequence == 9


def test_an_answer_that_overtakes_takes_no_reader_s_status_away() -> None:
    here = Bench()
    here.receive(10.0, 1)
    here.receive(10.3, 4, in_turn=False)
    assert here.mirror.status is not None
    assert here.mirror.status.sequence == 4, "it is known at once"
    overtaking = here.mirror.status
    for sequence in (2, 3, 4):
        here.receive(10.0 + (sequence - 1) / 10, sequence)
    items = list(here.statuses.drain())
    assert [status.sequence for status in items] == [1, 2, 3, 4]
    assert items[-1] is overtaking
    assert here.mirror.status is overtaking


def test_a_late_message_changes_nothing() -> None:
    here = Bench()
    here.receive(10.0, 5, state=BUSY)
    here.receive(9.0, 4, state=State.FAULT)
    assert here.mirror.state is BUSY
    assert here.mirror.stamp == 10.0
    assert here.sequences() == [5]


def test_before_the_gripper_was_read_there_is_no_status() -> None:
    here = Bench()
    here.receive(10.0, None, state=State.DISCONNECTED)
    assert here.mirror.status is None
    assert not here.mirror.is_silent
    assert here.sequences() == []


@virtual
async def test_about_another_gripper() -> None:
    here = Bench()
    assert not here.mirror.is_about_another(MARK)
    for mark in (MARK + 1, 0, "5", None):
        assert here.mirror.is_about_another(mark)
    assert here.mirror.misrouted == 4


# -- another run -------------------------------------------------------------------------------------------


def test_another_run_of_the_agent() -> None:
    here = Bench()
    here.receive(5000.0, 70, events=9)
    here.receive(10.0, 0, epoch=2, events=3, state=BUSY)
    here.receive(10.1, 1, epoch=2, events=3, state=BUSY)
    assert here.sequences() == [70, 71, 72], "sequences go on"
    assert here.mirror.stamp == 10.1
    assert here.mirror.events == 3, "earlier events are not reported again"
    assert here.changes() == [
        (State.DISCONNECTED, IDLE),
        (IDLE, State.DISCONNECTED),
        (State.DISCONNECTED, BUSY),
    ]
    answered = RobotiqStatus((0,) * 8, 20.0, 7).as_raw()
    assert here.mirror.read_status(answered).sequence == 71 + 7
    assert here.mirror.read_status(answered).timestamp == here.mirror.clock(20.0)


def test_another_run_of_this_hand() -> None:
    for first in (0, 500):
        one = Bench()
        one.receive(10.0, 70)
        one.mirror.shut_down(State.SHUTDOWN, Trigger.STOPPED, 1011.0)
        unheard = Mirror(MARK, Channels(), lambda _: None, one.mirror)
        unheard.shut_down(State.SHUTDOWN, Trigger.STOPPED, 1012.0)
        for before in (one.mirror, unheard):
            other = Bench(before)
            other.mirror.begin(1013.0)
            other.receive(20.0, first)
            assert other.sequences() == [max(71, first)]
            assert other.changes() == [(State.SHUTDOWN, State.DISCONNECTED), (State.DISCONNECTED, IDLE)]


# -- silence -----------------------------------------------------------------------------------------------


def test_silence_and_the_end_of_it() -> None:
    here = Bench()
    here.receive(10.0, 1)
    here.mirror.fall_silent(1012.0)
    here.mirror.fall_silent(1013.0)
    assert (here.mirror.state, here.mirror.is_silent) == (State.DISCONNECTED, True)
    assert here.mirror.status is not None, "the last status stays"
    here.receive(13.0, 2)
    assert (here.mirror.state, here.mirror.is_silent) == (IDLE, False)
    items = list(here.transitions.drain())
    assert [each.trigger for each in items] == [Trigger.SEEN_READY, Trigger.LINK_LOST, Trigger.SEEN_READY]
    assert [each.timestamp for each in items] == [1010.0, 1012.0, 1013.0]
    assert here.entered.count(State.DISCONNECTED) >= 1


def test_events_during_a_silence_are_reported_after_it_in_order() -> None:
    here = Bench()
    here.receive(10.0, 1, state=BUSY, events=1)
    here.mirror.fall_silent(1012.0)
    here.receive(13.0, 2, state=State.FAULT, events=3)
    assert here.mirror.state is State.FAULT
    assert here.mirror.has_missed()
    assert not here.mirror.receive_events([event(2, BUSY, IDLE, 11.0), event(3, IDLE, State.FAULT, 11.5)])
    assert not here.mirror.has_missed()
    assert here.changes() == [
        (State.DISCONNECTED, BUSY),
        (BUSY, State.DISCONNECTED),
        (State.DISCONNECTED, BUSY),
        (BUSY, IDLE),
        (IDLE, State.FAULT),
    ]


def test_after_the_end_nothing_changes() -> None:
    here = Bench()
    here.receive(10.0, 1)
    here.mirror.shut_down(State.DO_SHUTDOWN, Trigger.ASK_STOP, 1011.0)
    here.receive(11.5, 2, state=BUSY)
    here.mirror.receive_events([event(1, IDLE, BUSY)])
    here.mirror.fall_silent(1013.0)
    here.mirror.shut_down(State.SHUTDOWN, Trigger.STOPPED, 1012.0)
    assert here.mirror.state is State.SHUTDOWN
    assert here.changes()[1:] == [(IDLE, State.DO_SHUTDOWN), (State.DO_SHUTDOWN, State.SHUTDOWN)]


def test_the_end_of_the_agent_s_hand_is_not_the_end_of_ours() -> None:
    here = Bench()
    here.receive(10.0, 1)
    for state, other in ((State.DO_SHUTDOWN, IDLE), (State.SHUTDOWN, State.DO_SHUTDOWN)):
        here.mirror.receive_events([event(here.mirror.events + 1, other, state, 11.0)])
        here.receive(11.0, 1, state=state, events=here.mirror.events)
        assert here.mirror.state is State.DISCONNECTED
    assert here.changes() == [(State.DISCONNECTED, IDLE), (IDLE, State.DISCONNECTED)]
    assert State.SHUTDOWN not in here.entered


# -- events ------------------------------------------------------------------------------------------------


def test_events_wait_for_those_before_them() -> None:
    here = Bench()
    here.receive(10.0, 1)
    assert not here.mirror.receive_events([event(1, IDLE, BUSY)])
    assert here.mirror.receive_events([event(3, IDLE, BUSY)])
    assert not here.mirror.receive_events([event(1, IDLE, BUSY), event(2, BUSY, IDLE), event(3, IDLE, BUSY)])
    assert here.changes()[1:] == [(IDLE, BUSY), (BUSY, IDLE), (IDLE, BUSY)]


def test_events_the_agent_no_longer_has_leave_no_gap() -> None:
    here = Bench()
    here.receive(10.0, 1)
    here.mirror.skip_events(100)
    assert not here.mirror.receive_events([event(101, State.RESET, State.DO_ACTIVATION)])
    here.mirror.skip_events(50)
    assert here.mirror.events == 101
    changes = here.changes()
    assert all(before[1] is after[0] for before, after in itertools.pairwise(changes))
    assert changes[-1] == (State.RESET, State.DO_ACTIVATION)


def test_a_state_that_lasted_for_a_moment_is_entered() -> None:
    here = Bench()
    here.receive(10.0, 1)
    here.mirror.receive_events([event(1, IDLE, BUSY), event(2, BUSY, IDLE)])
    assert BUSY in here.entered


@pytest.mark.parametrize("bad", [{"kind": "transition"}, {"kind": "request", "registers": [1]}, {}])
def test_an_event_that_cannot_be_read(bad: dict[str, Any]) -> None:
    here = Bench()
    here.receive(10.0, 1)
    with pytest.raises(ProtocolError, match="an event that cannot be read"):
        here.mirror.receive_events([{"index": 1, **bad}])


def test_an_event_of_a_kind_that_is_not_known_is_passed_over() -> None:
    here = Bench()
    here.receive(10.0, 1)
    assert not here.mirror.receive_events([{"index": 1, "kind": "of a later version"}])
    assert here.mirror.events == 1


# -- the clock ---------------------------------------------------------------------------------------------


def test_the_guess_is_the_fastest_message() -> None:
    clock = AgentClock()
    for stamp, delay in ((0.0, 0.5), (0.01, 0.1), (0.02, 0.001), (0.03, 0.4)):
        clock.receive(stamp, stamp + AHEAD + delay)
    assert clock(7.0) == pytest.approx(7.0 + AHEAD + 0.001, abs=1e-4)


def test_it_follows_clocks_that_part_and_no_faster() -> None:
    clock = AgentClock()
    for second in range(1001):
        arrival = second * (1 + DRIFT / 2) + AHEAD
        clock.receive(float(second), arrival)
        assert clock(float(second)) == pytest.approx(arrival, abs=1e-6)
    slow = AgentClock()
    slow.receive(0.0, AHEAD)
    slow.receive(100.0, AHEAD + 105.0)  # congestion
    assert slow(100.0) == pytest.approx(AHEAD + 100.0 + 105.0 * DRIFT)


@given(
    st.lists(st.tuples(st.floats(0.001, 0.1), st.floats(0.0, 2.0), st.booleans()), min_size=1, max_size=50)
)
def test_timestamps_only_rise_and_are_never_ahead(steps: list[tuple[float, float, bool]]) -> None:
    here, stamp, arrival = Bench(), 10.0, 0.0
    for sequence, (interval, delay, in_turn) in enumerate(steps):
        stamp += interval
        arrival = max(arrival, stamp + AHEAD + delay)
        here.mirror.receive(message(stamp, sequence, age=interval / 2), arrival, in_turn=in_turn)
        source, target = ((IDLE, BUSY), (BUSY, IDLE))[sequence % 2]
        here.mirror.receive_events([event(sequence + 1, source, target, stamp - 0.9 * interval)])
        assert here.mirror.status is not None
        assert here.mirror.status.timestamp <= arrival + 1e-6
    for items in (
        [status.timestamp for status in here.statuses.drain()],
        [each.timestamp for each in here.transitions.drain()],
    ):
        assert items == sorted(items)
        assert not items or items[-1] <= arrival + 1e-6


@given(
    st.permutations(range(8)),
    st.lists(st.booleans(), min_size=8, max_size=8),
    st.lists(st.floats(0, 1), min_size=8, max_size=8),
)
def test_statuses_in_any_order_are_reported_in_order(
    order: list[int], in_turn: list[bool], delays: list[float]
) -> None:
    here = Bench()
    for sequence in order:
        here.receive(10.0 + sequence / 100, sequence, in_turn=in_turn[sequence], delay=delays[sequence])
    items = list(here.statuses.drain())
    assert all(before.sequence < after.sequence for before, after in itertools.pairwise(items))
    assert all(before.timestamp <= after.timestamp for before, after in itertools.pairwise(items))
    assert here.mirror.status is not None
    assert here.mirror.status.sequence == 7
