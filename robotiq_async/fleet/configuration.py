"""How a session of zenoh is set up: loopback and nothing else, unless asked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

PORT: Final = 7447
LOOPBACK: Final = f"tcp/127.0.0.1:{PORT}"
LOOPBACK_TLS: Final = f"tls/127.0.0.1:{PORT}"
LINK_LEASE_MS: Final = 1000
"""A side that is frozen or unplugged is noticed after this time; zenoh's own default is ten seconds."""


def session_configuration(listen: Sequence[str], connect: Sequence[str]) -> dict[str, object]:
    """The configuration of a peer that listens and connects where it is told, and looks for nobody."""
    return {
        "mode": "peer",
        "listen": {"endpoints": list(listen), "timeout_ms": 0, "exit_on_failure": True},
        # For ever: whoever is not there now may come.
        "connect": {"endpoints": list(connect), "timeout_ms": -1, "exit_on_failure": False},
        "scouting": {"delay": 50, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {"link": {"tx": {"lease": LINK_LEASE_MS}}},
    }
