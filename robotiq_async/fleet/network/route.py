"""Route: addresses of hands on other hosts, and how to reach them."""

from __future__ import annotations

import os
from dataclasses import dataclass
from pathlib import Path
from typing import Final
from urllib.parse import parse_qsl

from ..wire.names import GripperName
from .configuration import LOOPBACK_ENDPOINT, LOOPBACK_TLS, client_configuration

ROUTE_FORM: Final = "zenoh://SITE/HOST/GRIPPER[?connect=tls/HOST:7447][&keys=FOLDER]"
CONNECT_VARIABLE: Final = "ROBOTIQ_ASYNC_CONNECT"
KEYS_VARIABLE: Final = "ROBOTIQ_ASYNC_KEYS"
_ROUTE_OPTIONS: Final = frozenset({"connect", "keys", "insecure"})


@dataclass(frozen=True, slots=True)
class Route:
    """The way to agents.

    Attributes:
        connect: zenoh endpoints of agents or routers; empty for an agent on this machine.
        keys: folder with the certificates of this client; None without certificates.
        insecure: whether to connect beyond this machine without certificates.
    """

    connect: tuple[str, ...] = ()
    keys: Path | None = None
    insecure: bool = False

    @property
    def endpoints(self) -> tuple[str, ...]:
        """The endpoints to connect to; by default an agent on this machine."""
        return self.connect or (LOOPBACK_ENDPOINT if self.keys is None else LOOPBACK_TLS,)

    def configuration(self) -> dict[str, object]:
        """The zenoh configuration of a client session on this route.

        Raises:
            TypeError, ValueError: a malformed or unprotected endpoint, or a folder that lacks a file.
        """
        return client_configuration(self.endpoints, keys=self.keys, insecure=self.insecure)


def default_route() -> Route:
    """The route in the environment, else an agent on this machine."""
    connect = tuple(filter(None, os.environ.get(CONNECT_VARIABLE, "").split(",")))
    keys = os.environ.get(KEYS_VARIABLE)
    return Route(connect, Path(keys) if keys else None)


def parse_remote_address(address: object) -> tuple[GripperName, Route]:
    """Parse an address into gripper and route. The environment supplies the rest.

    Raises:
        TypeError: not a string.
        ValueError: malformed; the message has the form.
    """
    if not isinstance(address, str):
        raise TypeError(f"address must be a string, got {address!r}; accepted: {ROUTE_FORM}")
    plain, _, query = address.partition("?")
    try:
        name = GripperName.parse(plain)
        pairs = parse_qsl(query, strict_parsing=True) if query else []
    except ValueError as error:
        raise _malformed(address, str(error)) from None
    unknown = [option for option, _ in pairs if option not in _ROUTE_OPTIONS]
    if unknown:
        raise _malformed(address, f"no option {unknown[0]!r}")
    usual = default_route()
    connect = tuple(value for option, value in pairs if option == "connect")
    folders = [value for option, value in pairs if option == "keys"]
    insecure = any(option == "insecure" and value == "1" for option, value in pairs)
    return name, Route(connect or usual.connect, Path(folders[-1]) if folders else usual.keys, insecure)


def _malformed(address: str, why: str) -> ValueError:
    return ValueError(f"malformed address {address!r:.200}; accepted: {ROUTE_FORM}; {why:.100}")
