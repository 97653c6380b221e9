"""The settings of the page, as its process receives them."""

from __future__ import annotations

import json
import secrets
from dataclasses import asdict, dataclass, field
from socket import gethostname
from typing import Final, Self

from ...runtime import is_loopback
from ...values import DEFAULT_FORCE, DEFAULT_SPEED, check_int

LOOPBACK: Final = "127.0.0.1"
EVERYWHERE: Final = ("0.0.0.0", "::", "")
"""Hosts that mean every interface: the URL has the name of this machine."""
PAGE_PORT: Final = 8766
"""Next to the viewers' port."""


@dataclass(frozen=True, slots=True)
class PageSettings:
    """Settings of the page: its address, and the protection of it.

    Attributes:
        host: the interface to listen on.
        port: the TCP port; 0 takes a free one.
        control: whether the page may command.
        addresses: titles of the hands on the page, in their order.
        speed: initial value of the speed slider.
        force: initial value of the force slider.
        password: every user must give it; empty for the token in the printed address.
        certificate: PEM file with the certificate (chain) for https; empty for http.
        key: PEM file with its private key.
        token: in the printed address.
        folder: the path of the page. Cookies ignore ports; one for this path is not sent to other servers of
            this machine.
    """

    host: str = LOOPBACK
    port: int = PAGE_PORT
    control: bool = False
    addresses: tuple[str, ...] = ()
    speed: int = DEFAULT_SPEED
    force: int = DEFAULT_FORCE
    password: str = field(default="", repr=False)
    certificate: str = ""
    key: str = ""
    token: str = field(default_factory=lambda: secrets.token_urlsafe(24), repr=False)
    folder: str = field(default_factory=lambda: f"/{secrets.token_hex(8)}", repr=False)

    def __post_init__(self) -> None:
        """Check the settings.

        Raises:
            TypeError: port, speed or force is not an int.
            ValueError: one of them is outside its range; an interface other than loopback has neither
                password nor certificate; or a certificate has no key.
        """
        for name, high in (("port", 65535), ("speed", 255), ("force", 255)):
            object.__setattr__(self, name, check_int(name, getattr(self, name), 0, high))
        if bool(self.certificate) != bool(self.key):
            raise ValueError("a certificate needs its key, and a key its certificate")
        if not self.loopback and not (self.password or self.certificate):
            raise ValueError(f"{self.host} lets others in: that needs a password or a certificate")

    @property
    def loopback(self) -> bool:
        """Whether only programs of this machine reach the interface."""
        return is_loopback(self.host)

    @property
    def scheme(self) -> str:
        """The scheme of the URL."""
        return "https" if self.certificate else "http"

    def url(self, port: int) -> str:
        """The address to open. Everyone who has it is let in, unless there is a password."""
        host = gethostname() if self.host in EVERYWHERE else self.host
        host = f"[{host}]" if ":" in host else host
        return f"{self.scheme}://{host}:{port}/" + ("" if self.password else f"?token={self.token}")

    def line(self) -> bytes:
        """The settings as a line for a pipe: every user of the machine can read arguments of processes."""
        return json.dumps(asdict(self)).encode() + b"\n"

    @classmethod
    def read(cls, line: bytes) -> Self:
        """Decode such a line.

        Raises:
            ValueError: the line is not JSON.
        """
        fields = json.loads(line)
        return cls(**{**fields, "addresses": tuple(fields["addresses"])})
