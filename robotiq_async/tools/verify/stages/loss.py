"""Stage 8: what is left after the client, the cable, the power or the emergency stop was gone."""

from __future__ import annotations

import asyncio
from dataclasses import replace
from typing import Final

from ....values.enums import Fault, Finger
from ....values.errors import RobotiqConnectionError
from ....values.request import Request
from ....values.status import RobotiqStatus
from ..bench import Bench
from ..catalogue import EndError, Figure
from ..motions import MARGIN, activate, are_near, standing, way
from ..watch import ENTER, Watch

SECONDS: Final = 900.0
STEP: Final = 60
GONE_S: Final = 4.0  # longer than the motion takes
BEGINS_S: Final = 1.0
BACK_S: Final = 60.0  # A gripper may boot for so long
RETRY_S: Final = 0.5
AFTER_S: Final = 3.0
RESETS: Final = 2

GO_OR_SKIP: Final = {ENTER: "done, go on", "s": "skip this"}
CABLE: Final = (
    "Nothing moves now. Pull the cable of the gripper's link (not its power), wait five seconds, plug it in, "
    "and press Enter."
)
ESTOP: Final = "Nothing moves now. Press the emergency stop, wait three seconds, release it, and press Enter."
POWER: Final = (
    "Nothing moves now. Switch the gripper's power off, wait five seconds, switch it on, and press Enter."
)
ANEW: Final = (
    "ALL FINGERS MOVE: the gripper is reset and activated anew, as in stage 3. Hands away? Enter begins."
)


async def loss(bench: Bench) -> None:
    """One after the other; what needs hands is asked for, and may be skipped."""
    await _client(bench)
    await _alone(bench)
    for words, name, part in (
        (CABLE, "loss.cable", _cable),
        (ESTOP, "loss.estop", _estop),
        (POWER, "loss.power", _power),
    ):
        answer = await bench.person.chooses(words, GO_OR_SKIP)
        if answer == "s":
            bench.untold(name, "skipped")
        elif answer == ENTER:
            await part(bench)
        else:
            raise EndError("declined", f"{name} was neither done nor skipped")


async def _client(bench: Bench) -> None:
    """Finger A, slowly; the client goes away half way, and comes back."""
    watch = bench.watch(60.0)
    start = await watch.look()
    image, home = standing(start), {Finger.A: start.position(Finger.A)}
    far = {Finger.A: home[Finger.A] + (STEP if home[Finger.A] < 128 else -STEP)}
    await watch.write(image)
    watch.envelope = way(start, far)
    away = replace(image, go=True).with_positions(far)
    await watch.write(away)
    if await watch.until(lambda status: not are_near(status, home, MARGIN), 3.0) is None:
        raise EndError("time", f"{bench.first} did not begin to move within 3 s")
    await bench.link.close()
    await watch.rest(GONE_S)
    await bench.link.open()
    status = await watch.look()
    where = status.position(Finger.A)
    if are_near(status, far, MARGIN):
        bench.as_assumed("loss.client", f"{bench.first} went on to {where}")
    else:
        follows = "It stops by itself when it loses its client; that is safer than assumed."
        bench.differs("loss.client", f"{bench.first} stopped at {where}, asked {far[Finger.A]}", follows)
    await _wake(bench, watch, image, home)


async def _wake(bench: Bench, watch: Watch, image: Request, home: dict[Finger, int]) -> None:
    """The first image on the new connection is a motion."""
    assert watch.last is not None
    here = {Finger.A: watch.last.position(Finger.A)}
    watch.envelope = way(watch.last, home)
    back = replace(image, go=True).with_positions(home)
    for number in range(2):
        # Another position, or a gripper that has taken it for its own does not see a change.
        await watch.write(back if number == 0 else back.with_positions({Finger.A: home[Finger.A] + 2}))
        if await watch.until(lambda status: not are_near(status, here, MARGIN), BEGINS_S) is not None:
            break
    else:
        raise EndError("time", "two motions on a new connection were not followed")
    follows = "The first move after a connection raises MoveIgnoredError: call it again."
    found = "the first motion on the new connection was followed"
    if number:
        found = "the first motion was echoed and not followed; the second was"
    bench.judge("loss.wake", number == 0, found, follows)
    if await watch.until(lambda status: are_near(status, home, MARGIN), 6.0) is None:
        raise EndError("time", f"{bench.first} did not come back within 6 s")
    await watch.until_still(2.0)
    assert watch.last is not None
    await watch.write(standing(watch.last))
    await watch.until(lambda status: not status.go_echo, 1.0)


async def _alone(bench: Bench) -> None:
    """No client at all for a while, longer and longer."""
    alone = 0.0
    watch = bench.watch(SECONDS)
    for seconds in bench.lengths.alone:
        await bench.link.close()
        await watch.rest(seconds)
        await bench.link.open()
        statuses = [await bench.link.read() for _ in range(3)]
        status, alone = statuses[-1], seconds
        if not status.is_activated:
            report_lost_activation(bench, f"after {seconds:g} s without a client")
            raise EndError("inactive", f"the activation was lost after {seconds:g} s without a client")
    bench.as_assumed("loss.idle", f"still active after {alone:g} s without a client")


def report_lost_activation(bench: Bench, when: str) -> None:
    """It was not reset, and is no longer active."""
    follows = "Keep one program polling. A start after a pause activates: it MOVES, and lets go."
    bench.differs("loss.idle", f"the activation was lost {when}", follows)


async def _back(bench: Bench) -> tuple[list[RobotiqStatus], float]:
    """Read until the gripper answers, and then for some seconds; the statuses, and when the first came."""
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
                raise EndError("link", f"it has not answered again within {BACK_S:g} s: {error}") from error
            await watch.rest(RETRY_S)
    answered = loop.time() - began
    while loop.time() - began - answered < AFTER_S:
        statuses.append(await bench.link.read())
        await watch.rest(bench.interval)
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
    faults = _faults(statuses)
    if statuses[-1].is_activated:
        words = f"answered after {answered:.1f} s, still active"
        bench.as_assumed("loss.cable", words, seconds=answered, faults=faults)
    else:
        follows = "After a break of the link the next start activates: it MOVES, and lets go."
        bench.differs("loss.cable", "the activation was lost", follows, seconds=answered, faults=faults)
        raise EndError("inactive", "the activation was lost while the cable was out")


async def _estop(bench: Bench) -> None:
    """What is shown after it, and how many resets it takes."""
    statuses, answered = await _back(bench)
    figures: dict[str, Figure] = {"seconds": answered, "faults": _faults(statuses)}
    last = statuses[-1]
    if last.is_activated and last.fault is Fault.NONE:
        bench.as_assumed(
            "loss.estop", "still active, without a fault: it does not reach the gripper", **figures
        )
        return
    for number in range(1, RESETS + 1):
        if await _activated_anew(bench):
            words = f"showed {', '.join(map(str, _faults(statuses)))}; {number} reset and activation helped"
            bench.as_assumed("loss.estop", words, resets=number, **figures)
            return
    follows = "recover() tries twice, and gives up: switch the gripper's power off and on."
    bench.differs("loss.estop", f"{RESETS} resets and activations have not helped", follows, **figures)
    raise EndError("fault", f"the gripper is not active after {RESETS} resets")


async def _power(bench: Bench) -> None:
    statuses, answered = await _back(bench)
    figures: dict[str, Figure] = {"seconds": answered, "faults": _faults(statuses)}
    if statuses[-1].activation_echo or statuses[-1].go_echo:
        follows = "Look at what the hand adopts when it starts; please report."
        found = "rACT or rGTO is still set after the loss of power"
        bench.differs("loss.power", found, follows, **figures)
    else:
        words = f"answered {answered:.1f} s later, reset; showed {', '.join(map(str, _faults(statuses)))}"
        bench.as_assumed("loss.power", words, **figures)
    if not statuses[-1].is_activated and not await _activated_anew(bench):
        raise EndError("inactive", "the gripper could not be activated after the loss of power")


async def _activated_anew(bench: Bench) -> bool:
    """Ask, reset and activate; whether that came to its end."""
    if not await bench.person.consents(ANEW):
        raise EndError("declined", "the gripper was not activated anew")
    watch = bench.watch(SECONDS)
    watch.bears_faults = True
    try:
        await activate(watch)
    except EndError as end:
        if end.why in ("time", "inactive"):
            return False
        raise
    status = await watch.pass_by(0.5)
    return status.is_activated and not status.fault.is_serious
