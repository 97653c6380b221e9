"""Access: the role of each client, and the messages of that role.

The access list is a text file beside the certificates; agents use a copy. zenoh compares whole names, without
patterns, so the list contains every client. A client that is removed from it has no access, even with a valid
certificate, after the agents have been restarted with the new list. Do not give its name to another client:
the old certificate would be valid again.

Access control is the part of an agent's configuration with the messages that zenoh passes between it and its
clients. All others are denied.

A rule of zenoh covers an expression only if it includes all of it: zenoh silently drops a subscription that
is wider than the rule, and a message under a key without a rule. The common names in the certificates of both
sides identify the roles.
"""

from __future__ import annotations

import json
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path
from typing import Final, NamedTuple, Self

from ..wire.names import ROOT, check_name

NAME_MAX: Final = 56  # the common name in a certificate has at most 64 characters, and includes the role
_HEAD: Final = """\
# The role of each client. Agents use the copy in their folder, from their next start on.
# To shut a client out, remove its name, here and in the agents' copies, and never give it again:
# the old certificate would be valid again.
"""


class Role(Enum):
    """The purpose of a certificate."""

    AGENT = "agent"  # serves grippers
    READ = "read"  # watches
    HALT = "halt"  # watches, and halts
    OPERATE = "operate"  # watches, halts and commands

    def common_name(self, name: str) -> str:
        """The common name in the certificate of a role, which zenoh compares."""
        return f"{self.value}:{name}"


CLIENTS: Final = (Role.READ, Role.HALT, Role.OPERATE)
_IN: Final = "ingress"  # from the client to the agent
_OUT: Final = "egress"  # from the agent to the client
_SEE: Final = ("declare_liveliness_subscriber", "liveliness_query")
_ASK: Final = ("query",)
_ANSWER: Final = ("declare_queryable", "reply")
"""The client's side sends a request only if it knows of the queryable."""


class Right(NamedTuple):
    """A rule that a role has, and so have the roles after it."""

    name: str
    role: Role
    messages: tuple[str, ...]
    flow: str
    keys: tuple[str, ...]  # below the key of each gripper
    everywhere: tuple[str, ...] = ()  # of a whole fleet


_RIGHTS: Final = (
    Right("watch", Role.READ, ("declare_subscriber",), _IN, ("*",), (f"{ROOT}/*/*/*/summary",)),
    Right("published", Role.READ, ("put",), _OUT, ("feed", "summary")),
    # Peers receive tokens without a query; zenoh clients and routers query them.
    Right("presence", Role.READ, _SEE, _IN, (), (f"{ROOT}/*/*/*/alive/*",)),
    Right("present", Role.READ, ("liveliness_token",), _OUT, ("alive/*",)),
    Right("answer info", Role.READ, _ANSWER, _OUT, ("info/*",)),
    # Clients of version 1 ask there: the answer says that this is another version.
    Right("ask old info", Role.READ, _ASK, _IN, ("info",)),
    Right("answer old info", Role.READ, _ANSWER, _OUT, ("info",)),
    Right("ask halt", Role.HALT, _ASK, _IN, ("halt",)),
    Right("answer halt", Role.HALT, _ANSWER, _OUT, ("halt",)),
    Right("ask lease", Role.OPERATE, _ASK, _IN, ("lease",)),
    Right("answer lease", Role.OPERATE, _ANSWER, _OUT, ("lease",)),
    Right("ask cmd", Role.OPERATE, _ASK, _IN, ("cmd/*",)),
    Right("answer cmd", Role.OPERATE, _ANSWER, _OUT, ("cmd/*",)),
)

Rule = dict[str, object]


def check_subject(name: object) -> str:
    checked = check_name("the name in a certificate", name)
    if len(checked) > NAME_MAX:
        raise ValueError(f"the name in a certificate must have at most {NAME_MAX} characters, got {name!r}")
    return checked


@dataclass(frozen=True, slots=True)
class AccessList:
    """The names of the clients by role."""

    read: tuple[str, ...] = ()  # they watch
    halt: tuple[str, ...] = ()  # they also halt
    operate: tuple[str, ...] = ()  # they also command

    def of(self, role: Role) -> tuple[str, ...]:
        return {Role.READ: self.read, Role.HALT: self.halt, Role.OPERATE: self.operate}[role]

    def including(self, role: Role, name: str) -> Self:
        return replace(self, **{role.value: (*self.of(role), name)})

    @classmethod
    def read_file(cls, path: Path) -> Self:
        """Read a list: ValueError, with file and key, if it is missing or malformed."""
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


def access_control(
    site: str, hosts: Sequence[str], clients: AccessList, *, is_router: bool = False
) -> dict[str, object]:
    """The part of a zenoh configuration that denies everything but the rights of the clients of some agents.

    It belongs to an agent or to a router. At a router the link of each agent has the other side of each
    right, for the keys of its host alone.
    """
    names = [role.common_name(each) for role in CLIENTS for each in clients.of(role)]
    rules = [_rule(right, [_base(site, host) for host in hosts]) for right in _rights_of(names)]
    agents = {
        Role.AGENT.common_name(host): _rules_of_agent(host, _base(site, host), names)
        for host in (hosts if is_router else ())
    }
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*rules, *(rule for own in agents.values() for rule in own)],
        "subjects": [{"id": name, "cert_common_names": [name]} for name in (*names, *agents)],
        "policies": [
            # Roles without clients are left out: zenoh treats an empty list like a missing one.
            *(
                {
                    "rules": list(rights(role)),
                    "subjects": [role.common_name(each) for each in clients.of(role)],
                }
                for role in CLIENTS
                if clients.of(role)
            ),
            *({"rules": [f"ask info {name}"], "subjects": [name]} for name in names),
            *({"rules": [rule["id"] for rule in own], "subjects": [name]} for name, own in agents.items()),
        ],
    }


def _base(site: str, host: str) -> str:
    return f"{ROOT}/{check_name('site', site)}/{check_name('host', host)}/*"


def rights(role: Role) -> tuple[str, ...]:
    roles = CLIENTS[: CLIENTS.index(role) + 1]
    return tuple(right.name for right in _RIGHTS if right.role in roles)


def _rights_of(names: Sequence[str]) -> list[Right]:
    # Each client asks under its own name alone: its budget of questions is counted under that name.
    asking = [Right(f"ask info {name}", Role.READ, _ASK, _IN, (f"info/{name}",)) for name in names]
    return [*_RIGHTS, *asking]


def _rules_of_agent(host: str, own: str, names: Sequence[str]) -> list[Rule]:
    """The rules of a router for the link of an agent: the other side of each right of the clients.

    The agent also sees who else serves its grippers: of two agents of one host the second does not start.
    """
    rights = [right._replace(flow=_OUT if right.flow is _IN else _IN) for right in _rights_of(names)]
    rights += [
        Right("see others", Role.AGENT, _SEE, _IN, ("alive/*",)),
        Right("others", Role.AGENT, ("liveliness_token",), _OUT, ("alive/*",)),
    ]
    return [_rule(right._replace(name=f"agent {host}: {right.name}"), [own]) for right in rights]


def _rule(right: Right, own: Sequence[str]) -> Rule:
    return {
        "id": right.name,
        "permission": "allow",
        "messages": [*right.messages],
        "flows": [right.flow],
        "key_exprs": [*(f"{base}/{key}" for base in own for key in right.keys), *right.everywhere],
    }
