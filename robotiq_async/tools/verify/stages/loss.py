"""Stage 8: the state after a loss of the client, the cable or the power, and after an emergency stop."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Final

from ....values import Fault, Finger, Request, RobotiqConnectionError, RobotiqStatus
from ..bench import Bench
from ..catalogue import EndError, Figure
from ..motions import MARGIN, activate, are_near, in_place, motion_envelope
from ..watch import ENTER, StageWatch

LOSS_S: Final = 900.0
LOSS_STEP: Final = 60
CLIENT_AWAY_S: Final = 4.0  # longer than the motion takes
BEGINS_S: Final = 1.0
BACK_S: Final = 60.0  # a gripper may take this long to boot
LOSS_RETRY_S: Final = 0.5
AFTER_S: Final = 3.0
RESETS: Final = 2

GO_OR_SKIP: Final = {ENTER: "done, continue", "s": "skip this"}
CABLE: Final = (
    "Nothing moves now. Pull the cable of the gripper's link (not its power), wait five seconds, plug it in, "
    "and press Enter."
)
ESTOP: Final = "Nothing moves now. Press the emergency stop, wait three seconds, release it, and press Enter."
POWER: Final = (
    "Nothing moves now. Switch the gripper's power off, wait five seconds, switch it on, and press Enter."
)
RESET_AGAIN: Final = (
    "ALL FINGERS MOVE: the gripper is reset and activated again, as in stage 3. Hands away? Enter begins."
)


async def loss(bench: Bench) -> None:
    """Check one loss after the other; the person may skip losses made by hand."""
    await _client(bench)
    await _alone(bench)
    for words, name, part in (
        (CABLE, "loss.cable", _cable),
        (ESTOP, "loss.estop", _estop),
        (POWER, "loss.power", _power),
    ):
        answer = await bench.person.chooses(words, GO_OR_SKIP)
        if answer == "s":
            bench.inconclusive(name, "skipped")
        elif answer == ENTER:
            await part(bench)
        else:
            raise EndError("declined", f"the question about {name} was not answered")


async def _client(bench: Bench) -> None:
    """Move finger A slowly; the client goes away half way, and comes back."""
    watch = bench.watch(60.0)
    start = await watch.look()
    image, home = in_place(start), {Finger.A: start.position(Finger.A)}
    far = {Finger.A: home[Finger.A] + (LOSS_STEP if home[Finger.A] < 128 else -LOSS_STEP)}
    await watch.write(image)
    watch.confine(motion_envelope(start, far))
    away = replace(image, go=True).with_positions(far)
    await watch.write(away)
    if await watch.until(lambda status: not are_near(status, home, MARGIN), 3.0) is None:
        raise EndError("time", f"{bench.first} did not begin to move within 3 s")
    await bench.link.close()
    await watch.pause(CLIENT_AWAY_S)
    await bench.link.open()
    if not (status := await bench.link.read()).is_activated:
        bench.inconclusive("loss.client", "the activation was lost: there is no motion to judge")
        report_lost_activation(bench, f"after {CLIENT_AWAY_S:g} s without a client", CLIENT_AWAY_S)
        raise EndError("inactive", f"the activation was lost after {CLIENT_AWAY_S:g} s without a client")
    status = await watch.look()
    where = status.position(Finger.A)
    went_on = are_near(status, far, MARGIN)
    found = f"continued to {where}" if went_on else f"stopped at {where}, requested {far[Finger.A]}"
    follows = "It stops when it loses its client, which is safer than assumed."
    bench.judge("loss.client", went_on, f"{bench.first} {found}", follows)
    await _first_motion(bench, watch, image, home)


async def _first_motion(bench: Bench, watch: StageWatch, image: Request, home: dict[Finger, int]) -> None:
    """Write a motion as the first image on a new connection."""
    assert watch.last is not None
    here = {Finger.A: watch.last.position(Finger.A)}
    watch.confine(motion_envelope(watch.last, home))
    back = replace(image, go=True).with_positions(home)
    for number in range(2):
        # Another position, or a gripper that has taken it for its own does not see a change.
        await watch.write(back if number == 0 else back.with_positions({Finger.A: home[Finger.A] + 2}))
        if await watch.until(lambda status: not are_near(status, here, MARGIN), BEGINS_S) is not None:
            break
    else:
        raise EndError("time", "the gripper did not follow two motions on a new connection")
    follows = "The first move after a connection may move nothing: see MoveResult.reached, call it again."
    found = "the gripper followed the first motion on the new connection"
    if number:
        found = "the gripper echoed the first motion without moving, and followed the second"
    bench.judge("loss.first_motion", number == 0, found, follows)
    if await watch.until(lambda status: are_near(status, home, MARGIN), 6.0) is None:
        raise EndError("time", f"{bench.first} did not come back within 6 s")
    await watch.until_still(2.0)
    assert watch.last is not None
    await watch.write(in_place(watch.last))
    await watch.until(lambda status: not status.go_echo, 1.0)


async def _alone(bench: Bench) -> None:
    """Leave the gripper without a client for a while, longer and longer."""
    alone = 0.0
    watch = bench.watch(LOSS_S)
    for seconds in bench.lengths.alone:
        await bench.link.close()
        await watch.pause(seconds)
        await bench.link.open()
        statuses = [await bench.link.read() for _ in range(3)]
        status, alone = statuses[-1], seconds
        if not status.is_activated:
            report_lost_activation(bench, f"after {seconds:g} s without a client", seconds)
            raise EndError("inactive", f"the activation was lost after {seconds:g} s without a client")
    bench.as_assumed("loss.idle", f"still active after {alone:g} s without a client", seconds=alone)


def report_lost_activation(bench: Bench, when: str, seconds: float | None = None) -> None:
    """Note that the gripper is no longer active although it was not reset; the seconds, if they are known."""
    follows = "Keep one program polling. A start after a pause activates the gripper: it MOVES and lets go."
    bench.differs("loss.idle", f"the activation was lost {when}", follows, seconds=seconds)


async def _back(bench: Bench) -> tuple[list[RobotiqStatus], float]:
    """Read until the gripper answers, and then for some seconds; the statuses, and the time of the first."""
    loop = asyncio.get_running_loop()
    began = loop.time()
    watch = bench.watch(BACK_S + AFTER_S)
    statuses: list[RobotiqStatus] = []
    while not statuses:
        try:
            if not bench.link.is_open:
                await bench.link.open()
            statuses.append(await bench.link.read())
        except RobotiqConnectionError as error:
            await bench.link.close()
            if loop.time() - began > BACK_S:
                raise EndError("link", f"the gripper did not answer within {BACK_S:g} s: {error}") from error
            await watch.pause(LOSS_RETRY_S)
    answered = loop.time() - began
    while loop.time() - began - answered < AFTER_S:
        statuses.append(await bench.link.read())
        await watch.pause(bench.interval)
    bench.link.expect(statuses[-1].echo)
    return statuses, answered


def _faults(statuses: list[RobotiqStatus]) -> list[Figure]:
    shown: list[Figure] = []
    for status in statuses:
        if status.fault.name not in shown[-1:]:
            shown.append(status.fault.name)
    return shown


async def _cable(bench: Bench) -> None:
    statuses, answered = await _back(bench)
    stays = statuses[-1].is_activated
    found = f"answered after {answered:.1f} s, still active" if stays else "the activation was lost"
    follows = "After a break of the link the next start activates the gripper: it MOVES and lets go."
    bench.judge("loss.cable", stays, found, follows, seconds=answered, faults=_faults(statuses))
    if not stays:
        raise EndError("inactive", "the activation was lost while the cable was out")


async def _estop(bench: Bench) -> None:
    """Check the status after an emergency stop, and the number of resets it takes."""
    statuses, answered = await _back(bench)
    figures: dict[str, Figure] = {"seconds": answered, "faults": _faults(statuses)}
    last = statuses[-1]
    if last.is_activated and last.fault is Fault.NONE:
        found = "still active, no fault: the emergency stop was not pressed, or does not reach the gripper"
        bench.differs("loss.estop", found, "Have one that cuts the gripper's power.", **figures)
    for number in range(1, RESETS + 1):
        if await _activated_again(bench):
            words = f"showed {', '.join(map(str, _faults(statuses)))}; {number} reset and activation helped"
            bench.as_assumed("loss.estop", words, resets=number, **figures)
            return
    follows = "recover() gives up after two tries: switch the gripper's power off and on."
    bench.differs("loss.estop", f"{RESETS} resets and activations did not help", follows, **figures)


async def _power(bench: Bench) -> None:
    statuses, answered = await _back(bench)
    figures: dict[str, Figure] = {"seconds": answered, "faults": _faults(statuses)}
    if statuses[-1].activation_echo or statuses[-1].go_echo:
        follows = "Check the request that a hand adopts when it starts. Please report this."
        found = "rACT or rGTO is still set after the loss of power"
        bench.differs("loss.power", found, follows, **figures)
    else:
        words = f"answered {answered:.1f} s later, reset; showed {', '.join(map(str, _faults(statuses)))}"
        bench.as_assumed("loss.power", words, **figures)
    if not statuses[-1].is_activated and not await _activated_again(bench):
        raise EndError("inactive", "the gripper could not be activated after the loss of power")


async def _activated_again(bench: Bench) -> bool:
    """Ask the person, reset and activate; return whether it is active then."""
    if not await bench.person.consents(RESET_AGAIN):
        raise EndError("declined", "the new activation was not confirmed")
    watch = bench.watch(LOSS_S, allows_faults=True)
    try:
        await activate(watch)
    except EndError as end:
        if end.why in ("time", "inactive"):
            return False
        raise
    status = await watch.watch_for(0.5)
    return status.is_activated and not status.fault.is_serious
