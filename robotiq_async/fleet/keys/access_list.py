"""The access list: which client has which role. A text file beside the certificates; agents go by a copy.

zenoh compares whole names and knows no patterns, so every client that is to get in stands in the list. Who is
taken out of it gets nothing, whatever certificate they have, once the agents have been started with the new
list. Nobody else is to get such a name: the old certificate would open again.
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
"""A common name in a certificate has at most 64 characters, and the role stands before it."""
_HEAD: Final = """\
# Which client may do what. Agents go by the copy in their folder, from their next start on.
# To shut a client out, take its name away, here and in the agents' copies, and never give it again:
# the old certificate would open.
"""


class Role(Enum):
    """What a certificate is for."""

    AGENT = "agent"
    """Serves grippers."""
    READ = "read"
    """Watches."""
    HALT = "halt"
    """Watches, and halts."""
    OPERATE = "operate"
    """Watches, halts and commands."""

    def common_name(self, name: str) -> str:
        """What stands in the certificate of somebody in this role, and what zenoh compares."""
        return f"{self.value}:{name}"


CLIENTS: Final = (Role.READ, Role.HALT, Role.OPERATE)


def check_subject(name: object) -> str:
    """The name of somebody who gets a certificate.

    Raises:
        TypeError: not a string.
        ValueError: empty, too long, or with other characters than a gripper's name has.
    """
    checked = check_name("the name in a certificate", name)
    if len(checked) > NAME_MAX:
        raise ValueError(f"the name in a certificate must have at most {NAME_MAX} characters, got {name!r}")
    return checked


@dataclass(frozen=True, slots=True)
class AccessList:
    """The clients by role.

    Attributes:
        read: names of those who watch.
        halt: names of those who also halt.
        operate: names of those who also command.
    """

    read: tuple[str, ...] = ()
    halt: tuple[str, ...] = ()
    operate: tuple[str, ...] = ()

    def of(self, role: Role) -> tuple[str, ...]:
        """The names in a role of clients."""
        return {Role.READ: self.read, Role.HALT: self.halt, Role.OPERATE: self.operate}[role]

    def including(self, role: Role, name: str) -> Self:
        """The same with one more."""
        return replace(self, **{role.value: (*self.of(role), name)})

    @classmethod
    def read_file(cls, path: Path) -> Self:
        """The list in a file.

        Raises:
            ValueError: there is none, or it is malformed; the message names file and key.
        """
        try:
            table = tomllib.loads(path.read_text(encoding="utf-8"))
            return cls(**_check(table))
        except OSError as error:
            raise ValueError(f"cannot read {path}: {error.strerror or error}") from error
        except (TypeError, ValueError, RecursionError) as error:
            raise ValueError(f"{path}: {error}") from error

    def text(self) -> str:
        """The file's text."""
        lines = [f"{role.value} = {json.dumps(self.of(role))}\n" for role in CLIENTS]
        return _HEAD + "".join(lines)


def _check(table: Mapping[str, object]) -> dict[str, tuple[str, ...]]:
    """The names by role.

    Raises:
        TypeError, ValueError: something else is in it.
    """
    known = [role.value for role in CLIENTS]
    names: dict[str, tuple[str, ...]] = {}
    for key, value in table.items():
        if key not in known:
            raise ValueError(f"unknown role {key!r}; known are: {', '.join(known)}")
        if not isinstance(value, list):
            raise TypeError(f"{key} must be a list of names, got {value!r}")
        names[key] = tuple(check_subject(name) for name in value)
    return names
