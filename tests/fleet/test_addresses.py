"""Names, addresses, endpoints, and what is imported."""

from __future__ import annotations

import subprocess
import sys
from functools import partial
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.network.endpoints import check_endpoints
from robotiq_async.fleet.network.route import (
    CONNECT_VARIABLE,
    KEYS_VARIABLE,
    Route,
    default_route,
    parse_remote_address,
)
from robotiq_async.fleet.wire.names import ROOT, GripperName, check_name
from robotiq_async.link.address import is_remote
from robotiq_async.runtime.extras import install
from tests.patience import patience
from tests.strategies import ANY

ALLOWED = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-"
GOOD = st.text(ALLOWED, min_size=1, max_size=64)
BAD = ["", "a" * 65, "*", "$*", "a/b", "é", "a\n"]
NAME = GripperName("lab", "cell-1", "left")
PLAIN = "zenoh://lab/cell-1/left"
check = partial(check_endpoints, "listen")
LOOPBACK = ("tcp/127.0.0.1:7447", "tcp/127.1.2.3:1", "tcp/[::1]:7447", "tcp/localhost:65535")
OPEN = ("tcp/0.0.0.0:7447", "tcp/[::]:7447", "tcp/192.168.1.20:7447", "tcp/localhost.lab:1")
ENCRYPTED = ("tls/0.0.0.0:7447", "quic/cell-1.lab:7447", "tls/127.0.0.1:7447")
WITHOUT = """\
import asyncio, sys

sys.modules["zenoh"] = sys.modules["cryptography"] = None
from robotiq_async.fleet import *
from robotiq_async.fleet import Agent, Fleet, RemoteHand

print(Agent.__name__)
for one in (RemoteHand("zenoh://lab/cell/left"), Fleet("lab")):
    try:
        asyncio.run(one.__aenter__())
    except ImportError as error:
        print(error)
"""


# -- names -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", BAD)
def test_malformed_names_are_refused(name: str) -> None:
    with pytest.raises(ValueError, match=r"site must be 1\.\.64"):
        check_name("site", name)
    with pytest.raises(ValueError, match=r"1\.\.64"):
        Fleet(name)
    for parts in ((name, "b", "c"), ("a", name, "c"), ("a", "b", name)):
        with pytest.raises(ValueError, match=r"must be 1\.\.64"):
            GripperName(*parts)
        with pytest.raises(ValueError, match=r"must be (1\.\.64|zenoh://)"):
            GripperName.parse("zenoh://" + "/".join(parts))


@pytest.mark.parametrize("name", [None, 3, b"a", ["a"]])
def test_names_that_are_not_strings_are_refused(name: object) -> None:
    with pytest.raises(TypeError, match="host must be a string"):
        check_name("host", name)
    for parse in (GripperName.parse, parse_remote_address):
        with pytest.raises(TypeError, match="address must be a string"):
            parse(name)


@given(st.text(ANY, max_size=70))
def test_a_name_has_no_other_characters(name: str) -> None:
    try:
        check_name("site", name)
    except ValueError:
        assert not (1 <= len(name) <= 64 and set(name) <= set(ALLOWED))
    else:
        assert 1 <= len(name) <= 64
        assert set(name) <= set(ALLOWED)


@given(GOOD, GOOD, GOOD)
def test_addresses_and_keys_lead_back_to_the_name(site: str, host: str, gripper: str) -> None:
    name = GripperName(site, host, gripper)
    assert GripperName.parse(str(name)) == name
    assert GripperName.of_key(name.key("cmd", "move")) == name
    assert GripperName.of_key(name.key("feed")) == name
    assert name.key("halt") == f"{ROOT}/{site}/{host}/{gripper}/halt"
    assert 0 <= name.mark < 2**32


def test_a_scheme_is_a_scheme_in_capitals_too() -> None:
    assert GripperName.parse("ZENOH://Lab/b/c") == GripperName("Lab", "b", "c")


@pytest.mark.parametrize(
    "key",
    ["", "robotiq/v1/a/b/c", "robotiq/v2/a/b/c/feed", "x/v1/a/b/c/feed", "robotiq/v1/a/*/c/feed"],
)
def test_malformed_keys_are_refused(key: str) -> None:
    with pytest.raises(ValueError, match=r"not a key|must be"):
        GripperName.of_key(key)


def test_different_grippers_have_different_marks() -> None:
    names = [GripperName("lab", f"cell{host}", f"g{gripper}") for host in range(20) for gripper in range(50)]
    assert len({name.mark for name in names}) == len(names)


# -- route -------------------------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def empty_environment(monkeypatch: pytest.MonkeyPatch) -> None:
    for variable in (CONNECT_VARIABLE, KEYS_VARIABLE):
        monkeypatch.delenv(variable, raising=False)


def test_without_options_it_is_an_agent_on_this_machine() -> None:
    assert parse_remote_address(PLAIN) == (NAME, Route())


def test_options() -> None:
    address = f"{PLAIN}?connect=tls/cell-1:7447&connect=tls/router:7447&keys=/etc/robotiq%20keys"
    assert parse_remote_address(address) == (
        NAME,
        Route(("tls/cell-1:7447", "tls/router:7447"), Path("/etc/robotiq keys"), False),
    )
    assert parse_remote_address(f"{PLAIN}?insecure=1")[1].insecure
    assert not parse_remote_address(f"{PLAIN}?insecure=0")[1].insecure


def test_the_environment_fills_in_the_address(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(CONNECT_VARIABLE, "tls/a:1,tls/b:2")
    monkeypatch.setenv(KEYS_VARIABLE, "/keys")
    assert default_route() == Route(("tls/a:1", "tls/b:2"), Path("/keys"))
    assert parse_remote_address(PLAIN)[1] == default_route()
    assert parse_remote_address(f"{PLAIN}?connect=tls/c:3")[1] == Route(("tls/c:3",), Path("/keys"))
    assert parse_remote_address(f"{PLAIN}?keys=/mine")[1] == Route(("tls/a:1", "tls/b:2"), Path("/mine"))


@pytest.mark.parametrize("value", ["", ","])
def test_an_empty_environment_counts_as_unset(monkeypatch: pytest.MonkeyPatch, value: str) -> None:
    monkeypatch.setenv(CONNECT_VARIABLE, value)
    monkeypatch.setenv(KEYS_VARIABLE, "")
    assert default_route() == Route()


@pytest.mark.parametrize(
    "address",
    [
        "",
        "zenoh://lab/cell-1",
        "zenoh://lab/cell-1/left/more",
        "zenoh://lab/*/left",
        "zenoh:/lab/cell-1/left",
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


@pytest.mark.parametrize(
    ("address", "remote"),
    [(PLAIN, True), ("ZENOH://", True), ("tcp://a", False), ("zenoh:/a", False), (3, False), (None, False)],
)
def test_which_addresses_are_remote(address: object, remote: bool) -> None:
    assert is_remote(address) is remote


def test_a_route_beyond_this_machine_without_keys_is_refused() -> None:
    with pytest.raises(ValueError, match="open to everyone"):
        Route(("tcp/cell-1:7447",)).configuration()
    assert Route(("tcp/cell-1:7447",), insecure=True).configuration()
    assert Route().configuration()


# -- endpoints ---------------------------------------------------------------------------------------------


def test_on_this_machine_nothing_is_needed() -> None:
    assert check(LOOPBACK, has_keys=False) == LOOPBACK
    assert check([], has_keys=False) == ()


@pytest.mark.parametrize("endpoint", OPEN)
def test_listening_beyond_this_machine_must_be_confirmed(endpoint: str) -> None:
    with pytest.raises(ValueError, match="is open to everyone on that network"):
        check([LOOPBACK[0], endpoint], has_keys=False)
    assert check([endpoint], has_keys=False, insecure=True) == (endpoint,)


@pytest.mark.parametrize("endpoint", ENCRYPTED)
def test_encryption_takes_keys(endpoint: str) -> None:
    for insecure in (False, True):
        with pytest.raises(ValueError, match="needs keys"):
            check([endpoint], has_keys=False, insecure=insecure)
    assert check([endpoint], has_keys=True) == (endpoint,)


@pytest.mark.parametrize("endpoint", [*LOOPBACK, *OPEN])
def test_with_keys_everything_is_encrypted(endpoint: str) -> None:
    with pytest.raises(ValueError, match="must begin with tls/"):
        check([endpoint], has_keys=True)
    with pytest.raises(ValueError, match="cannot be combined"):
        check([endpoint], has_keys=True, insecure=True)


@pytest.mark.parametrize(
    "endpoint",
    [
        *("", "127.0.0.1:7447", "tcp/127.0.0.1", "tcp/127.0.0.1:0", "tcp/127.0.0.1:65536", "tcp/::1:7447"),
        *("udp/127.0.0.1:7447", "tls/cell-1:7447#enable_mtls=false", "tls/cell-1:7447?rel=0"),
        "tcp/127.0.0.1:7447\n",
    ],
)
def test_malformed_endpoints_are_refused(endpoint: str) -> None:
    """Options behind a # precede the rest of zenoh's configuration."""
    for options in ({"has_keys": True}, {"has_keys": False}, {"has_keys": False, "insecure": True}):
        with pytest.raises(ValueError, match=r"must be tcp/HOST:PORT, tls/HOST:PORT or quic/HOST:PORT"):
            check([endpoint], **options)


def test_an_endpoint_must_be_text() -> None:
    with pytest.raises(TypeError, match="got 7447"):
        check([7447], has_keys=False)


# -- public names ------------------------------------------------------------------------------------------


def test_without_zenoh_and_cryptography_the_names_are_there_and_the_error_names_the_extra() -> None:
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT], capture_output=True, text=True, timeout=patience(60)
    )
    error = f"hands on other hosts need zenoh: {install('fleet')}"
    assert done.stdout.splitlines() == ["Agent", error, error], done.stderr
    assert not done.stderr
