"""The order of the news of a run: for readers, listeners, and the callers whose calls a request has ended.

Their code may hold up the loop. So a write that is due leaves first.
"""

# Theory of operation
#
# A listener may command the hand. If it got a change of state in the middle of a call, the rest of the call
# would overwrite its request: changes are noted, and published after the call.
#
# A request may end the waits of others, and a request that stops the fingers leaves soon. Before its image
# has left
#
# * the callers whose calls it has ended wait, for any request;
# * the publication waits, too, if it is a stop, a halt, a reset or a hold: see hold_back(). State waiters are
#   woken by the publication, and so they wait with it.
#
# Both waits end two turns of the loop after the image left: a tunnel begins its exchange in the turn between.
# They end sooner if no image leaves, because the cycle had nothing to write, or the link failed or is closed:
# see tell(). A write that is not expected soon, as behind a slow gateway, is not waited for: so Run decides.

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Iterable
from typing import Any, Final

from ..control.state_machine import StateMachine
from ..control.waiters import Waiter, fail
from ..hands.streams import Channel, Channels
from ..values.errors import RobotiqError
from ..values.events import SentRequest, Transition
from ..values.status import RobotiqStatus
from .news import BITS, FaultNews


class Publisher:
    """Publishes the events of a run.

    Attributes:
        numbers: the sequence numbers of the statuses.
        has_to_tell: whether somebody waits for the next write.
    """

    def __init__(self, channels: Channels, machine: StateMachine) -> None:
        self._news: Final = FaultNews(machine)
        self.numbers: Final = channels.numbers
        self.has_to_tell: bool = False
        self._channels: Final = channels
        self._loop: Final = asyncio.get_running_loop()
        self._queue: Final[deque[tuple[Channel[Any], Any, Callable[[], None] | None]]] = deque()
        self._is_held_back = False
        self._ended: list[tuple[Waiter[Any], RobotiqError]] = []  # the callers whom a request has ended

    def note(self, change: Transition, wake: Callable[[], None] | None) -> None:
        """Note a change of state, to be published after the present call; ``wake`` is called before."""
        self._news.reached(change)
        self._queue.append((self._channels.transitions, change, wake))

    def publish_changes(self) -> None:
        """Publish the noted changes."""
        while self._queue and not self._is_held_back:
            channel, item, wake = self._queue.popleft()
            if wake is not None:
                wake()
            channel.push(item)

    def publish_status(self, status: RobotiqStatus) -> None:
        """Publish a status after the changes that it has led to."""
        if status.registers[1] & BITS != self._news.shown:
            self._news.see(status)
        if self._queue or self._is_held_back:
            self._queue.append((self._channels.statuses, status, None))
            self.publish_changes()
        else:  # the common case, at every poll
            self._channels.statuses.push(status)

    def publish_request(self, sent: SentRequest) -> None:
        """Publish a request after the changes that it has led to."""
        self._queue.append((self._channels.requests, sent, None))
        self.publish_changes()

    # -- the order of a write and of its news ---------------------------------------------------------

    def hold_back(self, *, publication: bool) -> None:
        """Let the callers whom a request has ended wait for its write; for a stop the publication, too."""
        self.has_to_tell = True
        self._is_held_back |= publication

    def image_leaves(self) -> None:
        """An image leaves in this turn of the loop."""
        if self.has_to_tell or self._ended:
            self._loop.call_soon(self._loop.call_soon, self.tell)

    def tell(self) -> None:
        """Publish and answer everything that waits for a write: it has left, or there is no write."""
        self.has_to_tell = self._is_held_back = False
        self.publish_changes()
        self.answer_ended()

    def end(self, callers: Iterable[Waiter[Any]], error: RobotiqError) -> None:
        """A request has ended the calls of these callers."""
        self._ended += [(caller, error) for caller in callers]

    @property
    def has_ended_callers(self) -> bool:
        return bool(self._ended)

    def answer_ended(self) -> None:
        """Answer the callers that a request has ended: its write has left, or there is no write."""
        ended, self._ended = self._ended, []
        for caller, error in ended:
            fail([caller], error)
