"""Nobody finds an agent who was not told where it is: zenoh's discovery is off."""

from __future__ import annotations

import json
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest
import zenoh

from robotiq_async.fleet.network.configuration import client_configuration, session_configuration
from tests.fleet.lab import LEFT
from tests.fleet.sessions import free_port
from tests.patience import patience

SEEN_S = 3.0


@contextmanager
def session(configuration: dict[str, Any]) -> Iterator[Any]:
    opened: Any = zenoh.open(zenoh.Config.from_json5(json.dumps(configuration)))
    try:
        yield opened
    finally:
        opened.close()


def test_a_stranger_who_looks_around_finds_no_agent() -> None:
    """It finds one beside ours that lets itself be found, or this machine has no multicast."""
    ours = session_configuration([f"tcp/127.0.0.1:{free_port()}"], [])
    found = session_configuration([f"tcp/127.0.0.1:{free_port()}"], [])
    found["scouting"] = {"multicast": {"enabled": True}}
    seen: set[str] = set()
    is_there = threading.Event()

    def see(sample: zenoh.Sample) -> None:
        seen.add(str(sample.key_expr))
        if "found" in str(sample.key_expr):
            is_there.set()

    with session(ours) as agent, session(found) as other, session({"mode": "peer"}) as stranger:
        tokens = [agent.liveliness().declare_token(LEFT.key("alive", "1"))]
        watching = stranger.liveliness().declare_subscriber("**", see, history=True)
        tokens.append(other.liveliness().declare_token("found"))
        if not is_there.wait(patience(SEEN_S)):
            pytest.skip("no multicast here")
        seen |= {str(each.ok.key_expr) for each in stranger.liveliness().get("**") if each.ok is not None}
        assert seen == {"found"}
        watching.undeclare()
        for token in tokens:
            token.undeclare()


def test_no_configuration_discovers() -> None:
    here = ["tcp/127.0.0.1:7447"]
    for each in (client_configuration(here), session_configuration(here, ())):
        scouting: Any = each["scouting"]
        assert (scouting["multicast"], scouting["gossip"]) == ({"enabled": False}, {"enabled": False})
