"""The page as a person sees it: in a real browser. One of it, one hand and one page serve all tests."""

from __future__ import annotations

import asyncio
import contextlib
import os
import shutil
import signal
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass
from functools import partial
from html import escape
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any, Literal

import pytest
import pytest_asyncio

pytest.importorskip("nicegui", reason="the page needs the extra web")
pytest.importorskip("selenium", reason="a browser is driven with the extra dev")

from selenium.common.exceptions import WebDriverException
from selenium.webdriver.common.action_chains import ActionChains
from selenium.webdriver.common.keys import Keys

from docs.site.__main__ import MERMAID
from robotiq_async import (
    OPEN,
    WIDTH_NORMAL,
    Fault,
    Finger,
    MotionInhibitedError,
    RobotiqHand,
    RobotiqStatus,
    State,
)
from robotiq_async.hands import Hand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.actions import Operator
from robotiq_async.tools.description import hand_model
from robotiq_async.tools.description.kinematics import JOINTS, joint_angles, joint_names
from robotiq_async.tools.description.simulated import bodies_of
from robotiq_async.tools.web.page.widgets.controls import ROWS
from robotiq_async.tools.web.server import PageServer, serve_page
from robotiq_async.tools.web.settings import PageSettings
from robotiq_async.values.enums import DEFAULT_SPEED, JAW
from robotiq_async.values.model import THREE_FINGER
from tests.conftest import watched
from tests.docs.pages import DOCS, blocks, read
from tests.fake_hand import FakeHand
from tests.virtual import HoldWatch
from tests.web.browser import BROWSER, COLORS, DRIVER, GEOMETRY, MISSING, SMALL, VISIBLE, Browser, Pace
from tests.web.measures import CONTRAST, COVERED, WIDE

pytestmark = pytest.mark.asyncio(loop_scope="module")

FAST, SLOW = 20.0, 0.25
LATER = "a halt came after the one that was seen"


@contextlib.asynccontextmanager
async def shown(*hands: Hand, control: bool = True) -> AsyncIterator[PageServer]:
    """The page of some hands."""
    operators = [Operator(hand, who="the page") for hand in hands] if control else []
    settings = PageSettings(port=0, control=control, addresses=tuple(hand.address for hand in hands))
    async with PageServer(hands, settings, operators=operators) as page:
        yield page


@dataclass
class Stage:
    """A gripper with its own clock, its hand and the page."""

    pace: Pace
    gripper: SimulatedGripper
    server: SimulatorServer
    hand: RobotiqHand
    page: PageServer

    async def clear(self) -> None:
        """Restore the state before the first test."""
        self.pace.set(FAST)
        self.gripper.remove_object()
        self.gripper.clear_faults()
        await self.hand.permit()
        async with asyncio.timeout(20):
            await anext(self.hand.statuses())  # a busy machine may have cost the link
        if self.hand.state is State.FAULT:
            await self.hand.recover()
        if self.hand.state is State.RESET:
            await self.hand.activate()
        await self.hand.set_speed(DEFAULT_SPEED)
        await self.hand.open()
        await self.hand.move(WIDTH_NORMAL, Finger.SCISSOR)

    async def slow(self) -> None:
        """Slow the gripper down: a stroke takes 40 seconds, and a click on a busy machine ten."""
        await self.hand.set_speed(0)
        self.pace.set(SLOW)


@pytest_asyncio.fixture(loop_scope="module", scope="module")
async def whole_stage() -> AsyncIterator[Stage]:
    pace = Pace(FAST)
    gripper = SimulatedGripper(pace, spread=False)
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address) as hand,
        shown(hand) as page,
    ):
        yield Stage(pace, gripper, server, hand, page)
    left = asyncio.all_tasks() - {asyncio.current_task()}
    assert not left, f"tasks left running: {left}"


@pytest_asyncio.fixture(loop_scope="module")
async def stage(whole_stage: Stage) -> Stage:
    await whole_stage.clear()
    return whole_stage


@pytest.fixture
def hand(stage: Stage) -> RobotiqHand:
    return stage.hand


@pytest_asyncio.fixture(loop_scope="module")
async def nothing_left_running(whole_stage: Stage, caplog: pytest.LogCaptureFixture) -> AsyncIterator[None]:
    with watched(
        caplog, tasks=False
    ):  # the stage has tasks of its own, and looks for what is left when it ends
        yield


@pytest.fixture(scope="module")
def shared_browser() -> Iterator[Browser]:
    if BROWSER is None or DRIVER is None:
        pytest.skip(MISSING)
    browser = Browser()
    yield browser
    browser.quit()


@pytest.fixture
def window(shared_browser: Browser) -> Iterator[Browser]:
    """The browser, with one window, and nothing in its logs."""
    driver = shared_browser.driver
    driver.execute_cdp_cmd("Emulation.clearDeviceMetricsOverride", {})
    driver.set_window_size(*SMALL)
    shared_browser.requested()
    shared_browser.complaints()
    yield shared_browser
    first, *others = driver.window_handles
    for other in others:
        driver.switch_to.window(other)
        driver.close()
    driver.switch_to.window(first)


@pytest_asyncio.fixture(loop_scope="module")
async def browser(window: Browser, stage: Stage) -> Browser:
    """It, with the page of the hand, in touch."""
    await window.open(stage.page.url)
    await window.in_touch()
    return window


async def press(browser: Browser, hand: RobotiqHand, name: str) -> None:
    """Press a button until the fingers move: on a busy machine that may come too late."""
    for _ in range(10):
        await browser.click(name)
        with contextlib.suppress(TimeoutError):
            await seen(hand, moving=True, within=2)
            return
    pytest.fail(f"{name} moves nothing: {browser.find('outcome').text}")


async def seen(hand: RobotiqHand, *, moving: bool, go: bool = True, within: float = 20) -> RobotiqStatus:
    """Wait until the fingers move or stand still, with rGTO set or not."""
    async with asyncio.timeout(within):
        async for status in hand.statuses():
            if status.is_moving is moving and (go or not status.go_echo):
                return status
    raise AssertionError("the hand has ended")


# -- the display -------------------------------------------------------------------------------------------


async def test_the_page_loads_and_asks_no_other_host(browser: Browser, stage: Stage) -> None:
    await browser.says("state", "ready")
    assert await browser.says("fault", "no fault")
    await browser.says("statistics", "polls")
    await browser.until(lambda: browser.link("finger_1_link_3"))
    base = stage.page.url.partition("?")[0].removeprefix("http://")
    for url in browser.requested():
        scheme, _, rest = url.partition("://")
        assert (scheme in ("http", "ws") and rest.startswith(base)) or url.startswith(("data:", "blob:")), url
    # Chromium requests an icon by itself, at the door, where it has no cookie.
    assert [each for each in browser.complaints() if "favicon" not in each] == []
    assert "token" not in await browser.run("return location.href")


async def test_following_a_link_opens_the_page(window: Browser, stage: Stage) -> None:
    """The link may be in a terminal in the browser, or in the file of --open: without cookies then."""
    await window.open(f"data:text/html,<a id=link href='{stage.page.url}'>here</a>")
    await window.do(lambda: window.driver.find_element("id", "link").click())
    await window.says("state", "ready")


async def test_the_joints_move_when_the_gripper_moves(browser: Browser, hand: RobotiqHand) -> None:
    """Three.js puts every link at the library's place for it."""
    for position, scissor in ((120, 60), (200, 219)):
        await hand.move(0)
        await hand.move(scissor, Finger.SCISSOR)
        await hand.move(position)
        poses = hand_model().link_poses(dict(zip(JOINTS, joint_angles(hand.status), strict=True)))
        for link in ("finger_1_link_3", "finger_2_link_2", "finger_middle_link_3", "finger_middle_link_1"):
            expected = poses[link].position
            await browser.until(partial(is_at, browser, link, expected))


def is_at(browser: Browser, link: str, position: tuple[float, float, float], root: str = "palm") -> bool:
    return bool(browser.link(link, root) == pytest.approx(position, abs=1e-4))


@pytest.mark.parametrize("name", ["2f85", "2f140", "hand-e"])
async def test_a_sibling_is_drawn_where_its_joint_says(window: Browser, name: str) -> None:
    async with RobotiqHand(f"sim://?model={name}&speedup=20") as jaw, shown(jaw) as page:
        await jaw.activate()
        await jaw.move(150)
        await window.open(page.url)
        await window.in_touch()
        model = hand_model(name)
        poses = model.link_poses(dict(zip(joint_names(jaw.model), joint_angles(jaw.status), strict=True)))
        for link in model.touching[JAW]:
            expected = poses[link].position
            await window.until(partial(is_at, window, link, expected, model.root))
        assert await window.says("state", "ready")
        shown_rows = [
            name for name, *_ in ROWS if await window.do(window.find(f"position-{name}").is_displayed)
        ]
        assert shown_rows == ["A"]
        assert not await window.do(window.find("pinch").is_displayed)


async def test_the_part_is_drawn_and_touching_pads_glow(browser: Browser, stage: Stage) -> None:
    await browser.until(lambda: browser.link("finger_1_link_3"))
    assert not await browser.run(VISIBLE, "bar")
    stage.gripper.place_object(Finger.ABC, position=90)
    await stage.hand.close()
    await browser.until(lambda: browser.driver.execute_script(VISIBLE, "bar"))
    await browser.until(lambda: "ff5a1f" in browser.driver.execute_script(COLORS, "finger_middle_link_3"))
    assert await browser.says("axes", "contact while closing")
    await stage.hand.open()
    await browser.until(lambda: not browser.driver.execute_script(VISIBLE, "bar"))


async def test_a_simulated_part_is_drawn_where_its_simulation_has_it(window: Browser) -> None:
    """And no guess of what the fingers hold: the part is seen before they meet it."""
    pytest.importorskip("mujoco", reason="needs the extra physics")
    size = {"width": 0.03, "height": 0.04, "depth": 0.06}
    address = "sim://?model=2f85&speedup=5&physics=box:30x40x60,0.3"
    async with RobotiqHand(address) as jaw, shown(jaw) as page:
        model = hand_model(jaw.model)
        await jaw.activate()
        await window.open(page.url)
        await window.in_touch()
        for move in (jaw.open, jaw.close):
            await move()
            bodies = bodies_of(jaw)
            assert bodies is not None
            (part,), poses = bodies.parts, model.link_poses(bodies.joints)
            await window.until(partial(is_at, window, "part_0", part.position, model.root))
            for link in model.touching[JAW]:
                await window.until(partial(is_at, window, link, poses[link].position, model.root))
        assert jaw.status.contacts
        assert size.items() <= (await window.run(GEOMETRY, "part_0")).items()
        assert await window.run(VISIBLE, "part_0")
        assert not await window.run(VISIBLE, "bar")


async def test_the_page_of_a_gripper_that_is_lost_and_comes_back(browser: Browser, stage: Stage) -> None:
    await browser.says("state", "ready")
    stage.server.refuse()
    stage.server.cut()
    await browser.says("state", "lost")
    await browser.says("fault", "what is shown is old")
    await stage.server.accept()
    await browser.says("state", "ready")
    stage.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await browser.says("fault", Fault.SCISSOR_BLOCKED.description)
    await browser.says("events", "0x0E")


async def test_many_hands_have_a_tile_each_and_it_fits_on_a_phone(window: Browser, hand: RobotiqHand) -> None:
    async with FakeHand() as other, shown(other, hand) as page:
        await window.do(lambda: window.driver.set_window_size(500, 900))
        await window.open(page.url)
        for tile in ("tile-0", "tile-1"):
            await window.says(tile, "ready")
        link = window.find("tile-1")
        assert link.tag_name == "a", "a link, for another tab and for the keyboard"
        assert str(link.get_attribute("href")).startswith(page.url.partition("?")[0])
        await window.click("tile-1")
        await window.says("address", hand.address)
        await window.says("state", "ready")
        await window.until(lambda: window.find("halt").is_displayed())
        # In the window without scrolling, and nothing stands out to the side.
        for place in (0, 10_000):
            await window.run("window.scrollTo(0, arguments[0])", place)
            assert await window.run(
                "const box = document.querySelector('[data-testid=halt]').getBoundingClientRect();"
                "return box.bottom <= innerHeight && box.height > 50 && box.width > innerWidth * 0.9"
                " && document.documentElement.scrollWidth <= document.documentElement.clientWidth"
            )


# -- what it makes the hand do -----------------------------------------------------------------------------


async def test_halt_stops_it_and_so_does_the_space_bar(browser: Browser, stage: Stage) -> None:
    hand = stage.hand
    await stage.slow()
    await press(browser, hand, "close")
    await browser.click("halt")
    status = await seen(hand, moving=False, go=False)
    assert status.position(Finger.A) < 200
    await browser.says("events", "halt: every axis has stopped")
    # It stays: whatever is pressed, and whatever the program asks.
    await browser.says("banner", "motion is inhibited: HALT was pressed (the page)")
    with pytest.raises(MotionInhibitedError):
        await hand.close()
    assert not await browser.do(browser.find("close").is_enabled)
    await permit(browser, hand)
    # While the button that was clicked has the focus: the space bar would press it again.
    await press(browser, hand, "close")
    await browser.press_keys(" ")
    await seen(hand, moving=False, go=False)


async def permit(browser: Browser, hand: RobotiqHand) -> None:
    """By the button that stands first, and its question."""

    def insist() -> bool:  # a yes does not count before it can have been read
        with contextlib.suppress(WebDriverException):
            browser.find("yes-permit" if browser.has("yes-permit") else "helps").click()
        return hand.inhibited is None

    await browser.until(insist)


async def test_a_yes_is_for_the_halt_that_its_question_showed(browser: Browser, stage: Stage) -> None:
    """It lifted the newest one, also where that came after the question."""
    hand = stage.hand
    await hand.inhibit("the guard is open", who="PLC")
    await browser.says("banner", "the guard is open (PLC)")

    def insist() -> bool:  # a yes does not count before it can have been read
        with contextlib.suppress(WebDriverException):
            browser.find("yes-permit").click()
        return not browser.has("yes-permit")

    def answer() -> str:
        said = browser.find("outcome").text
        return said if LATER in said or "too late" in said else ""

    said = "too late"
    while "too late" in said:  # a busy machine may have held up the press
        await browser.click("helps")
        await browser.says("about-permit", "motion is inhibited: the guard is open (PLC), since")
        await hand.inhibit("a hand is in the gripper")
        assert hand.inhibited is not None
        await browser.says("banner", f"{hand.inhibited.halts} halts")
        await browser.until(insist)
        said = str(await browser.until(lambda: answer() or False))
    assert LATER in said
    assert hand.inhibited is not None
    await permit(browser, hand)


async def test_the_loop_of_a_service_moves_nothing_after_an_operators_halt(
    window: Browser, stage: Stage, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The page of the documentation, word for word, beside the real page: it grasped again after a second."""
    names: dict[str, Any] = {}
    address = f"sim://?speedup={FAST}"
    monkeypatch.setenv("GRIPPER", address)
    exec(compile(blocks(read("how-to/service.md"), "python")[0].text, "service.md", "exec"), names)
    hand: RobotiqHand = names["hand"]
    async with shown(hand) as page:
        running = asyncio.create_task(names["main"]())
        await seen(hand, moving=True)
        await window.open(page.url)
        await window.in_touch()
        await window.click("halt")
        await window.says("state", "inhibited")
        halted = hand.status
        positions = [halted.position(axis) for axis in THREE_FINGER.axes]
        async for status in hand.statuses(lost_after=10):
            assert [status.position(axis) for axis in THREE_FINGER.axes] == positions
            if status.timestamp > halted.timestamp + 3:  # the loop tries again each second
                break
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await hand.stop()


async def test_a_password_lets_a_person_in(window: Browser, hand: RobotiqHand) -> None:
    """A browser sent the form without an origin, and was refused whatever the password."""
    async with serve_page(hand, port=0, password="correct horse") as page:
        await window.open(page.url)
        await window.do(lambda: login(window, "wrong password"))
        await window.until(lambda: "not the password" in window.driver.page_source)
        await window.do(lambda: login(window, "correct horse"))
        await window.says("state", "ready")


def login(window: Browser, password: str) -> None:
    window.driver.find_element("name", "password").send_keys(password, Keys.ENTER)


@pytest.mark.parametrize("size", [(1280, 800), (1024, 768), (390, 844)], ids=str)
async def test_nothing_covers_anything_and_all_text_can_be_read(
    browser: Browser, stage: Stage, size: tuple[int, int]
) -> None:
    await browser.do(lambda: browser.resize(*size))
    stage.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await browser.says("banner", Fault.SCISSOR_BLOCKED.description)
    first = await browser.run("return document.querySelector('.nicegui-content button').textContent")
    assert first == "recover...", "what helps stands first"
    assert await browser.run(WIDE) == 0
    assert await browser.run(COVERED) == []
    await can_be_read(browser)
    await stage.hand.recover()


async def test_all_text_can_be_read_in_every_state(browser: Browser, stage: Stage) -> None:
    hand = stage.hand
    await browser.do(lambda: browser.resize(1280, 800))
    await browser.says("state", "ready")
    await can_be_read(browser)
    stage.gripper.place_object(Finger.ABC, position=85)
    await hand.close()
    await browser.says("state", "holding")
    await can_be_read(browser)
    await hand.open()
    await stage.slow()
    closing = asyncio.create_task(hand.close())
    await browser.says("state", "moving")
    await can_be_read(browser)
    await hand.inhibit("HALT was pressed")
    with pytest.raises(MotionInhibitedError):
        await closing
    await browser.says("state", "inhibited")
    await can_be_read(browser)
    await hand.permit()
    stage.server.refuse()
    stage.server.cut()
    await browser.says("state", "lost")
    await can_be_read(browser)
    await stage.server.accept()


async def can_be_read(browser: Browser) -> None:
    """Measure the contrast of all text, light and dark."""
    for mode in ("light_mode", "dark_mode"):
        await browser.do(browser.find(mode).click)
        await browser.until(partial(shows_mode, browser, mode))
        assert [each for each in await browser.run(CONTRAST) if each[1] < 4.5] == []
    await browser.do(browser.find("light_mode").click)


def shows_mode(browser: Browser, mode: str) -> bool:
    """Whether the page is dark or light by now, and its colours do not fade any more."""
    fading = browser.driver.execute_script("return document.getAnimations().length")
    return browser.is_dark() is (mode == "dark_mode") and not fading


async def test_a_halt_is_not_under_a_question_that_is_open(browser: Browser, stage: Stage) -> None:
    """On a phone there is no space bar; the first tap closed the question, and the fingers moved on."""
    await stage.slow()
    await press(browser, stage.hand, "close")
    await browser.click("reset")
    await browser.until(lambda: browser.find("yes-reset").is_displayed())
    await browser.do(lambda: browser.find("halt").click())
    status = await seen(stage.hand, moving=False, go=False)
    assert status.position(Finger.A) < 200
    assert stage.hand.state is State.RUNNING_IDLE
    await browser.until(lambda: not browser.has("yes-reset"))


async def test_dangerous_actions_ask_first(browser: Browser, hand: RobotiqHand) -> None:
    await browser.click("reset")
    await browser.until(lambda: browser.find("yes-reset").is_displayed())
    assert hand.state is State.RUNNING_IDLE

    def insist() -> bool:  # a question takes no yes before it can have been read, nor one that is too late
        with contextlib.suppress(WebDriverException):
            browser.find("yes-reset" if browser.has("yes-reset") else "reset").click()
        return hand.state is State.RESET

    await browser.until(insist)
    await browser.press_keys(Keys.ESCAPE)  # it may have sent it once more
    await browser.says("state", "reset")


@pytest.mark.parametrize(
    ("name", "axes"),
    [
        ("A", Finger.A),
        ("B", Finger.B),
        ("C", Finger.C),
        ("scissor", Finger.SCISSOR),
        ("fingers", Finger.ABC),
    ],
)
async def test_each_axis_is_sent_where_its_slider_was_let_go(
    name: str, axes: Finger, browser: Browser, hand: RobotiqHand
) -> None:
    """The slider alone moves nothing, and one that is not touched has the position of its axis."""
    first = next(axis for axis in THREE_FINGER.axes if axis in axes)
    await browser.until(lambda: place_of(browser, name) == hand.status.position(first))
    target, before = place_of(browser, name) + 30, hand.status
    for _ in range(10):  # a busy machine may take a press for one that is too old
        await browser.focus_slider(f"position-{name}")
        await browser.press_keys(Keys.RIGHT * (target - place_of(browser, name)))
        if place_of(browser, name) != target:
            continue  # it was set back, for nothing had been touched yet
        assert hand.status.requested_position(first) == before.requested_position(first)
        await browser.click(f"move-{name}")
        if f"{first.name} at" in await browser.until(partial(outcome_of, browser, "move")):
            break
    asked = [hand.status.requested_position(axis) for axis in THREE_FINGER.axes]
    assert asked == [
        target if axis in axes else before.requested_position(axis) for axis in THREE_FINGER.axes
    ]
    await browser.until(lambda: place_of(browser, name) == hand.status.position(first))


def place_of(browser: Browser, name: str) -> int:
    """The value of the slider of an axis."""
    return int(str(browser.find(f"position-{name}").get_attribute("aria-valuenow")))


def outcome_of(browser: Browser, name: str) -> str | Literal[False]:
    """The outcome of a command, once it has ended."""
    words = browser.find("outcome").text
    return words.startswith(f"{name}: ") and words


async def test_a_slider_sends_where_it_was_let_go(browser: Browser, hand: RobotiqHand) -> None:
    """The server knows only its value some milliseconds before."""
    requests = hand.requests()
    await browser.focus_slider("speed")
    pressed, before, done = 0, 0, 0
    while done - before < 4:  # all of them, and none too late, as on a busy machine
        pressed, before = pressed + 4, done
        await browser.press_keys(Keys.RIGHT * 4)
        answers = await browser.until(partial(speeds_set, browser, pressed))
        done = sum(each.endswith("set") for each in answers)
    await hand.move(20, Finger.A)
    assert [*requests.drain()][-1].request.axes[0].speed == DEFAULT_SPEED + pressed


async def test_a_slider_is_not_set_back_to_what_the_server_knew(browser: Browser, hand: RobotiqHand) -> None:
    """Each value was answered with itself, which overwrote the next: four steps to the right were three."""
    await browser.focus_slider("speed")
    steps = ActionChains(browser.driver)
    for _ in range(12):
        steps.send_keys(Keys.RIGHT).pause(0.015)
    await browser.do(steps.perform)
    await browser.until(partial(speeds_set, browser, 12))
    assert browser.find("speed").get_attribute("aria-valuenow") == str(DEFAULT_SPEED + 12)


def speeds_set(browser: Browser, times: int) -> list[str] | Literal[False]:
    """The outcome of each change of the speed, once there are so many."""
    lines = [line for line in browser.find("events").text.splitlines() if "set_speed" in line]
    return len(lines) >= times and lines


# -- what happens when it is gone --------------------------------------------------------------------------


async def test_closing_a_page_holds_what_it_has_set_in_motion_and_the_other_page_goes_on(
    browser: Browser, stage: Stage
) -> None:
    hand = stage.hand
    await stage.slow()
    await browser.run("window.open(location.href)")
    await browser.until(lambda: len(browser.driver.window_handles) == 2)
    first, second = browser.driver.window_handles
    await browser.do(lambda: browser.driver.switch_to.window(second))
    await browser.in_touch()
    await press(browser, hand, "close")
    await browser.do(browser.driver.close)
    status = await seen(hand, moving=False)
    assert status.position(Finger.A) < 200
    await browser.do(lambda: browser.driver.switch_to.window(first))
    await browser.says("axes", str(status.position(Finger.A)))
    stage.pace.set(FAST)
    for _ in range(10):
        await browser.click("open")
        if "A at" in await browser.says("outcome", "open: "):
            return
    pytest.fail("the other page opens nothing")


async def test_a_page_that_cannot_be_heard_holds_its_motion(browser: Browser, stage: Stage) -> None:
    """A phone may leave the wireless network: no connection is closed."""
    await stage.slow()
    await press(browser, stage.hand, "close")
    await browser.run("window.emitEvent = () => {}; window.socket.emit = () => {};")
    status = await seen(stage.hand, moving=False)
    assert status.position(Finger.A) < 200


async def test_a_browser_that_comes_back_shows_what_is_newest(browser: Browser, stage: Stage) -> None:
    """NiceGUI sends the newest first, and then what got lost before: "moving", of a hand that stood still."""
    await browser.says("state", "ready")
    await stage.slow()
    await browser.run(LOSE)
    moving = asyncio.create_task(stage.hand.move(60))
    await browser.until(lambda: browser.driver.execute_script("return window.lost"))
    await browser.run("window.socket.io.engine.close()")
    stage.pace.set(FAST)
    await moving
    shown = await browser.run("return window.robotiqTime")
    for _ in range(4):  # the first is among what it missed, or after it
        shown = await browser.until(partial(shown_after, browser, shown))
    assert browser.find("state").text == "ready"


LOSE = """
window.lost = false;
const { ws } = window.socket.io.engine.transport;
ws.onmessage = (event) => { window.lost ||= event.data.includes('"moving"'); };
"""


def shown_after(browser: Browser, time: float) -> float | Literal[False]:
    shown: float = browser.driver.execute_script("return window.robotiqTime")
    return shown > time and shown


@pytest.mark.skipif(os.name != "posix", reason="stops a process")
async def test_a_page_whose_process_stands_still_holds_its_motion_and_takes_no_press(
    browser: Browser, stage: Stage
) -> None:
    """A press in that time arrives when it runs again, or never, and moves nothing."""
    await stage.slow()
    await press(browser, stage.hand, "close")
    process = stage.page._process.pid
    os.kill(process, signal.SIGSTOP)
    try:
        status = await seen(stage.hand, moving=False)
        assert status.position(Finger.A) < 200
        await browser.says("cut", "what is shown is old")
        requests = stage.hand.requests()
        await browser.do(lambda: browser.find("open").click())
    finally:
        os.kill(process, signal.SIGCONT)
    # The press may arrive now, too late, or is gone with its connection, or its button was disabled.
    await browser.until(lambda: not browser.find("cut").is_displayed())
    assert requests.take_nowait() is None
    await press(browser, stage.hand, "close")  # it comes after what was pressed before
    targets = [each.request.axes[0].position for each in requests.drain() if each.request.go]
    assert targets
    assert OPEN not in targets


# -- what it costs -----------------------------------------------------------------------------------------


async def test_the_hand_keeps_its_polls_with_two_pages_open(browser: Browser, stage: Stage) -> None:
    """99 % of 200 a second while it moves, without those that others on the machine have made it miss."""
    await browser.run("window.open(location.href)")
    await browser.until(lambda: stage.page.pages == 2)
    await stage.slow()
    closing = asyncio.create_task(stage.hand.close())
    watch, before = HoldWatch(), stage.hand.statistics
    statuses = stage.hand.statuses()
    others = -watch.waiting()
    for _ in range(400):
        await anext(statuses)
    others += watch.waiting()
    watch.close()
    after = stage.hand.statistics
    closing.cancel()
    await asyncio.gather(closing, return_exceptions=True)
    polls, missed = after.polls - before.polls, after.overruns - before.overruns
    missed_by_us = max(missed - others / 0.005, 0)
    share = polls / (polls + missed_by_us)
    assert share >= 0.99, f"{share:.2%}: {missed} missed in {polls}, others took {others:.3f} s"


# -- the pictures of the site ------------------------------------------------------------------------------

DIAGRAMS: str = """<html><body style="width: 720px; margin: 0" data-md-color-scheme="default">{}
<script type="module" src="diagrams.js"></script></body></html>"""
SMALLEST: str = """
const found = [...document.querySelectorAll('svg')].map((svg) => svg.getBoundingClientRect().width
  / svg.viewBox.baseVal.width * 16);
return document.querySelectorAll('.diagram:not(:has(svg))').length ? null : found;
"""
"""The size of the text in each picture, drawn at 16 pixels and then scaled to the column."""


async def test_the_pictures_of_the_states_can_be_read_on_the_site(window: Browser, tmp_path: Path) -> None:
    """In a column of 720 pixels it was 7 pixels high."""
    pictures = [block.text for block in blocks(read("state-machine.md"), "mermaid")]
    shutil.copytree(MERMAID, tmp_path / "mermaid")
    shutil.copy(DOCS / "site" / "diagrams.js", tmp_path)
    body = "".join(f'<pre class="diagram">{escape(each)}</pre>' for each in pictures)
    (tmp_path / "index.html").write_text(DIAGRAMS.format(body))
    handler = partial(QuietHandler, directory=str(tmp_path))
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        serving = asyncio.create_task(asyncio.to_thread(server.serve_forever))
        try:
            await window.do(lambda: window.resize(1280, 800))
            await window.open(f"http://127.0.0.1:{server.server_port}/index.html")
            sizes = await window.until(lambda: window.driver.execute_script(SMALLEST))
        finally:
            await asyncio.to_thread(server.shutdown)
            await serving
    assert len(sizes) == len(pictures) == 2
    assert min(sizes) >= 12


class QuietHandler(SimpleHTTPRequestHandler):
    """Writes no log."""

    def log_message(self, *_: object) -> None:
        pass
