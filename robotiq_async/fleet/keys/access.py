"""Access control: the messages that zenoh passes between an agent and its clients. All others are denied.

A rule of zenoh covers an expression only if it includes all of it: zenoh silently drops a subscription that
is wider than the rule, and a message under a key without a rule. The common names in the certificates of both
sides identify the roles.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

from ..wire.names import ROOT, check_name
from .access_list import CLIENTS, AccessList, Role

_IN: Final = ("ingress",)
"""From the client to the agent."""
_OUT: Final = ("egress",)
"""From the agent to the client."""
_RIGHTS: Final = {
    Role.READ: ("watch", "published", "presence", "present", "ask info", "answer info"),
    Role.HALT: ("ask halt", "answer halt"),
    Role.OPERATE: ("ask lease", "answer lease", "ask cmd", "answer cmd"),
}
"""The rules that each role has in addition to those of the roles before it."""

Rule = dict[str, object]


def access_control(site: str, host: str, clients: AccessList) -> dict[str, object]:
    """The part of an agent's zenoh configuration that denies everything but the rights of its clients."""
    own = f"{ROOT}/{check_name('site', site)}/{check_name('host', host)}/*"
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            *_reading(own),
            *_asking("halt", own, "halt"),
            *_asking("lease", own, "lease"),
            *_asking("cmd", own, "cmd/*"),
        ],
        "subjects": [
            # Roles without clients are left out: zenoh treats an empty list like a missing one.
            {"id": role.value, "cert_common_names": [role.common_name(name) for name in clients.of(role)]}
            for role in CLIENTS
            if clients.of(role)
        ],
        "policies": [
            {"rules": list(rights(role)), "subjects": [role.value]} for role in CLIENTS if clients.of(role)
        ],
    }


def rights(role: Role) -> tuple[str, ...]:
    """The names of all rules of a role."""
    roles = CLIENTS[: CLIENTS.index(role) + 1]
    return tuple(rule for each in roles for rule in _RIGHTS[each])


def _reading(own: str) -> list[Rule]:
    return [
        # The topics of one gripper, and the summaries of a whole fleet.
        _rule("watch", ("declare_subscriber",), _IN, (f"{own}/*", f"{ROOT}/*/*/*/summary")),
        _rule("published", ("put",), _OUT, (f"{own}/feed", f"{own}/summary")),
        # Peers receive tokens without a query; zenoh clients and routers query them.
        _rule(
            "presence",
            ("declare_liveliness_subscriber", "liveliness_query"),
            _IN,
            (f"{ROOT}/*/*/*/alive/*",),
        ),
        _rule("present", ("liveliness_token",), _OUT, (f"{own}/alive/*",)),
        *_asking("info", own, "info"),
    ]


def _asking(name: str, own: str, key: str) -> list[Rule]:
    # A request and its answer. The client's side sends a request only if it knows of the queryable.
    return [
        _rule(f"ask {name}", ("query",), _IN, (f"{own}/{key}",)),
        _rule(f"answer {name}", ("declare_queryable", "reply"), _OUT, (f"{own}/{key}",)),
    ]


def _rule(name: str, messages: Sequence[str], flows: Sequence[str], keys: Sequence[str]) -> Rule:
    return {
        "id": name,
        "permission": "allow",
        "messages": list(messages),
        "flows": list(flows),
        "key_exprs": list(keys),
    }
