"""The lease: who may command, and until when."""

from __future__ import annotations

import pytest

from robotiq_async.fleet.control.lease import Holder, Lease

ANNA, BEN = Holder("a", "anna@cell:1"), Holder("b", "ben@cell:2")


def test_it_is_nobody_s_at_first() -> None:
    lease = Lease()
    assert lease.holder is None
    assert lease.number == 0
    assert not lease.has_expired(1e9)
    assert lease.end("taken") is None
    assert lease.number == 0, "nothing has changed"


def test_it_lasts_for_its_window_from_what_was_heard_and_not_from_when_it_was_asked_for() -> None:
    lease = Lease(1.0)
    lease.grant(ANNA, seen=10.0)
    assert lease.expires == 11.0
    assert not lease.has_expired(11.0)
    assert lease.has_expired(11.001)


def test_renewing_goes_by_what_was_heard_and_never_back() -> None:
    lease = Lease(1.0)
    lease.grant(ANNA, seen=10.0)
    lease.renew(10.5)
    lease.renew(10.2)
    assert lease.expires == 11.5


@pytest.mark.parametrize(
    ("seen", "fresh"), [(9.0, True), (8.999, False), (10.0, True), (10.001, False), (-1e300, False)]
)
def test_fresh_is_within_the_window_and_not_from_the_future(seen: float, fresh: bool) -> None:
    assert Lease(1.0).is_fresh(seen, 10.0) is fresh


def test_every_change_of_holder_has_its_number() -> None:
    lease = Lease()
    assert lease.grant(ANNA, 0.0) == 1
    assert lease.end("taken") is ANNA
    assert (lease.number, lease.holder) == (2, None)
    assert lease.grant(BEN, 0.0) == 3


def test_it_is_known_why_a_lease_ended_for_a_while() -> None:
    lease = Lease()
    first = lease.grant(ANNA, 0.0)
    lease.end("taken")
    second = lease.grant(BEN, 0.0)
    lease.end("halted")
    assert (lease.end_of(first), lease.end_of(second)) == ("taken", "halted")
    for _ in range(1000):
        lease.grant(ANNA, 0.0)
        lease.end("released")
    assert lease.end_of(first) == "expired", "so long ago nobody remembers"
    assert len(lease._ends) <= 64
