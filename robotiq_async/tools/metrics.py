"""Metrics of long-running hands for Prometheus. Needs the extra ``metrics`` (prometheus-client).

    async with serve_metrics(hand, port=9100):
        ...

Prometheus collects them when it scrapes; they cost nothing in between. They count from the hand's last
start, as :attr:`Hand.statistics` does; Prometheus expects counters that start over.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import threading
from collections import Counter
from collections.abc import AsyncIterator, Iterable, Iterator
from socketserver import TCPServer, ThreadingMixIn
from typing import Any, Final

try:
    from prometheus_client import CollectorRegistry, MetricsHandler
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, Metric
    from prometheus_client.registry import Collector
except ModuleNotFoundError as error:
    from ..runtime import install

    raise ImportError(f"metrics need prometheus-client: {install('metrics')}") from error

from ..hands import Hand, Statistics
from ..runtime import in_a_thread, listen, log, wait_shielded
from ..values import Fault, NotStartedError, State, check_int
from .service import health

LOOPBACK: Final = "127.0.0.1"
TIMEOUT_S: Final = 5.0
"""Seconds for which a scrape waits for an event loop that is blocked."""
IDLE_S: Final = 2.0  # seconds for which a connection may send nothing
MOST_SCRAPES: Final = 16  # scrapes at a time; further connections are closed

_COUNTERS: Final = {
    "polls": "Statuses read.",
    "writes": "Requests acknowledged.",
    "overruns": "Polling ticks that were missed and skipped.",
    "reconnects": "Times the link was opened again.",
    "foreign_commands": "Times another client was seen commanding the gripper.",
    "faults": "Times the gripper reported a minor or a major fault.",
    "passing_faults": "Times fault 0x09 was shown for a moment and looked past.",
}
_GAUGES: Final = {
    "period_p50": "Median time between two polls.",
    "period_p99": "99th percentile of the time between two polls.",
    "round_trip_p50": "Median time from a read to its reply.",
    "round_trip_p99": "99th percentile of the time from a read to its reply.",
    "longest_stall": "Longest time the event loop was blocked.",
    "status_age_p50": "Median time from requesting a status to the write that was decided on it.",
    "status_age_p99": "99th percentile of the time from requesting a status to the write decided on it.",
}
_NOW: Final = {
    "ready": "1 while the hand takes motion commands.",
    "inhibited": "1 while a person has the hand refuse motion.",
    "holds": "Number of fingers that hold a part.",
    "status_age_seconds": "Time since the newest status was read; of a hand that has read one.",
}
_FAULT: Final = "1 for the fault in the newest status, 0 for every other one of the model."
_SHARES: Final = {"link_use": "Share of the time in which the hand waits for an answer, 0..1."}


class HandCollector(Collector):
    """Collects the metrics of hands for your registry."""

    def __init__(self, hands: Iterable[Hand]) -> None:
        """Create it in the event loop that the hands run in.

        Args:
            hands: the label ``hand`` of each is its name.

        Raises:
            ValueError: two of them have the same name.
        """
        self._hands = list(hands)
        names = Counter(hand.name for hand in self._hands)
        if twice := [name for name, count in names.items() if count > 1]:
            raise ValueError(f"hands must have different names, got {twice[0]!r} twice")
        self._loop = asyncio.get_running_loop()

    def describe(self) -> Iterable[Metric]:
        """Nothing: otherwise a registry would collect at once and deadlock with the event loop."""
        return []

    def collect(self) -> Iterator[Metric]:
        """Collect in the event loop; called in a thread of the server."""
        asking = asyncio.run_coroutine_threadsafe(self._figures(), self._loop)
        figures = asking.result(TIMEOUT_S)
        for family, unit, names in (
            (CounterMetricFamily, "", _COUNTERS),
            (GaugeMetricFamily, "_seconds", _GAUGES),
            (GaugeMetricFamily, "_ratio", _SHARES),
        ):
            for name, meaning in names.items():
                metric = family(f"robotiq_{name}{unit}", meaning, labels=["hand"])
                for hand, (_, statistics) in figures.items():
                    metric.add_metric([hand], getattr(statistics, name))
                yield metric
        moves = CounterMetricFamily("robotiq_moves", "Moves by outcome.", labels=["hand", "outcome"])
        state = GaugeMetricFamily("robotiq_state", "1 for the present state.", labels=["hand", "state"])
        for hand, (present, statistics) in figures.items():
            for outcome, count in statistics.moves.items():
                moves.add_metric([hand, outcome], count)
            for each in State:
                state.add_metric([hand, each.name], float(each is present))
        yield moves
        yield state
        yield self._controller_faults()
        yield from self._conditions()

    def _conditions(self) -> Iterator[Metric]:
        """The series for alarms. A hand has few, and always the same: for faults a series for each code."""
        families = {
            name: GaugeMetricFamily(f"robotiq_{name}", text, labels=["hand"]) for name, text in _NOW.items()
        }
        faults = GaugeMetricFamily("robotiq_fault", _FAULT, labels=["hand", "code", "name", "severity"])
        for hand in self._hands:
            found = health(hand)
            families["ready"].add_metric([hand.name], float(found.is_ready))
            families["inhibited"].add_metric([hand.name], float(found.inhibited is not None))
            if found.status_age is None:
                continue
            families["holds"].add_metric([hand.name], float(len(found.holds)))
            families["status_age_seconds"].add_metric([hand.name], found.status_age)
            for code, fault in enumerate(hand.model.faults):
                if fault is not Fault.NONE:
                    labels = [hand.name, f"0x{code:02X}", fault.name, fault.severity.name]
                    faults.add_metric(labels, float(fault is found.fault))
        yield from families.values()
        yield faults

    def _controller_faults(self) -> Metric:
        """The kFLT of each hand with a status: a hand without one has no figure."""
        meaning = "Fault code of the controller before a 2F or a Hand-E (kFLT); 0 for none."
        metric = GaugeMetricFamily("robotiq_controller_fault", meaning, labels=["hand"])
        for hand in self._hands:
            with contextlib.suppress(NotStartedError):
                metric.add_metric([hand.name], hand.status.controller_fault)
        return metric

    async def _figures(self) -> dict[str, tuple[State, Statistics]]:
        return {hand.name: (hand.state, hand.statistics) for hand in self._hands}


class _Handler(MetricsHandler):
    timeout = IDLE_S


class _ScrapeServer(ThreadingMixIn, TCPServer):
    """Answers scrapes, each in a thread.

    It runs in the process of the hands. So it limits the threads and files that strangers can use up, which
    the server of prometheus_client does not, and queries no name server in the event loop, as http.server
    does.
    """

    daemon_threads = True

    def __init__(self, host: str, port: int, registry: CollectorRegistry) -> None:
        super().__init__((host, port), _Handler.factory(registry), bind_and_activate=False)
        self.socket.close()
        self.socket = listen(host, port)
        self._free = threading.Semaphore(MOST_SCRAPES)

    def process_request(self, request: Any, client_address: Any) -> None:  # noqa: ANN401  # as in the base
        if not self._free.acquire(blocking=False):
            self.shutdown_request(request)
            return
        try:
            super().process_request(request, client_address)
        except RuntimeError as error:
            log.warning("a scrape was not answered: %s", error)
            self._free.release()
            self.shutdown_request(request)

    def process_request_thread(self, request: Any, client_address: Any) -> None:  # noqa: ANN401
        try:
            super().process_request_thread(request, client_address)
        finally:
            self._free.release()

    def handle_error(self, request: Any, client_address: Any) -> None:  # noqa: ANN401, ARG002
        log.debug("a scrape failed", exc_info=True)


@contextlib.asynccontextmanager
async def serve_metrics(
    *hands: Hand, port: int = 9100, host: str = LOOPBACK
) -> AsyncIterator[tuple[str, int]]:
    """Serve the metrics of hands over HTTP during a block; yields host and port.

    There is no password: on an interface other than loopback, everyone there can read them.

    Args:
        hands: at least one.
        port: 0 takes a free one.
        host: the interface to listen on.

    Raises:
        ValueError: no hand, two of the same name, or a port outside 0..65535.
        OSError: the port is taken, or no thread can be started.
    """
    if not hands:
        raise ValueError("hands must name at least one hand, got none")
    port = check_int("port", port, 0, 65535)
    registry = CollectorRegistry()
    registry.register(HandCollector(hands))
    server = _ScrapeServer(host, port, registry)
    thread = threading.Thread(target=server.serve_forever, daemon=True, name="robotiq_async metrics")
    try:
        thread.start()
    except RuntimeError as error:
        server.server_close()
        raise OSError(errno.EAGAIN, str(error)) from error
    try:
        yield host, int(server.socket.getsockname()[1])
    finally:

        def close() -> None:
            server.shutdown()
            server.server_close()
            thread.join()

        # It may be answering a scrape that waits for this loop: close it in a thread, also when cancelled.
        closing = in_a_thread(close)
        await wait_shielded(closing)
        if (failure := closing.exception()) is not None:
            log.warning("the server of the metrics is still open: %s", failure)
