"""Addresses: every accepted form, and many that are not."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.link.address import FORMS, Address, LineSettings, Simulation, parse_address
from tests.strategies import ANY

NAMES = st.text("abcdefghijklmnopqrstuvwxyz0123456789_-", min_size=1, max_size=63).filter(
    lambda name: not re.fullmatch("-.*|[0-9]+|0x[0-9a-f]*", name)
)
PORTS = st.integers(1, 65535)


# -- accepted ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("tcp://192.168.1.11", "192.168.1.11", 502),
        ("tcp://192.168.1.11:5020", "192.168.1.11", 5020),
        ("192.168.1.11", "192.168.1.11", 502),
        ("gripper", "gripper", 502),
        ("tcp://gripper.local", "gripper.local", 502),
        ("tcp://gripper-2.cell_1.example.org:502", "gripper-2.cell_1.example.org", 502),
        ("localhost", "localhost", 502),
        ("tcp://Gripper.LOCAL", "gripper.local", 502),
        ("TCP://192.168.1.11", "192.168.1.11", 502),
        ("[::1]", "::1", 502),
        ("tcp://[FE80::ABCD]", "fe80::abcd", 502),
        ("tcp://[::ffff:192.168.1.11]", "::ffff:192.168.1.11", 502),
    ],
)
def test_a_tcp_address_names_host_and_port(text: str, host: str, port: int) -> None:
    assert parse_address(text) == Address("tcp", host, port)


@pytest.mark.parametrize(
    "device", ["/dev/ttyUSB0", "/dev/serial/by-id/usb-FTDI_USB-RS485-if00", "COM3", "tty"]
)
def test_a_serial_address_names_the_port(device: str) -> None:
    assert parse_address(f"rtu://{device}") == Address("rtu", device)


@pytest.mark.parametrize(
    ("text", "simulation"),
    [
        ("sim://?speedup=10&object=150", Simulation(10.0, 150)),
        ("sim://?object=0", Simulation(object=0)),
        ("sim://?physics=box:40x60x80,0.3", Simulation(physics="box:40x60x80,0.3")),
        ("sim://", Simulation()),
    ],
)
def test_the_address_of_a_simulated_gripper_may_say_what_it_is_like(
    text: str, simulation: Simulation
) -> None:
    assert parse_address(text) == Address("sim", simulation=simulation)
    assert str(parse_address(text)) == text


@pytest.mark.parametrize(
    ("text", "full"),
    [
        ("192.168.1.11", "tcp://192.168.1.11:502"),
        ("Gripper:5020", "tcp://gripper:5020"),
        ("[::1]", "tcp://[::1]:502"),
        ("rtu:///dev/ttyUSB0", "rtu:///dev/ttyUSB0"),
        ("rtu://COM3", "rtu://COM3"),
        ("RTU://COM3", "rtu://COM3"),
        ("Sim://?object=150", "sim://?object=150"),
        ("sim://", "sim://"),
        ("sim://?object=150&speedup=010.0", "sim://?speedup=10&object=150"),
        ("sim://?speedup=1.0", "sim://"),
    ],
)
def test_an_address_prints_in_its_full_form(text: str, full: str) -> None:
    assert str(parse_address(text)) == full


@given(NAMES, PORTS, st.booleans(), st.booleans())
def test_any_host_and_port_are_found_again_in_the_full_form(
    host: str, port: int, with_scheme: bool, with_port: bool
) -> None:
    text = ("tcp://" if with_scheme else "") + host + (f":{port}" if with_port else "")
    address = parse_address(text)
    assert address == Address("tcp", host, port if with_port else 502)
    assert parse_address(str(address)) == address


@given(st.ip_addresses(v=6), PORTS)
def test_any_ipv6_address_is_found_again_in_the_full_form(host: object, port: int) -> None:
    address = parse_address(f"[{host}]:{port}")
    assert address == Address("tcp", str(host), port)
    assert parse_address(str(address)) == address


@given(st.floats(0.01, 1000).map(lambda value: round(value, 9)), st.none() | st.integers(0, 255))
def test_any_simulated_gripper_is_found_again_in_the_full_form(speedup: float, position: int | None) -> None:
    address = Address("sim", simulation=Simulation(speedup, position))
    assert parse_address(str(address)) == address


@given(st.text(ANY) | st.text("?&=.0123456789speduobjct").map("sim://".__add__))
def test_any_text_is_an_address_or_a_value_error_that_shows_the_forms(text: str) -> None:
    try:
        address = parse_address(text)
    except ValueError as error:
        assert "address" in str(error)  # noqa: PT017
    else:
        assert parse_address(str(address)) == address


# -- malformed ---------------------------------------------------------------------------------------------


def refusal(text: object, error: type[Exception] = ValueError) -> str:
    """The message that refuses an address; it fits into two lines of a terminal."""
    with pytest.raises(error) as caught:
        parse_address(text)
    assert len(str(caught.value)) <= 200
    return str(caught.value)


@pytest.mark.parametrize("text", ["", "tcp://", "sim://x", None, 5])
def test_without_a_better_guess_the_message_has_the_accepted_forms(text: object) -> None:
    assert FORMS in refusal(text, TypeError if text in (None, 5) else ValueError)


def test_the_forms_are_those_of_the_contract() -> None:
    for form in ("tcp://HOST", "rtu+tcp://HOST:PORT", "rtu://DEVICE", "sim://", "zenoh://"):
        assert form in FORMS


@given(st.text(min_size=150), st.sampled_from(["", "tcp://", "sim://?", "rtu://", "zenoh://"]))
def test_a_message_is_short_however_long_the_address_is(text: str, scheme: str) -> None:
    """Once it filled ten lines of a terminal."""
    try:
        parse_address(scheme + text)
    except ValueError as error:
        assert len(str(error)) <= 200  # noqa: PT017


def test_the_address_of_a_remote_hand_is_refused_with_the_class_that_takes_it() -> None:
    message = refusal("Zenoh://lab/cell-1/left")
    assert "robotiq_async.fleet.RemoteHand" in message
    assert "malformed" not in message


MALFORMED = {
    "scheme": ["", " ", "tcp:", "tcp:/192.168.1.11", "tcp:192.168.1.11", "://host", "udp://192.168.1.11"],
    "spaces": [" tcp://host", "tcp ://host", "tcp:// host", "host ", "host\n", "host name", "host\0name"],
    "more than a host": ["tcp://host/", "tcp://host:502/path", "tcp://host?unit=2", "tcp://user@host"],
    "host": ["tcp://", "tcp://tcp://host", "host,other", ".host", "-host", "h\u00f6st", "\uff48ost"],
    "label": ["a..b", "gripper..", "a" * 64, f"a.{'b' * 64}.c"],
    "IPv6": ["::1", "fe80::1", "tcp://::1", "[::1", "::1]", "[]", "[]:502", "[::1]502", "[::1]/", "[::1]]"],
    "no IPv6": ["[[::1]]", "[192.168.1.11]", "[gripper]", "[::g]", "[: :1]", "tcp://[::1] :502"],
    "IPv6 digits": ["[:]", "[:::::]", "[1:2]", "[1::2::3]", "[::12345]", "[::1%]", "[%:]"],
    "serial": ["rtu://", "rtu:///", "rtu:////", "rtu:", "rtu:/dev/x", "rtu:// /dev/x", "rtu:///dev/x "],
    "serial port": ["rtu:///dev/x\n", "rtu:///dev/tty\0USB0", "/dev/ttyUSB0"],
    "terminal": ["rtu:///dev/tty\x1b[2J", "rtu:///dev/tty\x07", "rtu:///dev/tty\u202e", "\x1b[2Jhost"],
    "pyserial": ["rtu://socket://192.168.1.20:5000", "rtu://rfc2217://host:1", "rtu://loop://"],
    "simulator": ["sim://x", "sim:///", "sim:// ", "sim:"],
    "serial server": ["rtu+tcp://192.168.1.20", "rtu+tcp://", "rtu+tcp://[::1]", "rtu+tcp:///dev/ttyUSB0"],
}


@pytest.mark.parametrize("what", MALFORMED)
def test_a_malformed_address_is_a_value_error_that_shows_it(what: str) -> None:
    for text in MALFORMED[what]:
        message = refusal(text)
        assert message.startswith("malformed address")
        assert repr(text) in message


PORTS_THAT_ARE_NONE = ["", "0", "65536", "-1", "+502", " 502", "502 ", "5_02", "5.02", "1e3", "0x1F6", "x"]


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("rtu:///dev/ttyUSB0", LineSettings(115200, "N", 1)),
        ("rtu:///dev/ttyUSB0?baud=500000", LineSettings(500000, "N", 1)),
        ("rtu://COM3?baud=9600&parity=E&stopbits=2", LineSettings(9600, "E", 2)),
        ("rtu://COM3?model=2f85&parity=o", LineSettings(115200, "O", 1)),
        (r"rtu://\\?\COM10?baud=9600", LineSettings(9600)),
        (r"rtu://\\?\COM10", LineSettings()),
    ],
)
def test_how_a_serial_port_sends(text: str, line: LineSettings) -> None:
    parsed = parse_address(text)
    assert parsed.line == line
    assert parse_address(str(parsed)) == parsed
    assert parsed.host in ("/dev/ttyUSB0", "COM3", r"\\?\COM10")


def test_a_character_has_ten_to_twelve_bits() -> None:
    assert LineSettings().character_s == pytest.approx(86.8e-6, abs=1e-7)
    assert LineSettings(9600, "E", 2).character_s == pytest.approx(12 / 9600)


@pytest.mark.parametrize(
    ("what", "meant"),
    [
        ("COM3", "rtu://COM3"),
        ("com12", "rtu://com12"),
        ("/dev/ttyUSB0", "rtu:///dev/ttyUSB0"),
        ("tcp://host?x=1", "no option 'x'; known are: model, stroke"),
        (
            "rtu:///dev/ttyUSB0?x=1",
            "known are: model, stroke, baud, parity, stopbits",
        ),
        ("rtu:///dev/ttyUSB0?baud", "baud must be given once, as baud=VALUE"),
        ("rtu:///dev/ttyUSB0?baudrate=9600", "no option 'baudrate'; known are: model, stroke, baud, parity"),
        ("rtu:///dev/ttyUSB0?", "no option ''"),
        ("rtu:///dev/ttyUSB0?115200", "no option '115200'"),
        (r"rtu://\\?\COM10?2f85", "no option '2f85'"),
        ("rtu:///dev/ttyUSB0?baud=300", "baud must be an integer in 9600..1000000, got '300'"),
        ("rtu:///dev/ttyUSB0?baud=1e6", "baud must be an integer"),
        ("rtu:///dev/ttyUSB0?parity=M", "parity must be N, E or O, got 'M'"),
        ("rtu:///dev/ttyUSB0?parity=even", "parity must be N, E or O, got 'even'"),
        ("rtu:///dev/ttyUSB0?stopbits=3", "stopbits must be 1 or 2, got '3'"),
        ("rtu:///dev/ttyUSB0?baud=9600&baud=9600", "baud must be given once"),
        ("rtu+tcp://192.168.1.20:54321?baud=9600", "a serial server has its own"),
    ],
)
def test_a_refusal_names_the_form_or_the_options(what: str, meant: str) -> None:
    message = refusal(what)
    assert message.startswith(f"malformed address {what!r}: ")
    assert meant in message.partition("; accepted")[0]


@pytest.mark.parametrize("host", ["com", "com3.lab", "2f85.lab", "dev"])
def test_a_host_that_only_looks_like_that_is_a_host(host: str) -> None:
    assert parse_address(host).host == host


@pytest.mark.parametrize("port", [*PORTS_THAT_ARE_NONE, "502:502", "502\n", "\u0665", "50\u00b2", "9" * 5000])
def test_a_malformed_port_is_a_value_error(port: str) -> None:
    for host in ("192.168.1.11", "tcp://gripper", "tcp://[::1]", "rtu+tcp://host"):
        assert "malformed address" in refusal(f"{host}:{port}")


IPV4 = (
    "127.1 127.0.1 2130706433 0 0x7f000001 0x7f.1 0X gripper.1 gripper.0x1f 192.168.1.011 192.168.1.256 "
    "192.168.1 192.168.1.11. 1.2.3.4.5 0177.0.0.1"
)


@pytest.mark.parametrize("host", IPV4.split())
def test_an_ipv4_address_is_four_numbers(host: str) -> None:
    """Resolvers take more for one, and do not agree on which: 011 is 9 to some."""
    with pytest.raises(ValueError, match=r"malformed address.*four numbers"):
        parse_address(f"tcp://{host}:502")


@pytest.mark.parametrize(
    ("query", "words"),
    [
        ("speedup=0", "speedup must be a number in 0.01..1000, got '0'"),
        ("speedup=1001", "speedup must be a number in 0.01..1000, got '1001'"),
        ("speedup=nan", "speedup must be a number in 0.01..1000, got 'nan'"),
        ("speedup=1e2", "speedup must be a number in 0.01..1000, got '1e2'"),
        ("speedup=", "speedup must be a number in 0.01..1000, got ''"),
        ("object=256", "object must be in 0..255, got 256"),
        ("object=-1", "object must be an integer in 0..255, got '-1'"),
        ("object=1.5", "object must be an integer in 0..255, got '1.5'"),
        ("speedup", "speedup must be given once, as speedup=VALUE"),
        ("object=1&object=2", "object must be given once, as object=VALUE"),
        ("speed=10", "no option 'speed'; known are: model, stroke, speedup, object"),
        ("", "no option ''; known are: model, stroke, speedup, object, physics"),
        ("object=1&", "no option ''; known are: model, stroke, speedup, object, physics"),
    ],
)
def test_a_malformed_option_of_a_simulated_gripper_is_named_with_its_range(query: str, words: str) -> None:
    message = refusal(f"sim://?{query}")
    assert "malformed address" in message
    assert words in message


@pytest.mark.parametrize(
    "address",
    [
        "tcp://host:502?model=2f85",
        "rtu:///dev/ttyUSB0?baud=500000&model=2f85",
        "urcap://host:63352?model=2f85",
        "sim://?speedup=10",
    ],
)
def test_any_address_can_name_the_file_of_its_openings(address: str) -> None:
    file = str(Path("/cell/left.csv").absolute())
    parsed = parse_address(f"{address}&stroke={file}")
    assert (parsed.stroke, str(parsed)) == (file, f"{address}&stroke={file}")


@pytest.mark.parametrize(
    ("option", "words"),
    [
        ("stroke=left.csv", "stroke must be the absolute path of a file, for an address is the same in any"),
        ("stroke=", "stroke must be the absolute path of a file"),
        ("stroke=a.csv&stroke=b.csv", "stroke must be given once, as stroke=FILE"),
    ],
)
def test_a_file_of_openings_has_an_absolute_path(option: str, words: str) -> None:
    for address in ("sim://", "host", "rtu:///dev/ttyUSB0", "rtu+tcp://host:1", "urcap://host"):
        assert words in refusal(f"{address}?{option}")


@pytest.mark.parametrize("address", [None, 502, b"tcp://host", Path("/dev/ttyUSB0")], ids=repr)
def test_an_address_that_is_not_a_string_is_a_type_error(address: object) -> None:
    message = refusal(address, TypeError)
    assert "address must be a string" in message
    assert repr(address) in message


@pytest.mark.parametrize("zone", ["eth0", "Ethernet", "enp3s0"])
def test_a_link_local_address_names_its_interface_as_it_is_spelled(zone: str) -> None:
    """A gripper on a cable of its own may have nothing but a link-local address."""
    assert parse_address(f"tcp://[fe80::1%{zone}]:502") == Address("tcp", f"fe80::1%{zone}", 502)


@pytest.mark.parametrize(
    ("typed", "zone"),
    [("25eth0", "eth0"), ("25Ethernet", "Ethernet"), ("252", "252"), ("25", "25"), ("2525gbe", "25gbe")],
)
def test_the_percent_sign_before_an_interface_may_be_that_of_a_uri(typed: str, zone: str) -> None:
    """RFC 6874 writes it as %25. Digits are the number of an interface."""
    assert parse_address(f"rtu+tcp://[fe80::1%{typed}]:4001") == Address("rtu+tcp", f"fe80::1%{zone}", 4001)


# -- a serial line behind a socket -------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "host", "port"),
    [
        ("rtu+tcp://192.168.1.20:54321", "192.168.1.20", 54321),
        ("rtu+tcp://Arm.local:4001", "arm.local", 4001),
        ("rtu+tcp://[::1]:54321", "::1", 54321),
    ],
)
def test_a_serial_server_is_a_host_and_a_port(text: str, host: str, port: int) -> None:
    address = parse_address(text)
    assert address == Address("rtu+tcp", host, port)
    assert str(address) == text.lower()
    assert parse_address(str(address)) == address
    assert (address.is_rtu, address.is_socket) == (True, True)
