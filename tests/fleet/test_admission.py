"""Admission: nothing twice, late, out of turn, under an old lease, or by the wrong gripper."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async.fleet.control.admission import Admission
from robotiq_async.fleet.control.lease import Lease
from robotiq_async.fleet.wire.envelope import Call
from robotiq_async.values.errors import AgentError, ControlLostError

BASE, EPOCH = "robotiq/v1/lab/cell/left", 77
NOW = 100.0


def admission(holder: str = "anna", number: int = 1) -> tuple[Admission, Call]:
    """With a holder, and a call that is let in."""
    one = Admission(BASE, EPOCH, Lease(1.0))
    lease = one.acquire(Call(BASE, holder, EPOCH, 0, number, NOW), holder)
    return one, Call(BASE, holder, EPOCH, lease, number + 1, NOW)


def test_what_is_let_in() -> None:
    one, call = admission()
    for number in (2, 3, 10):
        one.admit(replace(call, number=number), NOW)


@pytest.mark.parametrize(
    "other", ["robotiq/v1/lab/cell/right", "robotiq/v1/lab/cell", "", "robotiq/v1/lab/cell/left/"]
)
def test_for_another_gripper(other: str) -> None:
    one, call = admission()
    with pytest.raises(AgentError, match="nothing was done"):
        one.check_meant(replace(call, to=other))


def test_for_another_run_of_the_agent() -> None:
    one, call = admission()
    one.check_meant(call)
    one.check_meant(replace(call, epoch=0))
    for epoch in (EPOCH - 1, EPOCH + 1, 1):
        with pytest.raises(AgentError, match="the agent was restarted"):
            one.check_meant(replace(call, epoch=epoch))


@pytest.mark.parametrize("number", [0, 1, 2])
def test_overtaken_or_repeated(number: int) -> None:
    one, call = admission()
    one.admit(call, NOW)
    with pytest.raises(AgentError, match="a later request overtook"):
        one.admit(replace(call, number=number), NOW)


def test_of_somebody_else_or_under_another_lease() -> None:
    one, call = admission()
    for other in (
        replace(call, client="ben"),
        replace(call, lease=call.lease - 1),
        replace(call, lease=call.lease + 1),
    ):
        for ask in (one.admit, one.renew):
            with pytest.raises(ControlLostError):
                ask(other, NOW)
        assert not one.is_of_holder(other)
    assert one.is_of_holder(call)
    one.admit(call, NOW)


@pytest.mark.parametrize("reason", ["taken", "halted", "expired", "released", "closed"])
def test_under_a_lease_that_has_ended_says_why(reason: str) -> None:
    one, call = admission()
    one.lease.end(reason)
    with pytest.raises(ControlLostError, match=f"ended .{reason}., no client commands") as caught:
        one.admit(call, NOW)
    assert caught.value.reason == reason
    one.acquire(Call(BASE, "ben", EPOCH, 0, 1, NOW), "ben@cell")
    with pytest.raises(ControlLostError, match="ben@cell commands the gripper now"):
        one.admit(call, NOW)


@pytest.mark.parametrize("seen", [NOW - 1.001, NOW + 0.001, 0.0])
def test_too_long_on_its_way_or_from_the_future(seen: float) -> None:
    one, call = admission()
    for ask in (one.admit, one.renew, one.check_fresh):
        with pytest.raises(ControlLostError) as caught:
            ask(replace(call, seen=seen), NOW)
        assert caught.value.reason == "late"
    assert one.lease.expires == NOW + 1.0, "it prolongs nothing"
    one.admit(replace(call, seen=NOW - 0.999), NOW)


def test_a_refused_request_does_not_count() -> None:
    one, call = admission()
    with pytest.raises(ControlLostError):
        one.admit(replace(call, number=50, seen=NOW - 5), NOW)
    one.admit(replace(call, number=3), NOW)


def test_a_request_prolongs_the_lease_and_a_renewal_does_not_count() -> None:
    one, call = admission()
    one.renew(replace(call, number=9, seen=NOW + 0.5), NOW + 0.5)
    assert one.lease.expires == NOW + 1.5
    one.admit(replace(call, number=3, seen=NOW + 0.7), NOW + 0.8)
    assert one.lease.expires == NOW + 1.7


def test_a_bar() -> None:
    one, call = admission()
    one.bar(replace(call, number=20))
    with pytest.raises(AgentError, match="overtook"):
        one.admit(replace(call, number=20), NOW)
    one.bar(replace(call, number=3))
    with pytest.raises(AgentError, match="overtook"):
        one.admit(replace(call, number=19), NOW)
    one.admit(replace(call, number=21), NOW)


def test_the_lease_is_not_given_to_two() -> None:
    one, _ = admission()
    with pytest.raises(ControlLostError, match="anna commands the gripper") as caught:
        one.acquire(Call(BASE, "ben", EPOCH, 0, 1, NOW), "ben")
    assert caught.value.reason == "held"


def test_nothing_asked_before_the_lease_is_let_in_under_it() -> None:
    one, call = admission(number=10)
    with pytest.raises(AgentError, match="overtook"):
        one.admit(replace(call, number=9), NOW)


def test_a_repeated_request_for_the_lease() -> None:
    one = Admission(BASE, EPOCH, Lease(1.0))
    asked = Call(BASE, "anna", EPOCH, 0, 5, NOW)
    assert not one.is_repeated(asked)
    one.acquire(asked, "anna")
    assert one.is_repeated(asked), "it has what it asked for"
    assert not one.is_repeated(replace(asked, number=6))
    with pytest.raises(AgentError, match="was repeated"):
        one.is_repeated(asked)
    one.lease.end("taken")
    with pytest.raises(AgentError, match="was repeated"):
        one.is_repeated(replace(asked, number=6))


def test_a_thousand_clients_are_remembered_and_not_more() -> None:
    one = Admission(BASE, EPOCH, Lease(1.0))
    for client in range(3000):
        assert not one.is_repeated(Call(BASE, str(client), EPOCH, 0, 1, NOW))
    assert len(one._asked) <= 1000


# -- any sequence, against a model -------------------------------------------------------------------------


@dataclass
class Model:
    """What is promised, in the plainest words.

    Attributes:
        given: the lease that each client was given last.
        carried_out: the numbers let in, by lease.
        holder: who has the lease, or None.
    """

    given: dict[str, int] = field(default_factory=dict)
    carried_out: dict[int, list[int]] = field(default_factory=dict)
    proven: float = 0.0
    holder: str | None = None


CLIENTS = st.sampled_from(["anna", "ben", "cleo"])
STEP = st.tuples(
    st.sampled_from(["acquire", "take", "admit", "admit", "admit", "renew", "release", "bar", "wait"]),
    CLIENTS,
    st.integers(0, 4),  # the request is so many numbers old
    st.integers(0, 2),  # the lease is so many old
    st.sampled_from([-3.0, -0.9, -0.2, 0.0, 0.0, 0.0, 0.1]),  # when the agent was heard
)


@settings(max_examples=1500)
@given(st.lists(STEP, max_size=40))
def test_never_two_holders_and_never_an_old_lease(steps: list[tuple[str, str, int, int, float]]) -> None:
    one, model, now, number = Admission(BASE, EPOCH, Lease(1.0)), Model(), NOW, 10
    granted: set[int] = set()
    for what, client, old, leases_old, heard in steps:
        number += 1
        lease = model.given.get(client, 0) - leases_old
        call = Call(BASE, client, EPOCH, max(0, lease), number - old, now + heard)
        if one.lease.has_expired(now):
            one.lease.end("expired")
            model.holder = None
        is_holders = model.holder == client and call.lease == model.given.get(client)
        is_fresh = -1.0 <= heard <= 0.0
        if what == "wait":
            now += 0.4
        elif what in ("acquire", "take") and is_fresh:
            if what == "take" and model.holder not in (None, client):
                one.lease.end("taken")
                model.holder = None
            if raises(lambda call=call: one.acquire(call, call.client)) is None:  # type: ignore[misc]
                assert model.holder is None, "only one at a time"
                model.holder, model.given[client] = client, one.lease.number
                model.carried_out[one.lease.number] = [call.number]
                assert one.lease.number not in granted, "no number twice"
                granted.add(one.lease.number)
                model.proven = call.seen
            else:
                assert model.holder is not None
        elif what == "admit":
            let_in = raises(lambda call=call, now=now: one.admit(call, now)) is None  # type: ignore[misc]
            in_turn = is_holders and call.number > max(model.carried_out[call.lease])
            assert let_in == (is_holders and is_fresh and in_turn)
            if let_in:
                model.carried_out[call.lease].append(call.number)
                model.proven = max(model.proven, call.seen)
        elif what == "renew":
            renewed = raises(lambda call=call, now=now: one.renew(call, now)) is None  # type: ignore[misc]
            assert renewed == (is_holders and is_fresh)
            if renewed:
                model.proven = max(model.proven, call.seen)
        elif what == "release" and is_holders:
            one.lease.end("released")
            model.holder = None
        elif what == "bar" and is_holders:
            one.bar(call)
            model.carried_out[call.lease].append(max(call.number, max(model.carried_out[call.lease])))
        holder = one.lease.holder
        assert (None if holder is None else holder.client) == model.holder
        if holder is not None:
            assert one.lease.expires == model.proven + 1.0
            assert one.lease.number == model.given[holder.client]


def raises(ask: Callable[[], object]) -> Exception | None:
    try:
        ask()
    except (ControlLostError, AgentError) as error:
        return error
    return None
