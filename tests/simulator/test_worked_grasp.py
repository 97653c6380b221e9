"""The grasp that the manual works through (editions 2014, 2018): the words it writes, the frames it reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from robotiq_async.values.enums import Finger

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.simulator.conftest import Bench

ACTIVATE = (0x0100, 0x0000, 0x0000)
CLOSE = (0x0900, 0x00FF, 0xFFFF)
OPEN = (0x0900, 0x0000, 0xFFFF)
POSITIONS = (4, 7, 10)
"""The bytes that hold where A, B and C are."""

CLOSING = "39 C0 00 FF 08 0F 00 08 10 00 08 0F 00 89 00 00"
HELD = "B9 EA 00 FF BC 00 00 C1 00 00 BD 00 00 89 00 00"
OPENING = "39 C0 00 00 B8 0B 00 BD 0E 00 BA 0B 00 89 00 00"
OPENED = "F9 FF 00 00 07 00 00 06 00 00 06 00 00 89 00 00"


class Reader:
    """Compares what a gripper reports with what the manual prints; fingers may be some counts elsewhere."""

    def __init__(self, bench: Bench, within: int) -> None:
        self.bench = bench
        self.within = within

    def write(self, words: tuple[int, ...]) -> None:
        """The first three registers, as the manual does."""
        self.bench.gripper.write(0, words)
        self.bench.wait(0.006)

    def reads(self, printed: str) -> bool:
        frame = b"".join(word.to_bytes(2) for word in self.bench.gripper.status_registers())
        other = bytes.fromhex(printed)
        far = max(abs(frame[at] - other[at]) for at in POSITIONS)
        return far <= self.within and [byte for at, byte in enumerate(frame) if at not in POSITIONS] == [
            byte for at, byte in enumerate(other) if at not in POSITIONS
        ]

    def comes_to_read(self, printed: str, seconds: float = 3.0) -> bool:
        """Whether a frame is read at some time."""
        end = self.bench.now + seconds
        while not self.reads(printed) and self.bench.now < end:
            self.bench.wait(0.005)
        return self.reads(printed)


def each_finger_its_own(bench: Bench) -> None:
    """An object that stops each finger exactly where the manual's did."""
    for finger, position in zip((Finger.A, Finger.B, Finger.C), (0xBC, 0xC1, 0xBD), strict=True):
        bench.gripper.place_object(finger, position)


def one_for_all(bench: Bench) -> None:
    """One object; where each finger feels it is up to the spread: up to 5 counts apart, as in the manual."""
    bench.gripper.place_object(Finger.ABC, 0xBE)


@pytest.mark.parametrize(
    ("spread", "place", "within"), [(False, each_finger_its_own, 1), (True, one_for_all, 5)]
)
def test_the_worked_grasp(
    make_bench: Callable[..., Bench], spread: bool, place: Callable[[Bench], None], within: int
) -> None:
    bench = make_bench(spread=spread)
    reader = Reader(bench, within)
    reader.write(ACTIVATE)
    assert bench.words == (0x11, 0x00)
    bench.settle()
    assert bench.words == (0x31, 0x00)
    place(bench)
    reader.write(CLOSE)
    assert reader.comes_to_read(CLOSING)
    assert reader.comes_to_read(HELD)
    bench.wait(60)
    assert reader.reads(HELD), "for as long as it is held"
    if not spread:
        assert bench.positions[:3] == (0xBC, 0xC1, 0xBD), "exactly"
    reader.write(OPEN)
    assert reader.comes_to_read(OPENING)
    assert reader.comes_to_read(OPENED)
