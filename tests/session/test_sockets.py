"""Which hosts are this machine."""

from __future__ import annotations

import pytest

from robotiq_async.runtime.sockets import is_loopback


@pytest.mark.parametrize(
    ("host", "inside"),
    [
        ("127.0.0.1", True),
        ("127.1.2.3", True),
        ("::1", True),
        ("localhost", True),
        ("LOCALHOST", True),
        ("127.evil.example", False),
        ("localhost.example.com", False),
        ("::1234", False),
        ("0.0.0.0", False),
    ],
)
def test_which_hosts_are_this_machine(host: str, inside: bool) -> None:
    assert is_loopback(host) is inside
