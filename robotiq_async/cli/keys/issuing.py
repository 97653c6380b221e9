"""Makes the folder of a certificate authority, with a folder for each agent and each client.

::

    FOLDER/
        ca.pem, ca.key      the authority; ca.key can give anyone access, so it never leaves this folder
        access.toml         the role of each client
        agent-cell-1/       for the host cell-1: ca.pem, cert.pem, key.pem, access.toml
        operate-bob/        for Bob: ca.pem, cert.pem, key.pem
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Final

from ...fleet.keys.access import AccessList, Role, check_subject
from ...fleet.keys.key_folder import ACCESS, AUTHORITY, CERTIFICATE, KEY
from ...values import check_int
from .authority import DAYS_MAX, Authority, Pair

AUTHORITY_KEY: Final = "ca.key"
AUTHORITY_DAYS: Final = 3650
DAYS: Final = 825  # default validity of a certificate; some systems reject longer ones
LOOPBACK_NAMES: Final = ("localhost", "127.0.0.1", "::1")  # names of every agent on its own machine


def has_authority(folder: Path) -> bool:
    """Whether a folder has an authority, or a part of one."""
    return any((folder / name).exists() for name in (AUTHORITY, AUTHORITY_KEY, ACCESS))


def make_authority(folder: Path, *, days: int = AUTHORITY_DAYS) -> Path:
    """Make a certificate authority with an empty access list; returns the path of its certificate.

    Raises:
        FileExistsError: the folder has an authority already.
        OSError: the folder cannot be written.
        TypeError, ValueError: days not in 1..36500.
    """
    days = check_int("days", days, 1, DAYS_MAX)
    if has_authority(folder):
        raise FileExistsError(f"there is already an authority in {folder}")
    pair = Authority.make(days).pair()
    folder.mkdir(mode=0o700, parents=True, exist_ok=True)
    _write_new(folder / AUTHORITY_KEY, pair.key, secret=True)
    _write_new(folder / AUTHORITY, pair.certificate)
    _write_new(folder / ACCESS, AccessList().text().encode())
    return folder / AUTHORITY


def issue(folder: Path, name: str, role: Role, *, hosts: Sequence[str] = (), days: int = DAYS) -> Path:
    """Make a key and a certificate for an agent or a client, and add a client to the access lists.

    ``hosts`` are names and IP addresses that clients use for the agent; loopback is added. Returns the
    folder for that machine.

    Raises:
        FileExistsError: the folder exists already.
        OSError: there is no authority, or the folder cannot be written.
        TypeError, ValueError: a malformed name or host; days not in range, or beyond the end of the
            authority; hosts for a client; a malformed file of the authority.
    """
    check_subject(name)
    days = check_int("days", days, 1, DAYS_MAX)
    if hosts and role is not Role.AGENT:
        raise ValueError(f"hosts are for agents, but {name!r} is a client")
    own = subject_folder(folder, name, role)
    if own.exists():
        raise FileExistsError(f"{own} already exists")
    authority = _load(folder)
    clients = AccessList.read_file(folder / ACCESS)
    server_names = tuple(dict.fromkeys((*hosts, *LOOPBACK_NAMES))) if role is Role.AGENT else ()
    until = datetime.now(UTC) + timedelta(days=days)
    pair = authority.certify(role.common_name(name), until, server_names)
    own.mkdir(mode=0o700)
    _write_new(own / KEY, pair.key, secret=True)
    _write_new(own / CERTIFICATE, pair.certificate)
    _write_new(own / AUTHORITY, authority.pair().certificate)
    if role is Role.AGENT:
        _write_new(own / ACCESS, clients.text().encode())
    elif name not in clients.of(role):
        _enter(folder, clients.including(role, name))
    return own


def subject_folder(folder: Path, name: str, role: Role) -> Path:
    return folder / f"{role.value}-{name}"


def access_lists(folder: Path) -> list[Path]:
    """The access list of an authority, and the copies in its agents' folders."""
    return [folder / ACCESS, *sorted(folder.glob(f"{Role.AGENT.value}-*/{ACCESS}"))]


def _load(folder: Path) -> Authority:
    try:
        return Authority.load(Pair((folder / AUTHORITY).read_bytes(), (folder / AUTHORITY_KEY).read_bytes()))
    except (TypeError, ValueError) as error:
        raise ValueError(f"{folder / AUTHORITY} and {AUTHORITY_KEY}: {error}") from error


def _enter(folder: Path, clients: AccessList) -> None:
    # Each file is replaced in one step, so that an interruption leaves the old list or the new one.
    for path in access_lists(folder):
        beside = path.with_suffix(".new")
        beside.write_text(clients.text(), encoding="utf-8")
        beside.replace(path)


def _write_new(path: Path, data: bytes, *, secret: bool = False) -> None:
    # Opened with its final mode: other users could read a secret between its creation and a chmod.
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600 if secret else 0o644)
    with open(descriptor, "wb") as file:
        file.write(data)
