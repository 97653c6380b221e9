"""One place, however its address is written."""

from __future__ import annotations

import os
import socket
from itertools import combinations
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.link.address import parse_address
from robotiq_async.link.canonical import canonical_address

LOOPBACK = "lo" if os.path.exists("/sys/class/net/lo") else "lo0"


def place(text: str) -> str:
    return canonical_address(parse_address(text))


@pytest.mark.parametrize(
    "spellings",
    [
        [
            *(
                "localhost",
                "localhost.",
                "LocalHost",
                "gripper.localhost",
                "127.0.0.1",
                "tcp://127.0.0.1:502",
            ),
            *("0.0.0.0", "[::]", "[::1]", "[0:0:0:0:0:0:0:1]", "[::ffff:127.0.0.1]", "[::ffff:7f00:1]"),
            f"[::1%{LOOPBACK}]",
        ],
        ["192.168.1.11", "192.168.1.11:502", "[::ffff:192.168.1.11]", "[::FFFF:C0A8:10B]"],
        ["[2001:db8::1]", "[2001:DB8:0:0:0:0:0:1]:502", "[2001:0db8::0:1]"],
        ["gripper.local", "gripper.local.", "tcp://Gripper.LOCAL:502"],
        [f"[fe80::1%{LOOPBACK}]", f"[fe80:0::1%{socket.if_nametoindex(LOOPBACK)}]"],
        ["[fe80::1%no-such]", "[FE80::0:1%no-such]"],
        ["rtu://COM3", "rtu://com3", r"rtu://\\.\COM3", r"rtu://\\?\com3"],
    ],
    ids=lambda spellings: spellings[0],
)
def test_one_place_is_one(spellings: list[str]) -> None:
    assert len({place(each) for each in spellings}) == 1


def test_other_places_are_others() -> None:
    spellings = [
        *("gripper", "gripper.example.org", "gripper:503", "127.0.0.1", "127.0.0.2", "192.168.1.11"),
        *("[fe80::1]", f"[fe80::1%{LOOPBACK}]", "[fe80::1%no-such]", "[fe80::2]", "[2001:db8::1]"),
        *("localhosts", "rtu://gripper", "rtu://COM3", "rtu://COM4", "sim://"),
    ]
    for one, another in combinations(spellings, 2):
        assert place(one) != place(another), (one, another)


@given(st.ip_addresses(v=6))
def test_an_ipv6_address_is_one_however_it_is_written(address: object) -> None:
    written = {str(address), address.exploded, str(address).upper()}  # type: ignore[attr-defined]
    assert len({place(f"[{each}]") for each in written}) == 1


# -- serial ports ------------------------------------------------------------------------------------------


def test_the_links_to_a_serial_port_are_that_port(tmp_path: Path) -> None:
    (tmp_path / "port").touch()
    (tmp_path / "by-id").symlink_to(tmp_path / "port")
    assert place(f"rtu://{tmp_path}/by-id") == place(f"rtu://{tmp_path}/port")
    assert place(f"rtu://{tmp_path}/by-id") != place(f"rtu://{tmp_path}/other")


def test_a_link_is_followed_to_where_it_leads_now(tmp_path: Path) -> None:
    link = tmp_path / "by-id"
    link.symlink_to(tmp_path / "ttyUSB0")
    before = place(f"rtu://{link}")
    link.unlink()
    link.symlink_to(tmp_path / "ttyUSB1")
    assert before != place(f"rtu://{link}") == place(f"rtu://{tmp_path}/ttyUSB1")


def test_a_device_is_known_by_its_number(tmp_path: Path) -> None:
    master, slave = pytest.importorskip("pty").openpty()
    name = os.ttyname(slave)
    (tmp_path / "by-id").symlink_to(name)
    assert place(f"rtu://{tmp_path}/by-id") == place(f"rtu://{name}")
    assert place(f"rtu://{os.path.dirname(name)}/../pts/{os.path.basename(name)}") == place(f"rtu://{name}")
    number = os.stat(name).st_rdev
    assert f"{os.major(number)}:{os.minor(number)}" in place(f"rtu://{name}")
    os.close(slave)
    os.close(master)


def test_a_socket_is_one_place_for_all_protocols() -> None:
    assert place("rtu+tcp://localhost:54321") == place("tcp://127.0.0.1:54321")
    assert place("rtu+tcp://localhost:54321") != place("rtu+tcp://localhost:54322")
