"""A client in a process of its own, to be killed, or to call without a pause.

python -m tests.ros2.live.client goal RADIANS       sends it, says that it began and how it ended, and waits
python -m tests.ros2.live.client hammer SERVICE N   calls it N times, ten at a time
"""

from __future__ import annotations

import sys
import time

from tests.ros2.live.bench import Client, waited


def goal(client: Client, radians: str) -> None:
    sent = client.move(float(radians))
    sent.feedback.wait(new=False)
    print("under way", flush=True)  # noqa: T201
    print(f"ended: {sent.ends()[0]}", flush=True)  # noqa: T201
    time.sleep(3600)


def hammer(client: Client, service: str, times: str) -> None:
    client.call(service)
    began, well = time.monotonic(), 0
    print("begun", flush=True)  # noqa: T201
    for _ in range(int(times) // 10):
        well += sum(waited(answer).success for answer in [client.begin(service) for _ in range(10)])
    print(f"{well} answers in {time.monotonic() - began:.2f} s", flush=True)  # noqa: T201


if __name__ == "__main__":
    with Client() as this:
        what, *arguments = sys.argv[1:]
        (goal if what == "goal" else hammer)(this, *arguments)
