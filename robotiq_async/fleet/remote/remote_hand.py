"""RemoteHand: a hand that an agent on another host serves."""

from __future__ import annotations

from ...calibration import ForceCalibration, SpeedCalibration
from ...hands import Hand
from ..network.bus import Bus
from .backend import RemoteBackend
from .errand import no_answer_as_lost_connection
from .session import CONNECT_S


class RemoteHand(Hand):
    """A Robotiq gripper on another host, served by ``robotiq-async agent`` there.

    :class:`~robotiq_async.hands.Hand` has the promises of all hands. Commanding takes a lease, which this
    hand acquires when it starts and renews from its own event loop. A program that hangs loses the lease, and
    axes that it had set in motion are then held. Differences from a hand of this process:

    * :meth:`start` looks for the agent (ConnectFailedError, NotAllowedError) and acquires the lease
      (ControlLostError: another client commands). Without the extra ``fleet`` it raises ImportError. A hand
      that only reads activates nothing.
    * :meth:`stop` releases the lease; the agent's hand keeps running. Without the lease it stops no fingers.
      If the event loop was closed, the agent holds axes that move.
    * Commands raise ControlLostError without the lease, and ConnectionLostError when the agent falls silent:
      it may have carried them out, and holds axes that move within its window. If the agent refuses a command
      after :meth:`command` has returned, the refusal is logged.
    * :meth:`halt` needs no lease and is repeated until it is answered. If another client commands the
      gripper, it loses the lease. ConnectionLostError means no answer within 2 s: the fingers MAY STILL MOVE.
    * :meth:`inhibit` and :meth:`permit` are the agent's, for all its clients: they need a started hand and no
      lease. The inhibit outlasts leases, and restarts of the agent. A permit lifts the halts that this hand
      has heard of; a later halt stays, and RobotiqStateError is raised.
    * Millimetres and fractions follow the ``stroke`` of the agent's hand. They are sent as counts.
    * :attr:`state` is DISCONNECTED also while the agent is silent; that is a transition, too. Some statuses
      may be missing, and :meth:`grip_events` follows the statuses that arrived. :attr:`statistics` are
      the agent's, at most 1 s old.

    The safety of people must not depend on it: a network can be cut at any moment. None of this has run on
    real hardware yet. Making a hand checks every option; it opens nothing and needs no running loop.

    Args:
        address: ``zenoh://SITE/HOST/GRIPPER``; ``?connect=tls/HOST:7447&keys=FOLDER`` says how to get there.
            A missing part comes from the environment (``ROBOTIQ_ASYNC_CONNECT``, ``ROBOTIQ_ASYNC_KEYS``); the
            default is an agent on this machine.
        control: True acquires the lease when the hand starts, None with the first command that is awaited,
            False never: the hand only reads (and halts) unless :meth:`acquire` is called.
        connect_timeout: seconds for finding the agent, while the event loop runs, 0.1..60.
        bus: an open session to share; it stays open. None opens one.
        calibration: the speeds of :attr:`units`; default timeouts are the agent's. None for the thesis's
            gripper.
        force_calibration: the forces of :attr:`units`. None for the manual's figures.
        keep_grip: the default of :meth:`stop` and :meth:`release`; leaving the block always uses it.

    Raises:
        TypeError: an option of the wrong type.
        ValueError: an option outside its range, or a malformed address.
    """

    def __init__(
        self,
        address: str,
        *,
        control: bool | None = True,
        connect_timeout: float = CONNECT_S,
        bus: Bus | None = None,
        calibration: SpeedCalibration | None = None,
        force_calibration: ForceCalibration | None = None,
        keep_grip: bool = False,
    ) -> None:
        self._remote = RemoteBackend(
            address,
            control=control,
            connect_timeout=connect_timeout,
            bus=bus,
            calibration=calibration,
            force_calibration=force_calibration,
            keep_grip=keep_grip,
        )
        super().__init__(self._remote)

    # -- the lease -------------------------------------------------------------------------------------

    @property
    def is_in_control(self) -> bool:
        """Whether this hand holds the lease, as far as it knows."""
        session = self._remote.session
        return session is not None and not session.is_over and session.dialog.lease.is_held

    async def acquire(self) -> None:
        """Get the lease, unless another client holds it.

        Raises:
            ControlLostError: another client commands the gripper.
            RobotiqError: not started, or the agent does not answer.
        """
        with no_answer_as_lost_connection():
            await self._remote.running_session().keeper.acquire()

    async def take(self) -> None:
        """Get the lease, also from another client; axes that this client set in motion are held.

        Raises:
            RobotiqError: not started, or the agent does not answer.
        """
        with no_answer_as_lost_connection():
            await self._remote.running_session().keeper.acquire(take=True)

    async def release(self, *, halt: bool = True, keep_grip: bool | None = None) -> None:
        """Release the lease, and continue to read.

        Args:
            halt: False leaves the fingers moving.
            keep_grip: as for :meth:`stop`.

        Raises:
            RobotiqError: not started, the agent does not answer, or the fingers were not seen to stop.
        """
        level = self._remote.stop_level(halt, keep_grip)
        keeper = self._remote.running_session().keeper
        keeper.release(level)
        with no_answer_as_lost_connection():
            await keeper.released()
