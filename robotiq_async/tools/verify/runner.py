"""Goes through the stages: asks for consent, runs, stops the fingers, and continues only if all is well."""

# Theory of operation
#
# A run is a row of stages. _do() takes each through the same steps: look, consent, run, stop, save. A stage
# begins only if the one before it ended well; EndError with its reason, a lost link or a signal ends the run.
#
#   stages 0 and 1       read only, and write nothing at their end
#   from HARMLESS on     first the status: no other client commands, rGTO is 0 or is cleared with consent, and
#                        the gripper is active if the stage needs it
#
# At every end of a stage from HARMLESS on, _stop() writes rGTO = 0 until the gripper echoes it, shielded from
# Ctrl-C. Without the echo the run ends as "unstopped". The report is saved before such a stage as well: it
# must not call the gripper usable if the program is killed.

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Final, Protocol

from ...link import Address
from ...runtime import wait_shielded
from ...values import Request, RobotiqConnectionError, model_of
from .bench import Bench, Lengths
from .catalogue import HARMLESS, LAST, EndError
from .identification import check_before_writing, find
from .motions import as_found, stop_fingers
from .recorded_link import RecordedExchange
from .report import Report
from .stages import STAGES, Stage
from .stages.loss import report_lost_activation
from .watch import Person, describe

LEFT_SET: Final = (
    "A program has left rGTO set. If you continue, rGTO = 0 is written first: it stops every axis, and "
    "starts none."
)


class Tape(Protocol):
    """Takes frames. It never blocks or fails; ``failure`` is why nothing more is kept, or empty."""

    @property
    def failure(self) -> str: ...

    def keep(self, frame: RecordedExchange) -> None: ...

    def begin(self, stage: int) -> None: ...


@dataclass(frozen=True, slots=True)
class Plan:
    """Parameters of a run."""

    address: Address  # the gripper; any but sim
    first: int = 0  # the stage to begin with
    last: int = LAST  # the last stage
    agreed: int = -1  # the last stage that runs without a question, at most 2; -1: each stage asks
    label: str = ""  # title of the report
    lengths: Lengths = field(default_factory=Lengths)  # of the long checks

    def __post_init__(self) -> None:
        if not 0 <= self.first <= self.last <= LAST:
            raise ValueError(f"--from and --up-to must be 0 <= from <= up-to <= {LAST}")
        if not -1 <= self.agreed <= HARMLESS:
            raise ValueError(
                f"--yes-to must be in 0..{HARMLESS}: stages that move always ask, got {self.agreed}"
            )
        if self.address.kind == "sim":
            raise ValueError("a simulated gripper is verified through its server")


class Runner:
    """One run.

    Attributes:
        report: its findings so far.
    """

    def __init__(self, plan: Plan, person: Person, tape: Tape, save: Callable[[Report], object]) -> None:
        """Prepare; nothing is opened.

        Args:
            plan: parameters of the run.
            person: answers and watches.
            tape: takes every frame.
            save: is called with the report after each stage, and before each that writes; nothing moves then.
                An OSError ends the run.
        """
        self.report: Report = Report(plan.address.kind, model_of(plan.address.model), label=plan.label)
        self._plan = plan
        self._person = person
        self._tape = tape
        self._save = save
        self._bench = Bench(plan.address, person, tape.keep, plan.lengths, self.report.checks)

    async def run(self) -> Report:
        """Go through the stages. At every end of a stage that moves, the fingers are stopped first.

        Raises:
            asyncio.CancelledError: it was interrupted, as is in the report.
        """
        report = self.report
        try:
            for stage in STAGES[self._plan.first : self._plan.last + 1]:
                await self._do(stage)
            report.end("done", f"stages {self._plan.first} to {self._plan.last}")
        except EndError as end:
            report.end(end.why, end.words)
        except RobotiqConnectionError as error:
            report.end("link", str(error))
        except asyncio.CancelledError:
            report.end("interrupted", "Ctrl-C, or a signal")
            raise
        finally:
            report.complete()
            if self._bench.is_found:
                closing = asyncio.ensure_future(self._bench.link.close())
                with suppress(asyncio.CancelledError):
                    await wait_shielded(closing)
        return report

    async def _do(self, stage: Stage) -> None:
        image = await self._look_first(stage)
        await self._ask(stage)
        if stage.number == 1 and not self._bench.is_found:
            await self._find()
        self.report.entered.append(stage.number)
        if stage.number >= HARMLESS:
            self._save_report()  # it must not call the gripper usable if the run is killed from here on
        self._tape.begin(stage.number)
        try:
            await stage.run(self._bench)
        finally:
            if stage.number >= HARMLESS:
                await self._stop(image)
        if self.report.is_unstopped:
            raise EndError("unstopped", f"rGTO = 0 was not confirmed at the end of stage {stage.number}")
        self.report.stages.append(stage.number)
        self._bench.note_active(stage.number > HARMLESS)
        self._save_report()
        if self._person.has_stopped:
            raise EndError("stopped", "a key was pressed, or the terminal was closed")
        if self._tape.failure:
            raise EndError("disk", f"the recording has failed: {self._tape.failure}")

    def _save_report(self) -> None:
        try:
            self._save(self.report)
        except OSError as error:
            raise EndError("disk", f"the report cannot be written: {error.strerror or error}") from error

    # -- before a stage --------------------------------------------------------------------------------------

    async def _look_first(self, stage: Stage) -> Request:
        """Check that the stage may begin; returns the image that stops everything now."""
        if stage.number < HARMLESS:
            return Request(model=self._bench.model)
        if not self._bench.is_found:
            await self._find()
        status = await check_before_writing(self._bench)
        self._person.tell(f"The gripper is {describe(status)}.")
        if status.go_echo:
            await self._ask_to_clear_go(stage)
        if stage.needs_active and not status.is_activated:
            if self._bench.is_active:
                report_lost_activation(self._bench, "between two stages, while no client polled")
            raise EndError("inactive", f"stage {stage.number} needs an active gripper: begin with --from 3")
        return as_found(status)

    async def _ask_to_clear_go(self, stage: Stage) -> None:
        if stage.number <= self._plan.agreed:
            raise EndError(
                "refused", "rGTO is set: a program left it so, or commands the gripper. Run without --yes-to."
            )
        if not await self._person.consents(LEFT_SET):
            raise EndError("declined", "rGTO is set, and stays set")

    async def _ask(self, stage: Stage) -> None:
        if stage.number <= self._plan.agreed:
            self._person.tell(stage.as_text(self._bench.model))
        elif not await self._person.consents(stage.as_text(self._bench.model)):
            raise EndError("declined", f"stage {stage.number} was not confirmed")

    async def _find(self) -> None:
        try:
            await find(self._bench)
        finally:
            self.report.identify(self._bench.registers, self._bench.found)
        assert self._bench.found is not None
        self._bench.link.expect(self._bench.found.echo)

    # -- after it --------------------------------------------------------------------------------------------

    async def _stop(self, image: Request) -> None:
        """Write rGTO = 0 in any case; an activation that runs is taken back."""
        link = self._bench.link
        written, shown = link.written or image, link.shown
        if written.activate and shown is not None and not shown.is_activated:
            written = replace(written, activate=False)
        stopping = asyncio.ensure_future(stop_fingers(link, written, self._person.alarm))
        try:
            await wait_shielded(stopping)
        finally:
            self.report.stopped(stopping.result())
