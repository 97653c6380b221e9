"""Words of a command that a message tells a person to type, quoted for every shell.

Only double quotes are quotes in sh, PowerShell and the prompt of Windows alike.
"""

from __future__ import annotations

import re


def quoted(word: str) -> str:
    """A word for a command line, in double quotes if it needs them. The word itself must hold no quotes."""
    return word if re.fullmatch(r"[\w.:/+=-]+", word, re.ASCII) else f'"{word}"'
