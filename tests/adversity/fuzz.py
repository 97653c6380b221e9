"""Random and mutated replies, through the decoder and through a live link.

    python -m tests.adversity.fuzz --help

The tests run a small part of it (test_fuzz.py); figures of a long run are in docs/under-fault.md. HABITS in
the environment gives the gripper of the live link habits, as ``make habits`` does, and MODEL another model.
"""

from __future__ import annotations

import argparse
import asyncio
import logging
import random
import struct
import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from pymodbus.framer import FramerRTU

from robotiq_async import ReconnectPolicy, RobotiqError, RobotiqHand, RobotiqStatus, State
from robotiq_async.link.frames import CHECKSUM, expected_over_tcp, expected_reply
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.simulator.troubles.corruption import unchanged
from robotiq_async.values.model import MODELS, THREE_FINGER, Model
from tests.adversity.world import HABITS, MODEL

READ, WRITE = 4, 16


def mutated(rng: random.Random, reply: bytes) -> bytes:
    """A reply with something done to it, or noise; often hardly different."""
    data = bytearray(reply)
    for _ in range(rng.choice((1, 1, 1, 2, 5))):
        at = rng.randrange(len(data) + 1)
        match rng.randrange(9):
            case 0 if data:
                data[at % len(data)] ^= 1 << rng.randrange(8)
            case 1 if data:
                data[at % len(data)] = rng.choice((0, 1, 2, 3, 4, 16, 0x7F, 0x80, 0x84, 0x90, 255))
            case 2:
                del data[at:]
            case 3:
                data[at:at] = rng.randbytes(rng.choice((1, 2, 17, 300)))
            case 4:
                data += reply
            case 5 if data:
                del data[at % len(data)]
            case 6:
                data[: min(at, 9)] = rng.randbytes(min(at, 9))
            case 7:
                data = bytearray(rng.randbytes(rng.randrange(40)))
            case _:
                data[: at // 2] = reply[len(reply) - at // 2 :]
    return bytes(data)


# -- the decoder ---------------------------------------------------------------------------------------


def request_and_reply(rng: random.Random, serial: bool) -> tuple[bytes, bytes]:
    """A request as the link makes it, and the right reply."""
    unit, number = (9, 0) if serial else (2, rng.randrange(0x10000))
    if rng.random() < 0.3:
        count = rng.choice((8, 3))
        start = bytes((WRITE, 0x03, 0xE8, 0, count))
        pdu, answer = start + bytes((2 * count,)) + rng.randbytes(2 * count), start
    else:
        count = rng.choice((8, 8, 8, 1, 7, 3))
        pdu = bytes((3 if serial else READ, 0x07, 0xD0, 0, count))
        answer = bytes((pdu[0], 2 * count)) + rng.randbytes(2 * count)
    return framed(pdu, unit, number, serial), framed(answer, unit, number, serial)


def framed(pdu: bytes, unit: int, number: int, serial: bool) -> bytes:
    body = bytes((unit,)) + pdu
    if serial:
        return body + FramerRTU.compute_CRC(body).to_bytes(2, "big")
    return number.to_bytes(2, "big") + b"\0\0" + len(body).to_bytes(2, "big") + body


def answers(request: bytes, reply: bytes, serial: bool) -> bool:
    """Whether a frame is the right answer to a request; written down a second time, apart from frames.py."""
    if serial:
        if reply[-2:] != FramerRTU.compute_CRC(reply[:-2]).to_bytes(2, "big"):
            return False
        body, asked = reply[:-2], request[:6]
    else:
        if len(reply) < 8 or reply[:4] != request[:4] or int.from_bytes(reply[4:6], "big") != len(reply) - 6:
            return False
        body, asked = reply[6:], request[6:]
    if asked[1] == WRITE:
        return body == asked[:6]
    size = 2 * asked[5]
    return len(body) == 3 + size and body[:3] == bytes((asked[0], asked[1], size))


def payload(reply: bytes, serial: bool, model: Model) -> bytes | None:
    """The registers of a reply to the reading of a status, if it is right in all that can be checked.

    What follows it may arrive later, when the reply has been taken already.
    """
    where = model.rtu if serial else model.tcp
    begin = 3 if serial else 9
    end = begin + 2 * where.count
    size = end + (2 if serial else 0)
    reply = reply[:size]
    for function in (where.read_function, where.write_function):
        asked = struct.pack(">BBHH", where.device_id, function, where.status, where.count)
        request = asked if serial else reply[:4] + bytes((0, len(asked))) + asked
        if function != WRITE and len(reply) == size and answers(request, reply, serial):
            return reply[begin:end]
    return None


def decoder(count: int, seed: int = 1) -> dict[str, int]:
    """Put replies through the checks of frames.py and the status; in pieces, as they come off a line.

    Raises:
        AssertionError: a wrong reply was taken for an answer, or a status is impossible.
    """
    rng = random.Random(seed)
    figures = {"replies": count, "accepted": 0, "refused": 0, "incomplete": 0}
    for number in range(count):
        serial = bool(number % 2)
        request, reply = request_and_reply(rng, serial)
        given = mutated(rng, reply)
        verdict = _verdict(rng, request, given, serial)
        figures[verdict] += 1
        if verdict == "accepted":
            assert answers(request, given, serial), (request.hex(), given.hex())
            if request[1 if serial else 7] != WRITE and len(given) == len(reply) and len(given) > 20:
                check_possible(given[3:19] if serial else given[9:25])
    return figures


def _verdict(rng: random.Random, request: bytes, reply: bytes, serial: bool) -> str:
    if serial:
        expected = expected_reply(request[:-CHECKSUM], checksum=CHECKSUM)
    else:
        expected = expected_over_tcp(request[6:]).after(request[:4])
    cut = rng.randrange(len(reply) + 1) if rng.random() < 0.3 else 0
    for part in (reply[:cut], reply):
        if part and (verdict := expected.verdict(part)) is not None:
            # What follows a whole answer is more than was requested.
            return "accepted" if isinstance(verdict, bytes) and part == reply else "refused"
    return "incomplete"


def check_possible(payload: bytes) -> None:
    """A status made of these sixteen bytes has their values."""
    registers = tuple(int.from_bytes(payload[i : i + 2], "big") for i in range(0, 16, 2))
    for model in MODELS.values():
        status = RobotiqStatus.from_registers(registers, model=model)
        assert status.registers == registers
        assert int(status.fault) == payload[2] & 0x0F
        assert bool(status.fault) == bool(payload[2] & 0x0F), "a fault was read as none"
        assert repr(status)


# -- the live link -------------------------------------------------------------------------------------


@dataclass
class Line:
    """The line between a hand and a simulator, with one reply in so many mutated."""

    rng: random.Random
    serial: bool
    share: float
    model: Model = THREE_FINGER
    replies: int = 0
    mutated: int = 0
    statuses: int = 0
    commands: int = 0
    refused: int = 0
    given: deque[bytes] = field(default_factory=lambda: deque(maxlen=50))
    """The last replies as they went out."""

    def __call__(self, frame: bytes) -> Iterator[tuple[float, bytes]]:
        """The simulator's reply policy."""
        self.replies += 1
        if self.rng.random() < self.share:
            self.mutated += 1
            frame = mutated(self.rng, frame)
        self.given.append(frame)
        if frame and self.rng.random() < 0.1:
            cut = self.rng.randrange(len(frame))
            yield 0.0, frame[:cut]
            yield 0.0003, frame[cut:]
        else:
            yield 0.0, frame

    def check(self, status: RobotiqStatus) -> None:
        """Check that a published status is that of a whole reply just before."""
        self.statuses += 1
        said = [payload(frame, self.serial, self.model) for frame in self.given]
        read = status.registers[: self.model.tcp.count]  # on either link
        assert b"".join(each.to_bytes(2, "big") for each in read) in said, f"never sent: {status!r}"


async def live(
    server: SimulatorServer | SerialSimulatorServer, address: str, line: Line, count: int
) -> dict[str, int]:
    """Use a hand until so many replies have passed.

    Raises:
        AssertionError: a status that was never sent.
        Exception: anything but a RobotiqError that came out of a call.
    """
    server.policy = line
    policy = ReconnectPolicy(first_delay=0.0, max_delay=0.01)
    hand = RobotiqHand(
        address, poll_interval=0.001, response_timeout=0.02, reconnect=policy, model=server.gripper.model
    )

    async def command() -> None:
        while True:
            try:
                line.commands += 1
                await hand.set_position(line.rng.randrange(256))
                await hand.set_speed(line.rng.randrange(256))
            except RobotiqError:
                line.refused += 1
                await asyncio.sleep(0.003)

    while hand.state is not State.RUNNING_IDLE:
        try:
            await hand.start()
        except RobotiqError:
            line.refused += 1
    commanding = asyncio.create_task(command())
    async for status in hand.statuses(buffer=100):
        line.check(status)
        if line.replies >= count:
            break
    commanding.cancel()
    await asyncio.gather(commanding, return_exceptions=True)
    if commanding.done() and not commanding.cancelled():
        commanding.result()
    server.policy = unchanged
    await hand.stop()
    return {
        "replies": line.replies,
        "mutated": line.mutated,
        "statuses": line.statuses,
        "reconnects": hand.statistics.reconnects,
        "commands": line.commands,
        "commands refused": line.refused,
    }


@contextmanager
def memory_growth(figures: dict[str, float]) -> Iterator[None]:
    """Note by how many MiB the memory of this process has grown."""
    before = resident()
    yield
    figures["memory growth MiB"] = round((resident() - before) / 2**20, 1)


def resident() -> int:
    """Bytes of memory in use (Linux)."""
    return int(Path("/proc/self/statm").read_text(encoding="ascii").split()[1]) * 4096


async def _live_over_tcp(count: int, seed: int) -> dict[str, float]:
    async with SimulatorServer(SimulatedGripper(speedup=50, model=MODEL)) as server:
        for habit in HABITS:
            await server.fault_injector.begin(habit)
        line = Line(random.Random(seed), serial=False, share=0.25, model=MODEL)
        figures: dict[str, float] = {}
        # This fills what grows once: caches, samples, the history of writes (the last 10,000).
        await live(server, server.address, line, count // 2)
        with memory_growth(figures):
            figures |= await live(server, server.address, line, count)
        return figures


def main() -> int:
    """Run it and print the figures."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--decoder", type=int, default=1_000_000, help="replies for the decoder")
    parser.add_argument("--live", type=int, default=100_000, help="replies for a live link over TCP")
    parser.add_argument("--seed", type=int, default=int(time.time()))
    options = parser.parse_args()
    print(f"seed {options.seed}")  # noqa: T201
    logging.getLogger("robotiq_async").setLevel(logging.CRITICAL)
    figures: dict[str, float] = {}
    decoder(options.decoder // 10, options.seed)
    with memory_growth(figures):
        figures |= decoder(options.decoder, options.seed)
    print("decoder:", figures)  # noqa: T201
    print("live:", asyncio.run(_live_over_tcp(options.live, options.seed)))  # noqa: T201
    return 0


if __name__ == "__main__":
    sys.exit(main())
