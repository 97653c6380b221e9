"""Everything that a hand raises, bad arguments aside.

::

    RobotiqError
    +-- RobotiqStateError                       the hand cannot do that now
    |   +-- NotStartedError                     before start(), or after stop()
    |   +-- InvalidStateError                   .state and .allowed
    |   +-- NotActivatedError                   motion requested while reset
    |   +-- GripperFaultError                   .fault
    |   +-- ActivationTimeoutError (TimeoutError)
    |   +-- StateTimeoutError (TimeoutError)    a state that was never reached
    |   +-- MoveTimeoutError (TimeoutError)     .status
    |   +-- MoveSupersededError                 another command took over an axis of this move
    |   +-- MotionInhibitedError                a person stopped the hand; .reason, .who and .since
    +-- RobotiqConnectionError (ConnectionError)
        +-- ConnectFailedError                  refused, unreachable, no such port; .address
        +-- ConnectionLostError
        +-- ResponseTimeoutError (TimeoutError)
        +-- ProtocolError                       exception reply, wrong function, length or echo
            +-- WrongModelError                 a gripper of another model answers

Errors of other hosts are in :mod:`robotiq_async.fleet`, errors of recordings, viewers and measurements in
:mod:`robotiq_async.tools.errors`: each is a RobotiqError, too.

Bad arguments raise ValueError or TypeError.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from typing import TYPE_CHECKING, TypeVar

from .enums import Fault, State
from .inhibit import Inhibit

if TYPE_CHECKING:
    from .status import RobotiqStatus

T = TypeVar("T", bound="RobotiqError")


class RobotiqError(Exception):
    """Base of everything the library raises, bad arguments aside. Can be pickled and copied.

    Attributes:
        hand: the ``name`` given to the hand's constructor, or an empty string. ``str(error)`` begins with it.
        advice: the calls of the library that help, or an empty string. ``str(error)`` ends with it.
    """

    hand: str = ""
    advice: str = ""

    def __init__(self, *args: object, advice: str = "") -> None:
        super().__init__(*args)
        if advice:
            self.advice = advice

    @property
    def message(self) -> str:
        """The text without the name of the hand and without the advice."""
        return super().__str__()

    def __str__(self) -> str:
        return ": ".join(filter(None, (self.hand, self.message, self.advice)))

    def __repr__(self) -> str:
        return f"{type(self).__name__}({str(self)!r})" if self.hand or self.advice else super().__repr__()

    def __reduce__(self) -> tuple[Callable[..., RobotiqError], tuple[object, ...], dict[str, object]]:
        return _restore, (type(self), *self.args), vars(self)


def of_hand(error: T, name: str) -> T:
    """Name the hand of an error; returns the error itself."""
    error.hand = name
    return error


def _restore(kind: type[RobotiqError], *args: object) -> RobotiqError:
    error = kind.__new__(kind)
    error.args = args
    return error


class RobotiqStateError(RobotiqError):
    """The hand cannot carry out the call in its present state."""


class NotStartedError(RobotiqStateError):
    """The hand has not been started, or has been stopped."""


class InvalidStateError(RobotiqStateError):
    """The call is not possible in the present state.

    Attributes:
        state: the state the hand is in.
        allowed: the states in which the call is possible.
    """

    def __init__(
        self, message: str, state: State, allowed: Iterable[State] = (), *, advice: str = ""
    ) -> None:
        self.state = state
        self.allowed: frozenset[State] = frozenset(allowed)
        super().__init__(message, advice=advice)


class NotActivatedError(RobotiqStateError):
    """The gripper is reset: it moves only after an activation."""


class GripperFaultError(RobotiqStateError):
    """The gripper reports a minor or a major fault.

    Attributes:
        fault: the fault it reports.
    """

    def __init__(self, fault: Fault, message: str | None = None) -> None:
        self.fault = fault
        super().__init__(message or f"{fault.severity.value} fault 0x{int(fault):02X}: {fault.description}")


class ActivationTimeoutError(RobotiqStateError, TimeoutError):
    """The gripper did not finish its activation in time."""


class StateTimeoutError(RobotiqStateError, TimeoutError):
    """The hand did not reach the awaited state in time."""


class MoveTimeoutError(RobotiqStateError, TimeoutError):
    """An axis was still moving when the time limit of the move expired; the axes of the move now hold.

    Attributes:
        status: the last status seen.
    """

    def __init__(self, message: str, status: RobotiqStatus) -> None:
        self.status = status
        super().__init__(message)


class MoveSupersededError(RobotiqStateError):
    """Another command took over an axis of this move; its other axes keep moving."""


class MotionInhibitedError(RobotiqStateError):
    """A person stopped the hand, and motion is refused until a person permits it again.

    Attributes:
        reason: the reason that was given.
        who: the person or program that set the inhibit; may be empty.
        since: seconds since 1970.
    """

    def __init__(self, inhibit: Inhibit) -> None:
        self.reason: str = inhibit.reason
        self.who: str = inhibit.who
        self.since: float = inhibit.since
        super().__init__(
            str(inhibit), advice="a person permits it again: on the page, in the monitor, by fleet permit"
        )


class RobotiqConnectionError(RobotiqError, ConnectionError):
    """The link to the gripper failed."""


class ConnectFailedError(RobotiqConnectionError):
    """No gripper could be reached at the address.

    Attributes:
        address: the address that was tried.
    """

    def __init__(self, address: str, reason: str) -> None:
        self.address = address
        super().__init__(f"cannot connect to {address}: {reason}")


class ConnectionLostError(RobotiqConnectionError):
    """The link went down. Requests not acknowledged by then are dropped.

    No motion is sent again; a hold may be.
    """


class ResponseTimeoutError(RobotiqConnectionError, TimeoutError):
    """The gripper did not answer a request in time."""


class ProtocolError(RobotiqConnectionError):
    """The reply does not answer the request: an exception, a wrong function, length, echo or transaction."""


class WrongModelError(ProtocolError):
    """The registers belong to another model. Nothing was written to them."""
