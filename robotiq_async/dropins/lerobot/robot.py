r"""RobotiqGripper: a gripper as a robot of LeRobot, for its commands. Needs LeRobot 0.6 and Python 3.12.

    lerobot-teleoperate --robot.type=robotiq_gripper --robot.address=sim://?model=2f85 ...

LeRobot finds the type by the distribution ``lerobot_robot_robotiq``, or without it by
``--robot.discover_packages_path=robotiq_async.dropins.lerobot``.

It has two action dimensions, position and force. LeRobot keeps an action of one dimension as a number without
an axis: its ``lerobot-replay`` indexes that number, and fails. The price: a leader has to give both. For the
many leaders that give a position alone, ``action_force`` is the force.
"""

from dataclasses import dataclass, field
from typing import Any, Final

try:
    from lerobot.cameras import CameraConfig, make_cameras_from_configs
    from lerobot.robots import Robot, RobotConfig
    from lerobot.utils.decorators import check_if_already_connected, check_if_not_connected
except ImportError as error:
    raise ImportError(
        'the robot needs LeRobot 0.6 and Python 3.12 or newer: pip install "lerobot[core_scripts]==0.6.*" '
        "(the part, robotiq_async.dropins.lerobot.GripperPart, needs neither)"
    ) from error

from ...calibration import Convention
from ...sync import RobotiqHand
from ...values import DEFAULT_FORCE, DEFAULT_SPEED
from .gripper_part import LOST_AFTER_S, GripperPart

LOOP_RESPONSE_S: Final = 0.1
"""A lost reply is noticed after so long: three frames at 30 Hz. The usual 0.4 s would cost twelve."""


# Without `from __future__ import annotations`: draccus reads the types of the fields.
@RobotConfig.register_subclass("robotiq_gripper")
@dataclass(kw_only=True)
class RobotiqGripperConfig(RobotConfig):  # type: ignore[misc]  # LeRobot is not here
    """The options of the robot: ``--robot.address=...``.

    Attributes:
        address: of the gripper, as of :class:`~robotiq_async.RobotiqHand`, with its model:
            ``rtu:///dev/ttyUSB0?model=2f85``.
        activate: whether a gripper that is reset is activated when the robot connects: **its fingers MOVE**.
        speed: of the fingers, in counts 0..255.
        force: in counts 0..255, until an action sets another.
        action_force: whether an action has ``gripper.force``; False for a leader without it. Recordings
            then cannot be replayed with ``lerobot-replay``.
        clamp: whether an action beyond 0..100 is brought into it, as LeRobot's own motors do; else refused.
        cameras: LeRobot's, by name.
        lost_after: seconds, 0.05..60, that an observation and an action wait for a status.
        response_timeout: seconds, 0.005..5, that the hand waits for an answer.
    """

    address: str
    activate: bool = False
    speed: int = DEFAULT_SPEED
    force: int = DEFAULT_FORCE
    action_force: bool = True
    clamp: bool = True
    cameras: dict[str, CameraConfig] = field(default_factory=dict)
    lost_after: float = LOST_AFTER_S
    response_timeout: float = LOOP_RESPONSE_S


class RobotiqGripper(Robot):  # type: ignore[misc]  # LeRobot is not here
    """A gripper alone, as a robot: its numbers are LeRobot's, 0 closed .. 100 open.

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
        self.cameras = make_cameras_from_configs(config.cameras)
        hand = RobotiqHand(
            config.address,
            speed=config.speed,
            force=config.force,
            response_timeout=config.response_timeout,
        )
        self._part = GripperPart(hand, Convention.LEROBOT, lost_after=config.lost_after)

    @property
    def observation_features(self) -> dict[str, Any]:
        """The keys of an observation, and the shapes of the images."""
        images = {name: (each.height, each.width, 3) for name, each in self.cameras.items()}
        return {**dict.fromkeys(self._part.observations, float), **images}

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
        """Whether the gripper is active: it finds its stops when it is activated."""
        return self._part.is_active

    @check_if_already_connected
    def connect(self, calibrate: bool = True) -> None:
        """Connect; **with** ``activate`` **the fingers of a gripper that is reset MOVE to their stops**.

        Args:
            calibrate: False, as ``lerobot-calibrate`` has it, moves nothing, and connects to a gripper that
                is reset, too. True activates one only with the option ``activate``.

        Raises:
            DeviceAlreadyConnectedError, RobotiqError: as :meth:`GripperPart.connect`.
        """
        self._part.connect(calibrate and self.config.activate, allow_reset=not calibrate)
        try:
            for camera in self.cameras.values():
                camera.connect()
        except BaseException:
            self._disconnect()
            raise

    def calibrate(self) -> None:
        """Activate a gripper that is reset: **the fingers MOVE to their stops**."""
        self._part.activate()

    def configure(self) -> None:
        """Nothing to do."""

    @check_if_not_connected
    def get_observation(self) -> dict[str, Any]:
        """As :meth:`GripperPart.observe`, with the newest images.

        Raises:
            DeviceNotConnectedError, RobotiqError: as :meth:`GripperPart.observe`.
        """
        return {**self._part.observe(), **{name: each.read_latest() for name, each in self.cameras.items()}}

    @check_if_not_connected
    def send_action(self, action: dict[str, Any]) -> dict[str, float]:
        """As :meth:`GripperPart.act`. Keys of an arm are left alone, and ``gripper.force`` may be missing.

        Returns:
            The action that was sent: clamped, unless the option ``clamp`` is False.

        Raises:
            KeyError: ``gripper.pos`` is missing.
            TypeError, ValueError, DeviceNotConnectedError, RobotiqError: as :meth:`GripperPart.act`.
        """
        force = action.get("gripper.force") if self.config.action_force else None
        return self._part.act(action["gripper.pos"], force, clamp=self.config.clamp)

    @check_if_not_connected
    def disconnect(self) -> None:
        """As :meth:`GripperPart.disconnect`: the fingers stop.

        Raises:
            DeviceNotConnectedError: not connected.
        """
        self._disconnect()

    def _disconnect(self) -> None:
        try:
            self._part.disconnect()  # first: a camera may raise
        finally:
            for camera in self.cameras.values():
                if camera.is_connected:
                    camera.disconnect()
