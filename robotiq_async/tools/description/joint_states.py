"""Encodes sensor_msgs/msg/JointState as ROS 2 does (CDR, little endian), without ROS.

The names never change, so the bytes before the numbers are encoded once.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct, pack
from typing import Final

from .kinematics import JOINTS

SCHEMA_NAME: Final = "sensor_msgs/msg/JointState"
RULE: Final = "=" * 80
HEADER_DEFINITION: Final = f"""{RULE}
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
{RULE}
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""
JOINT_STATE_SCHEMA: Final = f"""std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
{HEADER_DEFINITION}"""
"""The message definition and the definitions it refers to, in MCAP's format ros2msg."""

ENCAPSULATION: Final = b"\x00\x01\x00\x00"
STAMP: Final = Struct("<iI")


class JointStateEncoder:
    """Encodes joint states of the eleven joints of the hand."""

    def __init__(self, frame_id: str = "palm", names: Sequence[str] = JOINTS) -> None:
        """Encode everything but the stamp and the numbers, which are in the order of the names."""
        body = bytearray(STAMP.size)
        add_string(body, frame_id)
        align(body, 4)
        body += pack("<I", len(names))
        for name in names:
            align(body, 4)
            add_string(body, name)
        self._count = len(names)
        self._constant = bytes(body[STAMP.size :])
        # Three sequences of doubles. CDR aligns each count to 4 bytes and the numbers to 8.
        layout, at = "<", len(body)
        for _ in range(3):
            layout += f"{-at % 4}xI"
            at += -at % 4 + 4
            layout += f"{-at % 8}x{len(names)}d"
            at += -at % 8 + 8 * len(names)
        self._numbers = Struct(layout)

    def encode(
        self,
        nanoseconds: int,
        positions: Sequence[float],
        velocities: Sequence[float],
        efforts: Sequence[float],
    ) -> bytes:
        """Encode one message. The stamp is in nanoseconds since 1970.

        There is a number for each joint: radians, radians per second, motor currents in ampere.
        """
        stamp = STAMP.pack(*divmod(nanoseconds, 1_000_000_000))
        count = self._count
        numbers = self._numbers.pack(count, *positions, count, *velocities, count, *efforts)
        return ENCAPSULATION + stamp + self._constant + numbers


def align(body: bytearray, size: int) -> None:
    """Append zeros up to a multiple of this size."""
    body += bytes(-len(body) % size)


def add_string(body: bytearray, text: str) -> None:
    """Append a string: its length, its bytes and a zero. Align the body to 4 bytes first."""
    encoded = text.encode() + b"\0"
    body += pack("<I", len(encoded)) + encoded
