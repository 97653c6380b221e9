"""Where zenoh listens and connects, and what is refused there: nothing leaves this machine unprotected."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

from ...runtime.sockets import is_loopback

FORMS: Final = "tcp/HOST:PORT, tls/HOST:PORT or quic/HOST:PORT"
_ENDPOINT: Final = re.compile(r"(tcp|tls|quic)/(\[[0-9A-Fa-f:.]+\]|[A-Za-z0-9_.-]+):([0-9]{1,5})")
"""What zenoh takes behind a ? or a # is left out: some of it would take the protection away."""


@dataclass(frozen=True, slots=True)
class Endpoint:
    """A checked endpoint.

    Attributes:
        text: as it was written, and as zenoh takes it.
        protocol: "tcp", "tls" or "quic".
        host: name or number, without brackets.
    """

    text: str
    protocol: str
    host: str

    @property
    def is_encrypted(self) -> bool:
        """Whether both sides show a certificate there."""
        return self.protocol != "tcp"

    @property
    def is_loopback(self) -> bool:
        """Whether only programs on this machine can be on the other side."""
        return is_loopback(self.host)


def parse_endpoint(what: str, text: object) -> Endpoint:
    """The endpoint in a string; ``what`` is for the message.

    Raises:
        TypeError: not a string.
        ValueError: malformed; the message shows the forms.
    """
    if not isinstance(text, str):
        raise TypeError(f"{what} must be {FORMS}, got {text!r}")
    found = _ENDPOINT.fullmatch(text)
    if found is None or not 1 <= int(found[3]) <= 65535:
        raise ValueError(f"{what} must be {FORMS}, and nothing more, got {text!r}")
    return Endpoint(text, found[1], found[2].strip("[]"))


def check_listen(endpoints: Sequence[object], *, has_keys: bool, insecure: bool = False) -> tuple[str, ...]:
    """Where an agent listens: on this machine only, unless it has keys.

    Args:
        endpoints: of zenoh.
        has_keys: whether there are certificates for mutual TLS.
        insecure: the word of whoever runs it that nobody else is on that network.

    Raises:
        TypeError: one is not a string.
        ValueError: one is malformed, or not protected.
    """
    return _check("listen", endpoints, has_keys=has_keys, insecure=insecure)


def check_connect(endpoints: Sequence[object], *, has_keys: bool, insecure: bool = False) -> tuple[str, ...]:
    """Where an agent or a client connects; see :func:`check_listen`, for others could read and write there.

    Raises:
        TypeError: one is not a string.
        ValueError: one is malformed, or not protected.
    """
    return _check("connect", endpoints, has_keys=has_keys, insecure=insecure)


def _check(what: str, endpoints: Sequence[object], *, has_keys: bool, insecure: bool) -> tuple[str, ...]:
    if has_keys and insecure:
        raise ValueError("keys and insecure exclude each other: with keys everything is encrypted")
    checked = [parse_endpoint(what, endpoint) for endpoint in endpoints]
    for endpoint in checked:
        _check_protected(what, endpoint, has_keys=has_keys, insecure=insecure)
    return tuple(endpoint.text for endpoint in checked)


def _check_protected(what: str, endpoint: Endpoint, *, has_keys: bool, insecure: bool) -> None:
    """Refuse an endpoint that is not protected, or that its protection does not fit.

    Raises:
        ValueError: it is not.
    """
    if endpoint.is_encrypted and not has_keys:
        raise ValueError(f"{what} {endpoint.text!r} needs keys: certificates of both sides")
    if has_keys and not endpoint.is_encrypted:
        raise ValueError(f"{what} {endpoint.text!r} must begin with tls/: tcp/ knows no certificates")
    if not (endpoint.is_encrypted or endpoint.is_loopback or insecure):
        raise ValueError(
            f"{what} {endpoint.text!r} is open to everybody on that network, who could read and command: "
            "use keys and tls/, or say insecure"
        )
