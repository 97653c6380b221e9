"""A real browser, driven from threads so that the loop of the test stays free; Debian's chromium does."""

from __future__ import annotations

import asyncio
import contextlib
import json
import shutil
import tempfile
from collections.abc import Callable
from time import monotonic
from typing import Any, Final, Literal, TypeVar

from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException, TimeoutException
from selenium.webdriver.chrome.service import Service
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.by import By
from selenium.webdriver.remote.webelement import WebElement
from selenium.webdriver.support.wait import WebDriverWait

T = TypeVar("T")

BROWSER: Final = shutil.which("chromium") or shutil.which("google-chrome")
DRIVER: Final = shutil.which("chromedriver")
MISSING: Final = "needs a browser and its driver: apt-get install chromium chromium-driver"
PATIENCE: Final = 20
SMALL: Final = (460, 420)
"""Size of a window in pixels: drawing without a graphics card takes the processor's time."""
FLAGS: Final = (
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
LINK: Final = """
const scene = window[Object.keys(window).find((key) => key.startsWith('scene_'))];
const [palm, link] = [arguments[1], arguments[0]].map((name) => scene.getObjectByName(name));
if (!palm || !link) return null;
scene.updateMatrixWorld(true);
return palm.worldToLocal(link.getWorldPosition(palm.position.clone())).toArray();
"""
"""The place at which the browser draws a link, in the frame of the root."""
MIDDLE: Final = "arguments[0].scrollIntoView({block: 'center'})"
VISIBLE: Final = """
const scene = window[Object.keys(window).find((key) => key.startsWith('scene_'))];
return scene.getObjectByName(arguments[0]).visible;
"""
GEOMETRY: Final = """
const scene = window[Object.keys(window).find((key) => key.startsWith('scene_'))];
return scene.getObjectByName(arguments[0]).geometry.parameters;
"""
COLORS: Final = """
const scene = window[Object.keys(window).find((key) => key.startsWith('scene_'))];
return scene.getObjectByName(arguments[0]).children.map((each) => each.material?.color.getHexString());
"""


class Part:
    """A part of the page, looked up at each use: the page may put another element in its place."""

    def __init__(self, driver: webdriver.Chrome, name: str) -> None:
        self._driver = driver
        self._selector = f"[data-testid={name}]"

    @property
    def text(self) -> str:
        return self._used(lambda element: element.text)

    @property
    def tag_name(self) -> str:
        return self._used(lambda element: element.tag_name)

    def get_attribute(self, name: str) -> str | None:
        return self._used(lambda element: element.get_attribute(name))

    def is_displayed(self) -> bool:
        return self._used(WebElement.is_displayed)

    def is_enabled(self) -> bool:
        return self._used(WebElement.is_enabled)

    def click(self) -> None:
        self._used(WebElement.click)

    def move_to_middle(self) -> None:
        self._used(lambda element: self._driver.execute_script(MIDDLE, element))

    def _used(self, use: Callable[[WebElement], T]) -> T:
        end = monotonic() + PATIENCE
        while monotonic() < end:
            with contextlib.suppress(StaleElementReferenceException):
                return use(self._driver.find_element(By.CSS_SELECTOR, self._selector))
        raise AssertionError(f"{self._selector} is replaced all the time")


class Browser:
    """One browser with its own profile; a window at a time is driven."""

    def __init__(self) -> None:
        assert BROWSER is not None
        assert DRIVER is not None
        self._profile = tempfile.mkdtemp(prefix="robotiq_async-")
        options = webdriver.ChromeOptions()
        options.binary_location = BROWSER
        for flag in (*FLAGS, f"--window-size={SMALL[0]},{SMALL[1]}", f"--user-data-dir={self._profile}"):
            options.add_argument(flag)
        options.set_capability("goog:loggingPrefs", {"browser": "ALL", "performance": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=Service(DRIVER))

    def quit(self) -> None:
        self.driver.quit()
        shutil.rmtree(self._profile, ignore_errors=True)

    def resize(self, width: int, height: int) -> None:
        """Show the page at a size, that of a phone too: a window is not narrower than 500 pixels."""
        metrics = {"width": width, "height": height, "deviceScaleFactor": 1, "mobile": False}
        self.driver.execute_cdp_cmd("Emulation.setDeviceMetricsOverride", metrics)

    def is_dark(self) -> bool:
        return "body--dark" in str(self.driver.find_element(By.TAG_NAME, "body").get_attribute("class"))

    async def do(self, work: Callable[[], T]) -> T:
        """Drive it, in a thread."""
        return await asyncio.to_thread(work)

    async def open(self, url: str) -> None:
        await self.do(lambda: self.driver.get(url))

    async def until(self, condition: Callable[[], T | Literal[False]]) -> T:
        """Look again and again until it is so; returns what was looked for."""
        waiting = WebDriverWait(self.driver, PATIENCE, 0.05, ignored_exceptions=(Exception,))
        found: T = await self.do(lambda: waiting.until(lambda _: condition()))
        return found

    def find(self, name: str) -> Part:
        return Part(self.driver, name)

    def has(self, name: str) -> bool:
        return bool(self.driver.find_elements(By.CSS_SELECTOR, f"[data-testid={name}]"))

    async def says(self, name: str, words: str) -> str:
        """Wait until a part of the page has these words; returns all of them."""
        try:
            return await self.until(lambda: words in self.find(name).text and self.find(name).text)
        except TimeoutException:
            said = self.find(name).text if self.has(name) else None
            raise AssertionError(f"{name} says {said!r}, and not {words!r}") from None

    async def click(self, name: str) -> None:
        await self.until(lambda: self.find(name).is_enabled())
        # In the middle of the window: at its foot the halt would be hit.
        await self.do(self.find(name).move_to_middle)
        await self.do(self.find(name).click)

    async def press_keys(self, keys: str) -> None:
        """Press keys in the element with the focus."""
        await self.do(lambda: ActionChains(self.driver).send_keys(keys).perform())

    async def focus_slider(self, name: str) -> None:
        await self.run(f"document.querySelector('[data-testid={name}] [tabindex]').focus()")

    async def run(self, script: str, *arguments: object) -> Any:
        return await self.do(lambda: self.driver.execute_script(script, *arguments))

    def link(self, name: str, root: str = "palm") -> Any:
        """The place at which it draws a link, in the frame of the root; None before it does."""
        return self.driver.execute_script(LINK, name, root)

    async def in_touch(self) -> None:
        """Wait until the page knows the time of the server, and may press buttons."""
        await self.until(lambda: self.driver.execute_script("return window.robotiqTime > 0"))

    def _log(self, kind: str) -> list[dict[str, Any]]:
        return list(self.driver.get_log(kind))  # type: ignore[no-untyped-call]

    def requested(self) -> set[str]:
        """Every address that was requested since the last time, except the browser's own requests."""
        messages = [json.loads(each["message"])["message"] for each in self._log("performance")]
        asked = {
            each["params"].get("request", each["params"]).get("url", "")
            for each in messages
            if each["method"] in ("Network.requestWillBeSent", "Network.webSocketCreated")
        }
        # The tab that Chromium begins with draws icons of its own, at any time; none is from another host.
        return {url for url in asked if not url.startswith("chrome://")}

    def complaints(self) -> list[str]:
        """Complaints of the page since the last time."""
        return [each["message"] for each in self._log("browser") if each["level"] == "SEVERE"]


class Pace:
    """The clock of a simulated gripper, which may run faster or slower than ours."""

    def __init__(self, rate: float = 1.0) -> None:
        """Start a clock with a rate relative to ours."""
        self._rate = rate
        self._at = self._now = monotonic()

    def __call__(self) -> float:
        """The time there."""
        at = monotonic()
        self._now += self._rate * (at - self._at)
        self._at = at
        return self._now

    def set(self, rate: float) -> None:
        """Set its rate relative to ours from now on."""
        self()
        self._rate = rate
