"""Blocking hands, for scripts and notebooks: the same names, without ``await``.

======================  ===================================================================
module                  contents
======================  ===================================================================
``robotiq_hand``        the hand, one line for each call of the async one, and the iterators it returns
``caller``              passes calls to the event loop; Ctrl-C, a fork, the end of the program
``signals``             a stop before a signal ends the program
``loop_thread``         the event loop of all blocking hands, in a thread that lives while it is needed
======================  ===================================================================
"""

from .robotiq_hand import RobotiqHand, Stream
from .signals import stops_on_signals

__all__ = ["RobotiqHand", "Stream", "stops_on_signals"]
