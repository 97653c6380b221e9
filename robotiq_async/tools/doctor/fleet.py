"""A gripper that the agent of another host serves: the keys, the way to it, and the agent.

Nothing moves, and no lease is taken.
"""

from __future__ import annotations

import asyncio
import ssl
import stat
from contextlib import suppress
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from ...fleet.keys.access import Role
from ...fleet.keys.key_folder import AUTHORITY, CERTIFICATE, KEY, check_key_folder
from ...fleet.network.bus import Bus
from ...fleet.network.endpoints import Endpoint, parse_endpoint
from ...fleet.network.route import Route, parse_remote_address
from ...fleet.wire.names import ROOT, GripperName
from ...values import ConnectFailedError
from .agent import examine_agent
from .findings import Finding, GiveUpError, Level, ReportFinding

FLEET_LOOK_S: Final = 3.0  # seconds of looking for the agent
ROUND_S: Final = 0.3  # duration of one look


async def examine_remote(address: str, report: ReportFinding, *, bus: Bus | None = None) -> None:
    """Examine the way to a gripper on another host; reports each finding at once.

    An open session is given as ``bus``: it stays open and is not examined.

    Raises:
        TypeError, ValueError: a malformed address.
    """
    name, route = parse_remote_address(address)
    way = "a session that is open" if bus is not None else ", ".join(route.endpoints)
    report(Finding(Level.GOOD, "address", f"{name} by {way}"))
    with suppress(GiveUpError):
        if bus is not None:
            await _examine(name, bus, report)
        else:
            await _examine_way_and_agent(name, route, report)


async def _examine_way_and_agent(name: GripperName, route: Route, report: ReportFinding) -> None:
    from ...fleet.network.zenoh_bus import open_bus  # noqa: PLC0415  # needs the extra

    if route.keys is not None:
        examine_keys(route.keys, report, now=datetime.now(UTC))
    try:
        configuration = route.configuration()
    except ValueError as error:
        advice = "robotiq-async fleet keys makes keys; &insecure=1 is for your own network."
        report(Finding(Level.BAD, "way", str(error), advice))
        raise GiveUpError from error
    await examine_way(route, report)
    try:
        bus = await open_bus(configuration, str(name))
    except ConnectFailedError as error:
        report(Finding(Level.BAD, "session", str(error), "Are the files in the folder of keys complete?"))
        raise GiveUpError from error
    try:
        await _examine(name, bus, report)
    finally:
        await bus.close()


async def _examine(name: GripperName, bus: Bus, report: ReportFinding) -> None:
    await _find(name, bus, report)
    await examine_agent(name, bus, report)


async def _find(name: GripperName, bus: Bus, report: ReportFinding) -> None:
    loop = asyncio.get_running_loop()
    ends = loop.time() + FLEET_LOOK_S
    own: set[str] = set()
    others: set[GripperName] = set()
    while not own and loop.time() < ends:
        for key in await bus.announced(f"{ROOT}/*/*/*/alive/*", timeout=ROUND_S):
            other = GripperName.of_key(key)
            if other == name:
                own.add(key)
            else:
                others.add(other)
        if not own:
            await asyncio.sleep(ROUND_S / 3)
    if not own:
        found = f"no agent serves {name}"
        if others:
            found += f"; there are {', '.join(map(str, sorted(others)))}"
            advice = "Check the three names in the address."
        else:
            advice = (
                "Does robotiq-async agent run there, and no other program? With keys: is this client in "
                "the agent's access.toml, and was the agent started since?"
            )
        report(Finding(Level.BAD, "agent", found, advice))
        raise GiveUpError
    if len(own) > 1:
        advice = "Two agents command one gripper: stop one."
        report(Finding(Level.BAD, "agent", f"{len(own)} serve this gripper", advice))
    else:
        report(Finding(Level.GOOD, "agent", "one serves this gripper"))


EXPIRES_SOON: Final = timedelta(days=30)
_MAY: Final = {
    Role.READ: "may watch",
    Role.HALT: "may watch and halt",
    Role.OPERATE: "may watch, halt and command",
}
_NEW_KEYS: Final = "The owner of the authority can make a new one: robotiq-async fleet keys."


def examine_keys(folder: Path, report: ReportFinding, *, now: datetime) -> None:
    """Examine a client's folder of keys."""
    # Needs the extra fleet. The folder of keys may come from another machine.
    from ...fleet.keys.credentials import read_credentials  # noqa: PLC0415

    try:
        found = read_credentials(check_key_folder(folder))
    except (OSError, ValueError) as error:
        advice = "Copy the folder again from the machine where robotiq-async fleet keys made it."
        report(Finding(Level.BAD, "certificate", f"{folder}: {error}", advice))
        raise GiveUpError from error
    _report_dates(found.begins, found.ends, now, report)
    _report_mode(folder / KEY, report)
    _report_role(found.common_name, found.role, report)


def _report_dates(begins: datetime, ends: datetime, now: datetime, report: ReportFinding) -> None:
    if now < begins:
        found = f"holds from {begins:%Y-%m-%d} on, and here it is {now:%Y-%m-%d}"
        report(Finding(Level.BAD, "certificate", found, "Set the clock of this computer."))
        raise GiveUpError
    if now > ends:
        report(Finding(Level.BAD, "certificate", f"ended on {ends:%Y-%m-%d}", _NEW_KEYS))
        raise GiveUpError
    if ends - now < EXPIRES_SOON:
        report(Finding(Level.DOUBT, "certificate", f"ends on {ends:%Y-%m-%d}", _NEW_KEYS))
    else:
        report(Finding(Level.GOOD, "certificate", f"holds until {ends:%Y-%m-%d}"))


def _report_mode(key: Path, report: ReportFinding) -> None:
    if stat.S_IMODE(key.stat().st_mode) & (stat.S_IRWXG | stat.S_IRWXO) and stat.S_ISREG(key.stat().st_mode):
        advice = f"chmod 600 {key}"
        report(
            Finding(Level.DOUBT, "private key", "other users of this computer may read or write it", advice)
        )


def _report_role(common_name: str, role: Role | None, report: ReportFinding) -> None:
    if role in _MAY:
        assert role is not None
        report(Finding(Level.GOOD, "role", f"{common_name}: {_MAY[role]}, if the agent's list has it"))
    elif role is Role.AGENT:
        advice = "Name the folder of a client: read-, halt- or operate-NAME."
        report(
            Finding(Level.BAD, "role", f"{common_name}: the certificate of an agent, not of a client", advice)
        )
    else:
        found = f"{common_name!r}: it names no role, so the agent's own rules decide what it may do"
        advice = "Is it from your own authority? The command fleet keys writes ROLE:NAME."
        report(Finding(Level.DOUBT, "role", found, advice))


REACH_S: Final = 3.0  # timeout for connecting, and for the TLS handshake
SHUT_S: Final = 0.5  # A side that distrusts a certificate hangs up within this time; one that trusts it waits


async def examine_way(route: Route, report: ReportFinding) -> None:
    """Examine every endpoint of a route."""
    endpoints = [parse_endpoint("connect", text) for text in route.endpoints]
    is_open = [await _examine_endpoint(endpoint, route, report) for endpoint in endpoints]
    if not any(is_open):
        raise GiveUpError


async def _examine_endpoint(endpoint: Endpoint, route: Route, report: ReportFinding) -> bool:
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
        advice = "Make keys (robotiq-async fleet keys), unless the network is yours alone."
        report(Finding(Level.DOUBT, "encryption", found, advice))
    return True


async def _is_open(endpoint: Endpoint, report: ReportFinding) -> bool:
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


async def _shake_hands(endpoint: Endpoint, keys: Path, report: ReportFinding) -> bool:
    own = _context(keys, shows=True)
    stays, found = False, "the agent does not trust this certificate"
    advice = "Is it from the same authority? Check the clock of the agent's host, too."
    try:
        stays = await _connect(endpoint, own)
    except ssl.SSLCertVerificationError as error:
        found = f"its certificate is not trusted: {error.verify_message}"
        advice = (
            "It must be from the same authority, still valid, and name the address you connect to "
            "(fleet keys --agent NAME=HOST,...)."
        )
    except OSError as error:
        found = f"no encrypted connection: {str(error) or 'no answer'}"
        advice = "Is it the port of an agent with keys? One without keys listens at tcp/."
    if not stays:
        report(Finding(Level.BAD, "certificates", f"{endpoint.text}: {found}", advice))
        return False
    report(Finding(Level.GOOD, "certificates", f"{endpoint.text}: both sides trust each other"))
    await _try_without(endpoint, keys, report)
    return True


async def _try_without(endpoint: Endpoint, keys: Path, report: ReportFinding) -> None:
    try:
        stays = await _connect(endpoint, _context(keys, shows=False))
    except OSError:
        stays = False
    if stays:
        found = f"{endpoint.text}: clients without a certificate are accepted, too"
        advice = "The program there is no agent with keys, or a router without mutual TLS. Stop it."
        report(Finding(Level.BAD, "no certificate", found, advice))
    else:
        report(Finding(Level.GOOD, "no certificate", "refused, as it must be"))


def _context(keys: Path, *, shows: bool) -> ssl.SSLContext:
    context = ssl.create_default_context(cafile=keys / AUTHORITY)
    if shows:
        context.load_cert_chain(keys / CERTIFICATE, keys / KEY)
    return context


async def _connect(endpoint: Endpoint, context: ssl.SSLContext | None) -> bool:
    """Connect and hang up; returns whether the other side kept the connection open."""
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
