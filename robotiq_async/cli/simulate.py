"""``robotiq-async simulate``."""

from __future__ import annotations

import asyncio
import sys
from typing import Annotated

from cyclopts import Parameter

from ..errors import RobotiqError
from .arguments import Port, usage

_LOOPBACK = ("127.", "::1", "localhost")


async def simulate(
    *,
    port: Port = 5020,
    host: str = "127.0.0.1",
    speedup: Annotated[float, Parameter(metavar="FACTOR")] = 1.0,
    serial: Annotated[str | None, Parameter(metavar="DEVICE")] = None,
) -> None:
    """Run a simulated gripper until Ctrl-C or SIGTERM.

    Its address is the only line on standard output, printed once it listens:
    other programs connect to it as to a real gripper.

    For example:

        robotiq-async simulate
        robotiq-async simulate --port 5021 --speedup 10
        robotiq-async simulate --serial /dev/pts/3

    Args:
        port: TCP port; 0 takes a free one.
        host: Interface to listen on. Modbus knows no password: whoever reaches the port is in command.
        speedup: How many times faster than the clock the simulated time runs.
        serial: Serve Modbus RTU on this serial device in place of TCP (extra serial).
    """
    from ..simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer

    with usage():
        gripper = SimulatedGripper(speedup=speedup)
        server: SimulatorServer | SerialSimulatorServer
        if serial is None:
            server = SimulatorServer(gripper, port=port, host=host)
        else:
            server = SerialSimulatorServer(serial, gripper)
    if serial is None and not host.startswith(_LOOPBACK):
        print(f"robotiq-async: anyone who reaches {host} can command this gripper", file=sys.stderr)
    try:
        async with server:
            print(server.address, flush=True)
            await asyncio.Event().wait()
    except asyncio.CancelledError:
        pass  # Being told to stop is how this command ends well.
    except ImportError as error:
        raise RobotiqError(str(error)) from error
    except OSError as error:
        where = f"{host}:{port}" if serial is None else serial
        raise RobotiqError(f"cannot listen on {where}: {error.strerror or error}") from error
