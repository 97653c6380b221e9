"""Claims: who owns which gripper."""

from __future__ import annotations

import asyncio
import threading
import time

import pytest

from robotiq_async.link.gripper_link import MOST_LEFT, Claims, Gripper


def never(_: object) -> bool:
    return False


@pytest.fixture
def claims() -> Claims[str, str]:
    return Claims()


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


async def test_the_first_owns_it_until_it_gives_it_back(claims: Claims[str, str]) -> None:
    assert claims.claim(lambda: Gripper("x"), "first", never) is None
    for who in ("second", "first"):
        assert claims.claim(lambda: Gripper("x"), who, never) == "first"
    assert claims.claim(lambda: Gripper("y"), "second", never) is None
    claims.release("first")
    assert claims.claim(lambda: Gripper("x"), "third", never) is None


async def test_where_a_gripper_is_is_asked_again(claims: Claims[str, str]) -> None:
    places = {"by-id": "ttyUSB0"}
    claims.claim(lambda: Gripper(places["by-id"]), "first", never)
    assert claims.claim(lambda: Gripper("ttyUSB0"), "second", never) == "first"
    places["by-id"] = "ttyUSB1"
    assert claims.claim(lambda: Gripper("ttyUSB1"), "second", never) == "first"
    assert claims.claim(lambda: Gripper("ttyUSB0"), "second", never) is None


async def test_an_owner_that_is_over_owns_nothing(claims: Claims[str, str]) -> None:
    claims.claim(lambda: Gripper("x"), "first", never)
    assert claims.claim(lambda: Gripper("x"), "second", lambda who: who == "first") is None
    assert claims.claim(lambda: Gripper("x"), "third", never) == "second"


def test_an_owner_whose_loop_was_closed_owns_nothing(claims: Claims[str, str]) -> None:
    async def claim(who: str) -> str | None:
        return claims.claim(lambda: Gripper("x"), who, never)

    assert asyncio.run(claim("first")) is None
    assert asyncio.run(claim("second")) is None


async def test_an_owner_of_another_loop_is_not_asked_whether_it_is_over(claims: Claims[str, str]) -> None:
    """It may be about to begin."""
    claims.claim(lambda: Gripper("x"), "first", never)

    async def claim() -> str | None:
        return claims.claim(lambda: Gripper("x"), "second", lambda _: True)

    assert await asyncio.to_thread(asyncio.run, claim()) == "first"


async def test_of_many_threads_one_gets_it(claims: Claims[str, str]) -> None:
    def slowly() -> Gripper:
        time.sleep(0.001)  # another thread's turn, in the middle of a claim
        return Gripper("another")

    claims.claim(slowly, "another", never)
    together = threading.Barrier(4)

    async def claim(who: str) -> bool:
        together.wait()
        got_it = claims.claim(lambda: Gripper("x"), who, never) is None
        together.wait()  # an owner whose loop is closed owns nothing
        return got_it

    def in_its_loop(number: int) -> bool:
        return asyncio.run(claim(f"thread {number}"))

    for _ in range(3):
        got = await asyncio.gather(*(asyncio.to_thread(in_its_loop, number) for number in range(4)))
        assert sum(got) == 1


async def test_a_serial_line_is_shared_in_one_event_loop(claims: Claims[str, str]) -> None:
    """Its connection belongs to one."""
    left, right = Gripper("x", 9, is_on_line=True), Gripper("x", 12, is_on_line=True)

    async def claim() -> str | None:
        return claims.claim(lambda: right, "elsewhere", never)

    assert claims.claim(lambda: left, "first", never) is None
    assert await asyncio.to_thread(asyncio.run, claim()) == "first"
    assert claims.claim(lambda: right, "second", never) is None
    assert claims.claim(lambda: Gripper("x", 14), "Modbus TCP to the same socket", never) == "first"


async def test_the_next_owner_gets_what_the_last_one_has_left(claims: Claims[str, str]) -> None:
    here, there = Gripper("x"), Gripper("y")
    assert claims.left(here) is None
    claims.claim(lambda: here, "first", never)
    claims.release("first", "what is on its way")
    claims.release("first", "too late")
    claims.claim(lambda: here, "second", never)
    claims.release("second")
    assert (claims.left(here), claims.left(there)) == ("what is on its way", None)


@pytest.mark.parametrize(("last", "following"), [(None, 9), (9, None)])
async def test_what_was_left_is_found_with_and_without_a_unit_id(
    claims: Claims[str, str], last: int | None, following: int | None
) -> None:
    claims.claim(lambda: Gripper("x", last), "first", never)
    claims.release("first", "what is on its way")
    assert claims.left(Gripper("x", following)) == "what is on its way"


async def test_what_was_left_is_kept_for_the_newest_grippers() -> None:
    claims: Claims[str, int] = Claims()

    def run(number: int) -> None:
        claims.claim(lambda: Gripper(f"gripper {number}"), "hand", never)
        claims.release("hand", number)

    for number in range(MOST_LEFT):
        run(number)
    run(0)
    run(MOST_LEFT)
    kept = [
        number for number in range(MOST_LEFT + 1) if claims.left(Gripper(f"gripper {number}")) is not None
    ]
    assert kept == [0, *range(2, MOST_LEFT + 1)]
