"""The browser of in_browser.py: what it does about a page that changes under its hands."""

from __future__ import annotations

from typing import Any, cast

from selenium import webdriver
from selenium.common.exceptions import StaleElementReferenceException

from tests.web.browser import Part


class Element:
    """An element that has been replaced when it is used, so many times."""

    def __init__(self, driver: Driver) -> None:
        self._driver = driver

    @property
    def text(self) -> str:
        if self._driver.replaced < 3:
            self._driver.replaced += 1
            raise StaleElementReferenceException
        return "words"


class Driver:
    """A page that puts another element in the place of each for a while."""

    replaced = 0

    def find_element(self, *_: Any) -> Element:
        return Element(self)


def test_a_part_of_a_page_that_is_replaced_is_looked_up_again() -> None:
    """Under load a test failed with a stale element, between looking it up and using it."""
    driver = Driver()
    assert Part(cast("webdriver.Chrome", driver), "outcome").text == "words"
    assert driver.replaced == 3
