"""Callbacks that are told at once what happens to a hand, before anybody who waits wakes up."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from typing import Any

from ..runtime.log import Log, log

Listener = Callable[[Any], None]


class Listeners:
    """Tells each of them everything, in its order."""

    def __init__(self, log: Log = log) -> None:
        """Begin with nobody; those that raise are logged."""
        self._log = log
        self._listeners: dict[object, Listener] = {}
        """By what :meth:`add` has made for each: the same callback may be added twice."""
        self._items: deque[object] = deque()
        self._is_telling = False

    def add(self, listener: Listener) -> Callable[[], None]:
        """Tell a listener from now on; returns what removes it again, which may be called twice."""
        key = object()
        self._listeners[key] = listener
        return lambda: self._remove(key)

    def tell(self, item: object) -> None:
        """Tell everybody. What happens because of it is told after it."""
        if not self._listeners:
            return  # quickly: this runs at every poll
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
            except (Exception, asyncio.CancelledError):  # noqa: BLE001  # nothing may end the task that polls
                self._remove(key)
                self._log.exception("a listener raised, and is not called any more: %r", listener)

    def _remove(self, key: object) -> None:
        self._listeners.pop(key, None)
