"""The version, for files that name the program that wrote them."""

from typing import Final

__version__: Final = "0.1.0"
