"""Hand: what every hand can do. RobotiqHand: the hand that owns the link to one gripper.

Five files, four of them each adding to the class of the one before:

* ``base.py``: :class:`Hand`, the promises;
* ``observation.py``: what the hand shows: state, statuses, streams, statistics, waiting for any of it;
* ``recovery.py``: activation, reset, automatic release, and the way out of a fault;
* ``commands.py``: positions, speeds, forces, moves, grasps, hold and halt;
* ``robotiq_hand.py``: the options, the start and the stop: :class:`RobotiqHand` itself.

``naming.py`` lets their errors tell the name of the hand.
"""

from .base import Hand, HandStream

__all__ = ["Hand", "HandStream"]
