"""Takes the pictures of the page in the browser, and a short animation, from a simulated gripper. A minute.

    python docs/make_web_pictures.py

Needs Debian's chromium and chromium-driver, selenium and Pillow. They are taken by hand when what they show
has changed, and looked at.
"""

from __future__ import annotations

import asyncio
import io
import sys
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Final

from PIL import Image

ROOT: Final = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from demo import grasp_loop  # noqa: E402
from robotiq_async import WIDTH_NORMAL, WIDTH_WIDE, Finger, RobotiqHand, RobotiqStatus  # noqa: E402
from robotiq_async.simulator import SimulatedGripper, SimulatorServer  # noqa: E402
from robotiq_async.tools.actions import Operator  # noqa: E402
from robotiq_async.tools.web.server import PageServer  # noqa: E402
from robotiq_async.tools.web.settings import PageSettings  # noqa: E402
from tests.web.browser import Browser, Pace  # noqa: E402

FOLDER: Final = ROOT / "docs" / "measured"
FRAME_S: Final = 0.3
SLOWER: Final = 4
"""So many times slower is the gripper that is filmed: without a graphics card drawing takes its time."""
PATIENCE_S: Final = 60.0
"""For a slow move."""
WIDTH: Final = 760
"""Of the animation, in pixels."""


async def main() -> None:
    """All of them."""
    pace = Pace()
    gripper, browser = SimulatedGripper(pace), Browser()
    try:
        async with SimulatorServer(gripper, port=5020) as server, RobotiqHand(server.address) as hand:
            settings = PageSettings(port=0, control=True, addresses=(hand.address,), speed=128, force=64)
            async with PageServer([hand], settings, operators=[Operator(hand, who="the page")]) as page:
                await resize(browser, 1040, 600)
                await browser.open(page.url)
                await browser.says("statistics", "polls")
                pace.set(1 / SLOWER)
                await animation(browser, hand, gripper)
                pace.set(1)
                await stills(browser, hand, gripper, server)
        await part(browser)
    finally:
        browser.quit()


async def animation(browser: Browser, hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    """Wide, normal, a grasp, and open again."""

    async def play() -> None:
        await hand.move(WIDTH_WIDE, Finger.SCISSOR, speed=255, timeout=PATIENCE_S)
        await hand.move(WIDTH_NORMAL, Finger.SCISSOR, speed=255, timeout=PATIENCE_S)
        gripper.place_object(Finger.ABC, position=85)
        await hand.close(speed=60, timeout=PATIENCE_S)
        await asyncio.sleep(SLOWER)
        await hand.open(speed=60, timeout=PATIENCE_S)
        gripper.remove_object()

    await light(browser, dark=False)
    frames, durations = await film(browser, play)
    await asyncio.to_thread(save, "web", frames, durations)  # the hand is polled meanwhile


class FromThread:
    """The hand of a page, for a program in another thread, which takes it for a blocking one."""

    def __init__(self, hand: RobotiqHand) -> None:
        self._hand = hand
        self._loop = asyncio.get_running_loop()

    @property
    def status(self) -> RobotiqStatus:
        """The newest one."""
        return self._hand.status

    def command(self, *, position: int) -> None:
        """The one call of the loop that moves."""
        self._loop.call_soon_threadsafe(lambda: self._hand.command(position=position))

    def hold(self) -> None:
        """The end of the loop."""
        asyncio.run_coroutine_threadsafe(self._hand.hold(), self._loop).result()


async def part(browser: Browser) -> None:
    """A part that bodies grip and let go of, by the loop of demo/grasp_loop.py."""
    address = f"sim://?model=2f85&speedup={1 / SLOWER}&physics=box:30x40x60,0.3"
    grasp_loop.PERIOD_S *= SLOWER
    async with RobotiqHand(address, speed=grasp_loop.SPEED, force=grasp_loop.FORCE) as hand:
        settings = PageSettings(port=0, addresses=("sim://?model=2f85&physics=box:30x40x60,0.3",))

        async def play() -> None:
            await asyncio.to_thread(grasp_loop.close_until_contact, FromThread(hand))
            await asyncio.sleep(SLOWER)
            await hand.open(timeout=PATIENCE_S)

        async with PageServer([hand], settings) as page:
            await resize(browser, 1040, 600)
            await browser.open(page.url)
            await browser.says("statistics", "polls")
            await light(browser, dark=False)
            await asyncio.sleep(1.5)
            await asyncio.to_thread(save, "web_part", *await film(browser, play))


def save(name: str, frames: list[Image.Image], durations: list[int]) -> None:
    """An animation."""
    size = (WIDTH, frames[0].height * WIDTH // frames[0].width)
    first, *others = [frame.resize(size, Image.Resampling.LANCZOS) for frame in frames]
    first.save(
        FOLDER / f"{name}.webp",
        save_all=True,
        append_images=others,
        duration=durations,
        loop=0,
        quality=60,
        method=6,
    )


async def stills(
    browser: Browser, hand: RobotiqHand, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    """Closing, holding something in the dark, on a phone, and lost."""
    await resize(browser, 1200, 900)
    closing = asyncio.create_task(hand.close(speed=100))
    await asyncio.sleep(1.2)
    await keep(browser, "web_closing")
    await closing
    await hand.open(speed=255)
    gripper.place_object(Finger.ABC, position=85)
    await hand.close(speed=255)
    await light(browser, dark=True)
    await asyncio.sleep(1.5)
    await keep(browser, "web_holding")
    await light(browser, dark=False)
    await resize(browser, 400, 820)
    await asyncio.sleep(1.5)
    await keep(browser, "web_phone")
    await resize(browser, 1200, 760)
    server.refuse()
    server.cut()
    await browser.says("state", "lost")
    await asyncio.sleep(1.5)
    await keep(browser, "web_lost")
    await server.accept()
    await browser.says("state", "holding")


async def film(browser: Browser, play: Callable[[], Awaitable[None]]) -> tuple[list[Image.Image], list[int]]:
    """The frames of an animation, and the milliseconds of each."""
    frames, durations = [], []
    playing, loop = asyncio.ensure_future(play()), asyncio.get_running_loop()
    while not playing.done():
        began = loop.time()
        frames.append(await shot(browser))
        await asyncio.sleep(max(FRAME_S - (loop.time() - began), 0))
        durations.append(round(1000 * (loop.time() - began) / SLOWER))
    await playing
    return frames, durations


async def shot(browser: Browser) -> Image.Image:
    """A picture of the window."""
    data = await browser.do(browser.driver.get_screenshot_as_png)
    return Image.open(io.BytesIO(data)).convert("RGB")


async def keep(browser: Browser, name: str) -> None:
    """A picture in the folder."""
    (await shot(browser)).save(FOLDER / f"{name}.webp", quality=80, method=6)


async def light(browser: Browser, *, dark: bool) -> None:
    """Light or dark."""
    await browser.click("dark_mode" if dark else "light_mode")


async def resize(browser: Browser, width: int, height: int) -> None:
    """Another window, or a phone."""
    metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": width < 600}
    await browser.do(lambda: browser.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics))
    await browser.run("window.dispatchEvent(new Event('resize'))")


if __name__ == "__main__":
    asyncio.run(main())
