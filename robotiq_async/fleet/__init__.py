"""Hands on other hosts, over zenoh: an agent that serves them, remote hands, a view of the fleet.

What a program needs is imported from here, also where zenoh is not installed: that is looked for when a
session is opened. ``import robotiq_async`` does not come here. Where it comes from::

    remote, fleet    RemoteHand, and Fleet with its members
    agent            Agent: owns the hands of a host; FLEET.toml
    control          who commands, and which requests are let in
    network          sessions: what is needed of one, zenoh's, where it listens
    keys             certificates, roles, what each may do
    wire             names, requests, answers, statuses
"""

from ..values.errors import AgentError, ControlLostError, NotAllowedError, NotAllStoppedError
from .agent.agent import Agent
from .fleet import Fleet, Member
from .network.bus import Bus
from .network.route import Route
from .remote.remote_hand import RemoteHand
from .wire.names import GripperName

__all__ = [
    "Agent",
    "AgentError",
    "Bus",
    "ControlLostError",
    "Fleet",
    "GripperName",
    "Member",
    "NotAllStoppedError",
    "NotAllowedError",
    "RemoteHand",
    "Route",
]
