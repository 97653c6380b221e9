"""Callbacks for everything that happens to a hand, called before any waiting task goes on."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any

from ..runtime.log import Log, log

Listener = Callable[[Any], None]


class Listeners:
    """Calls every listener with every item, in order. A listener that raises is logged and removed."""

    def __init__(self, log: Log = log) -> None:
        self._log = log
        self._listeners: dict[object, Listener] = {}
        """By a key of their own: the same callback may be added twice."""
        self._items: deque[object] = deque()
        self._is_telling = False

    def add(self, listener: Listener) -> Callable[[], None]:
        """Add a listener; return a function that removes it, and may be called twice."""
        key = object()
        self._listeners[key] = listener
        return lambda: self._remove(key)

    def tell(self, item: object) -> None:
        """Call every listener. What a listener itself brings about comes after the present item."""
        if not self._listeners:
            return  # the common case, at every poll
        self._items.append(item)
        if self._is_telling:
            return
        self._is_telling = True
        try:
            while self._items:
                self._tell(self._items.popleft())
        finally:
            self._is_telling = False

    def _tell(self, item: object) -> None:
        for key, listener in list(self._listeners.items()):
            if key not in self._listeners:
                continue  # removed by another one, just now
            try:
                listener(item)
            except (Exception, asyncio.CancelledError):  # noqa: BLE001  # no listener may end the poller task
                self._remove(key)
                self._log.exception("a listener raised, and is no longer called: %r", listener)

    def _remove(self, key: object) -> None:
        self._listeners.pop(key, None)
