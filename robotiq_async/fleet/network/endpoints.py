"""Endpoints of zenoh, checked: beyond this machine they must be protected."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from ...runtime import is_loopback

ENDPOINT_FORMS: Final = "tcp/HOST:PORT, tls/HOST:PORT or quic/HOST:PORT"
_ENDPOINT: Final = re.compile(r"(tcp|tls|quic)/(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9_.-]+):([0-9]{1,5})")
"""Options of zenoh after a ? or a # are refused: some of them would turn the protection off."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A checked endpoint."""

    text: str  # as zenoh takes it
    protocol: str  # "tcp", "tls" or "quic"
    host: str  # name or IP address, without brackets

    @property
    def is_encrypted(self) -> bool:
        """Whether both sides need a certificate."""
        return self.protocol != "tcp"

    @property
    def is_loopback(self) -> bool:
        return is_loopback(self.host)


def parse_endpoint(what: str, text: object) -> Endpoint:
    """Parse an endpoint, named ``what`` in messages. TypeError, ValueError: it has none of the FORMS."""
    if not isinstance(text, str):
        raise TypeError(f"{what} must be {ENDPOINT_FORMS}, got {text!r}")
    found = _ENDPOINT.fullmatch(text)
    if found is None or not 1 <= int(found[3]) <= 65535:
        raise ValueError(f"{what} must be {ENDPOINT_FORMS}, and nothing more, got {text!r}")
    return Endpoint(text, found[1], found[2].strip("[]"))


def check_endpoints(
    what: str, endpoints: Sequence[object], *, has_keys: bool, insecure: bool = False
) -> tuple[str, ...]:
    """Check endpoints to "listen" on, or to "connect" to, where others could read and write as well.

    Without keys, which are certificates for mutual TLS, only this machine is allowed; with ``insecure`` the
    operator vouches for everyone on that network.

    Raises:
        TypeError: an endpoint is not a string.
        ValueError: an endpoint is malformed or unprotected.
    """
    if has_keys and insecure:
        raise ValueError("keys and insecure cannot be combined: with keys everything is encrypted")
    checked = [parse_endpoint(what, endpoint) for endpoint in endpoints]
    for endpoint in checked:
        _check_protected(what, endpoint, has_keys=has_keys, insecure=insecure)
    return tuple(endpoint.text for endpoint in checked)


def _check_protected(what: str, endpoint: Endpoint, *, has_keys: bool, insecure: bool) -> None:
    if endpoint.is_encrypted and not has_keys:
        raise ValueError(f"{what} {endpoint.text!r} needs keys: certificates of both sides")
    if has_keys and not endpoint.is_encrypted:
        raise ValueError(f"{what} {endpoint.text!r} must begin with tls/: tcp/ has no certificates")
    if not (endpoint.is_encrypted or endpoint.is_loopback or insecure):
        raise ValueError(
            f"{what} {endpoint.text!r} is open to everyone on that network, to read and to command: "
            "use keys and tls/, or set insecure"
        )
