"""Everything the library raises, bad arguments aside.

::

    RobotiqError
    +-- RobotiqStateError                       the hand cannot do that now
    |   +-- NotStartedError                     before start(), or after stop()
    |   +-- InvalidStateError                   .state and .allowed
    |   +-- NotActivatedError                   motion asked for while reset
    |   +-- GripperFaultError                   .fault
    |   +-- ActivationTimeoutError (TimeoutError)
    |   +-- StateTimeoutError (TimeoutError)    a state that was never reached
    |   +-- MoveTimeoutError (TimeoutError)     .status
    |   |   +-- MoveIgnoredError                acknowledged, echoed, and nothing has moved
    |   +-- MoveSupersededError                 another command took over an axis of this move
    |   +-- ControlLostError                    on another host: somebody else commands the gripper, or nobody
    |   +-- NotAllowedError                     on another host: the fleet's access rules say no
    +-- RobotiqConnectionError (ConnectionError)
    |   +-- ConnectFailedError                  refused, unreachable, no such port; .address
    |   +-- ConnectionLostError
    |   +-- ResponseTimeoutError (TimeoutError)
    |   +-- ProtocolError                       exception reply, wrong function, length or echo
    |   +-- AgentError                          the agent of another host did not carry it out
    +-- RecordingError                          a recording that cannot be written, or read
    +-- ViewerError                             a viewer that cannot be served
    +-- MeasuringError                          a measurement that went wrong
    +-- NotAllStoppedError                      the halt of a fleet; .outcomes, .unreached

The three before the last concern neither gripper nor link: the hand goes on. They, and those about other
hosts, stand here and not among the names of the package;
so does MoveIgnoredError, which is caught as what it is a kind of.

Bad arguments are plain ValueError and TypeError: they are the program's mistake, not the gripper's.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from .enums import Fault, State

if TYPE_CHECKING:
    from .status import RobotiqStatus


class RobotiqError(Exception):
    """Base of everything the library raises, bad arguments aside. Can be pickled and copied.

    Attributes:
        hand: the name of the hand it comes from, as that was given to its constructor; empty if none was. The
            error as a text begins with it.
    """

    hand: str = ""

    @property
    def message(self) -> str:
        """What it says, without the name of the hand."""
        return super().__str__()

    def __str__(self) -> str:
        """The name of the hand, and what it says."""
        return f"{self.hand}: {self.message}" if self.hand else self.message

    def __repr__(self) -> str:
        """The same, with the kind of error."""
        return f"{type(self).__name__}({str(self)!r})" if self.hand else super().__repr__()

    def __reduce__(self) -> tuple[Callable[..., RobotiqError], tuple[object, ...], dict[str, object]]:
        """Restore message and attributes without the constructor, which asks for other arguments."""
        return _restore, (type(self), *self.args), vars(self)


def _restore(kind: type[RobotiqError], *args: object) -> RobotiqError:
    error = kind.__new__(kind)
    error.args = args
    return error


class RobotiqStateError(RobotiqError):
    """The hand cannot do that now."""


class NotStartedError(RobotiqStateError):
    """The hand has not been started, or has been stopped."""


class InvalidStateError(RobotiqStateError):
    """The call is not possible in the present state.

    Attributes:
        state: the state the hand is in.
        allowed: the states in which the call is possible.
    """

    def __init__(self, message: str, state: State, allowed: Iterable[State] = ()) -> None:
        """Keep the state and the states that would do."""
        self.state = state
        self.allowed = frozenset(allowed)
        super().__init__(message)


class NotActivatedError(RobotiqStateError):
    """The gripper is reset: it moves only after an activation."""


class GripperFaultError(RobotiqStateError):
    """The gripper reports a minor or a major fault.

    Attributes:
        fault: the fault it reports.
    """

    def __init__(self, fault: Fault, message: str | None = None) -> None:
        """Keep the fault."""
        self.fault = fault
        super().__init__(message or f"{fault.severity.value} fault 0x{int(fault):02X}: {fault.description}")


class ActivationTimeoutError(RobotiqStateError, TimeoutError):
    """The gripper did not finish its activation in time."""


class StateTimeoutError(RobotiqStateError, TimeoutError):
    """The hand did not reach the awaited state in time."""


class MoveTimeoutError(RobotiqStateError, TimeoutError):
    """An axis was still moving when the time of the move was over; its axes have been told to hold.

    Attributes:
        status: the last status seen.
    """

    def __init__(self, message: str, status: RobotiqStatus) -> None:
        """Keep the last status."""
        self.status = status
        super().__init__(message)


class MoveIgnoredError(MoveTimeoutError):
    """The gripper acknowledged and echoed the first motion on a connection, and moved nothing for a second.

    Some grippers are said to need an image with rACT before they move on a new connection, or to lose their
    activation while they are left alone. Its axes have been told to hold. The same move may do the next time;
    if not, :meth:`reset` and :meth:`activate` (which DROPS the part, and MOVES the fingers).
    """


class MoveSupersededError(RobotiqStateError):
    """Another command took over an axis of this move; its other axes run on."""


class ControlLostError(RobotiqStateError):
    """Commanding a gripper on another host takes a lease, and this hand does not hold it, or no longer.

    Attributes:
        reason: why not, in a word: "held" by somebody else, "taken" or "halted" by somebody else, "expired"
            for it was not renewed in time, "released" by this hand, "late" for one request, or "closed".
    """

    def __init__(self, message: str, reason: str) -> None:
        """Keep the reason."""
        self.reason = reason
        super().__init__(message)


class NotAllowedError(RobotiqStateError):
    """The access rules of the fleet do not let this client do that."""


class RobotiqConnectionError(RobotiqError, ConnectionError):
    """The link to the gripper failed."""


class ConnectFailedError(RobotiqConnectionError):
    """Nobody answers at the address.

    Attributes:
        address: the address that was tried.
    """

    def __init__(self, address: str, reason: str) -> None:
        """Keep the address."""
        self.address = address
        super().__init__(f"cannot connect to {address}: {reason}")


class ConnectionLostError(RobotiqConnectionError):
    """The link went down; what was not acknowledged by then has been dropped."""


class ResponseTimeoutError(RobotiqConnectionError, TimeoutError):
    """The gripper did not answer a request in time."""


class ProtocolError(RobotiqConnectionError):
    """A reply that is not the answer: an exception, a wrong function, length, echo or transaction."""


class AgentError(RobotiqConnectionError):
    """The agent of another host did not carry out a request, for a reason of its own."""


class RecordingError(RobotiqError):
    """A recording could not be written, or read."""


class ViewerError(RobotiqError):
    """A viewer could not be served."""


class MeasuringError(RobotiqError):
    """What was measured is not what was to be measured."""


class NotAllStoppedError(RobotiqError):
    """Not every gripper of a fleet was seen to stop: some MAY STILL MOVE.

    Attributes:
        outcomes: for each gripper how its halt ended; "stopped" is the good end.
        unreached: endpoints to which there was no connection; nobody knows which grippers are behind them.
    """

    def __init__(self, message: str, outcomes: Mapping[Any, str], unreached: Iterable[str] = ()) -> None:
        """Keep the outcomes."""
        self.outcomes = dict(outcomes)
        self.unreached = tuple(unreached)
        super().__init__(message)
