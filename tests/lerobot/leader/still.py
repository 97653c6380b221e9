"""A camera for LeRobot's commands: its picture is a grey one that brightens."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from lerobot.cameras import Camera, CameraConfig


@CameraConfig.register_subclass("still")
@dataclass(kw_only=True)
class StillConfig(CameraConfig):  # type: ignore[misc]  # LeRobot is not here
    fps: int | None = 30
    width: int | None = 32
    height: int | None = 32


class Still(Camera):  # type: ignore[misc]  # LeRobot is not here
    def __init__(self, config: StillConfig) -> None:
        super().__init__(config)
        self._is_connected = False

    @property
    def is_connected(self) -> bool:
        return self._is_connected

    @staticmethod
    def find_cameras() -> list[dict[str, Any]]:
        return []

    def connect(self, warmup: bool = True) -> None:  # noqa: ARG002  # as the base has it
        self._is_connected = True

    def read(self, color_mode: Any = None) -> Any:  # noqa: ARG002
        return np.full((32, 32, 3), int(50 * time.monotonic()) % 256, np.uint8)

    def async_read(self, timeout_ms: float = 0) -> Any:  # noqa: ARG002
        return self.read()

    def read_latest(self, max_age_ms: int = 0) -> Any:  # noqa: ARG002
        return self.read()

    def disconnect(self) -> None:
        self._is_connected = False
