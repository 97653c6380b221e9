"""Hands on other hosts, over zenoh: an agent that serves them, remote hands, a view of the fleet.

Programs import from here. That works without zenoh, which is imported when a session is opened.
``import robotiq_async`` does not import this package. Its folders::

    remote, fleet    RemoteHand, and Fleet with its members
    agent            Agent: owns the hands of a host; FLEET.toml
    control          the lease, and the admission of requests
    network          sessions over zenoh, endpoints, routes
    keys             certificates, roles and their rights
    wire             names, requests, answers, statuses
"""

from .agent.agent import Agent
from .errors import AgentError, ControlLostError, NotAllowedError, NotAllStoppedError
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
