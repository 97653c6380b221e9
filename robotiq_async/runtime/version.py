"""The version, for files that say what has written them."""

from typing import Final

__version__: Final = "0.1.0"
