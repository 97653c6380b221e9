"""``robotiq-async fleet`` and ``robotiq-async fleet halt``."""

from __future__ import annotations

import asyncio
import json
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...runtime.clock import now
from ...runtime.log import printable
from ..arguments import Flag, need
from ..failures import CommandError, usage

if TYPE_CHECKING:
    from ...fleet.fleet import Fleet, Member

SETTLE_S = 1.5
"""Time to collect: agents publish a summary of each gripper once a second."""
_ROW = "{:<40} {:<14} {:<10} {:<28} {}"

Site = Annotated[str | None, Parameter(help="The site's name; all sites without it.")]


async def fleet(
    site: Site = None,
    /,
    *,
    watch: Flag = False,
    as_json: Annotated[Flag, Parameter(name="--json")] = False,
) -> None:
    """List the grippers that agents serve: state, fault, who commands. Nothing moves.

    The age is the time since the agent last read the gripper.

    It looks on this machine; ROBOTIQ_ASYNC_CONNECT=tls/HOST:7447 names another, and
    ROBOTIQ_ASYNC_KEYS a folder of keys.

    For example:

        robotiq-async fleet
        robotiq-async fleet lab --watch
        robotiq-async fleet --json | jq -r .address

    Args:
        watch: Print a line for every change, until Ctrl-C.
        as_json: Print an object of JSON for each gripper, a line each.
    """
    need("zenoh", "fleet")
    from ...fleet.fleet import Fleet

    with usage():
        seen = Fleet(site)
    show = _print_object if as_json else _print_row
    async with seen:
        await asyncio.sleep(SETTLE_S)
        if not as_json:
            print(_ROW.format("GRIPPER", "STATE", "FAULT", "COMMANDED BY", "AGE, PROBLEM"))
        if watch:
            await _watch(seen, show)
            return
        for member in seen:
            show(member)
        if not seen.members:
            raise CommandError("no agent found; see robotiq-async agent --help")


async def halt(site: Site = None, /) -> None:
    """Stop every gripper of a site now, without a question. Clients that command lose the lease.

    Prints the outcome for each, and exits with 1 unless all were seen to stop and every
    endpoint was reached. It is no safety function: a network may be down when it is needed.

    For example:

        robotiq-async fleet halt
        robotiq-async fleet halt lab
    """
    need("zenoh", "fleet")
    from ...fleet.fleet import Fleet
    from ...values.errors import NotAllStoppedError

    with usage():
        seen = Fleet(site)
    async with seen:
        try:
            outcomes = await seen.halt_all()
        except NotAllStoppedError as error:
            for name, how in error.outcomes.items():
                print(f"{name}  {printable(how)}")
            raise
    for name, how in outcomes.items():
        print(f"{name}  {how}")


async def _watch(seen: Fleet, show: object) -> None:
    assert callable(show)
    changes = seen.changes()
    try:
        for member in seen:
            show(member)
        async for member in changes:
            show(member)
    except asyncio.CancelledError:
        pass  # Ctrl-C is the normal end of this command.


def _print_row(member: Member) -> None:
    state = "gone" if not member.is_there else "?" if member.state is None else member.state.name
    fault = "-" if not member.fault else member.fault.name
    problem = f"{member.agents} AGENTS  " * (member.agents > 1) + member.problem
    words = f"{_age(member)} {problem}".rstrip()
    row = _ROW.format(str(member.name), state, fault, member.holder or "-", words)
    print(printable(row.rstrip()), flush=True)


def _print_object(member: Member) -> None:
    fields = {
        "address": str(member.name),
        "is_there": member.is_there,
        "agents": member.agents,
        "state": None if member.state is None else member.state.name,
        "fault": None if member.fault is None else member.fault.name,
        "fault_code": None if member.fault is None else int(member.fault),
        "is_moving": member.is_moving,
        "holder": member.holder,
        "problem": member.problem,
        "gripper": member.address,
        "age": None if member.seen_at is None else round(now() - member.seen_at, 3),
    }
    print(json.dumps(fields), flush=True)


def _age(member: Member) -> str:
    return "-" if member.seen_at is None else f"{now() - member.seen_at:.1f} s"
