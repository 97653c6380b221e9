r"""RobotiqGripper: a gripper as a robot of LeRobot, for its commands. Needs LeRobot 0.6 and Python 3.12.

    lerobot-teleoperate --robot.discover_packages_path=robotiq_async.tools.lerobot \
        --robot.type=robotiq_gripper --robot.address=sim://?model=2f85 ...

It has two action dimensions, position and force. LeRobot keeps an action of one dimension as a number without
an axis: its ``lerobot-replay`` indexes that, and fails. The price is that a leader has to give both, and most
give a position alone: ``action_force`` is for those.
"""

from dataclasses import dataclass
from typing import Any

try:
    from lerobot.robots import Robot, RobotConfig
except ImportError as error:
    raise ImportError(
        "the robot needs LeRobot 0.6 and Python 3.12 or newer: pip install 'lerobot[core_scripts]==0.6.*' "
        "(the part, robotiq_async.tools.lerobot.GripperPart, needs neither)"
    ) from error

from ...sync import RobotiqHand
from ...values.enums import DEFAULT_FORCE, DEFAULT_SPEED
from .gripper_part import LOST_AFTER_S, GripperPart


# Without `from __future__ import annotations`: draccus reads the types of the fields.
@RobotConfig.register_subclass("robotiq_gripper")
@dataclass(kw_only=True)
class RobotiqGripperConfig(RobotConfig):  # type: ignore[misc]  # LeRobot is not here
    """The options of the robot: ``--robot.address=...``.

    Attributes:
        address: of the gripper, as of :class:`~robotiq_async.RobotiqHand`, with its model:
            ``rtu:///dev/ttyUSB0?model=2f85``.
        activate: whether a gripper that is reset is activated: **its fingers MOVE**.
        speed: of the fingers, in counts 0..255.
        force: in counts 0..255, until an action sets another.
        action_force: whether an action has ``gripper.force``; False for a leader that gives none. Recordings
            then cannot be replayed with ``lerobot-replay``.
        lost_after: age of the newest status, in 0.05..60 s, from which the robot raises ConnectionLostError.
    """

    address: str
    activate: bool = False
    speed: int = DEFAULT_SPEED
    force: int = DEFAULT_FORCE
    action_force: bool = True
    lost_after: float = LOST_AFTER_S


class RobotiqGripper(Robot):  # type: ignore[misc]  # LeRobot is not here
    """A gripper alone, as a robot: observations and actions are those of :class:`GripperPart`.

    Nothing has run on real hardware yet.

    Args:
        config: its options.

    Raises:
        TypeError, ValueError: an option of the wrong type, or outside its range.
    """

    config_class = RobotiqGripperConfig
    name = "robotiq_gripper"

    def __init__(self, config: RobotiqGripperConfig) -> None:
        super().__init__(config)
        self.config = config
        self.cameras: dict[str, Any] = {}  # lerobot-record counts them
        hand = RobotiqHand(config.address, speed=config.speed, force=config.force)
        self._part = GripperPart(hand, lost_after=config.lost_after)

    @property
    def observation_features(self) -> dict[str, type]:
        """The keys of an observation."""
        return dict.fromkeys(GripperPart.OBSERVATIONS, float)

    @property
    def action_features(self) -> dict[str, type]:
        """The keys of an action."""
        keys = ("gripper.pos", "gripper.force") if self.config.action_force else ("gripper.pos",)
        return dict.fromkeys(keys, float)

    @property
    def is_connected(self) -> bool:
        """As :attr:`GripperPart.is_connected`: true on a dead link, so that LeRobot disconnects."""
        return self._part.is_connected

    @property
    def is_calibrated(self) -> bool:
        """True: the gripper finds its stops when it is activated."""
        return True

    def connect(self, calibrate: bool = True) -> None:  # noqa: ARG002  # there is nothing to calibrate
        """Connect; **with** ``activate`` **the fingers of a gripper that is reset MOVE to their stops**.

        Raises:
            RobotiqError: as :meth:`GripperPart.connect`.
        """
        self._part.connect(self.config.activate)

    def calibrate(self) -> None:
        """Nothing to do."""

    def configure(self) -> None:
        """Nothing to do."""

    def get_observation(self) -> dict[str, float]:
        """As :meth:`GripperPart.observe`; does not wait."""
        return self._part.observe()

    def send_action(self, action: dict[str, Any]) -> dict[str, float]:
        """As :meth:`GripperPart.act`; does not wait. Keys of an arm are left alone.

        ``gripper.force`` may be missing. A value beyond 0..100 is refused: clamp what a policy overshoots.

        Returns:
            The action that was sent.

        Raises:
            KeyError: ``gripper.pos`` is missing.
            TypeError, ValueError, RobotiqError: as :meth:`GripperPart.act`.
        """
        keys = ["gripper.pos", *({"gripper.force"} & action.keys() & self.action_features.keys())]
        sent = {key: float(action[key]) for key in keys}
        self._part.act(sent["gripper.pos"], sent.get("gripper.force"))
        return sent

    def disconnect(self) -> None:
        """As :meth:`GripperPart.disconnect`: the fingers stop."""
        self._part.disconnect()
