"""The library, call by call: movements, speeds, forces, status and faults.

    python demo/demo.py [ADDRESS] [--yes]

Every step prints the call it makes, as code, and what came back. Without an address the gripper is a
simulated one, reached over a real Modbus TCP connection, that also gets an object to grasp and a fault;
with one it asks before anything moves, and without a terminal it needs --yes.
Nothing here has run on real hardware yet.
"""

from __future__ import annotations

import argparse
import asyncio
import signal
import sys
import textwrap
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import AbstractAsyncContextManager, aclosing, asynccontextmanager, nullcontext, suppress
from functools import partial
from typing import Any, TypeVar

from robotiq_async import (
    CLOSED,
    WIDTH_NORMAL,
    WIDTH_PINCH,
    WIDTH_WIDE,
    Finger,
    InvalidStateError,
    MoveResult,
    RobotiqError,
    RobotiqHand,
    State,
    Transition,
)
from robotiq_async.cli.addresses import gripper_words, is_simulated
from robotiq_async.cli.consent import consent
from robotiq_async.cli.failures import CommandError, UsageError
from robotiq_async.cli.output.messages import forget
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.hands import Hand
from robotiq_async.link.address import is_remote, parse_address
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import model_of

WARNING = """ALL its fingers MOVE.
It is activated (they open and close to their stops), then fingers and scissor,
or the jaw, open and close for about half a minute, at full speed and at full
force too. What the hand holds will drop. Keep hands and cables away; Ctrl-C
stops the fingers."""

COLUMN = 50
"""The column at which results begin."""
WIDTH = 80
"""Columns of a line at most: of the narrowest terminal that is usual."""

T = TypeVar("T")


async def run(
    address: str, shown: Callable[[Hand], AbstractAsyncContextManager[object]] = nullcontext
) -> None:
    """The whole demo.

    Args:
        address: of the gripper.
        shown: shows the hand while it moves, ``robotiq-async demo --show``.

    Raises:
        RobotiqError: the gripper or the link failed.
    """
    print(gripper_words(address), flush=True)
    async with gripper(address) as (where, simulated):
        kind: type[RemoteHand | RobotiqHand] = RemoteHand if is_remote(where) else RobotiqHand
        hand: Hand = kind(where)
        transitions = hand.transitions()  # Opened before start(), it misses nothing.
        print(f"# connects and activates\nasync with {kind.__name__}({where!r}) as hand:", flush=True)
        async with shown(hand), hand:
            await movements(hand)
            await speeds(hand)
            await forces(hand, simulated)
            await status(hand)
            await faults(hand, simulated)
        title("What the hand went through: hand.transitions()")
        await print_life(transitions)


@asynccontextmanager
async def gripper(address: str) -> AsyncIterator[tuple[str, SimulatedGripper | None]]:
    """The address to connect to, and the gripper itself if it is a simulated one."""
    if not is_simulated(address):
        yield address, None
        return
    # RobotiqHand("sim://") starts a server as well; with our own we can put an object between the fingers.
    simulated = SimulatedGripper(model=model_of(parse_address(address).model))
    async with SimulatorServer(simulated, port=0) as server:
        yield server.address, server.gripper


async def movements(hand: Hand) -> None:
    """Part 1: the fingers, and the scissor, if there is one, that sets the width between B and C."""
    title("1. Basic movements")
    await call(hand.set_speed, 255)
    await call(hand.open)
    if Finger.SCISSOR not in hand.model.all_axes:
        await call(hand.move, 90)
        return
    for width in (WIDTH_NORMAL, WIDTH_PINCH, WIDTH_WIDE):
        # The width changes with open fingers only: closed ones are in each other's way.
        await call(hand.move, width, Finger.SCISSOR)
        await call(hand.move, 90)
        await call(hand.open)
    note("the scissor grasps as well: B and C close on each other sideways")
    await call(hand.close, Finger.SCISSOR)
    await call(hand.move, WIDTH_NORMAL, Finger.SCISSOR)


async def speeds(hand: Hand) -> None:
    """Part 2: a speed for each finger, then one for the group."""
    title("2. Speeds")
    fingers = [finger for finger in hand.model.axes if finger in Finger.ABC]
    for finger, speed in zip(fingers, (255, 160, 96), strict=False):
        await call(hand.set_speed, speed, finger)
    if len(fingers) > 1:
        note("three moves at once; each returns when its own finger has stopped")
    await together(*(partial(hand.move, 120, finger) for finger in fingers))
    await call(hand.set_speed, 200, Finger.ABC)
    await call(hand.open)


async def forces(hand: Hand, simulated: SimulatedGripper | None) -> None:
    """Part 3: a force for each finger and for a group; a contact is a result, not an error."""
    title("3. Forces")
    if simulated is not None:
        note("server.gripper.place_object(Finger.ABC, position=120)  # something to grasp")
        simulated.place_object(Finger.ABC, position=120)
    await call(hand.set_force, 0, Finger.A)
    if others := hand.model.all_axes & (Finger.B | Finger.C):
        await call(hand.set_force, 128, others)
    grasp(await call(hand.close))
    await call(hand.open)
    note("speed and force can be part of the move, too")
    grasp(await call(hand.move, CLOSED, speed=255, force=255))
    await call(hand.open)
    if simulated is not None:
        simulated.remove_object()


def grasp(result: MoveResult) -> None:
    """Print the contacts and the currents of a move."""
    read("result.contacts", literal(result.contacts) if result.object_detected else "none")
    peaks = "  ".join(f"{axis.name} {current}" for axis, current in result.peak_current_ma.items())
    read("result.peak_current_ma", peaks)


async def status(hand: Hand) -> None:
    """Part 4, first half: the status, once and as a stream."""
    title("4. Status and faults")
    read("hand.state", hand.state)
    read("hand.is_activated, hand.is_moving", (hand.is_activated, hand.is_moving))
    read("hand.status.fault", hand.status.fault.name)
    for axis in hand.model.axes:
        read(f"hand.status.position({literal(axis)})", hand.status.position(axis))
    note("async for status in hand.statuses():  # every poll; here two a second")
    await asyncio.gather(hand.move(150), watch(hand))
    await call(hand.open)
    read("hand.statistics.polls, .overruns", (hand.statistics.polls, hand.statistics.overruns))
    read("hand.statistics.period_p50", f"{hand.statistics.period_p50 * 1000:.2f} ms")


async def watch(hand: Hand) -> None:
    """Print readings while the hand moves."""
    due = 0.0
    async with aclosing(hand.statuses()) as statuses:
        async for latest in statuses:
            if latest.timestamp >= due:
                due = latest.timestamp + 0.5
                read("    status.position(Finger.A)", latest.position(Finger.A))
                read("    status.current_ma(Finger.A)", latest.current_ma(Finger.A))
            if not hand.is_moving:
                break


async def faults(hand: Hand, simulated: SimulatedGripper | None) -> None:
    """Part 4, second half: a call that is refused, and a fault with the way out of it."""
    note("a call that makes no sense now is refused, and nothing is sent")
    with suppress(InvalidStateError):
        await call(hand.atr)
    if simulated is not None:
        blocked = hand.model.fault(0x0E)
        note(f"server.gripper.inject_fault(Fault.{blocked.name})")
        simulated.inject_fault(blocked)
        await call(hand.wait_for_state, State.FAULT)
        read("hand.status.fault.description", hand.status.fault.description)
        note("recover() resets and activates again; what the gripper holds drops")
        await call(hand.recover)
        read("hand.state", hand.state)


# From here on: printing, and the shell.


async def print_life(transitions: AsyncIterator[Transition]) -> None:
    """Every change of state but those of a delivered command, which are many and alike."""
    commands = 0
    async for change in transitions:
        if change.target is State.RUNNING_CC:
            commands += 1
        elif change.source is not State.RUNNING_CC:
            print(f"  {change.source.name:>13} -> {change.target.name:<15}{change.trigger.value}")
    print(f"  and {commands} times RUNNING_IDLE -> RUNNING_CC -> RUNNING_IDLE: once a command")


async def call(function: Callable[..., Awaitable[T]], *args: object, **options: object) -> T:
    """Await a call; print it as the code that makes it, then what came back."""
    call = f"  await {code(function, args, options)}"
    print(call, end="", flush=True)
    try:
        result = await function(*args, **options)
    except RobotiqError as error:
        print(beside(call, f"{type(error).__name__}: {error}"))
        raise
    print(beside(call, words(result)), flush=True)
    return result


async def together(*moves: partial[Coroutine[None, None, MoveResult]]) -> None:
    """The same for several moves at once."""
    print("  await asyncio.gather(", flush=True)
    for move, result in zip(moves, await asyncio.gather(*(move() for move in moves)), strict=True):
        call = f"      {code(move.func, move.args, move.keywords)},"
        print(call + beside(call, words(result)))
    print("  )", flush=True)


def code(function: Callable[..., object], args: tuple[object, ...], options: dict[str, Any]) -> str:
    """A call as it is written."""
    written = [literal(value) for value in args]
    written += [f"{name}={literal(value)}" for name, value in options.items()]
    return f"hand.{function.__name__}({', '.join(written)})"


def literal(value: object) -> str:
    """A value as it is written."""
    if isinstance(value, Finger):
        return " | ".join(f"Finger.{name}" for name in str(value.name).split("|"))
    return str(value)


def words(result: object) -> str:
    """The result of a call in a few words."""
    if not isinstance(result, MoveResult):
        return "done" if result is None else str(result)
    axes = (
        f"{axis.name} {result.positions[axis]}{' contact' if outcome.is_contact else ''}"
        for axis, outcome in result.outcomes.items()
    )
    return f"{result.duration:.2f} s   {'  '.join(axes)}"


def title(text: str) -> None:
    """The heading of a part."""
    print(f"\n{text}\n{'-' * len(text)}", flush=True)


def note(text: str) -> None:
    """A remark between two calls."""
    print(f"  # {text}", flush=True)


def read(expression: str, value: object) -> None:
    """An expression and its value."""
    left = f"  {expression}"
    print(left + beside(left, str(value)), flush=True)


def beside(left: str, right: str) -> str:
    """The right part of a line, printed behind the left one; on lines of its own if it is too long."""
    if COLUMN + len(right) <= WIDTH:
        return f"{'':<{max(1, COLUMN - len(left))}}{right}"
    return "\n" + textwrap.fill(right, WIDTH, initial_indent=" " * 8, subsequent_indent=" " * 8)


def main() -> int:
    """Run from the shell without the extra ``cli``."""
    parser = argparse.ArgumentParser(description="The robotiq_async demo. The fingers move.")
    parser.add_argument(
        "address",
        nargs="?",
        default="sim://",
        help="tcp://HOST, rtu://DEVICE, zenoh://SITE/HOST/NAME or sim://",
    )
    parser.add_argument("--yes", "-y", action="store_true", help="do not ask before moving")
    options = parser.parse_args()
    # As Ctrl-C does: leaving ``async with`` stops the fingers.
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        consent(options.address, WARNING, yes=options.yes)
        asyncio.run(run(options.address))
    except UsageError as error:
        print(f"demo: {error}", file=sys.stderr)
        return 2
    except (RobotiqError, CommandError) as error:
        print(f"demo: {error}", file=sys.stderr)
        return 1
    except BrokenPipeError:
        # The reader of the output has gone (demo.py | head); the fingers have been stopped.
        forget(sys.stdout)
        return 1
    except KeyboardInterrupt:
        print("demo: interrupted", file=sys.stderr)
        return 130
    return 0


if __name__ == "__main__":
    sys.exit(main())
