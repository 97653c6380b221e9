"""The library's logger, ``robotiq_async``, which never fails.

A handler of the application that raises (a full disk, a closed stream) must not end the task that owns the
link, or keep it from stopping the fingers.
"""

from __future__ import annotations

import logging
import sys
import traceback
from typing import Any, Final


class _Log(logging.LoggerAdapter[logging.Logger]):
    def log(self, level: int, msg: object, *args: object, **kwargs: Any) -> None:  # noqa: ANN401  # as the base class has it
        """Log; what goes wrong with that is shown as the logging module shows it."""
        try:
            super().log(level, msg, *args, **{"stacklevel": 2} | kwargs)
        except Exception:  # noqa: BLE001  # whatever a handler raises
            if logging.raiseExceptions and sys.stderr is not None:
                traceback.print_exc()


log: Final = _Log(logging.getLogger("robotiq_async"))
