"""Everything about a hand as messages on six topics, for recordings and for viewers.

``/gripper/status`` (every poll), ``/gripper/command`` (every request that was written) and ``/gripper/event``
(transitions, faults, inhibits) are JSON with a JSON Schema. ``/joint_states``, ``/robot_description`` (once)
and ``/tf``, from which viewers draw the gripper in 3-D, are as ROS 2 encodes them.
"""

from __future__ import annotations

import asyncio
import json
import math
import time
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final

from ...hands import Hand, Stream
from ...runtime import Log, now
from ...values import Model, RobotiqConnectionError, RobotiqStatus, SentRequest, Transition
from ..description.joint_states import JOINT_STATE_SCHEMA, SCHEMA_NAME, JointStateEncoder
from ..description.kinematics import joint_angles, joint_names, joint_velocities
from ..description.simulated import bodies_of, joints_and_parts
from ..description.transforms import (
    STRING_SCHEMA,
    STRING_SCHEMA_NAME,
    TRANSFORMS_SCHEMA,
    TRANSFORMS_SCHEMA_NAME,
    encode_description,
    encode_transforms,
)
from .payloads import SCHEMAS, InhibitEvents, Properties, efforts, fault_event, mark_fields, transition_fields

FEED_BUFFER: Final = 100_000
"""Statuses kept while the event loop is busy with something else: minutes."""
REOPEN_S: Final = 0.2
"""Pause before reopening the streams of a hand that has given up on its link."""
VELOCITY_S: Final = 0.05
"""Time over which joint velocities are taken: a count is half a degree."""
TRANSFORMS_S: Final = 0.05
"""Interval of ``/tf``: smooth to the eye, a tenth of the polls."""


@dataclass(frozen=True, slots=True)
class Topic:
    """A topic and its message type, as MCAP and Foxglove describe them."""

    name: str
    encoding: str  # of the messages
    schema_name: str  # the message type
    schema_encoding: str  # the language of the schema
    schema: bytes


def json_topic(name: str, schema: object) -> Topic:
    """A topic ``/gripper/NAME`` of JSON objects."""
    return Topic(f"/gripper/{name}", "json", f"gripper.{name}", "jsonschema", json.dumps(schema).encode())


def compact(fields: Properties) -> bytes:
    """An object as one line of JSON without spaces."""
    return json.dumps(fields, separators=(",", ":")).encode()


STATUS: Final = json_topic("status", SCHEMAS["status"])
COMMAND: Final = json_topic("command", SCHEMAS["command"])
EVENT: Final = json_topic("event", SCHEMAS["event"])


def ros_topic(name: str, schema_name: str, schema: str) -> Topic:
    """A topic of messages of ROS 2."""
    return Topic(name, "cdr", schema_name, "ros2msg", schema.encode())


JOINTS_TOPIC: Final = ros_topic("/joint_states", SCHEMA_NAME, JOINT_STATE_SCHEMA)
DESCRIPTION: Final = ros_topic("/robot_description", STRING_SCHEMA_NAME, STRING_SCHEMA)
TRANSFORMS: Final = ros_topic("/tf", TRANSFORMS_SCHEMA_NAME, TRANSFORMS_SCHEMA)
TOPICS: Final = (STATUS, COMMAND, EVENT, JOINTS_TOPIC, DESCRIPTION, TRANSFORMS)


@dataclass(frozen=True, slots=True)
class Message:
    """One message."""

    topic: Topic
    nanoseconds: int  # since 1970
    data: bytes  # in the encoding of the topic
    sequence: int = 0  # the number of its status; commands and events are counted from 1


class _FeedSource:
    """A stream of a hand that reopens when it ends."""

    def __init__(self, open_stream: Callable[[], Stream[Any]], publish: Callable[[Any], None]) -> None:
        self._open_stream = open_stream
        self._publish = publish
        self._stream: Stream[Any]
        self._missed_before = 0

    @property
    def missed(self) -> int:
        return self._missed_before + self._stream.missed

    def open(self) -> None:
        self._stream = self._open_stream()

    async def listen(self) -> None:
        while True:
            try:
                async for item in self._stream:
                    self._publish(item)
            except RobotiqConnectionError:
                await asyncio.sleep(REOPEN_S)  # until the next start, streams end at once
            self._missed_before = self.missed
            self.open()

    def drain(self) -> None:
        for item in self._stream.drain():
            self._publish(item)


class Feed:
    """Publishes statuses, requests, transitions and faults of a hand as messages. It only listens."""

    def __init__(self, hand: Hand, publish: Callable[[Message], None]) -> None:
        """Prepare; subscribes to nothing. ``publish`` is called with every message, in the event loop.

        The hand may be stopped and started again while the feed runs.
        """
        self._hand = hand
        self._publish = publish
        self._model: Model | None = None
        self._encoder = JointStateEncoder()
        self._transformed_at = -math.inf
        self._before: list[RobotiqStatus] = []
        self._inhibits = InhibitEvents(hand)
        self._epoch = 0.0
        self._counts = {COMMAND: 0, EVENT: 0}
        self._sources: tuple[_FeedSource, ...] = (
            _FeedSource(lambda: hand.statuses(FEED_BUFFER), self._publish_status),
            _FeedSource(hand.requests, self._publish_request),
            _FeedSource(hand.transitions, self._publish_transition),
        )
        self._tasks: list[asyncio.Task[None]] = []

    @property
    def missed(self) -> int:
        """Statuses that were dropped unpublished. A blocked event loop polls none: see ``overruns``."""
        return self._sources[0].missed

    def start(self) -> None:
        """Subscribe, and publish from now on."""
        loop = asyncio.get_running_loop()
        # Statuses carry monotonic time, messages wall-clock time.
        began = now()
        self._epoch = time.time() - began
        state = {"kind": "state", "timestamp": began, "target": self._hand.state.name}
        self._publish_json(EVENT, began, state)
        for source in self._sources:
            source.open()
        self._tasks = [
            loop.create_task(source.listen(), name="robotiq_async feed") for source in self._sources
        ]

    async def stop(self) -> None:
        """Publish the remaining items, and stop listening."""
        for task in self._tasks:
            task.cancel()
        for ended in await asyncio.gather(*self._tasks, return_exceptions=True):
            if isinstance(ended, Exception):
                Log(self._hand.name).critical(
                    "a feed failed: the hand is no longer published", exc_info=ended
                )
        for source in self._sources:
            source.drain()

    def mark(self, label: str, values: Mapping[str, object]) -> None:
        """Publish a mark of now, after the statuses that have come before it.

        Raises:
            TypeError: a value is no text, number or truth value.
            ValueError: a value is not finite or too long, or text has surrogates.
        """
        fields = mark_fields(label, values, now())
        self._sources[0].drain()
        self._publish_json(EVENT, fields["timestamp"], fields)

    def nanoseconds(self, timestamp: float) -> int:
        """Convert a timestamp in monotonic seconds to nanoseconds since 1970."""
        return round((timestamp + self._epoch) * 1e9)

    def _publish_json(self, topic: Topic, timestamp: float, fields: Properties) -> None:
        self._counts[topic] += 1
        self._publish(Message(topic, self.nanoseconds(timestamp), compact(fields), self._counts[topic]))

    def _publish_status(self, status: RobotiqStatus) -> None:
        stamp, data = self.nanoseconds(status.timestamp), compact(status.as_dict())
        self._publish(Message(STATUS, stamp, data, status.sequence))
        if event := fault_event(status, next(reversed(self._before), None)):
            self._publish_json(EVENT, status.timestamp, event)
        for event in self._inhibits.new(status.timestamp):
            self._publish_json(EVENT, status.timestamp, event)
        if self._model is not status.model:  # a remote hand learns it when it starts
            self._model, self._before = status.model, []
            self._encoder = JointStateEncoder(names=joint_names(status.model))
            self._publish(Message(DESCRIPTION, stamp, encode_description(status.model), status.sequence))
        if status.timestamp - self._transformed_at >= TRANSFORMS_S:
            self._publish_transforms(status, stamp)
        self._publish_joints(status, stamp)

    def _publish_transforms(self, status: RobotiqStatus, stamp: int) -> None:
        self._transformed_at = status.timestamp
        bodies = bodies_of(self._hand)
        joints = {} if bodies is None else joints_and_parts(bodies)[0]
        data = encode_transforms(status, stamp, joints)
        self._publish(Message(TRANSFORMS, stamp, data, status.sequence))

    def _publish_joints(self, status: RobotiqStatus, stamp: int) -> None:
        while len(self._before) > 1 and status.timestamp - self._before[1].timestamp >= VELOCITY_S:
            del self._before[0]
        self._before.append(status)
        angles, seconds = joint_angles(status), status.timestamp - self._before[0].timestamp
        velocities = joint_velocities(self._before[0], status) if seconds else (0.0,) * len(angles)
        data = self._encoder.encode(stamp, angles, velocities, efforts(status))
        self._publish(Message(JOINTS_TOPIC, stamp, data, status.sequence))

    def _publish_request(self, sent: SentRequest) -> None:
        self._publish_json(COMMAND, sent.timestamp, sent.as_dict())

    def _publish_transition(self, transition: Transition) -> None:
        self._publish_json(EVENT, transition.timestamp, transition_fields(transition))


class Timeline:
    """Collects the statuses and events of a hand between two looks, in order. It only listens."""

    def __init__(self, hand: Hand, buffer: int) -> None:
        self._hand, self._buffer = hand, buffer
        self._before: RobotiqStatus | None = None
        self._inhibits = InhibitEvents(hand)
        self.open()

    def open(self) -> None:
        """Listen from now on: the streams end when the hand is stopped."""
        self._statuses = self._hand.statuses(self._buffer)
        self._transitions = self._hand.transitions()

    @property
    def missed(self) -> int:
        """Statuses that were dropped because the buffer was full."""
        return self._statuses.missed

    def new(self) -> Iterator[tuple[float, RobotiqStatus | Properties]]:
        """Statuses, and events for transitions and faults, each with its time in seconds since 1970."""
        # Timestamps of a hand are monotonic; people and files use the wall clock.
        offset = time.time() - now()
        happened: list[RobotiqStatus | Transition] = [*self._transitions.drain(), *self._statuses.drain()]
        for each in sorted(happened, key=lambda one: one.timestamp):
            at = offset + each.timestamp
            if isinstance(each, Transition):
                yield at, transition_fields(each)
                continue
            yield at, each
            if event := fault_event(each, self._before):
                yield at, event
            self._before = each
        for event in self._inhibits.new(now()):
            yield offset + event["timestamp"], event
