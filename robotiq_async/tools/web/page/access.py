"""Decides from the head of a request whether it may pass. Pure.

Three checks for every request and every websocket:

- Host must be a name of this server. That refuses names of other sites that resolve to this machine (DNS
  rebinding).
- Origin must be this server. It may be missing only in a GET or HEAD. A page of another site can make a
  browser send requests, but cannot forge their origin.
- The cookie must be there. A browser gets it for the token of the printed address, or for the password.
"""

from __future__ import annotations

import hmac
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Final
from urllib.parse import parse_qs

from ..settings import PageSettings

COOKIE: Final = "robotiq_async"
_LOCAL: Final = ("127.0.0.1", "localhost", "[::1]")


class AccessDecision(Enum):
    """The decision about a request."""

    SERVE = "it is served"
    LET_IN = "it gets the cookie, and is sent on"
    ASK = "it is asked for the password"
    WRONG_HOST = "this is not the address that robotiq-async printed"
    WRONG_ORIGIN = "pages of other sites have no access"
    NO_TOKEN = "open the address that robotiq-async printed: it holds the token"


@dataclass(frozen=True, slots=True)
class Head:
    """The parts of a request that the decision needs."""

    method: str  # of HTTP; empty for a websocket
    path: str  # without the query
    query: str = ""  # as it was sent
    headers: Mapping[str, str] = field(default_factory=dict)  # with lower-case names


class Access:
    """The rules of one server, and its secret cookie."""

    def __init__(self, settings: PageSettings, port: int) -> None:
        self.settings = settings
        self._session = secrets.token_urlsafe(24)
        named = f"[{settings.host}]" if ":" in settings.host else settings.host
        names = (named, *_LOCAL) if settings.loopback else (named,)
        self._hosts = {f"{name.lower()}:{port}" for name in names}
        # Browsers omit the default port.
        if port == (443 if settings.certificate else 80):
            self._hosts |= {name.lower() for name in names}

    def judge(self, head: Head) -> AccessDecision:
        """Decide about a request."""
        host = head.headers.get("host", "").lower()
        # On another interface the server does not know its own names; the cookie belongs to the right one.
        if not host or (self.settings.loopback and host not in self._hosts):
            return AccessDecision.WRONG_HOST
        origin = head.headers.get("origin")
        needs_origin = head.method not in ("GET", "HEAD")
        if (origin is None and needs_origin) or not self._is_ours(origin, host):
            return AccessDecision.WRONG_ORIGIN
        if head.path.startswith(f"{self.settings.folder}/") and self._has_cookie(head):
            return AccessDecision.SERVE
        if head.path == "/" and head.method in ("GET", "POST"):
            return self._login(head)
        return AccessDecision.NO_TOKEN

    def knows(self, password: str) -> bool:
        """Whether this is the password."""
        return bool(self.settings.password) and _same(password, self.settings.password)

    @property
    def cookie(self) -> str:
        """The header that lets a browser in. Scripts and pages of other sites cannot use the cookie.

        Lax, not Strict: browsers do not send a strict cookie after a link in another page (a terminal in the
        browser, a chat). The check of the origin covers the difference.
        """
        secure = "; Secure" if self.settings.certificate else ""
        path = self.settings.folder
        return f"{COOKIE}={self._session}; Path={path}; HttpOnly; SameSite=Lax{secure}"

    def _login(self, head: Head) -> AccessDecision:
        if self.settings.password:
            return AccessDecision.ASK
        token = parse_qs(head.query).get("token", [""])[0]
        is_right = head.method == "GET" and _same(token, self.settings.token)
        return AccessDecision.LET_IN if is_right else AccessDecision.NO_TOKEN

    def _is_ours(self, origin: str | None, host: str) -> bool:
        return origin is None or origin.lower() == f"{self.settings.scheme}://{host}"

    def _has_cookie(self, head: Head) -> bool:
        # Not http.cookies: other servers of this machine have cookies, too, and a parser stops at the first
        # invalid one, or takes the last of two with the same name.
        ours = f"{COOKIE}={self._session}"
        return any(_same(each.strip(), ours) for each in head.headers.get("cookie", "").split(";"))


def _same(one: str, other: str) -> bool:
    # In constant time: the duration must not reveal how much is right.
    return hmac.compare_digest(one.encode("utf-8", "replace"), other.encode())
