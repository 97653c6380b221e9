"""Blocking hands, for scripts and notebooks: the same names, without ``await``.

======================  ===================================================================
module                  what it holds
======================  ===================================================================
``loop_thread``         the event loop of all of them, in a thread that is there while it is needed
``caller``              how a call gets there, and what Ctrl-C, a fork and the end of the program do
``blocking``            what the hand is made of; it and ``streams`` are written by hand
``robotiq_hand``        and the others: made from :mod:`robotiq_async.hand` by docs/make_sync.py
======================  ===================================================================
"""

from .robotiq_hand import RobotiqHand
from .streams import Stream

__all__ = ["RobotiqHand", "Stream"]
