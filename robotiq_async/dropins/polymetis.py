"""The gripper server of polymetis, for DROID's robot: gRPC on port 50052. Needs the extra ``grpc``.

DROID stays as it is, except one line of ``launch_gripper.sh``. **The fingers of a reset gripper MOVE**::

    python -m robotiq_async.dropins.polymetis --yes 'rtu:///dev/ttyUSB0?model=2f85'

It is a separate process because DROID's environment is Python 3.8. Its numbers have the units of DROID's data
sets: a width in "m" that is linear in counts, a speed of 0.013..0.1 "m/s", a force in percent.
"""

# Theory of operation
#
# Calls come in threads of gRPC, and the blocking hand polls in its own. A call waits for a fresh status,
# PATIENCE_S at most, and then fails with UNAVAILABLE: the last value is never given out as the present one.
# The port answers before the gripper is active, because DROID reads the metadata once, 5 s after the
# launch; a Goto waits for the activation. An active gripper is adopted: a part that is held stays held.
#
# DROID's thread of commands ends with the first error of a Goto. So a Goto waits instead, where it can.

from __future__ import annotations

import argparse
import math
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any, Final, NoReturn

from ..calibration import Convention
from ..runtime import __version__, install, log
from ..sync import RobotiqHand
from ..values import Finger, GripperFaultError, RobotiqConnectionError, RobotiqError, RobotiqStatus, State
from .patience import CallerPatience
from .protobuf import FieldValue, decoded, encoded

try:
    import grpc
except ImportError as error:
    raise ImportError(f"the gripper server needs grpcio: {install('grpc')}") from error

POLYMETIS_PORT: Final = 50052
PATIENCE_S: Final = 2.0
ACTIVATION_S: Final = 60.0  # that a Goto waits for it
LOOP_RESPONSE_S: Final = 0.1  # a lost reply costs one and a half of DROID's cycles, at 15 Hz
HZ: Final = 60  # as polymetis says; DROID does not use it
SLOWEST_M_S, FASTEST_M_S = 0.013, 0.1  # "m/s"
THREADS: Final = 8


class GripperService:
    """The three calls of ``service GripperServer`` that programs make, at one hand."""

    def __init__(self, hand: RobotiqHand) -> None:
        self._hand = hand
        self._patience = CallerPatience(hand, PATIENCE_S)
        self._widths = Convention("polymetis", open=hand.units.mm(0) / 1000, closed=0.0)
        self._fingers = [axis for axis in hand.model.axes if axis is not Finger.SCISSOR]
        self.is_ready: threading.Event = threading.Event()
        """Whether the gripper is active, so that a Goto need not wait."""

    @property
    def handlers(self) -> grpc.GenericRpcHandler:
        """For :meth:`grpc.Server.add_generic_rpc_handlers`; other calls are UNIMPLEMENTED."""
        calls = {"GetRobotClientMetadata": self.metadata, "GetState": self.state, "Goto": self.goto}
        methods = {name: grpc.unary_unary_rpc_method_handler(call) for name, call in calls.items()}
        return grpc.method_handlers_generic_handler("GripperServer", methods)

    def metadata(self, _request: bytes, _context: Any) -> bytes:  # noqa: ANN401  # gRPC has no types
        """``GripperMetadata``: version, rate and the widest opening."""
        return encoded({1: f"robotiq_async {__version__}".encode(), 2: HZ, 3: self._widths.open})

    def state(self, _request: bytes, context: Any) -> bytes:  # noqa: ANN401
        """``GripperState``, of a fresh status."""
        is_moving, status = self._made(context, self._look)
        opening = sum(map(status.open_fraction, self._fingers)) / len(self._fingers)
        seconds, part = divmod(time.time() - max(0.0, time.monotonic() - status.timestamp), 1)
        return encoded(
            {
                1: encoded({1: int(seconds), 2: int(part * 1e9)}),
                2: self._widths.value(opening),
                3: bool(status.contacts),
                4: is_moving,
                5: int(status.fault),
                6: True,
            }
        )

    def goto(self, request: bytes, context: Any) -> bytes:  # noqa: ANN401
        """``GripperCommand``: returns when the hand has it, as in polymetis; ``grasp`` closes the hand."""
        try:
            fields = decoded(request)
            width, speed, force = (_number(fields, number) for number in (2, 3, 4))
            opening = 0.0 if fields.get(5) else self._widths.fraction(width, clamp=True)
            rates = {"speed": _counts(speed / (FASTEST_M_S - SLOWEST_M_S)), "force": _counts(force / 100)}
        except ValueError as error:
            _abort(context, grpc.StatusCode.INVALID_ARGUMENT, error)
        self.is_ready.wait(ACTIVATION_S)

        def command() -> None:
            self._patience.call(lambda hand: hand.command(open_fraction=opening, **rates))

        self._made(context, command)
        return b""

    def _look(self) -> tuple[bool, RobotiqStatus]:
        self._patience.status()
        return self._patience.call(lambda hand: (hand.is_moving, hand.status))

    def _made(self, context: Any, call: Callable[[], Any]) -> Any:  # noqa: ANN401
        """The result of a call; a gRPC error if it fails."""
        try:
            return call()
        except RobotiqConnectionError as error:
            _abort(context, grpc.StatusCode.UNAVAILABLE, error)
        except RobotiqError as error:
            _abort(context, grpc.StatusCode.FAILED_PRECONDITION, error)


def _abort(context: Any, code: grpc.StatusCode, error: Exception) -> NoReturn:  # noqa: ANN401
    context.abort(code, str(error))
    raise AssertionError("abort() raises") from error


def _number(fields: dict[int, FieldValue], number: int) -> float:
    value = fields.get(number, 0.0)
    if isinstance(value, bytes) or not math.isfinite(value):
        raise ValueError(f"field {number} must be a finite number, got {value!r}")
    return value


def _counts(share: float) -> int:
    """Polymetis' way to 0..255: cut off and not rounded."""
    return min(max(int(share * 255), 0), 255)


def serve(
    address: str, *, host: str = "localhost", port: int = POLYMETIS_PORT, activate: bool = True
) -> None:
    """Serve a gripper until the program is interrupted. **If the gripper is reset, its fingers MOVE**.

    Leaving stops fingers that move, and keeps a grip.

    Args:
        address: of the gripper, as of :class:`robotiq_async.RobotiqHand`.
        host: where to listen. Beyond this machine anybody can move the fingers: plain gRPC has no login.
        port: where to listen; it must be free, because gRPC would silently share it with another server.
        activate: False activates nothing: the gripper must be active already.

    Raises:
        OSError: the port is taken.
        GripperFaultError: the gripper is in fault.
        RobotiqError: as :meth:`RobotiqHand.start`.
    """
    hand = RobotiqHand(address, keep_grip=True, response_timeout=LOOP_RESPONSE_S)
    service = GripperService(hand)
    server = grpc.server(ThreadPoolExecutor(THREADS), options=[("grpc.so_reuseport", 0)])
    server.add_generic_rpc_handlers((service.handlers,))
    try:
        server.add_insecure_port(f"{host}:{port}")
    except RuntimeError as error:
        raise OSError(f"port {port} of {host} is taken, perhaps by another gripper server: {error}") from None
    server.start()
    try:
        hand.start(activate)
        if hand.state is State.FAULT:
            raise GripperFaultError(hand.status.fault)
        service.is_ready.set()
        log.warning(
            "serving %s on %s:%d: anyone who reaches the port can MOVE the fingers", hand.address, host, port
        )
        server.wait_for_termination()
    finally:
        server.stop(0.2)
        hand.stop()


def main(arguments: Sequence[str] | None = None) -> int:
    """The command; returns its exit code: 0 after a signal, 1 after a failure, 2 for wrong usage."""
    parser = argparse.ArgumentParser(
        prog="python -m robotiq_async.dropins.polymetis",
        description="The gripper server for DROID. The FINGERS of a gripper that is reset MOVE.",
    )
    parser.add_argument("address", help="of the gripper, with its model: rtu:///dev/ttyUSB0?model=2f85")
    parser.add_argument("--yes", action="store_true", help="move without a question")
    parser.add_argument("--host", default="localhost", help="where to listen (%(default)s)")
    parser.add_argument("--port", type=int, default=POLYMETIS_PORT, help="where to listen (%(default)s)")
    given = parser.parse_args(arguments)
    if not (given.yes or given.address.startswith("sim:") or _agrees(given.address, parser)):
        return 1
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    try:
        serve(given.address, host=given.host, port=given.port)
    except KeyboardInterrupt:
        return 0
    except (TypeError, ValueError) as error:
        parser.error(str(error))
    except (RobotiqError, OSError) as error:
        print(error, file=sys.stderr)  # noqa: T201  # for the user
        return 1
    return 0


def _agrees(address: str, parser: argparse.ArgumentParser) -> bool:
    if not sys.stdin or not sys.stdin.isatty():
        parser.error("this moves the gripper; without a terminal to ask at it needs --yes")
    return input(
        f"{address}: the FINGERS MOVE if it is reset, and at each command of DROID. Continue? [y/N] "
    ) in ("y", "yes")


if __name__ == "__main__":
    sys.exit(main())
