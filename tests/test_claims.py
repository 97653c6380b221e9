"""Claims: who owns which gripper."""

from __future__ import annotations

import asyncio
import sys
import threading
from collections.abc import Iterator
from functools import partial

import pytest

from robotiq_async.claims import Claims, Gripper


def never(_: object) -> bool:
    return False


@pytest.fixture
def claims() -> Claims[str]:
    return Claims()


@pytest.fixture
def eager_threads() -> Iterator[None]:
    """Threads take turns as often as they can."""
    before = sys.getswitchinterval()
    sys.setswitchinterval(1e-6)
    yield
    sys.setswitchinterval(before)


@pytest.mark.parametrize(
    ("one", "other", "may_be"),
    [
        (Gripper("x"), Gripper("x"), True),
        (Gripper("x"), Gripper("y"), False),
        (Gripper("x", 2), Gripper("x", 2), True),
        (Gripper("x", 2), Gripper("x", 3), False),
        (Gripper("x"), Gripper("x", 3), True),
        (Gripper("x", 2), Gripper("y", 2), False),
        (Gripper("x", 2, "one hint"), Gripper("x", 2, "another"), True),
    ],
)
def test_unit_ids_tell_grippers_apart_where_both_are_given(
    one: Gripper, other: Gripper, may_be: bool
) -> None:
    assert one.may_be(other) is other.may_be(one) is may_be


async def test_the_first_owns_it_until_it_gives_it_back(claims: Claims[str]) -> None:
    assert claims.claim(lambda: Gripper("x"), "first", never) is None
    for who in ("second", "first"):
        assert claims.claim(lambda: Gripper("x"), who, never) == "first"
    assert claims.claim(lambda: Gripper("y"), "second", never) is None
    claims.release("first")
    assert claims.claim(lambda: Gripper("x"), "third", never) is None


async def test_where_a_gripper_is_is_asked_again(claims: Claims[str]) -> None:
    places = {"by-id": "ttyUSB0"}
    claims.claim(lambda: Gripper(places["by-id"]), "first", never)
    assert claims.claim(lambda: Gripper("ttyUSB0"), "second", never) == "first"
    places["by-id"] = "ttyUSB1"
    assert claims.claim(lambda: Gripper("ttyUSB1"), "second", never) == "first"
    assert claims.claim(lambda: Gripper("ttyUSB0"), "second", never) is None


async def test_an_owner_that_is_over_owns_nothing(claims: Claims[str]) -> None:
    claims.claim(lambda: Gripper("x"), "first", never)
    assert claims.claim(lambda: Gripper("x"), "second", lambda who: who == "first") is None
    assert claims.claim(lambda: Gripper("x"), "third", never) == "second"


def test_an_owner_whose_loop_was_closed_owns_nothing(claims: Claims[str]) -> None:
    async def claim(who: str) -> str | None:
        return claims.claim(lambda: Gripper("x"), who, never)

    assert asyncio.run(claim("first")) is None
    assert asyncio.run(claim("second")) is None


async def test_an_owner_of_another_loop_is_not_asked_whether_it_is_over(claims: Claims[str]) -> None:
    """It may be about to begin."""
    claims.claim(lambda: Gripper("x"), "first", never)

    async def claim() -> str | None:
        return claims.claim(lambda: Gripper("x"), "second", lambda _: True)

    assert await asyncio.to_thread(asyncio.run, claim()) == "first"


@pytest.mark.usefixtures("eager_threads")
def test_of_many_threads_one_gets_it(claims: Claims[str]) -> None:
    together = threading.Barrier(8)
    got: list[str] = []

    async def claim(who: str) -> None:
        for turn in range(50):
            together.wait()
            if claims.claim(partial(Gripper, f"gripper {turn}"), who, never) is None:
                got.append(f"gripper {turn}")
        together.wait()

    threads = [threading.Thread(target=asyncio.run, args=(claim(f"thread {n}"),)) for n in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(got) == sorted(f"gripper {turn}" for turn in range(50))
