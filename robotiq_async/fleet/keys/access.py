"""Access control: what zenoh lets pass between an agent and each of its clients. What is not here does not.

A rule of zenoh covers an expression if it includes it whole: a subscription that is wider than the rule is
dropped without a word, and so is what is published under a key that no rule names. Roles are told by the
common names in the certificates of both sides.
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
"""The rules that each role adds to those before it."""

Rule = dict[str, object]


def access_control(site: str, host: str, clients: AccessList) -> dict[str, object]:
    """The access control of the agent of a host, for zenoh's configuration: denied is what is not allowed.

    Raises:
        TypeError, ValueError: no such site or host can be.
    """
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
            # An empty list would be no list to zenoh.
            {"id": role.value, "cert_common_names": [role.common_name(name) for name in clients.of(role)]}
            for role in CLIENTS
            if clients.of(role)
        ],
        "policies": [
            {"rules": list(rights(role)), "subjects": [role.value]} for role in CLIENTS if clients.of(role)
        ],
    }


def rights(role: Role) -> tuple[str, ...]:
    """The rules that let somebody in a role do what he may."""
    roles = CLIENTS[: CLIENTS.index(role) + 1]
    return tuple(rule for each in roles for rule in _RIGHTS[each])


def _reading(own: str) -> list[Rule]:
    return [
        # What one gripper publishes, and what a whole fleet does.
        _rule("watch", ("declare_subscriber",), _IN, (f"{own}/*", f"{ROOT}/*/*/*/summary")),
        _rule("published", ("put",), _OUT, (f"{own}/feed", f"{own}/summary")),
        # Peers are told of tokens unasked; clients in zenoh's sense, and routers, ask.
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
    """A request and its answer. Without word of the queryable the client's side asks nobody."""
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
