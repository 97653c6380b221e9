"""FLEET.toml: its content, and the errors, each with its line."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotiq_async import TWO_FINGER_85
from robotiq_async.calibration.csv_tables import write_stroke
from robotiq_async.cli.agent_file import (
    AgentFileError,
    AgentSettings,
    machine_name,
    read_agent_file,
)
from robotiq_async.cli.connect import make_served
from robotiq_async.fleet.network.configuration import LOOPBACK_ENDPOINT, LOOPBACK_TLS, agent_configuration
from robotiq_async.fleet.wire.names import check_name

LEFT = '[grippers.left]\naddress = "tcp://192.168.1.11"\n'
GOOD = f'site = "lab"\nhost = "cell-1"\n{LEFT}'


def read(folder: Path, text: str) -> AgentSettings:
    file = folder / "FLEET.toml"
    file.write_text(text, encoding="utf-8")
    return read_agent_file(file)


def put_keys(folder: Path) -> Path:
    keys = folder / "cell-1"
    keys.mkdir()
    for name in ("ca.pem", "cert.pem", "key.pem", "access.toml"):
        (keys / name).touch()
    return keys


def test_the_least_there_can_be_listens_on_this_machine_only(tmp_path: Path) -> None:
    settings = read(tmp_path, f'site = "lab"\n{LEFT}')
    assert settings == AgentSettings("lab", settings.grippers)
    assert (settings.listen, settings.connect, settings.keys) == ((LOOPBACK_ENDPOINT,), (), None)
    assert settings.host == machine_name() == check_name("host", settings.host)


def test_everything(tmp_path: Path) -> None:
    keys = put_keys(tmp_path)
    settings = read(
        tmp_path,
        """
        site = "lab"
        host = "cell-1"
        listen = ["tls/0.0.0.0:7447", "quic/[::]:7447"]
        keys = "cell-1"
        window = 2

        [grippers]
        right = {address = "rtu:///dev/ttyUSB0", response_timeout = 0.2, status_address = 2000}

        [grippers.left]
        address = "192.168.1.11"
        device_id = 3
        speed = 255
        force = 0
        poll_interval = 0.01
        keep_grip = true
        """,
    )
    assert settings.listen == ("tls/0.0.0.0:7447", "quic/[::]:7447")
    assert (settings.host, settings.keys, settings.window) == ("cell-1", keys, 2.0)
    assert list(settings.grippers) == ["right", "left"]
    assert settings.grippers["left"].speed == 255
    assert settings.grippers["right"].status_address == 2000
    assert [each.keep_grip for each in settings.grippers.values()] == [False, True]
    hand = make_served(settings.grippers["left"])
    assert (hand.name, hand.address) == ("left", "tcp://192.168.1.11:502")


def test_with_keys_it_listens_encrypted(tmp_path: Path) -> None:
    put_keys(tmp_path)
    assert read(tmp_path, f'keys = "cell-1"\n{GOOD}').listen == (LOOPBACK_TLS,)


def test_behind_a_router_it_does_not_listen(tmp_path: Path) -> None:
    """Zenoh's routers carry nothing between two who may listen: no client heard of it."""
    settings = read(tmp_path, f'connect = ["tcp/127.0.0.1:7447"]\n{GOOD}')
    assert (settings.listen, settings.connect) == ((), ("tcp/127.0.0.1:7447",))
    assert agent_configuration("lab", "cell", ["left"], settings.listen, settings.connect)["mode"] == "client"
    assert agent_configuration("lab", "cell", ["left"])["mode"] == "peer"
    both = 'connect = ["tcp/127.0.0.1:7447"]\nlisten = ["tcp/127.0.0.1:7448"]\n'
    words = r"line 2: listen and connect cannot be combined.*through a router.*7448"
    with pytest.raises(AgentFileError, match=words):
        read(tmp_path, both + GOOD)


def test_a_router_is_trusted_only_where_the_file_says_so(tmp_path: Path) -> None:
    put_keys(tmp_path)
    router = f'keys = "cell-1"\nconnect = ["tls/gate:7447"]\n{GOOD}'
    assert not read(tmp_path, router).trusts_router
    assert read(tmp_path, f"trusts_router = true\n{router}").trusts_router
    for text, words in (
        (f'trusts_router = "yes"\n{router}', "line 1: trusts_router must be true or false, got 'yes'"),
        (f"trusts_router = true\n{GOOD}", "line 1: trusts_router is for agents with keys"),
    ):
        with pytest.raises(AgentFileError, match=words):
            read(tmp_path, text)


def test_two_grippers_behind_one_gateway_and_any_number_of_simulated_ones(tmp_path: Path) -> None:
    right = '[grippers.right]\naddress = "192.168.1.11:502"\ndevice_id = 4\n'
    simulated = "".join(f'[grippers.s{n}]\naddress = "sim://"\n' for n in range(3))
    assert len(read(tmp_path, f"{GOOD}device_id = 3\n{right}{simulated}").grippers) == 5


def test_two_grippers_on_one_serial_line(tmp_path: Path) -> None:
    left, right = (
        f'[grippers.{name}]\naddress = "rtu:///dev/ttyUSB0?model=2f85"\n' for name in ("left", "right")
    )
    site = 'site = "lab"\n'
    assert len(read(tmp_path, f"{site}{left}device_id = 9\n{right}device_id = 12\n").grippers) == 2
    with pytest.raises(AgentFileError, match="give each of the grippers its device_id"):
        read(tmp_path, f"{site}{left}device_id = 9\n{right}")


@pytest.mark.parametrize(
    ("one", "other", "words"),
    [
        (
            "rtu:///dev/ttyUSB0",
            "rtu:///dev/ttyUSB0?baud=500000",
            "left.s, .rtu.*USB0.: a port has only one rate",
        ),
        ("rtu:///dev/ttyUSB0?parity=E", "rtu:///dev/ttyUSB0", "a port has only one"),
        ("rtu+tcp://10.0.0.5:502", "tcp://10.0.0.5", "a socket has one protocol"),
    ],
)
def test_two_grippers_at_one_place_have_one_way_to_it(
    tmp_path: Path, one: str, other: str, words: str
) -> None:
    """The agent could not open the second one."""
    text = f'site = "lab"\n[grippers.left]\naddress = "{one}"\ndevice_id = 9\n'
    text += f'[grippers.right]\naddress = "{other}"\ndevice_id = 12\n'
    with pytest.raises(AgentFileError, match=f"line 6.*right.*{words}"):
        read(tmp_path, text)


def test_the_opening_of_a_jaw_is_points_or_a_file_beside_it(tmp_path: Path) -> None:
    own = ((13, 100.0), (213, 2.0))
    write_stroke(tmp_path / "left.csv", own)
    jaw = 'site = "lab"\n[grippers.left]\naddress = "sim://?model=2f85"\nstroke = '
    for value in ('"left.csv"', "[[13, 100], [213, 2.0]]"):
        assert read(tmp_path, jaw + value).grippers["left"].units.stroke.points == own
    with pytest.raises(AgentFileError, match=r"line 4, in \[grippers.left\]: stroke: positions must rise"):
        read(tmp_path, f"{jaw}[[13, 100], [5, 2.0]]")


def test_a_file_of_openings_says_its_model(tmp_path: Path) -> None:
    own = ((13, 100.0), (213, 2.0))
    write_stroke(tmp_path / "left.csv", own, TWO_FINGER_85)
    table = 'site = "lab"\n[grippers.left]\naddress = "tcp://192.168.1.11'
    for end in (
        '"\nstroke = "left.csv"\nmodel = "2f85"',
        f'?stroke={tmp_path / "left.csv"}"\nmodel = "2f85"',
        f'?model=2f85&stroke={tmp_path / "left.csv"}"',
    ):
        assert read(tmp_path, table + end).grippers["left"].units.stroke.points == own
    with pytest.raises(AgentFileError, match=r"line 4, in \[grippers.left\]: stroke: .* is a Hand-E"):
        read(tmp_path, table + '"\nstroke = "left.csv"\nmodel = "hand-e"')
    with pytest.raises(AgentFileError, match=r"line 3, in \[grippers.left\]: .*the absolute path of a file"):
        read(tmp_path, table + '?stroke=left.csv"\n')


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", ["site", "missing"]),
        (LEFT + 'site = "lab"\n', ["line 3", "'site'", "above [grippers.left]"]),
        ('site = "lab"', ["[grippers.NAME]", "missing"]),
        ('site = "lab"\n[grippers]', ["line 2", "[grippers.left]"]),
        ('site = "lab"\ngrippers = 3', ["line 2", "3"]),
        ("site = 3\n" + LEFT, ["line 1", "site", "string", "3"]),
        ('site = "a/b"\n' + LEFT, ["line 1", "site", "'a/b'", "A-Z"]),
        ('host = "*"\nsite = "lab"\n' + LEFT, ["line 1", "host", "'*'"]),
        ("window = 11\n" + GOOD, ["line 1", "window", "0.1..10", "11"]),
        ("window = nan\n" + GOOD, ["line 1", "window", "nan"]),
        ('insecure = "yes"\n' + GOOD, ["line 1", "insecure", "true or false", "'yes'"]),
        ("windwo = 1\n" + GOOD, ["line 1", "'windwo'", "did you mean window?"]),
        ("x = 1\n" + GOOD, ["line 1", "'x'", "site, grippers, host"]),
        (GOOD + "sped = 1\n", ["line 5", "[grippers.left]", "'sped'", "did you mean speed?"]),
        (GOOD + "speed = 300\n", ["line 5", "[grippers.left]", "speed", "0..255", "300"]),
        (GOOD + "force = true\n", ["line 5", "force", "0..255", "True"]),
        (GOOD + "device_id = 256\n", ["line 5", "device_id", "0..255"]),
        (GOOD + "read_function = 6\n", ["line 5", "read_function", "3..4"]),
        (GOOD + 'poll_interval = "fast"\n', ["line 5", "poll_interval", "0.001..0.1", "'fast'"]),
        (GOOD + "connect_timeout = 9\n", ["line 5", "connect_timeout", "0.01..5"]),
        (GOOD + "response_timeout = 9\n", ["line 5", "response_timeout", "0.005..5"]),
        (GOOD + "activation_timeout = 0\n", ["line 5", "activation_timeout", "0.01..120"]),
        (GOOD + "request_address = 70000\n", ["line 5", "request_address", "0..65528"]),
        (GOOD + "reconnect = false\n", ["line 5", "'reconnect'"]),
        (GOOD + "[grippers.right]\nspeed = 3\n", ["line 5", "[grippers.right]", "address", "missing"]),
        (GOOD + "[grippers.right]\naddress = 3\n", ["line 6", "address", "3"]),
        (GOOD + '[grippers.right]\naddress = "ftp://x"\n', ["line 6", "address", "'ftp://x'", "rtu://"]),
        (
            GOOD + '[grippers.right]\naddress = "zenoh://a/b/c"\n',
            ["line 6", "on another host", "zenoh://a/b/c"],
        ),
        (GOOD + '[grippers."r/t"]\naddress = "sim://"\n', ["line 5", "'r/t'", "A-Z"]),
        (GOOD + '[grippers.right]\naddress = "192.168.1.11"\n', ["line 6", "left", "device_id"]),
        (GOOD + '[grippers]\nright = "sim://"\n', ["[grippers.right]", "'sim://'"]),
        ('listen = "tcp/127.0.0.1:1"\n' + GOOD, ["line 1", "listen", "list"]),
        ('listen = ["tcp/0.0.0.0:7447"]\n' + GOOD, ["line 1", "tcp/0.0.0.0:7447", "keys", "insecure"]),
        ('connect = ["tcp/lab:7447"]\n' + GOOD, ["line 1", "connect", "tcp/lab:7447", "insecure"]),
        ('listen = ["tls/0.0.0.0:7447"]\n' + GOOD, ["line 1", "needs keys"]),
        ('keys = "nowhere"\n' + GOOD, ["line 1", "keys", "ca.pem", "nowhere"]),
        ("keys = 3\n" + GOOD, ["line 1", "keys", "folder", "3"]),
        ('keys = "a\\u0000b"\n' + GOOD, ["line 1", "keys", "folder"]),
        ("site = \n", ["line 1, column 8", "not TOML"]),
        (GOOD + GOOD, [", line ", "not TOML"]),
        ('site = "lab', ["not TOML"]),
        ("site = " + "[" * 5000, ["not TOML"]),
    ],
)
def test_a_bad_file_is_reported_in_one_line(text: str, words: list[str], tmp_path: Path) -> None:
    with pytest.raises(AgentFileError) as caught:
        read(tmp_path, text)
    message = str(caught.value)
    assert "\n" not in message
    for word in ("FLEET.toml", *words):
        assert word in message


def test_the_mark_that_editors_on_windows_put_first_is_none_of_the_text(tmp_path: Path) -> None:
    assert read(tmp_path, f"\ufeff{GOOD}").host == "cell-1"


def test_a_gripper_on_a_serial_line_is_polled_as_often_as_any(tmp_path: Path) -> None:
    line = '[grippers.left]\naddress = "rtu+tcp://192.168.1.20:54321"\nread_function = 4\n'
    grippers = read(tmp_path, f'site = "lab"\n{line}').grippers
    assert grippers["left"].poll_interval == 0.005
    grippers = read(tmp_path, f'site = "lab"\n{line}poll_interval = 0.015\n').grippers
    assert grippers["left"].poll_interval == 0.015
    assert grippers["left"].read_function == 4


def test_an_uncertain_line_number_is_left_out(tmp_path: Path) -> None:
    """The search takes what stands in a text of several lines for keys."""
    port = '[grippers.left]\naddress = """rtu:///dev/\\\nspeed = 3\\\n/x"""\nspeed = 300\n'
    with pytest.raises(AgentFileError, match=r"FLEET\.toml, in \[grippers\.left\]: speed"):
        read(tmp_path, f'site = "lab"\n{port}')


@pytest.mark.parametrize(
    ("line", "words"),
    [("insecure = true", "cannot be combined"), ('listen = ["tcp/127.0.0.1:7447"]', "line 2.*tls/")],
)
def test_with_keys_nothing_goes_unencrypted(tmp_path: Path, line: str, words: str) -> None:
    put_keys(tmp_path)
    with pytest.raises(AgentFileError, match=words):
        read(tmp_path, f'keys = "cell-1"\n{line}\n{GOOD}')


def test_a_file_that_is_not_there_or_no_text(tmp_path: Path) -> None:
    with pytest.raises(AgentFileError, match=r"cannot read .*FLEET\.toml: No such file"):
        read_agent_file(tmp_path / "FLEET.toml")
    (tmp_path / "FLEET.toml").write_bytes(b"site = '\xff'")
    with pytest.raises(AgentFileError, match="UTF-8"):
        read_agent_file(tmp_path / "FLEET.toml")
