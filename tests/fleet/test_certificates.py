"""The authority's folder: what is in it, what is never overwritten, and who is let in by it."""

from __future__ import annotations

import os
import stat
from datetime import UTC, datetime, timedelta
from ipaddress import ip_address
from pathlib import Path
from typing import cast

import numpy as np
import pytest
from cryptography import x509
from cryptography.x509.oid import ExtendedKeyUsageOID, NameOID

from robotiq_async.cli.keys.issuing import access_lists, issue, make_authority
from robotiq_async.fleet.keys.access import AccessList, Role
from robotiq_async.fleet.keys.key_folder import check_key_folder


def certificate(path: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(path.read_bytes())


def common_name(path: Path) -> object:
    return certificate(path).subject.get_attributes_for_oid(NameOID.COMMON_NAME)[0].value


def contents(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


@pytest.fixture
def authority(tmp_path: Path) -> Path:
    folder = tmp_path / "site" / "keys"
    make_authority(folder)
    return folder


def test_which_files_an_authority_makes(authority: Path) -> None:
    agent = issue(authority, "cell-1", Role.AGENT, hosts=["cell-1.lab", "192.168.1.20"])
    bob = issue(authority, "bob", Role.OPERATE)
    names = sorted(str(path.relative_to(authority)) for path in contents(authority))
    of_agent = [f"agent-cell-1/{name}" for name in ("access.toml", "ca.pem", "cert.pem", "key.pem")]
    of_bob = [f"operate-bob/{name}" for name in ("ca.pem", "cert.pem", "key.pem")]
    assert names == sorted(["access.toml", "ca.key", "ca.pem", *of_agent, *of_bob])
    assert [common_name(each / "cert.pem") for each in (agent, bob)] == ["agent:cell-1", "operate:bob"]
    assert (agent / "ca.pem").read_bytes() == (authority / "ca.pem").read_bytes()
    assert check_key_folder(agent) == agent


@pytest.mark.skipif(os.name != "posix", reason="modes of files are POSIX's")
def test_keys_are_for_their_owner_only(authority: Path) -> None:
    folder = issue(authority, "bob", Role.OPERATE)
    for path in (authority / "ca.key", folder / "key.pem"):
        assert stat.S_IMODE(path.stat().st_mode) == 0o600
    for path in (authority, folder):
        assert stat.S_IMODE(path.stat().st_mode) == 0o700


def test_only_an_agent_opens_a_server_and_under_the_names_it_was_given(authority: Path) -> None:
    agent = certificate(issue(authority, "cell-1", Role.AGENT, hosts=["cell-1.lab", "::2"]) / "cert.pem")
    names = agent.extensions.get_extension_for_class(x509.SubjectAlternativeName).value
    assert names.get_values_for_type(x509.DNSName) == ["cell-1.lab", "localhost"]
    numbers = [ip_address(each) for each in ("::2", "127.0.0.1", "::1")]
    assert names.get_values_for_type(x509.IPAddress) == numbers
    for role in (Role.READ, Role.HALT, Role.OPERATE):
        client = certificate(issue(authority, "bob", role) / "cert.pem")
        usage = client.extensions.get_extension_for_class(x509.ExtendedKeyUsage).value
        assert list(usage) == [ExtendedKeyUsageOID.CLIENT_AUTH]


def test_no_certificate_makes_others(authority: Path) -> None:
    bob = certificate(issue(authority, "bob", Role.OPERATE) / "cert.pem")
    assert not bob.extensions.get_extension_for_class(x509.BasicConstraints).value.ca
    assert not bob.extensions.get_extension_for_class(x509.KeyUsage).value.key_cert_sign
    above = certificate(authority / "ca.pem").extensions.get_extension_for_class(x509.BasicConstraints)
    assert above.value == x509.BasicConstraints(ca=True, path_length=0)


def test_how_long_they_are_valid(authority: Path, tmp_path: Path) -> None:
    now, three = datetime.now(UTC), cast("int", np.int64(3))
    for path, days in (
        (authority / "ca.pem", 3650),
        (issue(authority, "cell-1", Role.AGENT) / "cert.pem", 825),
        (issue(authority, "guest", Role.READ, days=three) / "cert.pem", 3),
        (make_authority(tmp_path / "short", days=10), 10),
    ):
        end = now + timedelta(days=days)
        assert abs(certificate(path).not_valid_after_utc - end) < timedelta(minutes=1)
        assert certificate(path).not_valid_before_utc < now
    with pytest.raises(ValueError, match="the authority ends on"):
        issue(tmp_path / "short", "bob", Role.READ, days=11)


def test_clients_are_entered_in_every_list(authority: Path) -> None:
    issue(authority, "alice", Role.READ)
    first = issue(authority, "cell-1", Role.AGENT)
    assert AccessList.read_file(first / "access.toml") == AccessList(read=("alice",))
    issue(authority, "panel", Role.HALT)
    issue(authority, "bob", Role.OPERATE)
    issue(authority, "bob", Role.READ)
    expected = AccessList(("alice", "bob"), ("panel",), ("bob",))
    assert [AccessList.read_file(path) for path in access_lists(authority)] == [expected] * 2


def test_nothing_is_overwritten(authority: Path) -> None:
    issue(authority, "cell-1", Role.AGENT)
    issue(authority, "bob", Role.OPERATE)
    before = contents(authority)
    with pytest.raises(FileExistsError, match="authority"):
        make_authority(authority)
    for name, role in (("cell-1", Role.AGENT), ("bob", Role.OPERATE)):
        with pytest.raises(FileExistsError, match=f"{role.value}-{name} already exists"):
            issue(authority, name, role)
    (authority / "ca.key").unlink()
    with pytest.raises(FileExistsError):
        make_authority(authority)
    assert contents(authority).items() <= before.items()


@pytest.mark.parametrize(
    ("name", "hosts", "days", "words"),
    [
        ("", (), 1, "A-Z"),
        ("a/b", (), 1, "'a/b'"),
        ("..", ("a..b",), 1, "a host must be"),
        ("x" * 57, (), 1, "at most 56"),
        ("a\n", (), 1, "A-Z"),
        ("cell-1", ("1.2.3",), 1, "'1.2.3'"),
        ("cell-1", ("*.lab",), 1, r"\*\.lab"),
        ("cell-1", ("",), 1, "''"),
        ("cell-1", ("bücher",), 1, "bücher"),
        ("cell-1", (), 0, r"1\.\.36500"),
        ("cell-1", (), 36501, r"1\.\.36500"),
    ],
)
def test_a_refused_certificate_leaves_no_files(
    authority: Path, name: str, hosts: tuple[str, ...], days: int, words: str
) -> None:
    before = contents(authority)
    with pytest.raises(ValueError, match=words):
        issue(authority, name, Role.AGENT, hosts=hosts, days=days)
    assert contents(authority) == before
    assert len(list(authority.iterdir())) == 3


def test_hosts_are_for_agents(authority: Path) -> None:
    with pytest.raises(ValueError, match="hosts are for agents"):
        issue(authority, "bob", Role.READ, hosts=["bob.lab"])


def test_an_authority_that_is_not_there_or_broken(authority: Path, tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError):
        issue(tmp_path / "nowhere", "bob", Role.READ)
    make_authority(tmp_path / "other")
    key = (authority / "ca.key").read_bytes()
    for spoilt in (b"", b"what", (tmp_path / "other" / "ca.key").read_bytes()):
        (authority / "ca.key").write_bytes(spoilt)
        with pytest.raises(ValueError, match=r"ca\.key"):
            issue(authority, "bob", Role.READ)
    (authority / "ca.key").write_bytes(key)
    (authority / "access.toml").unlink()
    with pytest.raises(ValueError, match=r"access\.toml: No such file"):
        issue(authority, "bob", Role.READ)
    assert not (authority / "read-bob").exists()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('raed = ["bob"]', "'raed'.*read, halt, operate"),
        ('read = "bob"', "read must be a list"),
        ("read = [3]", "must be a string, got 3"),
        ('read = ["*"]', "'\\*'"),
        ("read = [", "access.toml"),
        ("agent = []", "'agent'"),
    ],
)
def test_a_bad_access_list_is_reported(text: str, words: str, tmp_path: Path) -> None:
    file = tmp_path / "access.toml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=words):
        AccessList.read_file(file)


def test_an_access_list_is_read_as_it_was_written(tmp_path: Path) -> None:
    file = tmp_path / "access.toml"
    for clients in (AccessList(), AccessList(("a", "b-c"), ("d.e",), ("F_1",))):
        file.write_text(clients.text(), encoding="utf-8")
        assert AccessList.read_file(file) == clients
