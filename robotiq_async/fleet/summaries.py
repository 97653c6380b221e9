"""Summaries: what agents tell once a second of each gripper, as a fleet shows it."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from typing import Any

from ..values.enums import State
from ..values.model import model_of
from .remote.mirror import AgentClock
from .wire.names import GripperName
from .wire.values import reading, words


@dataclass(slots=True)
class _Run:
    """A run of an agent: its clock, and the newest of its stamps."""

    epoch: int
    newest: float = -math.inf
    clock: AgentClock = field(default_factory=AgentClock)


class Summaries:
    """Reads what arrives."""

    def __init__(self) -> None:
        self._runs: dict[GripperName, _Run] = {}
        """The run that was heard last."""

    def read(self, payload: bytes, arrival: float) -> tuple[GripperName, dict[str, Any]] | None:
        """Which gripper a summary is about, for the key may be a wrong one, and what a member shows of it.

        None if a newer one has overtaken it.

        Raises:
            ProtocolError: it cannot be read.
        """
        with reading("a summary"):
            told = json.loads(payload)
            name = GripperName.of_key(f"{told['to']}/summary")
            stamp, age, fault = float(told["stamp"]), told["age"], told["fault"]
            seen = stamp if age is None else stamp - float(age)
            if not math.isfinite(seen):
                raise ValueError(f"no time: {stamp}, {age}")
            what = {
                "state": State(told["state"]),
                "fault": None if fault is None else model_of(told.get("model")).fault(fault),
                "is_moving": bool(told["is_moving"]),
                "holder": None if told["holder"] is None else words(told["holder"]),
                "problem": words(told["problem"]),
                "address": words(told["address"]),
            }
            run = self._run_of(name, int(told["epoch"]))
        run.clock.receive(stamp, arrival)
        if stamp < run.newest:
            return None
        run.newest = stamp
        return name, what | {"seen_at": None if age is None else run.clock(seen)}

    def _run_of(self, name: GripperName, epoch: int) -> _Run:
        run = self._runs.get(name)
        if run is None or run.epoch != epoch:
            run = self._runs[name] = _Run(epoch)
        return run
