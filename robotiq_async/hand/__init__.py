"""RobotiqHand: one gripper, for the program that moves it.

Four files, each adding to the class of the one before:

* ``observation.py``: what the hand shows: state, statuses, streams, statistics, waiting for any of it;
* ``recovery.py``: activation, reset, automatic release, and the way out of a fault;
* ``commands.py``: positions, speeds, forces, moves, grasps, hold and halt;
* ``robotiq_hand.py``: the options, the start and the stop: :class:`RobotiqHand` itself.

``naming.py`` lets their errors tell the name of the hand.
"""

from .robotiq_hand import RobotiqHand

__all__ = ["RobotiqHand"]
