"""``robotiq-async view``."""

from __future__ import annotations

import asyncio
from importlib.resources import files
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from ...runtime import is_loopback
from ..addresses import gripper_words
from ..arguments import USUAL_LINK, AddressArgument, Host, LinkOptions, Port, need
from ..failures import file_errors, normal_end
from ..output.messages import tell


async def view(
    address: AddressArgument = "sim://",
    /,
    *,
    port: Port = 8765,
    host: Host = "127.0.0.1",
    layout: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    link: LinkOptions = USUAL_LINK,
) -> None:
    """Show a gripper in Foxglove or Lichtblick until Ctrl-C. Viewers only look; web --control also moves.

    It prints the address to open there (Open connection, Foxglove WebSocket). Status,
    commands, events and joint states are the topics of a recording; /gripper/state has
    state, fault and statistics, /robot_description and /tf the hand in three dimensions,
    /gripper/parts the parts that a simulation with physics has before it.

    There is no password: every program that reaches the port sees the gripper.

    For example:

        robotiq-async view tcp://192.168.1.11
        robotiq-async view --layout gripper.json

    Args:
        port: TCP port; 0 takes a free one.
        host: Interface to listen on. With one other than 127.0.0.1 other machines can look.
        layout: Write the matching layout to a file, for Foxglove to import, and exit.
    """
    if layout is not None:
        _write(layout)
        return
    need("foxglove", "view")
    from ...tools.viewer import Viewer
    from ..connect import connected
    from ..output.messages import forwarded_warnings

    if not is_loopback(host):
        tell(f"anyone who reaches {host} can see this gripper: there is no password")
    with normal_end(), forwarded_warnings(tell):
        async with (
            connected(address, link, halt=False) as hand,
            Viewer(hand, host=host, port=port) as viewer,
        ):
            tell(gripper_words(address))
            print(viewer.url, flush=True)
            await asyncio.Event().wait()


def _write(layout: Path) -> None:
    text = (files("robotiq_async") / "data" / "foxglove_layout.json").read_text(encoding="utf-8")
    with file_errors(layout), open(layout, "x", encoding="utf-8") as file:
        file.write(text)
    print(layout)
