"""The folder of keys of one machine."""

from __future__ import annotations

from pathlib import Path
from typing import Final

AUTHORITY: Final = "ca.pem"  # the authority's certificate, which both sides trust
CERTIFICATE: Final = "cert.pem"
KEY: Final = "key.pem"  # secret: proves that its owner is the one named in the certificate
ACCESS: Final = "access.toml"  # the access list; only agents have it


def check_key_folder(folder: Path) -> Path:
    """Check a folder of keys; returns its absolute path. ValueError: a file is missing."""
    missing = [name for name in (AUTHORITY, CERTIFICATE, KEY) if not (folder / name).is_file()]
    if missing:
        raise ValueError(f"keys must be a folder with {', '.join(missing)} in it, got {str(folder)!r}")
    return folder.absolute()
