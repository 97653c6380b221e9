"""GripperName: site, host and name of a gripper, with its address and its keys."""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Final, Self
from zlib import crc32

SCHEME: Final = "zenoh://"
ROOT: Final = "robotiq/v1"
"""Prefix of every key, the same in all versions of the protocol: so that each sees and refuses the others."""
VERSION: Final = 2  # of the protocol (docs/fleet-protocol.md)
FORM: Final = "zenoh://SITE/HOST/GRIPPER"
_NAME: Final = re.compile(r"[A-Za-z0-9_.-]{1,64}")


def other_version(what: str, version: object) -> str:
    return f"{what} of version {version!r} of the protocol; here it is {VERSION}: update the older side"


def check_name(what: str, name: object) -> str:
    """Check the name of a site, a host or a gripper: 1..64 of ``A-Z a-z 0-9 _ . -``, so never a wildcard."""
    if not isinstance(name, str):
        raise TypeError(f"{what} must be a string, got {name!r}")
    if not _NAME.fullmatch(name):
        raise ValueError(f"{what} must be 1..64 of the characters A-Z a-z 0-9 _ . -, got {name!r}")
    return name


@dataclass(frozen=True, slots=True, order=True)
class GripperName:
    """One gripper of a fleet.

    Attributes:
        site: the site's name.
        host: the name of the host whose agent owns the gripper.
        gripper: the gripper's name on that host.

    Raises:
        TypeError: a name is not a string.
        ValueError: a name is not 1..64 of ``A-Z a-z 0-9 _ . -``.
    """

    site: str
    host: str
    gripper: str

    def __post_init__(self) -> None:
        for part in self.__slots__:
            check_name(part, getattr(self, part))

    @classmethod
    def parse(cls, address: object) -> Self:
        """The gripper that an address ``zenoh://SITE/HOST/GRIPPER`` names.

        Raises:
            TypeError: not a string.
            ValueError: malformed; the message gives the reason, but does not repeat the address.
        """
        if not isinstance(address, str):
            raise TypeError(f"address must be a string, got {address!r}; accepted: {FORM}")
        parts = address[len(SCHEME) :].split("/")
        if address[: len(SCHEME)].lower() != SCHEME or len(parts) != 3:
            raise ValueError(f"it must be {FORM}")
        return cls(*parts)

    @classmethod
    def of_key(cls, key: str) -> Self:
        """The gripper that a key belongs to.

        Raises:
            ValueError: not a key of a gripper.
        """
        if not key.startswith(f"{ROOT}/") or key.count("/") < 5:
            raise ValueError(f"not a key of a gripper: {key!r}")
        return cls(*key.split("/")[2:5])

    @property
    def base(self) -> str:
        """The prefix of every key of the gripper."""
        return f"{ROOT}/{self.site}/{self.host}/{self.gripper}"

    @property
    def mark(self) -> int:
        """32 bits that identify the gripper in binary messages: the CRC-32 of :attr:`base`."""
        return crc32(self.base.encode())

    def key(self, *parts: str) -> str:
        """A key of the gripper: :attr:`base` and these parts."""
        return "/".join((self.base, *parts))

    def question(self, who: str) -> str:
        """The key under which a client asks about the gripper."""
        return self.key("info", who)

    def __str__(self) -> str:
        return f"{SCHEME}{self.site}/{self.host}/{self.gripper}"
