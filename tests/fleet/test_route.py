"""Addresses of hands on other hosts, with how to get there."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotiq_async.fleet.network.route import (
    CONNECT_VARIABLE,
    KEYS_VARIABLE,
    Route,
    default_route,
    parse_remote_address,
)
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.link.address import is_remote

NAME = GripperName("lab", "cell-1", "left")
PLAIN = "zenoh://lab/cell-1/left"


@pytest.fixture(autouse=True)
def empty_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in (CONNECT_VARIABLE, KEYS_VARIABLE):
        monkeypatch.delenv(variable, raising=False)


def test_without_options_it_is_an_agent_on_this_machine() -> None:
    assert parse_remote_address(PLAIN) == (NAME, Route((), None, False))


def test_options() -> None:
    address = f"{PLAIN}?connect=tls/cell-1:7447&connect=tls/router:7447&keys=/etc/robotiq%20keys"
    assert parse_remote_address(address) == (
        NAME,
        Route(("tls/cell-1:7447", "tls/router:7447"), Path("/etc/robotiq keys"), False),
    )
    assert parse_remote_address(f"{PLAIN}?insecure=1")[1].insecure
    assert not parse_remote_address(f"{PLAIN}?insecure=0")[1].insecure


def test_what_the_address_does_not_say_the_environment_does(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CONNECT_VARIABLE, "tls/a:1,tls/b:2")
    monkeypatch.setenv(KEYS_VARIABLE, "/keys")
    assert default_route() == Route(("tls/a:1", "tls/b:2"), Path("/keys"))
    assert parse_remote_address(PLAIN)[1] == default_route()
    assert parse_remote_address(f"{PLAIN}?connect=tls/c:3")[1] == Route(("tls/c:3",), Path("/keys"))
    assert parse_remote_address(f"{PLAIN}?keys=/mine")[1] == Route(("tls/a:1", "tls/b:2"), Path("/mine"))


@pytest.mark.parametrize("value", ["", ","])
def test_an_empty_environment_is_none(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv(CONNECT_VARIABLE, value)
    monkeypatch.setenv(KEYS_VARIABLE, "")
    assert default_route() == Route()


@pytest.mark.parametrize(
    "address",
    [
        "zenoh://lab/cell-1",
        "zenoh://lab/cell-1/left/more",
        "zenoh://lab/*/left",
        "tcp://lab/cell-1/left",
        f"{PLAIN}?conect=tls/a:1",
        f"{PLAIN}?connect",
        f"{PLAIN}#there",
        f"{PLAIN}/?connect=tls/a:1",
    ],
)
def test_malformed(address: str) -> None:
    with pytest.raises(ValueError, match=r"malformed .* accepted: zenoh://SITE/HOST/GRIPPER") as caught:
        parse_remote_address(address)
    assert repr(address) in str(caught.value)
    assert (str(caught.value).count("malformed"), str(caught.value).count("accepted")) == (1, 1)


def test_no_string() -> None:
    with pytest.raises(TypeError, match="address must be a string, got 3"):
        parse_remote_address(3)


@pytest.mark.parametrize(
    ("address", "remote"),
    [(PLAIN, True), ("ZENOH://", True), ("tcp://a", False), ("zenoh:/a", False), (3, False), (None, False)],
)
def test_which_is_remote(address: object, remote: bool) -> None:
    assert is_remote(address) is remote


def test_a_route_beyond_this_machine_without_keys_is_refused() -> None:
    with pytest.raises(ValueError, match="open to everyone"):
        Route(("tcp/cell-1:7447",)).configuration()
    assert Route(("tcp/cell-1:7447",), insecure=True).configuration()
    assert Route().configuration()
