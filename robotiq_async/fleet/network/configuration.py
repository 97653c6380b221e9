"""How a session of zenoh is set up: loopback and nothing else, unless asked; then with certificates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

from ..keys.access import access_control
from ..keys.access_list import AccessList
from ..keys.key_folder import ACCESS, AUTHORITY, CERTIFICATE, KEY, check_key_folder
from .endpoints import check_connect, check_listen

PORT: Final = 7447
LOOPBACK: Final = f"tcp/127.0.0.1:{PORT}"
LOOPBACK_TLS: Final = f"tls/127.0.0.1:{PORT}"
QUEUED: Final = 16
"""Halts, and commands, that may lie in a link until its thread gets a turn; zenoh's own default is two."""
UNKNOWN: Final = 1000
"""Connections that have not said who they are; zenoh's own default is 100, and then it accepts no others."""
UNKNOWN_MS: Final = 5000
"""They are closed after this time; zenoh's own default is ten seconds."""
LINK_LEASE_MS: Final = 1000
"""A side that is frozen or unplugged is noticed after this time; zenoh's own default is ten seconds."""


def agent_configuration(
    site: str,
    host: str,
    listen: Sequence[str] = (LOOPBACK,),
    connect: Sequence[str] = (),
    *,
    keys: Path | None = None,
    insecure: bool = False,
) -> dict[str, object]:
    """The configuration of an agent's session.

    Args:
        site: the site's name.
        host: the host's name.
        listen: endpoints where clients come in.
        connect: endpoints of routers; with none to listen on, the agent is reached through the router alone.
        keys: the agent's folder of keys; clients may then do what its access list says, and nothing else.
        insecure: see :func:`~robotiq_async.fleet.network.endpoints.check_listen`.

    Raises:
        TypeError, ValueError: an endpoint that is malformed or not protected; a folder that lacks a file.
    """
    listen = check_listen(listen, has_keys=keys is not None, insecure=insecure)
    connect = check_connect(connect, has_keys=keys is not None, insecure=insecure)
    # A router carries nothing from peer to peer; one of the two has to be its client, and clients are peers.
    mode = "client" if connect and not listen else "peer"
    session = session_configuration(listen, connect, keys) | {"mode": mode}
    if keys is None:
        return session
    clients = AccessList.read_file(keys / ACCESS)
    return session | {"access_control": access_control(site, host, clients)}


def client_configuration(
    connect: Sequence[str] = (LOOPBACK,), *, keys: Path | None = None, insecure: bool = False
) -> dict[str, object]:
    """The configuration of a client's session; it listens nowhere.

    Args:
        connect: endpoints of agents, or of a router.
        keys: the client's folder of keys.
        insecure: see :func:`~robotiq_async.fleet.network.endpoints.check_connect`.

    Raises:
        TypeError, ValueError: as :func:`agent_configuration`.
    """
    connect = check_connect(connect, has_keys=keys is not None, insecure=insecure)
    return session_configuration((), connect, keys)


def session_configuration(
    listen: Sequence[str], connect: Sequence[str], keys: Path | None = None
) -> dict[str, object]:
    """The configuration of a peer that listens and connects where it is told, and looks for nobody.

    Raises:
        ValueError: the folder of keys lacks a file.
    """
    # A message that finds no room within a millisecond is dropped, and each request takes a batch of its own.
    room = {"real_time": QUEUED, "interactive_high": QUEUED}
    link: dict[str, object] = {"tx": {"lease": LINK_LEASE_MS, "queue": {"size": room}}}
    if keys is not None:
        link["tls"] = _tls(check_key_folder(keys))
    return {
        "mode": "peer",
        "listen": {"endpoints": list(listen), "timeout_ms": 0, "exit_on_failure": True},
        # For ever: whoever is not there now may come.
        "connect": {"endpoints": list(connect), "timeout_ms": -1, "exit_on_failure": False},
        "scouting": {"delay": 50, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"link": link, "unicast": {"accept_pending": UNKNOWN, "accept_timeout": UNKNOWN_MS}},
    }


def _tls(folder: Path) -> Mapping[str, object]:
    """Mutual TLS: both sides show a certificate of the same authority, or there is no connection."""
    own = {"certificate": str(folder / CERTIFICATE), "private_key": str(folder / KEY)}
    return {
        "root_ca_certificate": str(folder / AUTHORITY),
        "enable_mtls": True,
        # The name or number that is connected to must stand in the agent's certificate, or the agent of one
        # host could be taken for that of another.
        "verify_name_on_connect": True,
        # Who was let in until Friday is not to stay over the weekend.
        "close_link_on_expiration": True,
        **{f"{side}_{what}": path for side in ("listen", "connect") for what, path in own.items()},
    }
