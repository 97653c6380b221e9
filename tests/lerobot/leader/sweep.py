"""A leader for LeRobot's commands: it closes and opens again, evenly. Without ``force`` it gives none."""

import time
from dataclasses import dataclass
from typing import Any

from lerobot.teleoperators import Teleoperator, TeleoperatorConfig


@TeleoperatorConfig.register_subclass("sweep")
@dataclass(kw_only=True)
class SweepConfig(TeleoperatorConfig):  # type: ignore[misc]  # LeRobot is not here
    force: bool = True
    period_s: float = 2.0


class Sweep(Teleoperator):  # type: ignore[misc]  # LeRobot is not here
    config_class = SweepConfig
    name = "sweep"
    feedback_features: dict[str, Any] = {}  # noqa: RUF012  # as the base has it
    is_calibrated = True
    is_connected = False

    def __init__(self, config: SweepConfig) -> None:
        super().__init__(config)
        self.config = config
        self.began = time.monotonic()

    @property
    def action_features(self) -> dict[str, Any]:
        return dict.fromkeys(self.get_action(), float)

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002  # as the base has it
        self.is_connected = True

    def calibrate(self) -> None: ...

    def configure(self) -> None: ...

    def get_action(self) -> dict[str, float]:
        done = (time.monotonic() - self.began) / self.config.period_s % 1
        force = {"gripper.force": 20.0} if self.config.force else {}
        return {"gripper.pos": 100 * abs(1 - 2 * done), **force}

    def send_feedback(self, feedback: dict[str, Any]) -> None: ...

    def disconnect(self) -> None:
        self.is_connected = False
