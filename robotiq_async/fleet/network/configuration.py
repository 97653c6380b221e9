"""Configuration of zenoh sessions: loopback only by default, certificates beyond that."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Final

from ..keys.access import AccessList, access_control
from ..keys.key_folder import ACCESS, AUTHORITY, CERTIFICATE, KEY, check_key_folder
from ..wire.names import GripperName
from .endpoints import check_endpoints

PORT: Final = 7447
LOOPBACK_ENDPOINT: Final = f"tcp/127.0.0.1:{PORT}"
LOOPBACK_TLS: Final = f"tls/127.0.0.1:{PORT}"
QUEUED: Final = 16  # halts, and commands, that may wait in a link until its thread runs; zenoh's default is 2
UNKNOWN: Final = 1000
"""Connections that have not identified themselves; at the limit, by default 100, zenoh accepts no others."""
UNKNOWN_MS: Final = 5000  # time in ms after which such connections are closed; zenoh's default is 10 s
LINK_LEASE_MS: Final = 1000
"""Time in ms after which a frozen or unplugged peer is detected; zenoh's default is 10 s."""
QUESTIONS_HZ: Final = 200.0
"""Questions a second about one gripper that zenoh lets in from one connection: a client that waits for its
answers does not ask again within 5 ms."""


def agent_configuration(
    site: str,
    host: str,
    grippers: Iterable[str],
    listen: Sequence[str] = (LOOPBACK_ENDPOINT,),
    connect: Sequence[str] = (),
    *,
    keys: Path | None = None,
    insecure: bool = False,
    trusts_router: bool = False,
) -> dict[str, object]:
    """Configuration of the session of an agent that serves ``grippers``, by their names.

    With keys, its access list decides what clients may do.

    Without an endpoint to listen on, the agent is reached through the routers in ``connect`` alone. It sees
    the certificate of the router, not the clients' certificates: its own list then refuses them all, unless
    it ``trusts_router``. In that case it has no rules, and everyone whom the router lets through commands.

    Raises:
        TypeError, ValueError: a malformed or unprotected endpoint; a folder that lacks a file; a router to
            trust, but no keys, no router, or an endpoint to listen on.
    """
    check_trust(trusts_router, listen, connect, has_keys=keys is not None)
    listen = check_endpoints("listen", listen, has_keys=keys is not None, insecure=insecure)
    connect = check_endpoints("connect", connect, has_keys=keys is not None, insecure=insecure)
    # A router forwards nothing between peers. Our clients are peers, so the agent is a client of the router.
    mode = "client" if connect and not listen else "peer"
    session = session_configuration(listen, connect, keys) | {"mode": mode}
    if listen:
        session |= {"downsampling": _limited_questions(site, host, grippers)}
    if keys is None or trusts_router:
        return session
    return session | {"access_control": access_control(site, (host,), AccessList.read_file(keys / ACCESS))}


def _limited_questions(site: str, host: str, grippers: Iterable[str]) -> list[object]:
    # A flood that zenoh drops at its connection takes no lock of the interpreter, and nothing of what others
    # may ask. Clients of a router share one connection, so there it would.
    rules = [
        {"key_expr": GripperName(site, host, each).key("info", "**"), "freq": QUESTIONS_HZ}
        for each in grippers
    ]
    return [{"messages": ["query"], "flows": ["ingress"], "rules": rules}] if rules else []


def check_trust(
    trusts_router: object, listen: Sequence[str], connect: Sequence[str], *, has_keys: bool
) -> bool:
    """Check that there is a router to trust, and no way around it. Raises TypeError or ValueError."""
    if not isinstance(trusts_router, bool):
        raise TypeError(f"trusts_router must be true or false, got {trusts_router!r}")
    if trusts_router and not (has_keys and connect and not listen):
        raise ValueError("trusts_router is for agents with keys that are reached by connect alone, got true")
    return trusts_router


def router_configuration(
    site: str, hosts: Sequence[str], listen: Sequence[str], keys: Path
) -> dict[str, object]:
    """Configuration of a router between the agents of some hosts and the clients in its access list.

    ``keys`` are the keys of an agent with the name of the router's host; errors as of an agent's
    configuration.
    """
    listen = check_endpoints("listen", listen, has_keys=True)
    clients = AccessList.read_file(keys / ACCESS)
    rules = access_control(site, hosts, clients, is_router=True)
    return session_configuration(listen, (), keys) | {"mode": "router", "access_control": rules}


def client_configuration(
    connect: Sequence[str] = (LOOPBACK_ENDPOINT,), *, keys: Path | None = None, insecure: bool = False
) -> dict[str, object]:
    """Configuration of a client's session, which does not listen; errors as of an agent's."""
    connect = check_endpoints("connect", connect, has_keys=keys is not None, insecure=insecure)
    return session_configuration((), connect, keys)


def session_configuration(
    listen: Sequence[str], connect: Sequence[str], keys: Path | None = None
) -> dict[str, object]:
    """Configuration of a peer without discovery: it uses only the endpoints given."""
    # zenoh drops a message that finds no room within 1 ms, and each request takes a separate batch.
    room = {"real_time": QUEUED, "interactive_high": QUEUED}
    link: dict[str, object] = {"tx": {"lease": LINK_LEASE_MS, "queue": {"size": room}}}
    if keys is not None:
        link["tls"] = _tls(check_key_folder(keys))
    return {
        "mode": "peer",
        "listen": {"endpoints": list(listen), "timeout_ms": 0, "exit_on_failure": True},
        # No limit: an agent that is not running now may be started later.
        "connect": {"endpoints": list(connect), "timeout_ms": -1, "exit_on_failure": False},
        "scouting": {"delay": 50, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"link": link, "unicast": {"accept_pending": UNKNOWN, "accept_timeout": UNKNOWN_MS}},
    }


def _tls(folder: Path) -> Mapping[str, object]:
    # Mutual TLS: both sides need a certificate of the same authority to connect.
    own = {"certificate": str(folder / CERTIFICATE), "private_key": str(folder / KEY)}
    return {
        "root_ca_certificate": str(folder / AUTHORITY),
        "enable_mtls": True,
        # The host name or IP address of the connection must be in the agent's certificate. Otherwise the
        # agent of one host could pass for the agent of another.
        "verify_name_on_connect": True,
        # An open link would otherwise outlive the certificate.
        "close_link_on_expiration": True,
        **{f"{side}_{what}": path for side in ("listen", "connect") for what, path in own.items()},
    }
