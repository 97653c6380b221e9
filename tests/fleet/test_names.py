"""Names: what may be one, and the keys made of them."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.wire.names import ROOT, GripperName, check_name

GOOD = st.from_regex(r"[A-Za-z0-9_.-]{1,64}", fullmatch=True)
BAD = [
    "",
    "a" * 65,
    "*",
    "**",
    "a*",
    "a/b",
    "/",
    "$*",
    "a?b",
    "a#b",
    "a b",
    "é",
    "\uff41",
    "名",
    "a\n",
    "\x00",
    "a:b",
    "@",
]


@pytest.mark.parametrize("name", BAD)
def test_what_is_no_name(name: str) -> None:
    with pytest.raises(ValueError, match=r"site must be 1\.\.64"):
        check_name("site", name)
    for parts in ((name, "b", "c"), ("a", name, "c"), ("a", "b", name)):
        with pytest.raises(ValueError, match=r"must be 1\.\.64"):
            GripperName(*parts)
        with pytest.raises(ValueError, match=r"must be (1\.\.64|zenoh://)"):
            GripperName.parse("zenoh://" + "/".join(parts))


@pytest.mark.parametrize("name", [None, 3, b"a", ["a"]])
def test_what_is_no_string(name: object) -> None:
    with pytest.raises(TypeError, match="host must be a string"):
        check_name("host", name)
    with pytest.raises(TypeError, match="address must be a string"):
        GripperName.parse(name)


@given(st.text(max_size=70))
def test_a_name_has_no_other_characters(name: str) -> None:
    allowed = set("ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_.-")
    try:
        check_name("site", name)
    except ValueError:
        assert not (1 <= len(name) <= 64 and set(name) <= allowed)
    else:
        assert 1 <= len(name) <= 64
        assert set(name) <= allowed


@given(GOOD, GOOD, GOOD)
def test_addresses_and_keys_lead_back_to_the_name(site: str, host: str, gripper: str) -> None:
    name = GripperName(site, host, gripper)
    assert GripperName.parse(str(name)) == name
    assert GripperName.of_key(name.key("cmd", "move")) == name
    assert GripperName.of_key(name.key("feed")) == name
    assert name.key("halt") == f"{ROOT}/{site}/{host}/{gripper}/halt"
    assert 0 <= name.mark < 2**32


@pytest.mark.parametrize(
    "address",
    [
        "",
        "zenoh://",
        "zenoh://a/b",
        "zenoh://a/b/c/d",
        "tcp://a/b/c",
        "a/b/c",
        "zenoh:/a/b/c",
    ],
)
def test_what_is_no_address(address: str) -> None:
    with pytest.raises(ValueError, match="zenoh://SITE/HOST/GRIPPER"):
        GripperName.parse(address)


def test_a_scheme_is_a_scheme_in_capitals_too() -> None:
    assert GripperName.parse("ZENOH://Lab/b/c") == GripperName("Lab", "b", "c")


@pytest.mark.parametrize(
    "key",
    [
        "",
        "robotiq/v1",
        "robotiq/v1/a/b/c",
        "robotiq/v2/a/b/c/feed",
        "x/v1/a/b/c/feed",
        "robotiq/v1/a/*/c/feed",
    ],
)
def test_what_is_no_key(key: str) -> None:
    with pytest.raises(ValueError, match=r"not a key|must be"):
        GripperName.of_key(key)


def test_different_grippers_have_different_marks() -> None:
    names = [GripperName("lab", f"cell{host}", f"g{gripper}") for host in range(20) for gripper in range(50)]
    assert len({name.mark for name in names}) == len(names)


@pytest.mark.parametrize("name", ["*", "**", "a*", "$*", "a/b", "?", "#", "", "a" * 65, "ä"])
def test_names_with_wildcards_are_none(name: str) -> None:
    with pytest.raises(ValueError, match=r"1\.\.64"):
        GripperName("lab", "cell", name)
    with pytest.raises(ValueError, match=r"1\.\.64"):
        Fleet(name)
