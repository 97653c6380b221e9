"""FLEET.toml: the grippers that an agent serves, their names, and where it listens."""

from __future__ import annotations

import re
import socket
import tomllib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, fields
from difflib import get_close_matches
from itertools import combinations
from pathlib import Path
from typing import Any, Final

from ..fleet.control.lease import LEASE_WINDOW_S, WINDOW_MAX_S, WINDOW_MIN_S
from ..fleet.keys.access import AccessList
from ..fleet.keys.key_folder import ACCESS, check_key_folder
from ..fleet.network.configuration import LOOPBACK_ENDPOINT, LOOPBACK_TLS, check_trust
from ..fleet.network.endpoints import check_endpoints
from ..fleet.wire.names import check_name
from ..hands import HandOptions
from ..values import check_seconds

_GRIPPERS: Final = "grippers"
Names = tuple[str, ...]
_KEY_OF_LINE: Final = re.compile(r"""\s*((?:"[^"\n]*"|'[^'\n]*'|[A-Za-z0-9_.\s-])+)=""")


class AgentFileError(ValueError):
    """A FLEET.toml that an agent cannot use; the message names file, line, key, value and range."""


@dataclass(frozen=True, slots=True)
class AgentSettings:
    """The content of FLEET.toml, checked."""

    site: str
    grippers: Mapping[str, HandOptions]  # by the name of the hand
    host: str = field(default_factory=lambda: machine_name())
    listen: tuple[str, ...] = (LOOPBACK_ENDPOINT,)  # endpoints of zenoh for clients; none with a router
    connect: tuple[str, ...] = ()  # endpoints of a router, through which clients connect
    keys: Path | None = None  # folder with the agent's certificate and key; None for no encryption
    insecure: bool = False  # whether other machines may connect without encryption
    trusts_router: bool = False  # whether the rules of the router in connect stand in for the access list
    window: float = LEASE_WINDOW_S  # seconds for which a lease lasts without being renewed


_OF_AGENT: Final = tuple(each.name for each in fields(AgentSettings))


def machine_name() -> str:
    """This machine's name, with characters replaced that a key cannot have."""
    return re.sub(r"[^A-Za-z0-9_.-]+", "-", socket.gethostname())[:64] or "host"


def read_agent_file(path: str | Path) -> AgentSettings:
    """Read and check a FLEET.toml; AgentFileError if it cannot be read, or its content is invalid."""
    path = Path(path)
    try:
        text = path.read_text(encoding="utf-8-sig")  # editors on Windows may begin it with a mark
    except OSError as error:
        raise AgentFileError(f"cannot read {path}: {error.strerror or error}") from error
    except UnicodeDecodeError as error:
        raise AgentFileError(f"{path}: not UTF-8: {error.reason} at byte {error.start}") from error
    return _Reader(path, text).settings()


class _Reader:
    def __init__(self, path: Path, text: str) -> None:
        self._path = path
        self._text = text

    def settings(self) -> AgentSettings:
        table = self._table()
        self._check_place_of_keys(table.get(_GRIPPERS))
        self._check_keys_of(table, (), _OF_AGENT, needed=("site", _GRIPPERS))
        with self._blaming("site"):
            site = check_name("site", table["site"])
        with self._blaming("host"):
            host = check_name("host", table.get("host", machine_name()))
        with self._blaming("window"):
            window = check_seconds("window", table.get("window", LEASE_WINDOW_S), WINDOW_MIN_S, WINDOW_MAX_S)
        with self._blaming("insecure"):
            insecure = _check_bool("insecure", table.get("insecure", False))
        with self._blaming("keys"):
            keys = self._keys(table.get("keys"))
        with self._blaming("connect"):
            wanted = _check_list("connect", table.get("connect", []))
            connect = check_endpoints("connect", wanted, has_keys=keys is not None, insecure=insecure)
        default = [] if connect else [LOOPBACK_ENDPOINT if keys is None else LOOPBACK_TLS]
        with self._blaming("listen"):
            wanted = _check_list("listen", table.get("listen", default))
            listen = check_endpoints("listen", wanted, has_keys=keys is not None, insecure=insecure)
            if listen and connect:
                why = "clients connect there, or through a router"
                raise ValueError(f"listen and connect cannot be combined: {why}, got {wanted!r}")
        with self._blaming("trusts_router"):
            trusts = check_trust(
                table.get("trusts_router", False), listen, connect, has_keys=keys is not None
            )
        return AgentSettings(
            site, self._grippers(table[_GRIPPERS]), host, listen, connect, keys, insecure, trusts, window
        )

    def _table(self) -> dict[str, Any]:
        try:
            return tomllib.loads(self._text)
        except tomllib.TOMLDecodeError as error:
            what, _, where = str(error).partition(" (at ")
            where = f", {where.rstrip(')')}" if where else ""
            raise AgentFileError(f"{self._path}{where}: not TOML: {what}") from error
        except RecursionError as error:
            raise AgentFileError(f"{self._path}: not TOML: nested too deeply") from error

    def _keys(self, value: object) -> Path | None:
        if value is None:
            return None
        if not isinstance(value, str) or not value or "\0" in value:
            raise TypeError(f"keys must be the path of a folder, got {value!r}")
        folder = check_key_folder(self._path.parent / value)
        AccessList.read_file(folder / ACCESS)
        return folder

    def _grippers(self, tables: object) -> dict[str, HandOptions]:
        with self._blaming(_GRIPPERS):
            if not isinstance(tables, dict) or not tables:
                raise ValueError(f"a table for each gripper is needed: [grippers.left], got {tables!r}")
        grippers = {name: self._gripper(name, table) for name, table in tables.items()}
        for one, other in combinations(grippers, 2):
            with self._blaming(_GRIPPERS, other, "address"):
                first, second = grippers[one], grippers[other]
                if why := second.link.why_not_beside(first.link):
                    why = why.replace("hands", "grippers")
                    raise ValueError(f"address must go with {one}'s, {first.address!r}: {why}")
        return grippers

    def _gripper(self, name: str, table: object) -> HandOptions:
        path = (_GRIPPERS, name)
        with self._blaming(*path):
            check_name("the name of a gripper", name)
            if not isinstance(table, dict):
                raise TypeError(f"{name} must be a table with an address: [grippers.{name}], got {table!r}")
        self._check_keys_of(table, path, HandOptions.in_files(), needed=("address",))
        if isinstance(table.get("stroke"), str):
            table = {**table, "stroke": self._path.parent / table["stroke"]}
        address, model = table["address"], table.get("model")
        with self._blaming(*path, "model"):
            HandOptions(model=model)  # type: ignore[arg-type]  # None: as the address says
        with self._blaming(*path, "address"):
            HandOptions(address, model=model)  # type: ignore[arg-type]
        for key, value in table.items():  # one by one: the error names the line of the key
            with self._blaming(*path, key):
                HandOptions(**{"address": address, "model": model, key: value})
        return HandOptions(name=name, **table)

    def _check_keys_of(
        self,
        table: Mapping[str, object],
        path: Names,
        known: tuple[str, ...],
        needed: tuple[str, ...],
    ) -> None:
        for key in table:
            if key not in known:
                near = get_close_matches(key, known, 1)
                hint = f"did you mean {near[0]}?" if near else f"known keys are {', '.join(known)}"
                raise self._error((*path, key), f"unknown key {key!r}; {hint}")
        for key in needed:
            if key not in table:
                what = "[grippers.NAME], a table for each gripper" if key == _GRIPPERS else key
                raise self._error(path, f"missing: {what}")

    def _check_place_of_keys(self, tables: object) -> None:
        # In TOML a key after the header of a table belongs to that table.
        for name, table in tables.items() if isinstance(tables, dict) else ():
            for key in _OF_AGENT if isinstance(table, dict) else ():
                if key in table:
                    raise self._error(
                        (_GRIPPERS, name, key), f"{key!r} is the agent's: put it above [grippers.{name}]"
                    )

    @contextmanager
    def _blaming(self, *path: str) -> Iterator[None]:
        # Adds file and line of the key to the error of a check.
        try:
            yield
        except (TypeError, ValueError, ImportError) as error:  # the last of a simulation with physics
            raise self._error(path, str(error)) from error

    def _error(self, path: Names, message: str) -> AgentFileError:
        line = line_of(self._text, path)
        where = str(self._path) if line is None else f"{self._path}, line {line}"
        if len(path) > 1:
            where += f", in [{path[0]}.{path[1]}]"
        return AgentFileError(f"{where}: {message}")


def _check_bool(name: str, value: object) -> bool:
    if not isinstance(value, bool):
        raise TypeError(f"{name} must be true or false, got {value!r}")
    return value


def _check_list(name: str, value: object) -> list[object]:
    if not isinstance(value, list):
        raise TypeError(f"{name} must be a list of endpoints, got {value!r}")
    return value


def line_of(text: str, path: Names) -> int | None:
    """The line, counted from 1, of the key or the table at a path; None if it is not certain.

    tomllib does not have it. Inside an inline table or an array it is the line where that begins. The search
    looks at single lines, and a multi-line string may contain text that looks like a key.
    """
    for length in range(len(path), 0, -1):
        lines = [number for number, found in _keys(text) if found == path[:length]]
        if lines:
            return lines[0] if len(lines) == 1 else None
    return None


def _keys(text: str) -> Iterator[tuple[int, Names]]:
    """Line number and path of each line that begins with a key or is the header of a table."""
    table: Names = ()
    for number, line in enumerate(text.splitlines(), 1):
        if line.lstrip().startswith("["):
            table = _path(line) or table
            yield number, table
        elif (found := _KEY_OF_LINE.match(line)) is not None:
            yield number, table + _path(f"{found[1]}= 0")


def _path(line: str) -> Names:
    """The nested names on a line; empty if the line is not TOML."""
    try:
        found: object = tomllib.loads(line)
    except tomllib.TOMLDecodeError:
        return ()
    names: list[str] = []
    while isinstance(found, dict) and found:
        name, found = next(iter(found.items()))
        names.append(name)
    return tuple(names)
