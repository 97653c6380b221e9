"""The layer below everything: clocks, timers, event loops and threads, logging, optional packages."""

from .clock import now
from .concurrency import NoThreadError, check_loop, in_a_thread, running_loop, wait_shielded, write_all
from .extras import install, is_frozen
from .host_names import addresses_of
from .limit import Limit
from .logger import Log, log, printable
from .shell import quoted
from .signals import INSIST_S, check_main_thread, ending_signals, pass_on
from .sockets import is_loopback, listen
from .version import __version__

__all__ = ["now"]
__all__ += ["NoThreadError", "check_loop", "in_a_thread", "running_loop", "wait_shielded", "write_all"]
__all__ += ["install", "is_frozen"]
__all__ += ["addresses_of"]
__all__ += ["Limit"]
__all__ += ["Log", "log", "printable"]
__all__ += ["quoted"]
__all__ += ["INSIST_S", "check_main_thread", "ending_signals", "pass_on"]
__all__ += ["is_loopback", "listen"]
__all__ += ["__version__"]
