"""``robotiq-async verify``."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Mapping
from contextlib import AsyncExitStack, suppress
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from ...hands import HandOptions
from ...link import is_remote, parse_address
from ...runtime import wait_shielded
from ...values import model_of
from ..addresses import gripper_words
from ..arguments import AddressArgument, StageNumber, need
from ..failures import CommandError, UsageError, usage
from ..keyboard import Keyboard, has_terminal, wrapped
from ..output.messages import tell

if TYPE_CHECKING:
    from ...tools.verify import Person, Plan, Report
    from ...tools.verify.files import Folder

HARMLESS = 2
FIRST_RUN_NOTE = (
    "None of this has run on real hardware: your gripper may be the first. It is no safety function: have an "
    "emergency stop in reach that cuts the gripper's power. While a stage runs ANY KEY stops the fingers."
)


async def verify(
    address: AddressArgument,
    /,
    *,
    up_to: StageNumber | None = None,
    from_: Annotated[StageNumber, Parameter(name="--from")] = 0,
    report: Annotated[Path | None, Parameter(metavar="DIR")] = None,
    yes_to: Annotated[StageNumber | None, Parameter(show_default=False)] = None,
    label: Annotated[str, Parameter(metavar="TEXT", show_default=False)] = "",
    model: Literal["3f", "2f85", "2f140", "hand-e"] | None = None,
) -> None:
    """Check a real gripper against the assumptions of this library. FROM STAGE 3 ON THE FINGERS MOVE.

    Ten stages: this computer; reading only; writing with rGTO = 0; activation; one
    axis at a time, slowly; stopping; full strokes; something soft; loss of client,
    cable, emergency stop and power; soak. Each announces the moving axes, their way and speed,
    and the space to keep clear. Enter begins it; any other key ends with the report so far.

    Stages 0 to 2 move nothing, take four minutes, and make a report that is worth sending.
    While a stage runs any key and Ctrl-C write rGTO = 0 first. No stage beyond 2 runs
    without a terminal, and none after a fault or after a safety check that differs.
    A gripper that another client commands, or that holds something, is not written to.

    The folder of the report gets report.json, report.md and recording.mcap with every
    frame (extra record). They contain no address, host or user.

    For example:

        robotiq-async verify tcp://192.168.1.11
        robotiq-async verify tcp://192.168.1.11 --up-to 2
        robotiq-async verify rtu:///dev/ttyUSB0 --from 4 --report second-try
        robotiq-async verify tcp://192.168.1.11 --up-to 2 --yes-to 2

    Args:
        up_to: The last stage, 0..9; 9 unless given.
        from_: The stage to begin with. The gripper is identified first in any case.
        report: Folder for the report; it must not contain one yet.
        yes_to: Do not ask for the stages up to this one, at most 2.
        label: Title of the report; it appears there as you write it.
        model: The gripper (default: the model of the address, or 3f).
    """
    if is_remote(address):
        raise UsageError("verify does not use an agent: run it on the host that is connected to the gripper")
    last = 9 if up_to is None else up_to
    agreed = -1 if yes_to is None else yes_to
    has_person = has_terminal()
    if not has_person and not (last <= HARMLESS and agreed >= last):
        raise UsageError(
            "without a terminal to ask at and to be stopped at, verify needs --up-to and --yes-to, at most 2"
        )
    with usage():
        parsed = parse_address(address)
        if model is not None:
            parsed = replace(parsed, model=model_of(model))
        if parsed.kind != "sim":
            HandOptions(str(parsed))  # raises as a hand would
    need("mcap", "record")
    from ...tools.verify import Plan
    from ...tools.verify.files import Folder

    print(gripper_words(address), flush=True)
    async with AsyncExitStack() as stack:
        if parsed.kind == "sim":
            from ...link import new_gripper
            from ...simulator import SimulatorServer

            gripper = new_gripper(parsed.simulation, model_of(parsed.model))
            server = await stack.enter_async_context(SimulatorServer(gripper))
            parsed = parse_address(server.address)
        with usage():
            plan = Plan(parsed, first=from_, last=last, agreed=agreed, label=label)
        try:
            folder = Folder(report or Path(time.strftime("verify-%Y%m%d-%H%M%S")), parsed)
        except OSError as error:
            raise CommandError(f"{error.filename}: {error.strerror}: nothing was sent") from error
        person: Person = stack.enter_context(Keyboard()) if has_person else Unattended()
        person.tell(FIRST_RUN_NOTE)
        await _run(plan, person, folder)


async def _run(plan: Plan, person: Person, folder: Folder) -> None:
    from ...tools.verify import Runner

    runner = Runner(plan, person, folder.recording, folder.save)
    report = runner.report
    try:
        await runner.run()
    except asyncio.CancelledError:
        with suppress(OSError):  # the terminal is gone
            tell(f"interrupted: the report is in {folder.path}")
        raise
    finally:
        ending = asyncio.ensure_future(folder.end(report))
        try:
            await wait_shielded(ending)
        finally:
            failure = ending.result()
            where = f"the report in {folder.path} is not complete: {failure}" if failure else str(folder.path)
            with suppress(OSError):  # the terminal is gone
                _print_summary(report, where)
    if failure or report.why != "done":
        raise CommandError(f"{report.why}: {report.words.rstrip('.')}; {'' if failure else 'see '}{where}")


def _print_summary(report: Report, where: str) -> None:
    from ...tools.verify.report import is_unusable, lines, sentences

    print(wrapped("\n" + "\n".join(sentences(report))), flush=True)
    for check in report.differing:
        print(wrapped(f"  {check.name} differs: {check.found}. {check.follows}"), flush=True)
    if not is_unusable(report):
        print("\n" + "\n\n".join(lines(report).values()), flush=True)
    print(f"\n{where}", flush=True)


class Unattended:
    """Takes the place of a person, for stages that were agreed to beforehand and move nothing."""

    has_stopped = False

    def tell(self, words: str) -> None:
        print(words, flush=True)

    alarm = tell

    async def consents(self, words: str) -> bool:
        print(words, flush=True)
        return False

    async def chooses(self, question: str, answers: Mapping[str, str]) -> str | None:
        print(question, ", ".join(answers.values()), flush=True)
        return None
