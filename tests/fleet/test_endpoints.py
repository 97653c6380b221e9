"""Where zenoh may listen and connect."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import pytest

from robotiq_async.fleet.network.endpoints import check_endpoints

Check = Callable[..., tuple[str, ...]]
CHECKS = pytest.mark.parametrize("check", [partial(check_endpoints, "listen")])
LOOPBACK = ("tcp/127.0.0.1:7447", "tcp/127.1.2.3:1", "tcp/[::1]:7447", "tcp/localhost:65535")
OPEN = (
    "tcp/0.0.0.0:7447",
    "tcp/[::]:7447",
    "tcp/192.168.1.20:7447",
    "tcp/cell-1:7447",
    "tcp/localhost.lab:1",
)
ENCRYPTED = ("tls/0.0.0.0:7447", "quic/cell-1.lab:7447", "tls/127.0.0.1:7447")


@CHECKS
def test_on_this_machine_nothing_is_needed(check: Check) -> None:
    assert check(LOOPBACK, has_keys=False) == LOOPBACK
    assert check([], has_keys=False) == ()


@CHECKS
@pytest.mark.parametrize("endpoint", OPEN)
def test_beyond_it_somebody_must_say_so(check: Check, endpoint: str) -> None:
    with pytest.raises(ValueError, match="is open to everyone on that network"):
        check([LOOPBACK[0], endpoint], has_keys=False)
    assert check([endpoint], has_keys=False, insecure=True) == (endpoint,)


@CHECKS
@pytest.mark.parametrize("endpoint", ENCRYPTED)
def test_encryption_takes_keys(check: Check, endpoint: str) -> None:
    for insecure in (False, True):
        with pytest.raises(ValueError, match="needs keys"):
            check([endpoint], has_keys=False, insecure=insecure)
    assert check([endpoint], has_keys=True) == (endpoint,)


@CHECKS
@pytest.mark.parametrize("endpoint", [*LOOPBACK, *OPEN])
def test_with_keys_everything_is_encrypted(check: Check, endpoint: str) -> None:
    with pytest.raises(ValueError, match="must begin with tls/"):
        check([endpoint], has_keys=True)
    with pytest.raises(ValueError, match="exclude each other"):
        check([endpoint], has_keys=True, insecure=True)


@CHECKS
@pytest.mark.parametrize(
    "endpoint",
    [
        "",
        "127.0.0.1:7447",
        "tcp/127.0.0.1",
        "tcp/127.0.0.1:0",
        "tcp/127.0.0.1:65536",
        "tcp/127.0.0.1:7447 ",
        "tcp/::1:7447",
        "udp/127.0.0.1:7447",
        "ws/127.0.0.1:7447",
        "unixsock-stream//tmp/socket",
        "tls/cell-1:7447#enable_mtls=false",
        "tls/cell-1:7447?rel=0",
        "tcp/127.0.0.1:7447\n",
    ],
)
def test_what_is_no_endpoint_of_ours(check: Check, endpoint: str) -> None:
    """What stands behind a # goes before the rest of zenoh's configuration."""
    for options in ({"has_keys": True}, {"has_keys": False}, {"has_keys": False, "insecure": True}):
        with pytest.raises(ValueError, match=r"must be tcp/HOST:PORT, tls/HOST:PORT or quic/HOST:PORT"):
            check([endpoint], **options)


@CHECKS
def test_what_is_no_text(check: Check) -> None:
    with pytest.raises(TypeError, match="got 7447"):
        check([7447], has_keys=False)
