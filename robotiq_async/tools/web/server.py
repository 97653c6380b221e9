"""Shows hands on a page during a block: starts its process, sends updates, receives commands.

    async with serve_page(hand, control=True) as page:
        print(page.url)

The two processes exchange lines of JSON through two pipes.
"""

from __future__ import annotations

import asyncio
import json
import os
import sys
from asyncio.subprocess import PIPE, Process
from collections import deque
from collections.abc import AsyncIterator, Iterator, Sequence
from contextlib import asynccontextmanager
from importlib.util import find_spec
from itertools import zip_longest
from pathlib import Path
from typing import Final, Self

from ...hands import Hand
from ...runtime import is_frozen, log, now, wait_shielded
from ...values import NotStartedError, RobotiqStatus
from ..actions import Operator
from ..description.simulated import bodies_of
from ..errors import ViewerError
from ..recording.feed import Timeline
from ..recording.payloads import Properties, is_command, title
from .commands import PageCommands
from .settings import LOOPBACK, PAGE_PORT, PageSettings

if find_spec("nicegui") is None:
    from ...runtime import install

    raise ImportError(f"the page needs nicegui: {install('web')}")

UPDATE_S: Final = 0.05
START_S: Final = 30.0
"""Importing NiceGUI takes a second, on a busy machine several."""
PAGE_STOP_S: Final = 2.0
BACKLOG: Final = 16_384
"""Bytes that the page has not read yet. Beyond this there are no updates until it has read them."""
LINE: Final = 65_536
PAGE_SILENCE_S: Final = 2.0
"""The page's process sends four heartbeats a second; after this silence its motions are held."""
PAGE_BUFFER: Final = 64
"""Statuses between two calls of gather(), for the peaks of the currents: a third of a second."""
EVENTS_KEPT: Final = 200
"""Events kept for a page that does not read."""
STATISTICS_S: Final = 1.0
SHORTEST: Final = 8  # characters of a password


class HandUpdates:
    """Collects the statuses and events of a hand, which may be started later. It only listens."""

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        self.problem = ""  # why the hand could not be started; empty if it was
        self._timeline = Timeline(hand, PAGE_BUFFER)
        self._events: deque[Properties] = deque(maxlen=EVENTS_KEPT)
        self._peaks = [0] * len(hand.model.axes)
        self._counted_at = 0.0

    def note_start(self, problem: str = "") -> None:
        """Note why the hand could not be started; empty if it was."""
        self.problem = problem

    def open(self) -> None:
        """Listen again after a stop of the hand."""
        self._timeline.open()

    def gather(self) -> None:
        """Collect new statuses and events; call it often."""
        for at, each in self._timeline.new():
            if isinstance(each, RobotiqStatus):
                currents = (each.current_ma(axis) or 0 for axis in each.model.axes)
                self._peaks = [max(pair) for pair in zip_longest(self._peaks, currents, fillvalue=0)]
            elif not is_command(each):
                self._events.append({**each, "time": at})

    def take(self, index: int) -> Properties:
        """The next update of the hand with this number on the page. It contains each event once."""
        fields: Properties = {
            "hand": index,
            "state": self.hand.state.name,
            "problem": self.problem,
            "inhibited": None if self.hand.inhibited is None else self.hand.inhibited.as_dict(),
            "peaks": self._peaks,
            "events": list(self._events),
            **self._newest(),
            **dict(self._statistics()),
        }
        self._events.clear()
        self._peaks = [0] * len(self._peaks)
        return fields

    def _newest(self) -> Properties:
        try:
            status = self.hand.status
        except NotStartedError:
            return {}
        return {
            "model": status.model.name,
            "stroke": status.stroke.points,
            "has_current": status.has_current,
            "registers": status.registers,
            "timestamp": status.timestamp,
            "sequence": status.sequence,
            "age": max(now() - status.timestamp, 0.0),
            "bodies": bodies_of(self.hand),
        }

    def _statistics(self) -> Iterator[tuple[str, Properties]]:
        # Once a second: percentiles are expensive.
        if now() - self._counted_at >= STATISTICS_S:
            self._counted_at = now()
            yield "statistics", self.hand.statistics.as_dict()


class PageServer:
    """The page of some hands.

    Attributes:
        updates: the updates, one for each hand.
        url: the address to open, once the page is served.
        pages: number of browsers that show the page.
    """

    def __init__(
        self, hands: Sequence[Hand], settings: PageSettings, *, operators: Sequence[Operator] = ()
    ) -> None:
        """Prepare; starts nothing.

        Args:
            hands: started before or while they are shown.
            settings: of the page.
            operators: carry out the commands, one for each hand; without them the page only watches.

        Raises:
            ValueError: the operators do not match the hands or the settings.
        """
        if operators and [operator.hand for operator in operators] != list(hands):
            raise ValueError("operators must belong to the hands, in their order")
        if settings.control != bool(operators):
            raise ValueError("control needs operators, and operators need control")
        self.updates: list[HandUpdates] = [HandUpdates(hand) for hand in hands]
        self.url: str = ""
        self.pages = 0
        self._settings = settings
        self._commands = PageCommands(operators, self._answer)
        self._process: Process
        self._tasks: list[asyncio.Task[None]] = []
        self._answers: list[Properties] = []
        self._heard_at = 0.0
        self._seen = asyncio.Event()
        self._over = asyncio.Event()

    async def __aenter__(self) -> Self:
        """Start the process, and wait until it serves the page.

        Raises:
            ViewerError: the port is taken, there is no such interface, or the process ended.
        """
        self._process, limit = await _start(), _patience()
        try:
            self._write(self._settings.line())
            async with asyncio.timeout(limit):
                first = await self._read()
            if first is None or "failed" in first:
                raise ViewerError(first["failed"] if first else "the process of the page has ended")
        except TimeoutError:
            await self._end_process()
            raise ViewerError(f"the process of the page did not serve within {limit:.0f} s") from None
        except BaseException:
            await self._end_process()
            raise
        self.url = self._settings.url(first["serving"])
        self._heard_at = now()
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(work, name="robotiq_async page") for work in (self._listen(), self._tell())
        ]
        return self

    async def __aexit__(self, *_: object) -> None:
        await wait_shielded(asyncio.ensure_future(self._close()))

    async def seen(self) -> None:
        """Wait until a browser shows the page."""
        await self._seen.wait()

    async def ended(self) -> None:
        """Wait until the process of the page ends."""
        await self._over.wait()

    @property
    def is_ending(self) -> bool:
        """Whether all commands but halts are refused: after :meth:`refuse_commands`, or after the block."""
        return self._commands.is_ending

    def refuse_commands(self) -> None:
        """Refuse all commands but halts: for a program that is about to stop the hands."""
        self._commands.refuse()

    async def _close(self) -> None:
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        await self._commands.close()
        await self._end_process()

    async def _end_process(self) -> None:
        assert self._process.stdin is not None
        self._process.stdin.close()  # that ends it
        try:
            async with asyncio.timeout(PAGE_STOP_S):
                await self._process.wait()
        except TimeoutError:
            self._process.kill()
            await self._process.wait()

    # -- updates ---------------------------------------------------------------------------------------

    async def _tell(self) -> None:
        assert self._process.stdin is not None
        while not self._over.is_set():
            for updates in self.updates:
                updates.gather()
            if self._commands.under_way and now() - self._heard_at > PAGE_SILENCE_S:
                self._commands.all_gone()
            if self._process.stdin.transport.get_write_buffer_size() < BACKLOG:
                hands = [updates.take(index) for index, updates in enumerate(self.updates)]
                self._write(json.dumps({"hands": hands, "answers": self._answers}).encode() + b"\n")
                self._answers = []
            await asyncio.sleep(UPDATE_S)

    def _answer(self, answer: Properties) -> None:
        self._answers.append(answer)

    def _write(self, line: bytes) -> None:
        assert self._process.stdin is not None
        self._process.stdin.write(line)

    # -- commands --------------------------------------------------------------------------------------

    async def _listen(self) -> None:
        try:
            while (message := await self._read()) is not None:
                self._heard_at = now()
                self._hear(message)
        except Exception:  # noqa: BLE001  # after any message of the other process the axes are held
            log.exception("the page has sent an invalid message: its commands are ignored from now on")
        finally:
            self._commands.all_gone()
            self._over.set()

    def _hear(self, message: Properties) -> None:
        if "do" in message:
            self._commands.do(message["do"])
        if "gone" in message:
            self._commands.gone(message["gone"])
        if "pages" in message:
            self.pages = message["pages"]
            if self.pages:
                self._seen.set()

    async def _read(self) -> Properties | None:
        assert self._process.stdout is not None
        line = await self._process.stdout.readline()
        message: Properties | None = json.loads(line) if line else None
        return message


@asynccontextmanager
async def serve_page(
    *hands: Hand,
    control: bool = False,
    port: int = PAGE_PORT,
    host: str = LOOPBACK,
    password: str = "",
    certificate: str = "",
    key: str = "",
) -> AsyncIterator[PageServer]:
    """Serve the page of a program's own hands during a block; yields the page, with its url.

    HALT on the page is :meth:`Hand.inhibit` of these very hands: no call of the program moves a finger then,
    until a person permits it. The hands are the program's, which starts and stops them.

    Args:
        hands: at least one, started or not.
        control: whether the page may command; False only watches.
        port: 0 takes a free one.
        host: the interface to listen on; all but 127.0.0.1 need a password or a certificate.
        password: every user must give it, 8 characters or more. Empty for a token in the url, new each time.
        certificate: PEM file for https; empty for http.
        key: PEM file with its private key.

    Raises:
        ValueError: no hand, or settings that do not fit.
        ViewerError: the port is taken, there is no such interface, or no process can be started.
    """
    if not hands:
        raise ValueError("hands must name at least one hand, got none")
    if password and len(password) < SHORTEST:
        raise ValueError(f"password must have {SHORTEST} characters or more, got {len(password)}")
    settings = PageSettings(
        host=host,
        port=port,
        control=control,
        addresses=tuple(title(hand) for hand in hands),
        password=password,
        certificate=certificate,
        key=key,
    )
    operators = [Operator(hand, who="the page") for hand in hands] if control else []
    async with PageServer(hands, settings, operators=operators) as page:
        yield page


def _patience() -> float:
    """Seconds that the start may take: its imports are 2 s of a CPU, and on a busy machine others have it."""
    waiting = os.getloadavg()[0] / (os.cpu_count() or 1) if hasattr(os, "getloadavg") else 1.0
    return START_S * max(1.0, waiting)


async def _start() -> Process:
    if is_frozen():  # it would start itself, and move the fingers a second time
        raise ViewerError("the page needs a separate Python, which a frozen program lacks")
    # This package, even if the working directory contains another of its name.
    package, here = __name__.partition(".")[0], str(Path(__file__).parents[3])
    paths = os.pathsep.join(filter(None, (here, os.environ.get("PYTHONPATH"))))
    return await asyncio.create_subprocess_exec(
        sys.executable,
        *("-P", "-m", f"{package}.tools.web.page"),
        stdin=PIPE,
        stdout=PIPE,
        limit=LINE,
        env=os.environ | {"PYTHONPATH": paths},
    )
