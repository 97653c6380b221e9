"""A camera for LeRobot's commands: it sees a lamp that is lit every other two seconds."""

import time
from dataclasses import dataclass
from typing import Any

import numpy as np
from lerobot.cameras import Camera, CameraConfig

LIT_S = 2.0


def is_lit() -> bool:
    return time.monotonic() % (2 * LIT_S) < LIT_S


@CameraConfig.register_subclass("lamp")
@dataclass(kw_only=True)
class LampConfig(CameraConfig):  # type: ignore[misc]  # LeRobot is not here
    fps: int | None = 30
    width: int | None = 32
    height: int | None = 32


class Lamp(Camera):  # type: ignore[misc]  # LeRobot is not here
    def __init__(self, config: LampConfig) -> None:
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
        return np.full((32, 32, 3), 220 if is_lit() else 30, np.uint8)

    def async_read(self, timeout_ms: float = 0) -> Any:  # noqa: ARG002
        return self.read()

    def read_latest(self, max_age_ms: int = 0) -> Any:  # noqa: ARG002
        return self.read()

    def disconnect(self) -> None:
        self._is_connected = False
