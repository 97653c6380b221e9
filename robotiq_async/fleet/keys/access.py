"""Access: the role of each client, and the messages of that role.

The access list is a text file beside the certificates; agents use a copy. zenoh compares whole names, without
patterns, so the list contains every client. A client that is removed from it has no access, whatever its
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
from typing import Final, Self

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
_IN: Final = ("ingress",)  # from the client to the agent
_OUT: Final = ("egress",)  # from the agent to the client
_RIGHTS: Final = {
    Role.READ: (
        "watch",
        "published",
        "presence",
        "present",
        "answer info",
        "ask old info",
        "answer old info",
    ),
    Role.HALT: ("ask halt", "answer halt"),
    Role.OPERATE: ("ask lease", "answer lease", "ask cmd", "answer cmd"),
}
"""The rules that each role has in addition to those of the roles before it."""

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

    It is an agent's, or that of a router: there the link of each agent has the other side of each right, for
    the keys of its own host alone.
    """
    names = [role.common_name(each) for role in CLIENTS for each in clients.of(role)]
    rules = _rules([_base(site, host) for host in hosts], names)
    agents = {
        Role.AGENT.common_name(host): [_other_side(rule, host) for rule in _rules([_base(site, host)], names)]
        for host in (hosts if is_router else ())
    }
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [*rules, *(rule for own in agents.values() for rule in own)],
        # Each client asks under its own name alone: that is what its budget of questions is counted by.
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
    return tuple(rule for each in roles for rule in _RIGHTS[each])


def _rules(own: Sequence[str], names: Sequence[str]) -> list[Rule]:
    return [
        *_reading(own),
        *(_rule(f"ask info {name}", ("query",), _IN, _below(own, f"info/{name}")) for name in names),
        *_asking("halt", own, "halt"),
        *_asking("lease", own, "lease"),
        *_asking("cmd", own, "cmd/*"),
    ]


def _reading(own: Sequence[str]) -> list[Rule]:
    return [
        # The topics of one gripper, and the summaries of a whole fleet.
        _rule("watch", ("declare_subscriber",), _IN, (*_below(own, "*"), f"{ROOT}/*/*/*/summary")),
        _rule("published", ("put",), _OUT, _below(own, "feed", "summary")),
        # Peers receive tokens without a query; zenoh clients and routers query them.
        _rule(
            "presence",
            ("declare_liveliness_subscriber", "liveliness_query"),
            _IN,
            (f"{ROOT}/*/*/*/alive/*",),
        ),
        _rule("present", ("liveliness_token",), _OUT, _below(own, "alive/*")),
        _asking("info", own, "info/*")[1],
        # Clients of version 1 ask there, and get to know that this is another one.
        *_asking("old info", own, "info"),
    ]


def _asking(name: str, own: Sequence[str], key: str) -> list[Rule]:
    # A request and its answer. The client's side sends a request only if it knows of the queryable.
    return [
        _rule(f"ask {name}", ("query",), _IN, _below(own, key)),
        _rule(f"answer {name}", ("declare_queryable", "reply"), _OUT, _below(own, key)),
    ]


def _below(own: Sequence[str], *keys: str) -> list[str]:
    return [f"{base}/{key}" for base in own for key in keys]


def _other_side(rule: Rule, host: str) -> Rule:
    # What comes from the clients goes to the agent, and what comes from there goes to them.
    flows = list(_OUT if rule["flows"] == list(_IN) else _IN)
    return {**rule, "id": f"agent {host}: {rule['id']}", "flows": flows}


def _rule(name: str, messages: Sequence[str], flows: Sequence[str], keys: Sequence[str]) -> Rule:
    return {
        "id": name,
        "permission": "allow",
        "messages": list(messages),
        "flows": list(flows),
        "key_exprs": list(keys),
    }
