"""The way to an agent: is the port open, and do both sides trust each other's certificates?"""

from __future__ import annotations

import asyncio
import ssl
from pathlib import Path
from typing import Final

from ...fleet.keys.key_folder import AUTHORITY, CERTIFICATE, KEY
from ...fleet.network.endpoints import Endpoint, parse_endpoint
from ...fleet.network.route import Route
from .findings import Finding, GiveUpError, Level, Report

REACH_S: Final = 3.0
"""Timeout for connecting, and for the TLS handshake."""
SHUT_S: Final = 0.5
"""A side that distrusts a certificate hangs up within this time; one that trusts it waits."""


async def examine_way(route: Route, report: Report) -> None:
    """Examine every endpoint of a route.

    Raises:
        GiveUpError: none of them is open.
    """
    endpoints = [parse_endpoint("connect", text) for text in route.endpoints]
    is_open = [await _examine(endpoint, route, report) for endpoint in endpoints]
    if not any(is_open):
        raise GiveUpError


async def _examine(endpoint: Endpoint, route: Route, report: Report) -> bool:
    if endpoint.protocol == "quic":
        report(Finding(Level.GOOD, "port", f"{endpoint.text}: not checked, because it is not TCP"))
        return True
    if not await _is_open(endpoint, report):
        return False
    if endpoint.is_encrypted:
        assert route.keys is not None  # parse_remote_address() checks that
        return await _shake_hands(endpoint, route.keys, report)
    if not endpoint.is_loopback:
        found = f"{endpoint.text}: everyone on that network can read and command"
        advice = "Make keys (robotiq-async fleet keys), unless no one else can be on it."
        report(Finding(Level.DOUBT, "encryption", found, advice))
    return True


async def _is_open(endpoint: Endpoint, report: Report) -> bool:
    try:
        await _connect(endpoint, None)
    except TimeoutError:
        found = f"{endpoint.text} does not answer within {REACH_S:g} s"
        advice = "Is the host up, and on this network? A firewall may drop the packets."
    except ConnectionRefusedError:
        found = f"{endpoint.text}: nothing listens"
        advice = "Does robotiq-async agent run there, and does its FLEET.toml listen at this address?"
    except OSError as error:
        found = f"{endpoint.text}: {error.strerror or error}"
        advice = "Check the spelling of the name, and the network of this computer."
    else:
        report(Finding(Level.GOOD, "port", f"{endpoint.text} is open"))
        return True
    report(Finding(Level.BAD, "port", found, advice))
    return False


async def _shake_hands(endpoint: Endpoint, keys: Path, report: Report) -> bool:
    own = _context(keys, shows=True)
    try:
        stays = await _connect(endpoint, own)
    except ssl.SSLCertVerificationError as error:
        found = f"{endpoint.text}: its certificate is not trusted: {error.verify_message}"
        advice = (
            "It must be of the same authority, not past its end, and name what you connect to "
            "(fleet keys --agent NAME=HOST,...)."
        )
        report(Finding(Level.BAD, "certificates", found, advice))
        return False
    except OSError as error:
        found = f"{endpoint.text}: no encrypted connection: {str(error) or 'no answer'}"
        advice = "Is it the port of an agent with keys? One without listens at tcp/."
        report(Finding(Level.BAD, "certificates", found, advice))
        return False
    if not stays:
        found = f"{endpoint.text}: the agent does not trust this certificate"
        advice = "Is it of the same authority? Look at the clock of the agent's host, too."
        report(Finding(Level.BAD, "certificates", found, advice))
        return False
    report(Finding(Level.GOOD, "certificates", f"{endpoint.text}: both sides trust each other"))
    await _try_without(endpoint, keys, report)
    return True


async def _try_without(endpoint: Endpoint, keys: Path, report: Report) -> None:
    try:
        stays = await _connect(endpoint, _context(keys, shows=False))
    except OSError:
        stays = False
    if stays:
        found = f"{endpoint.text}: clients without a certificate are let in, too"
        advice = "What listens there is no agent of this kind, or a router without mutual TLS. Stop it."
        report(Finding(Level.BAD, "no certificate", found, advice))
    else:
        report(Finding(Level.GOOD, "no certificate", "refused, as it must be"))


def _context(keys: Path, *, shows: bool) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=keys / AUTHORITY)
    if shows:
        context.load_cert_chain(keys / CERTIFICATE, keys / KEY)
    return context


async def _connect(endpoint: Endpoint, context: ssl.SSLContext | None) -> bool:
    """Connect and hang up; returns whether the other side kept the connection open.

    Raises:
        OSError: no connection.
        TimeoutError: none in time.
    """
    port = int(endpoint.text.rpartition(":")[2])
    async with asyncio.timeout(REACH_S):
        reader, writer = await asyncio.open_connection(endpoint.host, port, ssl=context)
    try:
        if context is None:
            return True
        async with asyncio.timeout(SHUT_S):
            # The other side checks our certificate after the handshake has ended on this side.
            return bool(await reader.read(1))
    except TimeoutError:
        return True
    except OSError:
        return False
    finally:
        writer.transport.abort()
