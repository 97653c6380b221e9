"""The blocking hand is made from the async one, and lacks nothing of it."""

from __future__ import annotations

import inspect
import re

import pytest

import robotiq_async
from docs import make_sync
from robotiq_async import sync
from robotiq_async.session.streams import Stream as AsyncStream
from tests.sync import toy

ASYNC, BLOCKING = robotiq_async.RobotiqHand, sync.RobotiqHand
NAMES = [name for name in dir(ASYNC) if not name.startswith("_")]


def test_every_module_of_the_room_is_made_or_written_by_hand() -> None:
    there = {path.stem for path in make_sync.FOLDER.glob("*.py")}
    assert there == make_sync.BY_HAND | {path.stem for path in make_sync.generated()}


def test_the_modules_are_up_to_date() -> None:
    for path, text in make_sync.generated().items():
        assert path.read_text(encoding="utf-8") == text, "run docs/make_pages.py"


def test_it_has_the_names_of_the_async_hand_and_no_others() -> None:
    assert [name for name in dir(BLOCKING) if not name.startswith("_")] == NAMES
    assert inspect.signature(BLOCKING) == inspect.signature(ASYNC)


@pytest.mark.parametrize("name", NAMES)
def test_a_call_has_the_signature_and_the_docstring_of_the_async_one(name: str) -> None:
    here, there = inspect.getattr_static(BLOCKING, name), inspect.getattr_static(ASYNC, name)
    assert isinstance(here, property) == isinstance(there, property)
    if not isinstance(here, property):
        assert not inspect.iscoroutinefunction(here)
        assert inspect.signature(here) == inspect.signature(there)
    assert here.__doc__
    assert set(here.__doc__.split()) <= set(there.__doc__.split()) | {"``with``"}
    assert here.__doc__.partition("\n")[0] == there.__doc__.partition("\n")[0]
    assert "RuntimeError" not in here.__doc__, "there is but one, of which the class tells"


def test_a_stream_has_the_names_of_the_async_one() -> None:
    inside = {"push", "end", "belong_to"}
    there = {name for name in dir(AsyncStream) if not name.startswith("_")} - inside
    here = {name for name in dir(sync.Stream) if not name.startswith("_")} - {"missed"}
    assert here == {re.sub("^aclose$", "close", name) for name in there}


# -- the script ----------------------------------------------------------------------------------------


def test_what_has_coroutines_gets_a_blocking_class_of_its_own() -> None:
    modules = make_sync.modules(toy.Toy)
    assert list(modules) == ["toy"]
    text = make_sync.shaped(modules["toy"])
    for words in (
        "from tests.sync.toy import Gauge as AsyncGauge\n",
        "from ..values.enums import CLOSED, Finger\n",
        "class Toy(BlockingHand):\n",
        "        return Gauge(self._inner.gauge, self._caller)\n",
        "    def find(self, *names: str, limit: int = CLOSED) -> Gauge:\n",
        "Gauge(self._caller.wait(lambda: self._inner.find(*names, limit=limit)), self._caller)\n",
        "        self._caller.tell(lambda: self._inner.nod())\n",
        "class Gauge(Blocking[AsyncGauge]):\n",
        "    def read(self, finger: Finger = Finger.A) -> float:\n",
        "        return self._caller.wait(lambda: self._inner.read(finger))\n",
        "            ValueError: there is none.\n",
    ):
        assert words in text
    assert "RuntimeError" not in text
    assert text.count("Raises:") == 1


@pytest.mark.parametrize(
    "kind",
    [toy.WithIterator, toy.WithList, toy.WithDecorator, toy.WithField, toy.WithAttribute, toy.WithContext],
)
def test_what_the_script_does_not_know_is_an_error(kind: type) -> None:
    with pytest.raises(ValueError, match="nobody knows"):
        make_sync.modules(kind)


def test_a_name_that_is_taken_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(make_sync, "BY_HAND", {"toy"})
    with pytest.raises(ValueError, match="toy is a module that is not made"):
        make_sync.modules(toy.Toy)
