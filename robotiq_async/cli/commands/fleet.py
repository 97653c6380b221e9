"""``robotiq-async fleet``, ``fleet halt`` and ``fleet keys``."""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from ...runtime import now, printable
from ...tools.wording import inhibit_shown
from ...values import MODELS, RobotiqError
from ..arguments import Flag, Yes, need
from ..consent import consent, screen_to_ask_at
from ..failures import CommandError, UsageError, normal_end, usage

if TYPE_CHECKING:
    from ...fleet.fleet import Fleet, Member
    from ...fleet.keys.access import Role
    from ...hands import Hand

PERMIT_WARNING = "If motion is permitted again, a program may MOVE its fingers at once."
DISCOVERY_S = 1.5
"""Seconds to collect: agents publish a summary of each gripper once a second."""
_ROW_FORMAT = "{:<27} {:<13} {:<6} {:<17} {}"  # 80 columns, unless a name is long

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
        await asyncio.sleep(DISCOVERY_S)
        if not as_json:
            print(_ROW_FORMAT.format("GRIPPER", "STATE", "FAULT", "COMMANDED BY", "AGE, PROBLEM"))
        if watch:
            await _watch(seen, show)
            return
        for member in seen:
            show(member)
        if not seen.members:
            raise CommandError("no agent found; see robotiq-async agent --help")


async def halt(site: Site = None, /) -> None:
    """Stop every gripper of a site now, without a question, and refuse motion from then on.

    It stays: clients that command lose the lease, and no gripper moves until a person permits
    it, with fleet permit or on a page. Prints the outcome for each, and exits with 1 unless all
    were seen to stop and every endpoint was reached. It is no safety function: a network may be
    down when it is needed.

    For example:

        robotiq-async fleet halt
        robotiq-async fleet halt lab
    """
    need("zenoh", "fleet")
    from ...fleet.errors import NotAllStoppedError
    from ...fleet.fleet import Fleet

    with usage():
        seen = Fleet(site)
    async with seen:
        try:
            outcomes = await seen.halt_all("fleet halt")
        except NotAllStoppedError as error:
            for name, how in error.outcomes.items():
                print(f"{name}  {printable(how)}")
            raise
    for name, how in outcomes.items():
        print(f"{name}  {how}")


async def permit(*addresses: str, yes: Yes = False) -> None:
    """Permit motion of the named grippers again after a halt. Look at them first.

    The command moves nothing, but a program may move the fingers at once. It shows the halt of one
    gripper after another and asks, and without a terminal needs --yes. A halt that comes after
    the question stays. Exits with 1 unless motion of all of them is permitted.

    For example:

        robotiq-async fleet permit zenoh://lab/cell-1/left

    Args:
        addresses: Grippers on other hosts, zenoh://SITE/HOST/GRIPPER.
        yes: Do not ask.
    """
    need("zenoh", "fleet")
    from ...link import is_remote
    from ..connect import make_hand

    if not addresses or not all(map(is_remote, addresses)):
        raise UsageError("name grippers of agents: robotiq-async fleet permit zenoh://SITE/HOST/GRIPPER")
    hands = [make_hand(address, control=False) for address in addresses]
    if not yes:
        screen_to_ask_at(addresses[0])
    left = 0
    for hand in hands:
        try:
            outcome = await _permitted(hand, yes=yes)
        except (RobotiqError, CommandError) as error:
            outcome, left = f"not permitted: {error}", left + 1
        print(f"{hand.address}  {printable(outcome)}", flush=True)
    if left:
        raise CommandError(f"motion is not permitted: {left} of {len(hands)}")


async def _permitted(hand: Hand, *, yes: bool) -> str:
    """Ask, and permit motion after the halt that the question showed."""
    async with hand:
        seen = hand.inhibited
    if seen is None:
        return "was not inhibited"
    consent(hand.address, f"{inhibit_shown(seen)}\n{PERMIT_WARNING}", yes=yes)
    async with hand:  # again: a question may be open for hours
        await hand.permit(seen=seen)
    return f"permitted; {seen}"


async def _watch(seen: Fleet, show: Callable[[Member], None]) -> None:
    changes = seen.changes()
    with normal_end():
        for member in seen:
            show(member)
        async for member in changes:
            show(member)


def _print_row(member: Member) -> None:
    state = "gone" if not member.is_there else "?" if member.state is None else member.state.name
    is_unknown = bool(member.model) and member.model not in MODELS  # that of a newer agent
    fault = "?" if is_unknown else "-" if not member.fault else member.fault.name
    problem = f"{member.agents} AGENTS  " * (member.agents > 1)
    model = f"the model {member.model!r} is unknown here: update robotiq_async" if is_unknown else ""
    problem += "; ".join(filter(None, (member.inhibited, member.problem, model)))
    age = "-" if member.seen_at is None else f"{now() - member.seen_at:.1f} s"
    words = f"{age} {problem}".rstrip()
    row = _ROW_FORMAT.format(str(member.name), state, fault, member.holder or "-", words)
    print(printable(row.rstrip()), flush=True)


def _print_object(member: Member) -> None:
    fields = {
        "address": str(member.name),
        "is_there": member.is_there,
        "agents": member.agents,
        "state": None if member.state is None else member.state.name,
        "model": member.model or None,
        "fault": None if member.fault is None else member.fault.name,
        "fault_code": None if member.fault is None else int(member.fault),
        "is_moving": member.is_moving,
        "holder": member.holder,
        "inhibited": member.inhibited,
        "problem": member.problem,
        "gripper": member.address,
        "age": None if member.seen_at is None else round(now() - member.seen_at, 3),
    }
    print(json.dumps(fields), flush=True)


_MAY: Final = {"read": "watch", "halt": "watch and halt", "operate": "watch, halt and command"}

Operators = Annotated[tuple[str, ...], Parameter(metavar="NAME", negative=(), show_default=False)]
AgentHosts = Annotated[tuple[str, ...], Parameter(metavar="NAME[=HOST,...]", negative=(), show_default=False)]


def keys(
    folder: Path,
    /,
    *,
    agent: AgentHosts = (),
    read: Operators = (),
    halt: Operators = (),
    operate: Operators = (),
    days: Annotated[int | None, Parameter(metavar="N", show_default=False)] = None,
) -> None:
    """Make keys for agents and clients, and set the role of each client.

    The first time it makes a certificate authority in FOLDER. Every agent and every client
    (that reads, that also halts, that operates) gets a folder in it, for you to copy to its
    machine. Nothing is overwritten. Treat these folders as you would a password.

    For example:

        robotiq-async fleet keys keys --agent cell-1=192.168.1.20 --operate bob
        robotiq-async fleet keys keys --read alice --halt panel --days 30

    Args:
        folder: The folder of the authority. It stays on your own machine.
        agent: A host with grippers, and the addresses that clients connect to (default: its name).
        read: A client that watches.
        halt: A client that watches and halts.
        operate: A client that watches, halts and commands.
        days: Validity of the certificates (default: 825; the authority: ten years).
    """
    need("cryptography", "fleet")
    from ...fleet.keys.access import Role
    from ..keys.issuing import DAYS

    days = DAYS if days is None else days
    clients = {Role.READ: read, Role.HALT: halt, Role.OPERATE: operate}
    subjects = [_agent(text) for text in dict.fromkeys(agent)]
    subjects += [Subject(role, name) for role, names in clients.items() for name in dict.fromkeys(names)]
    _check(folder, subjects, days)
    try:
        _make(folder, subjects, days)
    except (OSError, ValueError) as error:
        raise CommandError(str(error)) from error


@dataclass(frozen=True)
class Subject:
    """The owner of a certificate."""

    role: Role
    name: str
    hosts: tuple[str, ...] = ()


def _agent(text: str) -> Subject:
    from ...fleet.keys.access import Role

    name, equals, hosts = text.partition("=")
    return Subject(Role.AGENT, name, tuple(hosts.split(",")) if equals else (name,))


def _check(folder: Path, subjects: list[Subject], days: int) -> None:
    """Check everything before anything is written."""
    from ...fleet.keys.access import check_subject
    from ..keys.authority import DAYS_MAX, check_host
    from ..keys.issuing import subject_folder

    if not 1 <= days <= DAYS_MAX:
        raise UsageError(f"--days must be an integer in 1..{DAYS_MAX}, got {days}")
    if len({(subject.role, subject.name) for subject in subjects}) < len(subjects):
        raise UsageError("an agent is named twice")
    for subject in subjects:
        with usage():
            check_subject(subject.name)
            for host in subject.hosts:
                check_host(host)
        path = subject_folder(folder, subject.name, subject.role)
        if path.exists():
            raise CommandError(f"{path} exists already: nothing was made")


def _make(folder: Path, subjects: list[Subject], days: int) -> None:
    """Make the missing files, and print the destination of each folder."""
    from ...fleet.keys.access import Role
    from ..keys.issuing import AUTHORITY_KEY, access_lists, has_authority, issue, make_authority

    if not has_authority(folder):
        print(f"{make_authority(folder)}: the authority. {AUTHORITY_KEY} beside it never leaves this folder.")
    for subject in subjects:
        path = issue(folder, subject.name, subject.role, hosts=subject.hosts, days=days)
        if subject.role is Role.AGENT:
            use = f"the agent on {subject.name}; clients connect to it by {', '.join(subject.hosts)}"
        else:
            use = f"{subject.name}, who may {_MAY[subject.role.value]}"
        print(f"{path}: for {use}")
    if any(subject.role is not Role.AGENT for subject in subjects):
        own, *copies = access_lists(folder)
        print(f"{own}: the role of each client")
        for copy in copies:
            print(f"{copy}: a copy; agents use it from their next start on")
