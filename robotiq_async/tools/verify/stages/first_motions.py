"""Stages 3 and 4: the activation, in which all fingers move, and one axis at a time, slowly."""

from __future__ import annotations

import asyncio
from dataclasses import dataclass, field, replace
from typing import Final

from ....hands import ACTIVATION_TIMEOUT_S, POLL_INTERVAL_S
from ....values import Finger, ObjectStatus, Request, RobotiqStatus
from ..bench import Bench
from ..catalogue import EndError
from ..motions import ACTIVATION_S, activate, are_near, in_place, motion_envelope
from ..watch import StageWatch

FIRST_MOTIONS_S: Final = ACTIVATION_S + 20
USUAL_S: Final = 20.0
ROOM: Final = 1.5  # activation_timeout is this many times the duration of the activation


async def activation(bench: Bench) -> None:
    """Reset and activate, and check the status after it."""
    watch = bench.watch(FIRST_MOTIONS_S)
    took = await activate(watch)
    status = await watch.watch_for(1.0)
    found = f"{took:.1f} s"
    wanted = round(ROOM * took)
    options = {"activation_timeout": wanted} if wanted > ACTIVATION_TIMEOUT_S else {}
    waits = options.get("activation_timeout", ACTIVATION_TIMEOUT_S)
    follows = f"A hand waits {waits:g} s; other clients may wait less."
    bench.judge("activation.time", took <= USUAL_S, found, follows, options, seconds=took)
    words = f"registers {status.registers[0]:04X} {status.registers[1]:04X}"
    zeros = all(status.finger_status(axis) is ObjectStatus.IN_MOTION for axis in status.model.axes)
    follows = "No option is needed: a hand ignores gDT until it has commanded a position. Report this."
    bench.judge("activation.registers", zeros and not status.go_echo, words, follows)
    bench.note_active(True)


STEP: Final = 30
STEP_S: Final = 6.0
"""Seconds for one way: 1.3 s at the slowest speed (thesis, table A1.1), and the time before it begins."""
LAG_WINDOW_S: Final = 0.5
LAG_READ_S: Final = 0.002
LAG_S: Final = 0.25  # seconds for which a hand ignores an object status that nothing else confirms
END_COUNTS: Final = 2

QUESTION: Final = (
    "Which finger has moved, there and back? Left and right are the palm's, seen from its front with "
    "the single finger at the bottom."
)
FINGER_ANSWERS: Final = {
    "a": "the single finger",
    "l": "the left finger of the pair",
    "r": "the right finger of the pair",
    "s": "the pair came together or spread",
    "n": "nothing, or several of these",
}
JAW_QUESTION: Final = "What has moved, there and back?"
JAW_ANSWERS: Final = {"a": "the jaw", "n": "nothing, or something else"}
EXPECTED: Final = {Finger.A: "a", Finger.B: "lr", Finger.C: "lr", Finger.SCISSOR: "s"}
"""Answers for each axis. No source has the side of B; C must be on the other."""
SURE: Final = "Commanded was {axis}, and your answer is: {answer}. Is this what you saw?"


@dataclass
class _Found:
    """The findings of the motions so far."""

    lags: list[float] = field(default_factory=list)
    errors: list[int] = field(default_factory=list)
    answers: dict[Finger, str] = field(default_factory=dict)


async def single_axis(bench: Bench) -> None:
    """Move each axis there and back; the person names the finger that moved."""
    found = _Found()
    has_several = len(bench.model.axes) > 1
    for axis in bench.model.axes:
        await _there_and_back(bench, axis, found)
        await _ask_what_moved(bench, axis, found.answers)
    if has_several:
        side = FINGER_ANSWERS[found.answers[Finger.B]]
        bench.as_assumed("axis.finger", f"each moved as named; B is {side}", b_is=side)
        bench.as_assumed("axis.alone", "the other axes did not move")
    else:
        bench.as_assumed("axis.finger", "the jaw moved")
    _judge(bench, found)


async def _ask_what_moved(bench: Bench, axis: Finger, before: dict[Finger, str]) -> None:
    question, answers = (
        (QUESTION, FINGER_ANSWERS) if len(bench.model.axes) > 1 else (JAW_QUESTION, JAW_ANSWERS)
    )
    answer = await bench.person.chooses(question, answers)
    if answer is None:
        raise EndError("declined", "the question was not answered")
    if answer not in EXPECTED[axis] or answer in before.values():
        # One wrong key must not condemn a gripper.
        if not await bench.person.consents(SURE.format(axis=axis.name, answer=answers[answer])):
            raise EndError("declined", "the answer was not confirmed: begin with --from 4")
        seen = f"commanded: {axis.name}; moved: {answers[answer]}"
        bench.differs("axis.finger", seen, "Do not use names of fingers with this gripper; report this.")
    before[axis] = answer


async def _there_and_back(bench: Bench, axis: Finger, found: _Found) -> None:
    watch = bench.watch(4 * STEP_S)
    start = await watch.look()
    image = in_place(start)
    await watch.write(image)
    position = start.position(axis)
    target = position - STEP if position > 127 else position + STEP
    try:
        for goal in (target, position):
            await _one_way(watch, image, axis, goal, found)
    except EndError as end:
        if end.why == "envelope" and len(bench.model.axes) > 1:
            bench.differs("axis.alone", end.words, "Do not use this gripper until the cause is known.")
        raise
    await watch.write(in_place(await watch.look()))
    await watch.until(lambda status: not status.go_echo, 1.0)


async def _one_way(watch: StageWatch, image: Request, axis: Finger, goal: int, found: _Found) -> None:
    start = await watch.look()
    watch.confine(motion_envelope(start, {axis: goal}))
    await watch.write(replace(image, go=True).with_positions({axis: goal}))
    if start.go_echo and start.finger_status(axis) is ObjectStatus.AT_POSITION:
        lag = await _lag(watch, axis, goal)
        found.lags.extend([] if lag is None else [lag])
    arrived = await watch.until(lambda status: _rests(status, axis, goal), STEP_S)
    if arrived is None:
        where = watch.last.position(axis) if watch.last else "?"
        raise EndError("time", f"{axis.name} was sent to {goal} and is at {where} after {STEP_S:g} s")
    still = await watch.until_still(2.0)
    found.errors.append(abs((still or arrived).position(axis) - goal))


def _rests(status: RobotiqStatus, axis: Finger, goal: int) -> bool:
    return (
        are_near(status, {axis: goal}, END_COUNTS + 2)
        and status.finger_status(axis) is not ObjectStatus.IN_MOTION
    )


async def _lag(watch: StageWatch, axis: Finger, goal: int) -> float | None:
    """Seconds from the first read with the echo to the first with a gDT of motion."""
    loop, echoed = asyncio.get_running_loop(), 0.0

    def shows_motion(status: RobotiqStatus) -> bool:
        nonlocal echoed
        if status.requested_position(axis) != goal:
            return False
        echoed = echoed or loop.time()
        return status.finger_status(axis) is ObjectStatus.IN_MOTION

    if await watch.until(shows_motion, LAG_WINDOW_S, LAG_READ_S) is None:
        return None
    return loop.time() - echoed


def _judge(bench: Bench, found: _Found) -> None:
    if found.lags:
        worst = max(found.lags)
        words = f"at most {1000 * worst:.0f} ms after the echo"
        follows = "No option is needed: a hand ignores the object status for 250 ms."
        if worst > LAG_S:
            follows = "That is longer than a hand waits: a move may end before it begins. Please report this."
        bench.judge("axis.lag", worst <= max(0.01, POLL_INTERVAL_S), words, follows, worst_ms=1000 * worst)
        if worst > LAG_S:
            raise EndError("deviation", f"axis.lag: {words}, longer than a hand waits")
    else:
        bench.inconclusive("axis.lag", "no motion began from a known gDT")
    worst_error = max(found.errors)
    words = f"at most {worst_error} counts beside the request"
    follows = "Do not compare positions with requests; a hand uses gDT."
    bench.judge("axis.accuracy", worst_error <= END_COUNTS, words, follows, counts=worst_error)
