"""The numbers of learning stacks: each scale by the formula of its source, its sign, its ends."""

from __future__ import annotations

import asyncio
import copy
import math
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import (
    HAND_E,
    JAW,
    THREE_FINGER,
    TWO_FINGER_85,
    TWO_FINGER_140,
    Convention,
    RobotiqHand,
    Units,
)
from robotiq_async.calibration.conventions import CONVENTIONS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.virtual import virtual

SHARES = st.floats(0, 1)
MODELS = (THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, HAND_E)
UNITS = [RobotiqHand("tcp://127.0.0.1", model=model).units for model in MODELS]
EACH = st.sampled_from([*CONVENTIONS.values()])
NAMED = pytest.mark.parametrize("convention", CONVENTIONS.values(), ids=CONVENTIONS)

FORMULAS: dict[str, Callable[[float], float]] = {
    "DROID": lambda share: 1 - (0.085 * share) / 0.085,  # 1 - width / max_width
    "RLDS": lambda share: 1 - (1 - share),  # 1 - the action of a stack where 1 closes
    "LIBERO": lambda share: -1 if share == 1 else 1 - 2 * share,  # -1 opens, 1 closes
    "HIL_SERL": lambda share: 2 * share - 1,
    "MANISKILL": lambda share: 2 * (0.05 * share) / 0.05 - 1,  # of limits, normalised to -1..1
    "LEROBOT": lambda share: 100 * share,
    "UR_RTDE": lambda share: 1 - (1 - share),  # the counts over 255, turned round
    "POLYMETIS_2F85": lambda share: 0.085 * share,
    "RADIANS_2F85": lambda share: 0.8 * (1 - share),
    "RADIANS_2F140": lambda share: 0.7 * (1 - share),
}
"""A share of the travel that is open, as the source of each scale calls it."""


def test_there_are_ten_and_each_is_an_attribute_of_its_name() -> None:
    assert CONVENTIONS.keys() == FORMULAS.keys()
    assert all(getattr(Convention, name) is each for name, each in CONVENTIONS.items())


@NAMED
@given(share=SHARES)
def test_a_value_is_that_of_the_source(convention: Convention, share: float) -> None:
    assert convention.value(share) == pytest.approx(FORMULAS[convention.name](share), abs=1e-12)


@NAMED
@given(share=SHARES)
def test_there_and_back(convention: Convention, share: float) -> None:
    assert convention.fraction(convention.value(share)) == pytest.approx(share, abs=1e-12)


@given(one=EACH, other=EACH, share=SHARES)
def test_one_to_another_keeps_the_opening(one: Convention, other: Convention, share: float) -> None:
    there = other.value(one.fraction(one.value(share)))
    assert other.fraction(there) == pytest.approx(share, abs=1e-9)


@given(convention=EACH, shares=st.tuples(SHARES, SHARES), units=st.sampled_from(UNITS))
def test_nearer_to_closed_never_opens(
    convention: Convention, shares: tuple[float, float], units: Units
) -> None:
    wide, narrow = (convention.value(share) for share in sorted(shares, reverse=True))
    assert abs(wide - convention.closed) >= abs(narrow - convention.closed)
    assert units.position(open_fraction=convention.fraction(wide)) <= units.position(
        open_fraction=convention.fraction(narrow)
    )


@NAMED
def test_the_ends_are_those_of_open_and_close_on_four_models(convention: Convention) -> None:
    ends = [convention.fraction(end) for end in (convention.open, convention.closed)]
    assert [math.copysign(1, end) for end in ends] == [1, 1], "no negative zero in a table"
    for units in UNITS:
        assert [units.position(open_fraction=end) for end in ends] == [0, 255]
    assert [convention.value(share) for share in (1, 0)] == [convention.open, convention.closed]


@given(st.floats(-1e9, 1e9), st.floats(-1e9, 1e9), SHARES)
def test_a_scale_of_ones_own(open_: float, closed: float, share: float) -> None:
    if open_ == closed:
        return
    mine = Convention("mine", open_, closed)
    assert (mine.fraction(open_), mine.fraction(closed)) == (1, 0)
    assert (mine.value(1), mine.value(0)) == (open_, closed)
    assert 0 <= mine.fraction(mine.value(share), clamp=True) <= 1


# -- refusals ----------------------------------------------------------------------------------------------


@NAMED
def test_what_is_beyond_the_range_is_refused_or_clamped(convention: Convention) -> None:
    low, high = sorted((convention.open, convention.closed))
    step = 1e-6 * (high - low)
    for beyond, end in ((low - step, low), (high + step, high)):
        with pytest.raises(
            ValueError, match=f"value must be a number of {convention.name} in {low}..{high}, got"
        ):
            convention.fraction(beyond)
        assert convention.fraction(beyond, clamp=True) == convention.fraction(end)


@pytest.mark.parametrize("clamp", [False, True])
def test_nan_infinity_and_what_is_no_number_are_refused_also_when_clamped(clamp: bool) -> None:
    for value in (math.nan, math.inf, -math.inf, np.array(np.nan)):
        with pytest.raises(ValueError, match="value must be a number of DROID"):
            Convention.DROID.fraction(value, clamp=clamp)
    for wrong in (True, np.True_, "0.5", None, [0.5], np.array([0.2, 0.3]), 0.5j):
        with pytest.raises(TypeError, match="value must be a number of DROID"):
            Convention.DROID.fraction(wrong, clamp=clamp)


def test_numbers_of_numpy_and_arrays_of_one_are_numbers() -> None:
    for value in (np.float32(0.25), np.array(0.25), np.array([[0.25]])):
        assert Convention.DROID.fraction(value) == 0.75
    assert Convention.DROID.fraction(np.int64(1)) == 0


def test_a_share_is_checked() -> None:
    for share in (-0.01, 1.01, math.nan):
        with pytest.raises(ValueError, match=r"open_fraction must be a number in 0\.0\.\.1\.0"):
            Convention.DROID.value(share)


@pytest.mark.parametrize(
    ("arguments", "error"),
    [
        (("x", 1.0, 1.0), ValueError),
        (("x", math.nan, 1.0), ValueError),
        (("x", 0.0, math.inf), ValueError),
        (("x", True, 0.0), TypeError),
        ((3, 1.0, 0.0), TypeError),
        (("x", 1.0), TypeError),
    ],
)
def test_a_scale_needs_a_name_and_two_different_numbers(
    arguments: tuple[Any, ...], error: type[Exception]
) -> None:
    with pytest.raises(error):
        Convention(*arguments)


def test_it_is_a_value() -> None:
    copies = (pickle.loads(pickle.dumps(Convention.DROID)), copy.deepcopy(Convention.DROID))
    assert all(each == Convention.DROID and hash(each) == hash(Convention.DROID) for each in copies)
    assert Convention.RLDS != Convention.UR_RTDE, "equal numbers of two names"
    with pytest.raises(AttributeError):
        Convention.DROID.open = 1.0  # type: ignore[misc]


# -- at a gripper ------------------------------------------------------------------------------------------


@NAMED
@virtual
async def test_the_closed_end_grips_a_part_and_the_open_end_lets_it_go(convention: Convention) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85, spread=False)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        gripper.place_object(JAW, position=120)
        held = await hand.move(open_fraction=convention.fraction(convention.closed))
        assert held.contacts == JAW
        assert convention.value(held.status.open_fraction(JAW)) != convention.closed
        free = await hand.move(open_fraction=convention.fraction(convention.open))
        assert not free.contacts
        assert convention.value(free.status.open_fraction(JAW)) == convention.open
