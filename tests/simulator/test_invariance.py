"""Looking at the gripper never changes what it does, and what it does keeps within its bounds."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async.simulator import Habits, SimulatedGripper
from robotiq_async.values.enums import Fault, Initialization, Mode
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus

if TYPE_CHECKING:
    from collections.abc import Callable

_BYTE = st.integers(0, 255)
_MOMENT = st.floats(0, 60, allow_nan=False)
_REQUEST = st.builds(
    Request,
    # Mostly active and going: anything else is dull.
    activate=st.sampled_from([True, True, True, True, True, False]),
    go=st.sampled_from([True, True, True, False]),
    release=st.sampled_from([False] * 9 + [True]),
    mode=st.sampled_from(Mode),
    individual_fingers=st.booleans(),
    individual_scissor=st.booleans(),
    axes=st.tuples(*(st.builds(AxisRequest, _BYTE, _BYTE, _BYTE) for _ in THREE_FINGER.axes)),
)
Action = tuple[str, tuple[object, ...]]
_IMAGE = st.builds(lambda request: request.registers, _REQUEST)
_ACTION: st.SearchStrategy[Action] = st.one_of(
    st.tuples(st.just("write"), st.tuples(st.just(0), _IMAGE)),
    st.tuples(st.just("place_object"), st.tuples(st.integers(1, 15), _BYTE)),
    st.tuples(st.just("remove_object"), st.tuples(st.integers(1, 15))),
    st.tuples(st.just("inject_fault"), st.tuples(st.sampled_from(list(Fault)[1:]), st.floats(0, 30))),
    st.tuples(st.just("clear_faults"), st.just(())),
    st.tuples(st.just("emergency_stop"), st.tuples(st.integers(1, 2))),
    st.tuples(st.just("end_emergency_stop"), st.just(())),
    st.tuples(st.just("power_cycle"), st.tuples(st.floats(0, 2))),
)


class Event(NamedTuple):
    """Something done to the gripper, this long after it was activated."""

    time: float
    action: Action


_EVENTS = st.lists(st.builds(Event, _MOMENT, _ACTION), max_size=8).map(
    lambda events: sorted(events, key=lambda event: event.time)
)


_USUAL = Habits()
_OTHERWISE = Habits(
    activation_time=12.0,
    status_lag=0.2,
    write_spacing=0.01,
    echoes_limits=True,
    lets_go_on_halt=True,
    keeps_status_on_halt=False,
    opens_without_rics=False,
)
"""All but a fault after silence, which depends on when it is read."""


def _run(
    events: list[Event],
    looks: list[float],
    look: Callable[[SimulatedGripper], object],
    habits: Habits = _USUAL,
) -> tuple[object, ...]:
    """Play events to a gripper, looking at it in between; how it ends."""
    now = 0.0
    gripper = SimulatedGripper(lambda: now, habits=habits)
    gripper.write(0, Request(activate=True).registers)
    schedule = [(event.time + 5, 1, event) for event in events] + [(time, 0, None) for time in looks]
    for time, _, event in sorted(schedule, key=lambda entry: entry[:2]):
        now = time
        if event is None:
            look(gripper)
        else:
            name, arguments = event.action
            getattr(gripper, name)(*arguments)
    now = 70.0
    return gripper.status_registers(), *(gripper.travel(axis) for axis in THREE_FINGER.axes)


@settings(deadline=None, max_examples=200)
@given(
    events=_EVENTS,
    looks=st.lists(st.floats(0, 70), max_size=30),
    habits=st.sampled_from([_USUAL, _OTHERWISE]),
)
def test_looking_changes_nothing(events: list[Event], looks: list[float], habits: Habits) -> None:
    unseen = _run(events, [], lambda _: None, habits)
    watched = _run(events, looks, lambda gripper: gripper.status_registers(), habits)
    assert watched == unseen


@settings(deadline=None, max_examples=100)
@given(events=_EVENTS, looks=st.lists(st.floats(0, 70), min_size=5, max_size=30))
def test_every_status_makes_sense(events: list[Event], looks: list[float]) -> None:
    def check(gripper: SimulatedGripper) -> None:
        status = RobotiqStatus.from_registers(gripper.status_registers())
        if not gripper.is_powered:
            return
        for finger in THREE_FINGER.axes[:3]:
            assert 6 <= status.position(finger) <= 242
        assert 6 <= status.position(THREE_FINGER.axes[3]) <= 232
        assert status.activation_echo or status.is_reset
        if status.initialization is Initialization.COMPLETE and gripper.is_moving:
            assert status.is_moving
            assert status.go_echo
        if status.fault.is_serious and status.fault not in (
            Fault.SCISSOR_INTERFERENCE,
            Fault.AUTOMATIC_RELEASE,
        ):
            assert not gripper.is_moving

    _run(events, looks, check)
