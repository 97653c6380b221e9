"""The address of a tunnel, by an entry point of the package that has its scheme."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path
from typing import Final

import pytest

from robotiq_async import RobotiqHand, TunnelPlace
from robotiq_async.link.address import TUNNELS, parse_address
from robotiq_async.link.canonical import canonical_address
from tests.installed import install
from tests.link.test_tunnel import Arm, arm

HERE: Final = "tests.link.test_tunnel_addresses"
MADE: Final[list[tuple[TunnelPlace, Arm]]] = []
"""The tunnels that were made for ``myarm://``, the newest last."""
READY: Final[list[Arm]] = []
"""Arms for them."""


def make(place: TunnelPlace) -> Arm:
    if "wrong" in place.options:
        raise ValueError("the option wrong is unknown")
    MADE.append((place, READY.pop()))
    return MADE[-1][1]


def make_nothing(_: TunnelPlace) -> str:
    return "an arm"


@pytest.fixture(autouse=True)
def package(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    schemes = {"myarm": "make", "nothing": "make_nothing", "missing": "make_what"}
    entries = {scheme: f"{HERE}:{name}" for scheme, name in schemes.items()}
    install(monkeypatch, tmp_path, "myarm", TUNNELS, **entries)


@pytest.mark.virtual_time
async def test_a_hand_is_made_by_an_address() -> None:
    READY.append(await arm())
    text = "MyArm://Arm.local:7000?side=left&model=2f85&baud=9600"
    async with RobotiqHand(text, device_id=12) as hand:
        assert hand.address == "myarm://arm.local:7000?side=left&baud=9600&model=2f85"
        await hand.move(200)
    place, tunnel = MADE[-1]
    assert place == TunnelPlace("arm.local", 7000, 12, {"side": "left", "baud": "9600"})
    assert (tunnel.opened, tunnel.closed) == (1, 1)


@pytest.mark.parametrize(
    "text", ["myarm://arm?model=hand-e", "myarm://[::1]:5?side=left", "myarm://arm?a=1&model=2f85&stroke=/f"]
)
def test_an_address_has_one_form(text: str) -> None:
    address = parse_address(text)
    assert str(address) == text
    assert parse_address(text.upper()[:5] + text[5:]) == address


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("yourarm://arm", "no package here has yourarm://"),
        ("myarm://", "a tunnel is myarm://HOST"),
        ("myarm://arm:99999", "a tunnel is myarm://HOST"),
        ("myarm://arm?side", "given once, as NAME=VALUE, got 'side'"),
        ("myarm://arm?side=l&side=r", "given once, as NAME=VALUE, got 'side=r'"),
        ("myarm://arm?wrong=1", f"{HERE}:make makes no tunnel: the option wrong is unknown"),
        ("nothing://arm", "make_nothing must return an object with open, exchange and close, got 'an arm'"),
        ("missing://arm", "make_what makes no tunnel: AttributeError"),
    ],
)
def test_what_is_wrong_is_said_when_the_hand_is_made(text: str, words: str) -> None:
    with pytest.raises(ValueError, match=words.replace("?", r"\?")):
        RobotiqHand(text)


def test_a_scheme_of_two_packages_is_refused(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    (tmp_path / "other").mkdir()
    install(monkeypatch, tmp_path / "other", "other", TUNNELS, myarm="other:make", tcp="other:make")
    with pytest.raises(
        ValueError, match=f"several packages have tunnels for myarm://: other:make and {HERE}"
    ):
        parse_address("myarm://arm")
    assert parse_address("tcp://arm").kind == "tcp", "no package takes a scheme over"


@pytest.mark.parametrize(
    ("one", "other", "is_same"),
    [
        ("myarm://arm", "myarm://ARM.?model=2f85", True),
        ("myarm://arm?a=1&b=2", "myarm://arm?b=2&a=1", True),
        ("myarm://arm", "nothing://arm", False),
        ("myarm://arm", "tcp://arm", False),
        ("myarm://arm?side=left", "myarm://arm?side=right", False),
    ],
)
def test_one_place_has_one_spelling(one: str, other: str, is_same: bool) -> None:
    same = canonical_address(parse_address(one)) == canonical_address(parse_address(other))
    assert same == is_same


def test_no_package_is_looked_for_where_a_scheme_is_known() -> None:
    """importlib.metadata takes a tenth of the time that the whole library takes."""
    known = ["192.168.1.11", "tcp://h", "rtu:///dev/ttyUSB0", "rtu+tcp://h:1", "urcap://h", "sim://"]
    said = f"import sys; from robotiq_async.link.address import parse_address; [*map(parse_address, {known})]"
    said += "; assert 'importlib.metadata' not in sys.modules"
    subprocess.run([sys.executable, "-c", said], check=True, cwd=Path(__file__).parents[2])
