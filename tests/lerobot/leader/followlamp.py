"""A leader for LeRobot's commands: it closes while the lamp is lit. Its file has the name of its class."""

from dataclasses import dataclass

from lerobot.teleoperators import TeleoperatorConfig

from .lamp import is_lit
from .sweep import Sweep, SweepConfig


@TeleoperatorConfig.register_subclass("follow_lamp")
@dataclass(kw_only=True)
class FollowLampConfig(SweepConfig):
    pass


class FollowLamp(Sweep):
    config_class = FollowLampConfig
    name = "follow_lamp"

    def get_action(self) -> dict[str, float]:
        return {"gripper.pos": 0.0 if is_lit() else 100.0, "gripper.force": 20.0}
