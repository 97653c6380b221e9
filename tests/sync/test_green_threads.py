"""gevent and eventlet replace Python's threads: a blocking hand refuses, and sends nothing.

Neither is installed here. What the hand asks of them is what they document: ``is_module_patched`` of
``gevent.monkey``, ``is_monkey_patched`` of ``eventlet.patcher``.
"""

from __future__ import annotations

import sys
import threading
from types import SimpleNamespace

import pytest

from robotiq_async.sync import RobotiqHand
from tests.sync.conftest import Wire

LIBRARIES = {
    "gevent": ("gevent.monkey", "is_module_patched", "threading"),
    "eventlet": ("eventlet.patcher", "is_monkey_patched", "thread"),
}


def pretend(monkeypatch: pytest.MonkeyPatch, library: str, *, patched: bool) -> None:
    module, function, threads = LIBRARIES[library]
    asked = {function: lambda name: patched and name == threads}
    monkeypatch.setitem(sys.modules, module, SimpleNamespace(**asked))


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_hand_refuses_and_sends_nothing(monkeypatch: pytest.MonkeyPatch, library: str) -> None:
    wire = Wire()
    wire.activate()
    hand = RobotiqHand(wire)
    pretend(monkeypatch, library, patched=True)
    before = threading.active_count()
    with pytest.raises(RuntimeError, match=f"{library} has replaced Python's threads.*nothing was sent"):
        hand.start()
    assert threading.active_count() == before
    assert wire.writes() == 0
    hand.stop()


@pytest.mark.parametrize("library", LIBRARIES)
def test_a_hand_takes_a_library_that_has_replaced_other_things(
    monkeypatch: pytest.MonkeyPatch, library: str
) -> None:
    pretend(monkeypatch, library, patched=False)
    wire = Wire()
    wire.activate()
    with RobotiqHand(wire) as hand:
        assert hand.is_activated
