"""One run of a hand: who owns the address, who learns of its end, and what can be waited for."""

from __future__ import annotations

import asyncio
import contextlib
import gc
import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

import pytest

from robotiq_async.control.pending import changes
from robotiq_async.local.session import Session
from robotiq_async.values.enums import Finger, State, Trigger
from robotiq_async.values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    InvalidStateError,
    MoveSupersededError,
    NotStartedError,
    RobotiqError,
)
from robotiq_async.values.events import Transition
from tests.fake_transport import LOST, Wire
from tests.local.sessions import Run, running
from tests.virtual import VirtualLoop, run

pytestmark = pytest.mark.virtual_time

# -- who owns the address ----------------------------------------------------------------------------------


async def test_an_address_has_one_session_at_a_time(session: Session) -> None:
    with pytest.raises(InvalidStateError, match="another hand runs on wire already"):
        Run().session()
    other = Run(key="another wire").session()
    await other.connected()
    await other.stop(halt=False)
    await session.stop(halt=False)
    again = Run().session()
    await again.connected()
    await again.stop(halt=False)


async def test_in_shutdown_the_address_is_free() -> None:
    """A start in the turn of SHUTDOWN was refused: the address still had its owner."""
    async with running() as (here, session):
        began: list[Session] = []

        def begin(item: object) -> None:
            if isinstance(item, Transition) and item.target is State.SHUTDOWN:
                began.append(Run().session())

        remove = here.channels.listeners.add(begin)
        await session.stop(halt=False)
        remove()
    await began[0].stop(halt=False)


async def test_a_refused_session_keeps_the_reason_why_the_link_is_down(session: Session) -> None:
    session.machine.note_down(LOST)
    with pytest.raises(InvalidStateError, match="this hand runs"):
        Session(session.options, session.machine, session._channels, activate=False)
    assert session.machine.why_down is LOST


async def test_a_session_that_could_not_begin_leaves_the_address_free() -> None:
    here = Run()

    def fail(**_: float) -> Wire:
        raise ZeroDivisionError

    broken = replace(here.options, link=replace(here.options.link, make=fail))
    with pytest.raises(ZeroDivisionError):
        Session(broken, here.machine, here.channels, activate=False)
    session = here.session()
    await session.connected()
    await session.stop(halt=False)


# -- its end -----------------------------------------------------------------------------------------------


async def test_a_session_is_over_when_it_was_stopped_and_may_be_stopped_again(session: Session) -> None:
    assert not session.is_over
    session.check_running()
    await session.stop(halt=True)
    assert session.is_over
    assert session.machine.state is State.SHUTDOWN
    with pytest.raises(NotStartedError):
        session.check_running()


async def test_a_first_contact_that_fails_is_the_end() -> None:
    here = Run()
    here.wire.failing["open"] = ConnectFailedError("wire", "refused")
    session = here.session()
    with pytest.raises(ConnectFailedError):
        await session.connected()
    await session.stop(halt=False)
    assert session.is_over


async def test_callers_that_wait_when_a_session_ends_get_the_reason(session: Session) -> None:
    state = asyncio.create_task(session.reach({State.FAULT}, None, what="never"))
    position = asyncio.create_task(
        session.answered(lambda waiter: session.controller.command(changes(Finger.A, 100), waiter))
    )
    stream = session._channels.transitions.open(None)
    await asyncio.sleep(0)
    await session.stop(halt=False)
    for task in (state, position):
        with pytest.raises(NotStartedError, match="the hand was stopped"):
            await task
    assert [each.target async for each in stream][-2:] == [State.DO_SHUTDOWN, State.SHUTDOWN]


# -- the write comes first -----------------------------------------------------------------------------------


class Order:
    """Who has heard of what, and whether the image had left by then."""

    def __init__(self, session: Session, wire: Wire) -> None:
        self._session, self._wire = session, wire
        self.heard: dict[str, bool] = {}

    def note(self, who: str) -> None:
        self.heard[who] = "write" in self._wire.calls

    async def move(self, axes: Finger = Finger.ABC) -> None:
        with self._session.moving(255, axes, 0, None) as (ended, _):
            with pytest.raises((MoveSupersededError, NotStartedError)):
                await ended
            self.note("move")

    async def wait_for(self, state: State) -> None:
        with contextlib.suppress(NotStartedError):
            await self._session.reach({state}, None, what="", failing={})
        self.note("state")

    def listen(self, *states: State) -> Callable[[], None]:
        def hear(item: object) -> None:
            if isinstance(item, Transition) and item.target in states:
                self.note("listener")

        return self._session._channels.listeners.add(hear)


@pytest.fixture(params=["tcp", "serial line"])
def link(request: pytest.FixtureRequest, wire: Wire, monkeypatch: pytest.MonkeyPatch) -> str:
    """A serial line is silent between two frames, and there a poll takes most of its interval."""
    name: str = request.param
    if name == "serial line":

        async def send(decide: Callable[[], Sequence[int] | None]) -> bool:
            await asyncio.sleep(0.002)
            return await Wire.send(wire, decide)

        monkeypatch.setattr(wire, "send", send)
        monkeypatch.setattr(wire, "exchange_s", 0.007)
    return name


@pytest.mark.usefixtures("link")
@pytest.mark.parametrize("how", ["stop", "keep", "halt", "reset", "hold", "command"])
@pytest.mark.parametrize("moment", [0.0, 0.0012, 0.0034, 0.0056, 0.0078])
async def test_a_write_that_is_due_leaves_before_anybody_hears_of_it(
    session: Session, wire: Wire, how: str, moment: float
) -> None:
    """Callers and listeners may hold up the loop, and the fingers moved on meanwhile."""
    order = Order(session, wire)
    tasks = [asyncio.create_task(order.move())]
    await asyncio.sleep(0.1)
    if how in ("stop", "keep", "reset"):
        tasks.append(asyncio.create_task(order.wait_for(State.DO_RESET)))
    await asyncio.sleep(0.02 + moment)
    stops = (State.DO_SHUTDOWN, State.DO_RESET)
    remove = order.listen(*stops if how != "hold" else (State.RUNNING_CC,))
    del wire.calls[:]
    controller = session.controller
    match how:
        case "halt":
            await session.answered(controller.halt)
        case "hold":
            await session.answered(lambda waiter: controller.hold(Finger.ABC, waiter))
        case "command":
            await session.answered(lambda waiter: controller.command(changes(Finger.A, 0), waiter))
        case "reset":
            await session.reach({State.RESET}, 5.0, what="", ask=controller.reset, failing={})
        case _:
            await session.stop(halt=True, keep_grip=how == "keep")
    await asyncio.gather(*tasks)
    remove()
    assert all(order.heard.values()), order.heard
    assert len(order.heard) == {"stop": 3, "keep": 3, "reset": 3, "hold": 2}.get(how, 1)


async def test_behind_a_slow_gateway_nobody_waits_for_the_write(
    session: Session, wire: Wire, monkeypatch: pytest.MonkeyPatch
) -> None:
    order = Order(session, wire)
    moving = asyncio.create_task(order.move())
    monkeypatch.setattr(wire, "exchange_s", 0.3)
    await asyncio.sleep(2.0)
    halting = asyncio.create_task(session.answered(session.controller.halt))
    await asyncio.sleep(0.001)
    assert moving.done()
    await halting


async def test_who_waits_for_a_write_hears_when_the_link_fails(session: Session, wire: Wire) -> None:
    order = Order(session, wire)
    moving = asyncio.create_task(order.move())
    await asyncio.sleep(0.1)
    wire.silent.add("write")
    with pytest.raises(RobotiqError):
        await session.answered(session.controller.halt)
    await moving
    wire.silent.clear()


async def test_what_nothing_is_written_for_is_heard_at_once(session: Session, wire: Wire) -> None:
    order = Order(session, wire)
    moving = asyncio.create_task(order.move())
    await asyncio.sleep(0.1)
    session.ask(session.controller.drop_requests, MoveSupersededError("its client is gone"))
    await asyncio.sleep(0)
    await asyncio.sleep(0)
    assert moving.done()


async def test_callers_that_wait_when_the_link_is_given_up_get_the_reason(
    session: Session, wire: Wire
) -> None:
    state = asyncio.create_task(session.reach({State.FAULT}, None, what="never"))
    stream = session._channels.statuses.open(1)
    wire.failing["read"] = wire.failing["open"] = LOST
    with pytest.raises(ConnectionLostError, match="the link is down: unplugged") as caught:
        await state
    assert caught.value.__cause__ is LOST
    with pytest.raises(ConnectionLostError, match="unplugged"):
        async for _ in stream:
            pass
    with pytest.raises(ConnectionLostError, match="unplugged"):
        session.check_running()


async def test_callers_that_wait_when_the_task_fails_get_an_error(caplog: pytest.LogCaptureFixture) -> None:
    """A bug must not leave a caller waiting for ever."""
    async with running() as (_, session):
        state = asyncio.create_task(session.reach({State.FAULT}, None, what="never"))
        await asyncio.sleep(0)
        session.controller.command(changes(Finger.A, 256))  # checked above; here it has no place in a byte
        with pytest.raises(ConnectionLostError, match="internal error: ValueError"):
            await state
        assert session.is_over
    (record,) = [each for each in caplog.records if each.levelno == logging.CRITICAL]
    assert "the task that owns the link failed" in record.getMessage()


async def test_a_bug_while_it_connects_is_named(caplog: pytest.LogCaptureFixture) -> None:
    """It was reported as "the hand was stopped while it connected"."""
    here = Run()
    here.wire.failing["open"] = ZeroDivisionError("a bug")
    session = here.session()
    with pytest.raises(ConnectionLostError, match="internal error: ZeroDivisionError"):
        await session.connected()
    await session.ended()
    assert "the task that owns the link failed" in caplog.text


# -- a loop that is closed under it ------------------------------------------------------------------------


@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.parametrize("state", [State.RUNNING_IDLE, State.DO_SHUTDOWN, State.SHUTDOWN])
def test_a_closed_loop_leaves_the_address_and_the_next_run_alone(state: State) -> None:
    """When the old task was thrown away, it shut down the hand of the new one."""
    _, left = in_a_loop_that_is_closed(state)
    with pytest.raises(NotStartedError, match=r"was closed|not started"):
        left.check_running()

    async def again() -> None:
        nonlocal left
        with pytest.raises(RuntimeError, match=r"closed before stop\(\)"):
            await left.stop(halt=True)
        here = Run()
        await here.wire.activate()
        left = session = here.session()
        await session.connected()
        with pytest.raises(InvalidStateError):
            Run().session()
        await asyncio.sleep(0.1)
        polls = session.counters.polls
        gc.collect()
        await asyncio.sleep(0.1)
        assert here.machine.state is State.RUNNING_IDLE
        assert here.wire.is_open
        assert session.counters.polls == pytest.approx(polls + 10, abs=1)
        await session.stop(halt=False)

    run(again)
    gc.collect()


def in_a_loop_that_is_closed(state: State) -> tuple[Run, Session]:
    """A session whose loop was closed in the turn in which the hand came to a state."""
    loop = VirtualLoop()

    async def begin() -> tuple[Run, Session]:
        here = Run()
        await here.wire.activate()
        session = here.session()
        changed = here.machine.changed

        def stop_the_loop(source: State, target: State, trigger: Trigger) -> None:
            changed(source, target, trigger)
            if target is state:
                loop.stop()

        here.machine.changed = stop_the_loop
        return here, session

    here, session = loop.run_until_complete(begin())
    if state is not State.RUNNING_IDLE:
        stopping = session.stop(halt=state is State.DO_SHUTDOWN)
        loop.call_later(0.1, lambda: loop.create_task(stopping))
    loop.run_forever()
    assert here.machine.state is state
    loop.close()
    return here, session


async def test_an_interrupt_during_a_stop_is_raised(session: Session) -> None:
    """The third Ctrl-C in asyncio.run ended in InvalidStateError."""
    stopping = session.stop(halt=True)
    stopping.send(None)
    with pytest.raises(KeyboardInterrupt):
        stopping.throw(KeyboardInterrupt())
    await session.ended()
