"""Summaries: reads what agents publish once a second about each gripper."""

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
    """A run of an agent: its clock, and the newest stamp."""

    epoch: int
    newest: float = -math.inf
    clock: AgentClock = field(default_factory=AgentClock)


class Summaries:
    """Reads summaries, and drops those that were overtaken."""

    def __init__(self) -> None:
        self._runs: dict[GripperName, _Run] = {}
        """The last run of the agent, by gripper."""

    def read(self, payload: bytes, arrival: float) -> tuple[GripperName, dict[str, Any]] | None:
        """The gripper of a summary, and the fields of its member; None if a newer summary has overtaken it.

        Raises:
            ProtocolError: malformed.
        """
        with reading("a summary"):
            fields = json.loads(payload)
            # The name in the payload, not in the key: zenoh may deliver under a wrong one.
            name = GripperName.of_key(f"{fields['to']}/summary")
            stamp, age, fault = float(fields["stamp"]), fields["age"], fields["fault"]
            seen = stamp if age is None else stamp - float(age)
            if not math.isfinite(seen):
                raise ValueError(f"no time: {stamp}, {age}")
            what = {
                "state": State[fields["state"]],
                "fault": None if fault is None else model_of(fields.get("model")).fault(fault),
                "is_moving": bool(fields["is_moving"]),
                "holder": None if fields["holder"] is None else words(fields["holder"]),
                "problem": words(fields["problem"]),
                "address": words(fields["address"]),
            }
            run = self._run_of(name, int(fields["epoch"]))
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
