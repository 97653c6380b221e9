"""Checks every request and every websocket before it reaches the page."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Awaitable, Callable, MutableMapping
from contextlib import suppress
from html import escape
from typing import Any, Final
from urllib.parse import parse_qs
from weakref import WeakValueDictionary

from .access import Access, AccessDecision, Head

AsgiMessage = MutableMapping[str, Any]
Receive = Callable[[], Awaitable[AsgiMessage]]
AsgiSend = Callable[[AsgiMessage], Awaitable[None]]
App = Callable[[AsgiMessage, Receive, AsgiSend], Awaitable[None]]

TRY_S: Final = 1.0
"""Duration of a wrong attempt; the next one from the same address waits for it."""
WAITING: Final = 8  # attempts of one address at a time: each keeps a connection of the page
FORM_S: Final = 10.0
MAX_FORM: Final = 4096

HEADERS: Final = {
    # No library may fetch anything from other hosts.
    "content-security-policy": "default-src 'self' 'unsafe-inline' 'unsafe-eval' data: blob:;"
    " frame-ancestors 'none'; base-uri 'none'; form-action 'self'",
    "cross-origin-resource-policy": "same-origin",
    # Not no-referrer: a browser then sends the form of the password with "Origin: null".
    "referrer-policy": "same-origin",
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
}
_PASSWORD_PAGE: Final = """<!doctype html><html lang="en"><meta charset="utf-8"><title>Robotiq gripper</title>
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="color-scheme" content="light dark">
<style>body{font:1.1em sans-serif;max-width:30em;margin:15vh auto;padding:0 1em}
input,button{font:inherit;padding:.4em}
</style><h1>Robotiq gripper</h1>"""
_PASSWORD_FORM: Final = """<form method="post" action="/"><label>Password <input type="password"
 name="password" autofocus autocomplete="current-password"></label> <button>Enter</button></form>"""


class Guard:
    """An ASGI application that passes on only requests that the rules allow."""

    def __init__(self, app: App, access: Access) -> None:
        self.app = app
        self._access = access
        self._trying: WeakValueDictionary[str, asyncio.Lock] = WeakValueDictionary()
        """Locks by address: many attempts from one address do not delay attempts from others."""
        self._waiting: Counter[str] = Counter()  # attempts by address

    async def __call__(self, scope: AsgiMessage, receive: Receive, send: AsgiSend) -> None:
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        verdict = self._access.judge(_head(scope))
        if verdict is AccessDecision.SERVE:
            await self.app(scope, receive, _with_headers(send))
        elif scope["type"] == "websocket":
            await receive()
            await send({"type": "websocket.close", "code": 1008})
        elif verdict is AccessDecision.LET_IN:
            await self._let_in(send)
        elif verdict is AccessDecision.ASK:
            await self._ask(scope, receive, send)
        else:
            await _answer(send, 403, f"<p>{escape(verdict.value)}.</p>")

    async def _ask(self, scope: AsgiMessage, receive: Receive, send: AsgiSend) -> None:
        if scope["method"] != "POST":
            await _answer(send, 200, _PASSWORD_FORM)
            return
        password = parse_qs((await _body(receive)).decode("utf-8", "replace")).get("password", [""])[0]
        address = scope["client"][0]
        if self._waiting[address] >= WAITING:
            await _answer(send, 429, f"<p>Too many attempts at a time: try again.</p>{_PASSWORD_FORM}")
            return
        self._waiting[address] += 1
        try:
            async with self._trying.setdefault(address, asyncio.Lock()):
                right = self._access.knows(password)
                if not right:
                    await asyncio.sleep(TRY_S)
        finally:
            self._waiting -= Counter([address])  # that also forgets one without attempts
        if right:
            await self._let_in(send)
        else:
            await _answer(send, 403, f"<p>That is not the password.</p>{_PASSWORD_FORM}")

    async def _let_in(self, send: AsgiSend) -> None:
        location = f"{self._access.settings.folder}/"
        await _answer(send, 303, "", {"location": location, "set-cookie": self._access.cookie})


def _head(scope: AsgiMessage) -> Head:
    headers: dict[str, str] = {}
    for name, value in scope["headers"]:
        key, text = name.decode("latin-1"), value.decode("latin-1")
        headers[key] = f"{headers[key]}, {text}" if key in headers else text  # two origins match no rule
    method = scope.get("method", "")
    return Head(method, scope["path"], scope["query_string"].decode("latin-1"), headers)


async def _body(receive: Receive) -> bytes:
    # Truncated if it is long or slow.
    body, more = b"", True
    with suppress(TimeoutError):
        async with asyncio.timeout(FORM_S):
            while more and len(body) < MAX_FORM:
                message = await receive()
                body += message.get("body", b"")
                more = message.get("more_body", False)
    return body[:MAX_FORM]


async def _answer(send: AsgiSend, status: int, words: str, more: dict[str, str] | None = None) -> None:
    fields = {
        "content-type": "text/html; charset=utf-8",
        "cache-control": "no-store",
        "connection": "close",  # else a stranger keeps it with half a second request
        **HEADERS,
        **(more or {}),
    }
    headers = [(name.encode(), value.encode("latin-1")) for name, value in fields.items()]
    await send({"type": "http.response.start", "status": status, "headers": headers})
    await send({"type": "http.response.body", "body": (_PASSWORD_PAGE + words).encode()})


def _with_headers(send: AsgiSend) -> AsgiSend:
    added = [(name.encode(), value.encode()) for name, value in HEADERS.items()]

    async def sent(message: AsgiMessage) -> None:
        if message["type"] == "http.response.start":
            message = {**message, "headers": [*message.get("headers", ()), *added]}
        await send(message)

    return sent
