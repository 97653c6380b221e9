"""A small part of the soak run, in virtual time: every run the same. The long one is ``make soak``."""

from __future__ import annotations

import asyncio
import logging

import pytest

from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85
from tests.adversity.soak import Setting, run
from tests.adversity.watch import VirtualLoopWatch

SETTINGS = {
    "tcp": Setting("tcp", THREE_FINGER),
    "rtu": Setting("rtu", THREE_FINGER, is_starved=True),
    "a shared line": Setting("rtu", TWO_FINGER_85, hands=2, silent=1),
    "urcap": Setting("urcap", TWO_FINGER_85),
    "tunnel": Setting("tunnel", THREE_FINGER),
}


@pytest.mark.parametrize("setting", SETTINGS.values(), ids=SETTINGS)
def test_some_cycles(setting: Setting, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.CRITICAL, logger="robotiq_async")
    loop = VirtualLoopWatch()
    with asyncio.Runner(loop_factory=loop.make_loop) as runner:
        assert runner.run(run(0.4, setting, loop)) == 0
