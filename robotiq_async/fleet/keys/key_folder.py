"""The folder of keys that a machine gets."""

from __future__ import annotations

from pathlib import Path
from typing import Final

AUTHORITY: Final = "ca.pem"
"""The authority's certificate: whose word both sides go by."""
CERTIFICATE: Final = "cert.pem"
KEY: Final = "key.pem"
"""Secret: whoever has it is the one whose name is in the certificate."""
ACCESS: Final = "access.toml"
"""Which client may do what; only agents have it."""
DAYS: Final = 825
"""How long a certificate is valid unless told otherwise; some systems accept none for longer."""


def check_key_folder(folder: Path) -> Path:
    """A folder with keys, as an absolute path.

    Raises:
        ValueError: something is missing in it.
    """
    missing = [name for name in (AUTHORITY, CERTIFICATE, KEY) if not (folder / name).is_file()]
    if missing:
        raise ValueError(f"keys must be a folder with {', '.join(missing)} in it, got {str(folder)!r}")
    return folder.absolute()
