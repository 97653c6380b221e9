"""A session at a wire without a network, and what outlives it."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from robotiq_async.control.state_machine import StateMachine
from robotiq_async.hands.options import HandOptions, ReconnectPolicy
from robotiq_async.hands.streams import Channels
from robotiq_async.link.gripper_link import Gripper, GripperLink
from robotiq_async.local.session import Session
from tests.fake_transport import Wire


def options(wire: Wire, policy: ReconnectPolicy | None, key: str = "wire") -> HandOptions:
    """Those of a hand at this wire."""
    return HandOptions(
        link=GripperLink("wire", gripper=lambda: Gripper(key), make=lambda **_: wire),
        poll_interval=0.01,
        write_spacing=0.0,
        activation_timeout=20.0,
        reconnect=policy or False,
    )


class Run:
    """The parts that outlive a session, and the means to make one."""

    def __init__(
        self, key: str = "wire", policy: ReconnectPolicy | None = None, speedup: float = 1.0
    ) -> None:
        self.wire = Wire(speedup)
        self.machine = StateMachine()
        self.channels = Channels()
        self.options = options(self.wire, policy, key)

    def session(self, *, activate: bool = False) -> Session:
        return Session(self.options, self.machine, self.channels, activate=activate)


@asynccontextmanager
async def running(
    *, active: bool = True, policy: ReconnectPolicy | None = None, speedup: float = 1.0
) -> AsyncIterator[tuple[Run, Session]]:
    """A session at a gripper that is active, or was just switched on."""
    here = Run(policy=policy, speedup=speedup)
    if active:
        await here.wire.activate()
    session = here.session()
    await session.connected()
    yield here, session
    await session.stop(halt=True)
