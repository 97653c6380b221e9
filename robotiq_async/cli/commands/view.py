"""``robotiq-async view``."""

from __future__ import annotations

import asyncio
from importlib.resources import files
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ...tools.viewer.gate import is_loopback
from ...values.enums import DEFAULT_FORCE, DEFAULT_SPEED
from ..addresses import gripper_words
from ..arguments import USUAL, Address, Byte, Flag, Host, Link, Port, need
from ..failures import CommandError, UsageError
from ..output.notices import tell


async def view(
    address: Address = "sim://",
    /,
    *,
    port: Port = 8765,
    host: Host = "127.0.0.1",
    control: Flag = False,
    origin: Annotated[tuple[str, ...], Parameter(metavar="URL", negative=(), show_default=False)] = (),
    layout: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    speed: Byte = DEFAULT_SPEED,
    force: Byte = DEFAULT_FORCE,
    link: Link = USUAL,
) -> None:
    """Show a gripper in Foxglove or Lichtblick until Ctrl-C; --control lets buttons there move it.

    What is printed is the address to open there (Open connection, Foxglove WebSocket).
    Status, commands, events and joint states are the topics of a recording;
    /gripper/state has state, fault and statistics, /robot_description and /tf the hand
    in three dimensions.

    Nothing moves until a service is called, and there are none without --control.
    There is no password: with it, every program of this machine may call them. Pages of
    other sites are refused, but for https://app.foxglove.dev and those named by --origin.

    Ending it stops the fingers only if they were moved from here.

    For example:

        robotiq-async view tcp://192.168.1.11
        robotiq-async view --control --origin http://localhost:8080 192.168.1.11
        robotiq-async view --layout gripper.json

    Args:
        port: TCP port; 0 takes a free one.
        host: Interface to listen on. Another one than 127.0.0.1 lets others look.
        control: Let viewers command the gripper. On 127.0.0.1 only: from elsewhere through ssh -L.
        origin: A site whose pages may connect too: where a viewer of your own is served. May be given again.
        speed: Speed of all axes from the first command on; the present one cannot be read.
        force: Force of all axes from the first command on. A grip made with more loosens.
        layout: Write the matching layout to a file, for Foxglove to import, and exit.
    """
    if layout is not None:
        _write(layout)
        return
    need("foxglove", "view")
    from ...tools.viewer.viewer import ORIGINS, Viewer
    from ..connect import make_operator, operated
    from ..output.log_capture import forwarded_warnings

    if not is_loopback(host):
        if control:
            raise UsageError("--control needs 127.0.0.1, as viewers know no password: use ssh -L")
        tell(f"anyone who reaches {host} can see this gripper: there is no password")
    try:
        operator = make_operator(address, link, speed=speed, force=force)
        viewer = Viewer(
            operator.hand,
            host=host,
            port=port,
            operator=operator if control else None,
            origins=(*ORIGINS, *origin),
        )
        # In this order no viewer delays the stop of the fingers.
        with forwarded_warnings(tell):
            async with viewer, operated(operator, tell):
                tell(gripper_words(address))
                print(viewer.url, flush=True)
                await asyncio.Event().wait()
    except asyncio.CancelledError:
        pass  # Being told to stop is how this command ends well.


def _write(layout: Path) -> None:
    text = (files("robotiq_async") / "data" / "foxglove_layout.json").read_text(encoding="utf-8")
    try:
        with open(layout, "x", encoding="utf-8") as file:
            file.write(text)
    except OSError as error:
        raise CommandError(f"{layout}: {error.strerror}") from error
    print(layout)
