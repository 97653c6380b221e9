"""What stands in the certificate of a folder of keys, and whether its files belong together."""

from __future__ import annotations

from dataclasses import dataclass
from datetime import datetime
from pathlib import Path

from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives import serialization
from cryptography.x509.oid import NameOID

from .access_list import Role
from .key_folder import AUTHORITY, CERTIFICATE, KEY


@dataclass(frozen=True, slots=True)
class Credentials:
    """A certificate whose key and authority lie beside it.

    Attributes:
        common_name: whose it is, as zenoh compares it.
        begins: from when it holds.
        ends: until when it holds; the authority's end, if that comes first.
    """

    common_name: str
    begins: datetime
    ends: datetime

    @property
    def role(self) -> Role | None:
        """What the certificate is for; None if that does not stand in it."""
        role, colon, _ = self.common_name.partition(":")
        known = {each.value: each for each in Role}
        return known.get(role) if colon else None


def read_credentials(folder: Path) -> Credentials:
    """What a folder of keys holds.

    Raises:
        OSError: a file cannot be read.
        ValueError: one is malformed, or they do not belong together.
    """
    authority = _certificate(folder / AUTHORITY)
    own = _certificate(folder / CERTIFICATE)
    try:
        key = serialization.load_pem_private_key((folder / KEY).read_bytes(), None)
    except (TypeError, ValueError) as error:
        raise ValueError(f"{KEY} is no private key without a password") from error
    if key.public_key() != own.public_key():
        raise ValueError(f"{KEY} is not the key of {CERTIFICATE}")
    try:
        own.verify_directly_issued_by(authority)
    except (InvalidSignature, TypeError, ValueError) as error:
        raise ValueError(f"{CERTIFICATE} was not issued by the authority of {AUTHORITY}") from error
    names = own.subject.get_attributes_for_oid(NameOID.COMMON_NAME)
    return Credentials(
        str(names[0].value) if names else "",
        max(own.not_valid_before_utc, authority.not_valid_before_utc),
        min(own.not_valid_after_utc, authority.not_valid_after_utc),
    )


def _certificate(path: Path) -> x509.Certificate:
    try:
        return x509.load_pem_x509_certificate(path.read_bytes())
    except ValueError as error:
        raise ValueError(f"{path.name} is no certificate") from error
