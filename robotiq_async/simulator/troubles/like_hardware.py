"""What a simulator does to be like hardware: the habits of real grippers that several sources agree on.

======================  ===================================================================================
habit                   sources
======================  ===================================================================================
``status-lag``          the vendor's SDK for the two-finger grippers, in its text and in its example, which
                        wait up to 0.2 s; no driver of the 3-Finger looks soon enough to have seen it
``silence-fault``       the manual of a sibling, two recordings of others in normal operation
``write-spacing``       the manual of 2014, in its chapters on TCP and on RTU; users of two arms whose
                        two-finger grippers took no dense commands
an activation of 12 s   one driver reports 15 s; others wait for 25 and 30
======================  ===================================================================================

Left out is what one source tells or none: ``echoed-limits``, ``e-stop``, ``wake-needed``, ``idle-reset``,
``function-3-only``, ``one-connection-only``. Nothing of it has been measured by us.
"""

from __future__ import annotations

from typing import Final

from ..physics.habits import REAL_ACTIVATION, Habits
from .trouble import Trouble

OWN_HABITS: Final = Habits(activation_time=REAL_ACTIVATION)
"""Those of the gripper itself: faster in a simulation that is."""
LIKE_HARDWARE: Final = (Trouble("status-lag"), Trouble("silence-fault"), Trouble("write-spacing"))
"""Those that go by real time, as the clients do that meet them."""
