"""Nothing is carried out twice, late, out of order, under an old lease, or by the wrong gripper."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.fleet.agent.questions import EACH, AgentQuestions
from robotiq_async.fleet.control.admission import Admission
from robotiq_async.fleet.control.lease import Holder, Lease
from robotiq_async.fleet.errors import AgentError, ControlLostError
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import AgentCall
from tests.fleet.lab import LEFT, Lab, lab
from tests.fleet.network import MemoryBus
from tests.virtual import inside

BASE, EPOCH = "robotiq/v1/lab/cell/left", 77
NOW = 100.0
CLIENTS = st.sampled_from(["anna", "ben", "cleo"])
STEP = st.tuples(
    st.sampled_from(["acquire", "take", "admit", "admit", "admit", "renew", "release", "bar", "wait"]),
    CLIENTS,
    st.integers(0, 4),  # the request is so many numbers old
    st.integers(0, 2),  # the lease is so many old
    st.sampled_from([-3.0, -0.9, -0.2, 0.0, 0.0, 0.0, 0.1]),  # when the agent was heard
)
ANNA, BEN = Holder("a", "anna@cell:1"), Holder("b", "ben@cell:2")
FLOOD = 8000
"""Questions a second: they took an agent from 203 polls a second to 119."""


# -- admission ---------------------------------------------------------------------------------------------


def admission(holder: str = "anna", number: int = 1) -> tuple[Admission, AgentCall]:
    """An admission with a holder, and a call that is let in."""
    one = Admission(BASE, EPOCH, Lease(1.0))
    lease = one.acquire(AgentCall(BASE, holder, EPOCH, 0, number, NOW), holder)
    return one, AgentCall(BASE, holder, EPOCH, lease, number + 1, NOW)


@pytest.mark.parametrize(
    "other", ["robotiq/v1/lab/cell/right", "robotiq/v1/lab/cell", "", "robotiq/v1/lab/cell/left/"]
)
def test_for_another_gripper(other: str) -> None:
    one, call = admission()
    with pytest.raises(AgentError, match="was carried to"):
        one.check_meant(replace(call, to=other))


def test_for_another_run_of_the_agent() -> None:
    one, call = admission()
    one.check_meant(call)
    one.check_meant(replace(call, epoch=0))
    for epoch in (EPOCH - 1, EPOCH + 1, 1):
        with pytest.raises(AgentError, match="the agent was restarted"):
            one.check_meant(replace(call, epoch=epoch))


def test_of_another_client_or_under_another_lease() -> None:
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
    one.acquire(AgentCall(BASE, "ben", EPOCH, 0, 1, NOW), "ben@cell")
    with pytest.raises(ControlLostError, match="ben@cell commands the gripper now"):
        one.admit(call, NOW)
    with pytest.raises(ControlLostError, match=r"^ben@cell commands the gripper$") as caught:
        one.acquire(call, "anna@cell")
    assert caught.value.reason == "held"


@pytest.mark.parametrize("seen", [NOW - 1.001, NOW + 0.001, 0.0])
def test_too_long_on_its_way_or_from_the_future(seen: float) -> None:
    one, call = admission()
    for ask in (one.admit, one.renew, one.check_fresh):
        with pytest.raises(ControlLostError) as caught:
            ask(replace(call, seen=seen), NOW)
        assert caught.value.reason == "late"
    assert one.lease.expires == NOW + 1.0, "it prolongs nothing"
    one.admit(replace(call, seen=NOW - 0.999), NOW)


def test_a_renewal_overtakes_no_command() -> None:
    one, call = admission()
    one.renew(replace(call, number=9), NOW)
    one.admit(call, NOW)


def test_a_bar() -> None:
    one, call = admission()
    one.bar(replace(call, number=20))
    with pytest.raises(AgentError, match="overtook"):
        one.admit(replace(call, number=20), NOW)
    one.bar(replace(call, number=3))
    with pytest.raises(AgentError, match="overtook"):
        one.admit(replace(call, number=19), NOW)
    one.admit(replace(call, number=21), NOW)


def test_a_repeated_request_for_the_lease() -> None:
    one = Admission(BASE, EPOCH, Lease(1.0))
    asked = AgentCall(BASE, "anna", EPOCH, 0, 5, NOW)
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
        assert not one.is_repeated(AgentCall(BASE, str(client), EPOCH, 0, 1, NOW))
    assert len(one._by_client) <= 1000


# -- any sequence, against a model -------------------------------------------------------------------------


@dataclass
class Model:
    """The promises, in the plainest words.

    Attributes:
        given: the lease that each client was given last.
        carried_out: the numbers let in, by lease.
        holder: who has the lease, or None.
    """

    given: dict[str, int] = field(default_factory=dict)
    carried_out: dict[int, list[int]] = field(default_factory=dict)
    proven: float = 0.0
    holder: str | None = None


@given(st.lists(STEP, min_size=20, max_size=40))
def test_never_two_holders_and_never_an_old_lease(steps: list[tuple[str, str, int, int, float]]) -> None:
    one, model, now, number = Admission(BASE, EPOCH, Lease(1.0)), Model(), NOW, 10
    granted: set[int] = set()
    for what, client, old, leases_old, heard in steps:
        number += 1
        lease = model.given.get(client, 0) - leases_old
        call = AgentCall(BASE, client, EPOCH, max(0, lease), number - old, now + heard)
        has_expired = model.holder is not None and now > model.proven + 1.0
        assert one.lease.has_expired(now) == has_expired
        if has_expired:
            one.lease.end("expired")
            model.holder = None
        is_holders = model.holder == client and call.lease == model.given.get(client)
        is_fresh = -1.0 <= heard <= 0.0
        if what == "wait":
            now += 0.5
        elif what in ("acquire", "take") and is_fresh:
            if what == "take" and model.holder not in (None, client):
                one.lease.end("taken")
                model.holder = None
            if accepted(one.acquire, call, client):
                assert model.holder is None, "only one at a time"
                model.holder, model.given[client] = client, one.lease.number
                model.carried_out[one.lease.number] = [call.number]
                assert one.lease.number not in granted, "no number twice"
                granted.add(one.lease.number)
                model.proven = call.seen
            else:
                assert model.holder is not None
        elif what == "admit":
            let_in = accepted(one.admit, call, now)
            in_turn = is_holders and call.number > max(model.carried_out[call.lease])
            assert let_in == (is_holders and is_fresh and in_turn)
            if let_in:
                model.carried_out[call.lease].append(call.number)
                model.proven = max(model.proven, call.seen)
        elif what == "renew":
            renewed = accepted(one.renew, call, now)
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


def accepted(ask: Callable[..., object], *arguments: object) -> bool:
    try:
        ask(*arguments)
    except (ControlLostError, AgentError):
        return False
    return True


# -- lease -------------------------------------------------------------------------------------------------


def test_a_new_lease_has_no_holder() -> None:
    lease = Lease()
    assert lease.holder is None
    assert lease.number == 0
    assert not lease.has_expired(1e9)
    assert lease.end("taken") is None
    assert lease.number == 0, "nothing has changed"


@pytest.mark.parametrize(
    ("seen", "fresh"), [(9.0, True), (8.999, False), (10.0, True), (10.001, False), (-1e300, False)]
)
def test_fresh_is_within_the_window_and_not_from_the_future(seen: float, fresh: bool) -> None:
    assert Lease(1.0).is_fresh(seen, 10.0) is fresh


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
    assert lease.end_of(first) == "expired", "so long ago that it was forgotten"
    assert len(lease._ends) <= 64


# -- questions ---------------------------------------------------------------------------------------------


class Asked:
    """The questions of clients, at times of our own."""

    def __init__(self) -> None:
        self.at = 1.0
        self.questions = AgentQuestions(lambda: self.at)

    def read(self, who: str, count: int = FLOOD, step: float = 0.0) -> int:
        """How many are read of those that a client sends, so many seconds from one to the next."""
        read = 0
        for _ in range(count):
            read += self.questions.sort(LEFT.question(who)) is not None
            self.at += step
        return read


def test_each_client_has_a_second_s_worth_and_then_its_rate() -> None:
    asked = Asked()
    assert [asked.read(who) for who in ("one", "one", "two")] == [EACH, 0, EACH]
    assert asked.read("one", 1000, step=0.001) in range(90, 102)
    asked.at = 99.0
    assert asked.read("one") == EACH, "what was not used is not saved up"


def test_the_memory_is_bounded() -> None:
    """Without keys, a client may call itself something else each time."""
    asked = Asked()
    assert all(asked.read(f"client {each}", 1) for each in range(FLOOD))
    assert len(asked.questions._left) <= 1000


def test_dropped_questions_are_logged_now_and_then(caplog: pytest.LogCaptureFixture) -> None:
    at = 1.0
    questions = AgentQuestions(lambda: at)
    with caplog.at_level(logging.WARNING):
        for _ in range(3000):  # for 15 s
            questions.sort("")
            at += 0.005
        for _ in range(FLOOD):
            questions.sort("")
    assert caplog.text.count("a request for information was dropped: a client sends too many") == 2


@inside(lab)
async def test_questions_about_grippers_that_it_does_not_serve_do_not_reach_the_agent(here: Lab) -> None:
    """A flood about each of the agent's own has a limit in zenoh, and one about others would have none."""
    bus = here.agent._bus
    assert isinstance(bus, MemoryBus)
    asked = {expression for expression, _ in bus.queryables if "/info" in expression}
    assert asked == {LEFT.key("info"), LEFT.key("info", "*")}


@inside(lab)
async def test_the_statistics_of_an_answer_are_those_of_the_last_summary(here: Lab) -> None:
    """They were four fifths of the work for a question. The first summary may be from before a poll."""
    polls = []
    for number, pause in enumerate((0.1, 1.1, 0.1, 1.1)):
        await asyncio.sleep(pause)
        call = AgentCall(LEFT.base, "curious", number=number)
        polls.append((await here.answer("info/curious", call.pack())).value["statistics"]["polls"])
    assert 0 < polls[0] < polls[1] == polls[2] < polls[3]


@inside(lab)
async def test_a_flood_of_questions_leaves_other_clients_and_the_log_alone(
    here: Lab, hand: RemoteHand, caplog: pytest.LogCaptureFixture
) -> None:
    flooding = asyncio.create_task(flood(here))
    await asyncio.sleep(0.25)
    async with here.client("reader", control=False) as reader:
        await hand.move(30)
        await reader.halt()
    answered = await flooding
    assert answered <= 2 * EACH < FLOOD / 2
    assert caplog.text.count("a request for information was dropped") == 1


async def flood(here: Lab) -> int:
    """Send questions for half a second; return the number of answers."""
    bus, answers = here.network.bus("flooding"), []
    for number in range(FLOOD // 16):
        call = AgentCall(LEFT.base, "curious", number=number)
        answers += [
            bus.ask(LEFT.question("curious"), call.pack(), timeout=1.0, urgency=Urgency.COMMAND)
            for _ in range(8)
        ]
        await asyncio.sleep(0.001)
    return sum(reply is not None for reply in await asyncio.gather(*answers))
