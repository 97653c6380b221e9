"""Credentials: the owner that a folder of keys names, and until when."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import serialization
from cryptography.x509.oid import NameOID

from .access import Role
from .key_folder import AUTHORITY, CERTIFICATE, KEY


@dataclass(frozen=True, slots=True)
class Credentials:
    """A certificate whose key and authority are in the same folder."""

    common_name: str  # the owner's, as zenoh compares it
    begins: datetime
    ends: datetime  # or the end of the authority, if earlier

    @property
    def role(self) -> Role | None:
        """The role in the common name; None if it names no role."""
        role, colon, _ = self.common_name.partition(":")
        known = {each.value: each for each in Role}
        return known.get(role) if colon else None


def read_credentials(folder: Path) -> Credentials:
    """Read a folder of keys; ValueError if a file is malformed, or the files do not belong together."""
    authority = _certificate(folder / AUTHORITY)
    own = _certificate(folder / CERTIFICATE)
    try:
        key = serialization.load_pem_private_key((folder / KEY).read_bytes(), None)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{KEY} is not an unencrypted private key") from error
    if key.public_key() != own.public_key():
        raise ValueError(f"{KEY} is not the key of {CERTIFICATE}")
    try:
        own.verify_directly_issued_by(authority)
    except (InvalidSignature, TypeError, ValueError) as error:
        raise ValueError(f"{CERTIFICATE} was not issued by the authority of {AUTHORITY}") from error
    return Credentials(
        _common_name(own),
        max(own.not_valid_before_utc, authority.not_valid_before_utc),
        min(own.not_valid_after_utc, authority.not_valid_after_utc),
    )


def common_name(certificate: Path) -> str:
    """The common name in a certificate, as zenoh compares it; empty if it is missing."""
    return _common_name(_certificate(certificate))


def _common_name(certificate: x509.Certificate) -> str:
    names = certificate.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return str(names[0].value) if names else ""


def _certificate(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path.name} is not a certificate") from error
