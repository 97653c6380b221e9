"""The habits of real grippers that several sources agree on, by model: a simulator like hardware has them.

======================  =============  ====================================================================
habit                   of which       sources
======================  =============  ====================================================================
activation of 12 s      3-Finger       one driver reports 15 s; others wait for 25 and 30
activation of 4.2 s     2F, Hand-E     pyRobotiqGripper gives up after 5 s, and its users do not complain
``status-lag``          3-Finger       none for it: no driver looks soon enough to have seen one. The
                                       vendor's SDK for the 2F waits up to 0.2 s
no ``status-lag``       2F, Hand-E     pyRobotiqGripper's and the vendor's example loop end with the first
                                       gOBJ after a write; only the SDK's text says that gOBJ trails
``silence-fault``       all            the manual of a sibling, two recordings of 2F in normal operation
``write-spacing``       3-Finger       the manual of 2014, pp. 58 and 75
no ``write-spacing``    2F, Hand-E     the vendor's loop writes 100 times a second, and up to 250 times
======================  =============  ====================================================================

Troubles with at most one source are left out: ``echoed-limits``, ``e-stop``, ``wake-needed``, ``idle-reset``,
``function-3-only``, ``one-connection-only``. We have measured none of these habits.
"""

from __future__ import annotations

from robotiq_async.values.model import THREE_FINGER, Model

from ..physics.habits import QUICK_ACTIVATION, REAL_ACTIVATION, Habits
from .trouble import Trouble


def own_habits(model: Model) -> Habits:
    """The habits of a real gripper of this model, to pass to :class:`SimulatedGripper` as ``habits``.

    They follow the time of the gripper: a faster simulation has faster habits.
    """
    return Habits(activation_time=REAL_ACTIVATION if model is THREE_FINGER else QUICK_ACTIVATION)


def like_hardware(model: Model) -> tuple[Trouble, ...]:
    """Misbehaviour of a real gripper of this model on its link, as troubles for :class:`FaultInjector`.

    They go by real time, as the clients do that meet them.
    """
    if model is THREE_FINGER:
        return Trouble("status-lag"), Trouble("silence-fault"), Trouble("write-spacing")
    return (Trouble("silence-fault"),)
