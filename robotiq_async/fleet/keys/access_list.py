"""The access list: the role of each client. A text file beside the certificates; agents use a copy.

zenoh compares whole names, without patterns, so the list contains every client. A client that is removed from
it has no access, whatever its certificate, after the agents have been restarted with the new list. Do not
give its name to another client: the old certificate would be valid again.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Final, Self

from ..wire.names import check_name

NAME_MAX: Final = 56
"""The common name in a certificate has at most 64 characters, and includes the role."""
_HEAD: Final = """\
# The role of each client. Agents use the copy in their folder, from their next start on.
# To shut a client out, remove its name, here and in the agents' copies, and never give it again:
# the old certificate would be valid again.
"""


class Role(Enum):
    """The purpose of a certificate."""

    AGENT = "agent"
    """Serves grippers."""
    READ = "read"
    """Watches."""
    HALT = "halt"
    """Watches, and halts."""
    OPERATE = "operate"
    """Watches, halts and commands."""

    def common_name(self, name: str) -> str:
        """The common name in the certificate of a role, which zenoh compares."""
        return f"{self.value}:{name}"


CLIENTS: Final = (Role.READ, Role.HALT, Role.OPERATE)


def check_subject(name: object) -> str:
    """Check the name of the owner of a certificate.

    Raises:
        TypeError: not a string.
        ValueError: empty, too long, or with characters that a gripper's name cannot have.
    """
    checked = check_name("the name in a certificate", name)
    if len(checked) > NAME_MAX:
        raise ValueError(f"the name in a certificate must have at most {NAME_MAX} characters, got {name!r}")
    return checked


@dataclass(frozen=True, slots=True)
class AccessList:
    """The clients by role.

    Attributes:
        read: names of clients that watch.
        halt: names of clients that also halt.
        operate: names of clients that also command.
    """

    read: tuple[str, ...] = ()
    halt: tuple[str, ...] = ()
    operate: tuple[str, ...] = ()

    def of(self, role: Role) -> tuple[str, ...]:
        return {Role.READ: self.read, Role.HALT: self.halt, Role.OPERATE: self.operate}[role]

    def including(self, role: Role, name: str) -> Self:
        """A copy with one more client."""
        return replace(self, **{role.value: (*self.of(role), name)})

    @classmethod
    def read_file(cls, path: Path) -> Self:
        """Read a list.

        Raises:
            ValueError: missing or malformed; the message names file and key.
        """
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
            return cls(**_check(table))
        except OSError as error:
            raise ValueError(f"cannot read {path}: {error.strerror or error}") from error
        except (TypeError, ValueError, RecursionError) as error:
            raise ValueError(f"{path}: {error}") from error

    def text(self) -> str:
        lines = [f"{role.value} = {json.dumps(self.of(role))}\n" for role in CLIENTS]
        return _HEAD + "".join(lines)


def _check(table: Mapping[str, object]) -> dict[str, tuple[str, ...]]:
    known = [role.value for role in CLIENTS]
    names: dict[str, tuple[str, ...]] = {}
    for key, value in table.items():
        if key not in known:
            raise ValueError(f"unknown role {key!r}; known are: {', '.join(known)}")
        if not isinstance(value, list):
            raise TypeError(f"{key} must be a list of names, got {value!r}")
        names[key] = tuple(check_subject(name) for name in value)
    return names
