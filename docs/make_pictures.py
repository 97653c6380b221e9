"""Makes the pictures of the monitor and of recordings, from simulated grippers. Takes half a minute.

    python docs/make_pictures.py

They are made by hand when what they show has changed, and looked at: they hold times and figures of that day.
"""

from __future__ import annotations

import asyncio
import math
import re
import sys
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

ROOT: Final = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from robotiq_async import TWO_FINGER_85, Finger, RobotiqError, RobotiqHand, State  # noqa: E402
from robotiq_async.cli.output.messages import forwarded_warnings  # noqa: E402
from robotiq_async.cli.tui.screen import Monitor  # noqa: E402
from robotiq_async.simulator import SimulatedGripper, SimulatorServer  # noqa: E402
from robotiq_async.tools.actions import ACTIONS, Operator  # noqa: E402
from robotiq_async.tools.measure.recording_plot import plot_recordings  # noqa: E402
from robotiq_async.tools.recording.curves import RecordingCurves, read_curves  # noqa: E402
from robotiq_async.tools.recording.recorder import Recorder  # noqa: E402
from robotiq_async.tools.recording.recordings import read_recording  # noqa: E402

FOLDER: Final = ROOT / "docs" / "measured"
FONT: Final = re.compile(r"@font-face \{.*?\}", re.DOTALL)
"""The pictures would fetch a font from elsewhere; any font of even width will do."""


async def main() -> None:
    """All of them."""
    await recordings()
    gripper = SimulatedGripper()
    async with SimulatorServer(gripper, port=5020) as server:
        hand = RobotiqHand(server.address)
        operator = Operator(hand)
        await hand.start()
        screen = Monitor(operator)
        with forwarded_warnings(screen.write_log, of=hand.name):
            async with screen.run_test(size=(100, 28)):
                await grasp(screen, operator, gripper)
                await fault(screen, operator, gripper)
                await loss(screen, operator, server)
        await hand.stop()


async def recordings() -> None:
    """A jaw that streams, with a part and without; and a grasp of something soft by three fingers."""
    with TemporaryDirectory() as folder:
        cup = await streamed(Path(folder) / "cup.mcap", 120)
        plot_recordings(FOLDER / "episodes", [cup, await streamed(Path(folder) / "nothing.mcap")])
        plot_recordings(FOLDER / "grasp", [await soft_grasp(Path(folder) / "grasp.mcap")])
    for name in ("episodes", "grasp"):
        (FOLDER / f"{name}.png").unlink()
        sys.stdout.write(f"docs/measured/{name}.svg\n")


async def streamed(file: Path, part: int | None = None) -> RecordingCurves:
    """A 2F-85 that a policy streams to, for 6 s; the link is lost for a moment where there is no part."""
    gripper = SimulatedGripper(model=TWO_FINGER_85)
    if part is not None:
        gripper.place_object(Finger.A, part, soft=12)
    is_cut = part is not None
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address, model=TWO_FINGER_85) as hand,
        Recorder(hand, file) as recorder,
    ):
        recorder.mark(file.stem)
        began = hand.status.timestamp
        async for status in hand.statuses():
            at = status.timestamp - began
            if at > 6:
                break
            with suppress(RobotiqError):
                hand.command(position=round(110 - 105 * math.cos(1.3 * at)), speed=200, force=60)
            if at > 3 and not is_cut:
                is_cut = True
                server.refuse()
                server.cut()
                await hand.wait_for_state(State.DISCONNECTED)
                await asyncio.sleep(0.5)
                await server.accept()
    return read(file)


async def soft_grasp(file: Path) -> RecordingCurves:
    """Three fingers grasp something soft; a fault comes in the middle of the opening."""
    gripper = SimulatedGripper()
    gripper.place_object(Finger.A, 120, soft=20)
    gripper.place_object(Finger.B, 150, soft=20)
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address) as hand,
        Recorder(hand, file),
    ):
        await hand.close(speed=200, force=200)
        opening = asyncio.ensure_future(hand.open(speed=100))
        await asyncio.sleep(1)
        gripper.inject_fault(0x09)
        await asyncio.sleep(0.5)
        gripper.clear_faults()
        await asyncio.gather(opening, return_exceptions=True)
        await hand.wait_for_state(State.RUNNING_IDLE)
        await hand.open()
    return read(file)


def read(file: Path) -> RecordingCurves:
    curves = read_curves(file.name, read_recording(file))
    assert curves is not None, "it has statuses"
    return curves


async def grasp(screen: Monitor, operator: Operator, gripper: SimulatedGripper) -> None:
    """A is stopped by something early, B and C go on; the picture is of the moment in between."""
    await asyncio.sleep(2)
    screen.action_act("pinch")
    await asyncio.sleep(2)
    screen.action_speed(-64)
    await asyncio.sleep(0.5)
    gripper.place_object(Finger.A, 90)
    gripper.place_object(Finger.B, 200)
    closing = asyncio.ensure_future(operator.act(ACTIONS["close"]))
    await asyncio.sleep(3)
    save(screen, "monitor")
    screen.write_log(f"close: {await closing}", "bold")


async def fault(screen: Monitor, operator: Operator, gripper: SimulatedGripper) -> None:
    """A question is asked."""
    gripper.inject_fault(0x0E)
    await operator.hand.wait_for_state(State.FAULT)
    screen.action_act("recover")
    await asyncio.sleep(0.5)
    save(screen, "monitor_question")
    screen.ask(None)


async def loss(screen: Monitor, operator: Operator, server: SimulatorServer) -> None:
    """The link is gone, and comes back."""
    server.refuse()
    server.cut()
    await operator.hand.wait_for_state(State.DISCONNECTED)
    await asyncio.sleep(1.5)
    save(screen, "monitor_lost")
    await server.accept()


def save(screen: Monitor, name: str) -> None:
    """Write the screen as it is."""
    file = FOLDER / f"{name}.svg"
    file.write_text(FONT.sub("", screen.export_screenshot(title="robotiq-async monitor")), encoding="utf-8")
    sys.stdout.write(f"{file.relative_to(ROOT)}\n")


if __name__ == "__main__":
    asyncio.run(main())
