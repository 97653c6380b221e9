"""Pages of hands, and the browser that looks at them."""

from __future__ import annotations

import contextlib
from collections.abc import AsyncIterator, Iterator

import pytest

pytest.importorskip("nicegui", reason="the page needs the extra web")

from robotiq_async.actions import Operator
from robotiq_async.protocol import Hand
from robotiq_async.web.server import PageServer
from robotiq_async.web.settings import PageSettings
from tests.web.browser import BROWSER, DRIVER, MISSING, Browser


@contextlib.asynccontextmanager
async def shown(*hands: Hand, control: bool = True) -> AsyncIterator[PageServer]:
    """The page of some hands."""
    operators = [Operator(hand) for hand in hands] if control else []
    settings = PageSettings(port=0, control=control, addresses=tuple(hand.address for hand in hands))
    async with PageServer(hands, settings, operators=operators) as page:
        yield page


@pytest.fixture(scope="package")
def shared_browser() -> Iterator[Browser]:
    """One for all tests: it takes a second to start."""
    if BROWSER is None or DRIVER is None:
        pytest.skip(MISSING)
    browser = Browser()
    yield browser
    browser.quit()


@pytest.fixture
def browser(shared_browser: Browser) -> Iterator[Browser]:
    """It, with one window, and nothing in its logs."""
    driver = shared_browser.driver
    driver.set_window_size(1280, 900)
    shared_browser.requested()
    shared_browser.complaints()
    yield shared_browser
    first, *others = driver.window_handles
    for other in others:
        driver.switch_to.window(other)
        driver.close()
    driver.switch_to.window(first)
    driver.get("about:blank")
