"""Requests that are let in, and those that are not."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import MutableMapping
from socket import gethostname
from typing import Any

import pytest

from robotiq_async.tools.web.page.access import Access, AccessDecision, Head
from robotiq_async.tools.web.page.guard import WAITING, Guard
from robotiq_async.tools.web.settings import PageSettings

PORT = 8766
HERE = f"127.0.0.1:{PORT}"


def access(**options: object) -> Access:
    return Access(PageSettings(**options), PORT)  # type: ignore[arg-type]


def cookie(rules: Access) -> str:
    return rules.cookie.partition(";")[0]


def head(rules: Access, path: str = "/", method: str = "GET", **headers: str) -> Head:
    return Head(method, path, headers.pop("query", ""), {"host": HERE, **headers})


def test_the_token_lets_in_and_nothing_else_does() -> None:
    rules = access()
    token = rules.settings.token
    assert rules.judge(head(rules, query=f"token={token}")) is AccessDecision.LET_IN
    for query in ("", "token=", f"token={token[:-1]}", f"token=x{token}", f"other={token}", "token=%FF"):
        assert rules.judge(head(rules, query=query)) is AccessDecision.NO_TOKEN
    assert len(token) >= 24
    assert access().settings.token != token


def test_the_cookie_serves_what_lies_in_the_folder() -> None:
    rules = access()
    inside = f"{rules.settings.folder}/anything"
    assert rules.judge(head(rules, inside, cookie=cookie(rules))) is AccessDecision.SERVE
    for wrong in ("", "robotiq_async=", "robotiq_async=x", cookie(access()), "a=b; robotiq_async", "\x00"):
        assert rules.judge(head(rules, inside, cookie=wrong)) is AccessDecision.NO_TOKEN
    assert rules.judge(head(rules, inside, cookie=f"x{cookie(rules)}")) is AccessDecision.NO_TOKEN
    assert rules.judge(head(rules, "/elsewhere", cookie=cookie(rules))) is AccessDecision.NO_TOKEN
    assert rules.judge(head(rules, inside)) is AccessDecision.NO_TOKEN


def test_the_cookie_is_for_browsers_only_and_for_this_server_only() -> None:
    """Cookies do not know ports: the folder keeps this one from other servers of the machine."""
    rules = access()
    assert f"Path={rules.settings.folder};" in rules.cookie
    assert "HttpOnly" in rules.cookie
    assert "SameSite=Lax" in rules.cookie
    assert "Secure" not in rules.cookie
    assert "Secure" in access(certificate="cert.pem", key="key.pem").cookie


@pytest.mark.parametrize(
    "others",
    ["robotiq_async=x", 'state={"open": [1, 2]}', "plain; a=b", 'quoted="x; y"', "", "\x00=\xff"],
)
def test_cookies_of_other_servers_of_this_machine_do_no_harm(others: str) -> None:
    """Cookies know no ports: one that no parser reads, or one of the same name, locked people out."""
    rules = access()
    for together in (f"{others}; {cookie(rules)}", f"{cookie(rules)}; {others}"):
        asked = head(rules, f"{rules.settings.folder}/x", cookie=together)
        assert rules.judge(asked) is AccessDecision.SERVE


@pytest.mark.parametrize(
    ("host", "fine"),
    [
        (HERE, True),
        (f"LOCALHOST:{PORT}", True),
        (f"[::1]:{PORT}", True),
        ("127.0.0.1", False),
        ("127.0.0.1:80", False),
        (f"evil.example:{PORT}", False),
        (f"127.0.0.1.evil.example:{PORT}", False),
        ("", False),
    ],
)
def test_the_host_must_be_ours(host: str, fine: bool) -> None:
    """A name of another site may resolve to this machine: its pages would be of the same origin."""
    rules = access()
    verdict = rules.judge(head(rules, query=f"token={rules.settings.token}", host=host))
    assert verdict is (AccessDecision.LET_IN if fine else AccessDecision.WRONG_HOST)


@pytest.mark.parametrize("method", ["GET", "POST", ""])
@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", "http://127.0.0.1:80", "http://127.0.0.1", "null", "", f"https://{HERE}"],
)
def test_a_foreign_origin_is_refused_even_with_the_cookie(method: str, origin: str) -> None:
    rules = access()
    asked = head(rules, f"{rules.settings.folder}/x", method, cookie=cookie(rules), origin=origin)
    assert rules.judge(asked) is AccessDecision.WRONG_ORIGIN


@pytest.mark.parametrize("method", ["POST", "PUT", "OPTIONS", ""])
def test_requests_that_change_something_or_stay_open_need_an_origin(method: str) -> None:
    rules = access()
    inside = f"{rules.settings.folder}/x"
    assert rules.judge(head(rules, inside, method, cookie=cookie(rules))) is AccessDecision.WRONG_ORIGIN
    ours = head(rules, inside, method, cookie=cookie(rules), origin=f"http://{HERE}")
    assert rules.judge(ours) is AccessDecision.SERVE


def test_a_password_takes_the_place_of_the_token() -> None:
    rules = access(host="192.0.2.1", password="correct horse")
    here = "gripper.lab:8766"
    assert rules.judge(head(rules, host=here)) is AccessDecision.ASK
    assert rules.judge(head(rules, host=here, query=f"token={rules.settings.token}")) is AccessDecision.ASK
    assert rules.judge(head(rules, "/", "POST", host=here)) is AccessDecision.WRONG_ORIGIN
    assert rules.judge(head(rules, "/", "POST", host=here, origin=f"http://{here}")) is AccessDecision.ASK
    assert rules.knows("correct horse")
    for wrong in ("", "correct", "correct horse ", "\udcff"):
        assert not rules.knows(wrong)
    assert not access().knows(""), "no password is not the empty one"


def test_another_interface_needs_a_password_or_a_certificate() -> None:
    for host in ("192.0.2.1", "0.0.0.0", "::", "", "gripper.lab"):
        with pytest.raises(ValueError, match="lets others in"):
            access(host=host)
        access(host=host, certificate="cert.pem", key="key.pem")
        access(host=host, password="correct horse")
    for host in ("127.0.0.1", "127.0.0.2", "::1", "localhost"):
        assert access(host=host).settings.loopback
    with pytest.raises(ValueError, match="needs its key"):
        access(certificate="cert.pem")


def test_settings_travel_as_a_line_and_show_no_secret() -> None:
    settings = PageSettings(addresses=("sim://", "tcp://192.0.2.7:502"), password="correct horse")
    assert PageSettings.read(settings.line()) == settings
    assert settings.token not in repr(settings)
    assert "horse" not in repr(settings)
    assert settings.url(80) == "http://127.0.0.1:80/"
    assert PageSettings(host="::1").url(80).startswith("http://[::1]:80/?token=")
    for everywhere in ("0.0.0.0", "::"):
        assert access(host=everywhere, password="x").settings.url(80) == f"http://{gethostname()}:80/"


# -- the guard, without a server -------------------------------------------------------------------------


@pytest.mark.virtual_time
async def test_guessing_passwords_delays_no_other_host() -> None:
    """A wrong one takes a second, and the next from there waits for it: others do not."""
    tries = [asyncio.create_task(entered("198.51.100.7", f"guess {n}")) for n in range(50)]
    await asyncio.sleep(0.5)
    began = asyncio.get_running_loop().time()
    assert (await entered("192.0.2.1", WORD))["status"] == 303
    assert asyncio.get_running_loop().time() == began
    assert sum(each.done() for each in tries) == 50 - WAITING, "each keeps a connection"
    answers = await asyncio.gather(*tries)
    assert Counter(answer["status"] for answer in answers) == {403: WAITING, 429: 50 - WAITING}
    assert not any(b"set-cookie" in dict(answer["headers"]) for answer in answers)
    assert asyncio.get_running_loop().time() - began >= WAITING - 1


@pytest.mark.virtual_time
async def test_the_right_password_is_not_looked_at_among_too_many() -> None:
    tries = [asyncio.create_task(entered("198.51.100.7", f"guess {n}")) for n in range(WAITING)]
    await asyncio.sleep(0.5)
    assert (await entered("198.51.100.7", WORD))["status"] == 429
    await asyncio.gather(*tries)
    assert (await entered("198.51.100.7", WORD))["status"] == 303


WORD = "correct horse"
RULES = Access(PageSettings(password=WORD), 80)
GUARD = Guard(None, RULES)  # type: ignore[arg-type]


async def entered(client: str, password: str, *, ends: bool = True) -> dict[str, Any]:
    """The answer to a password."""
    answers: list[dict[str, Any]] = []
    parts = [{"type": "http.request", "body": f"password={password}".encode(), "more_body": not ends}]

    async def receive() -> dict[str, object]:
        return parts.pop(0) if parts else await asyncio.Future()

    async def send(message: MutableMapping[str, object]) -> None:
        answers.append(dict(message))

    headers = [(b"host", b"127.0.0.1"), (b"origin", b"http://127.0.0.1")]
    scope = {"type": "http", "method": "POST", "path": "/", "query_string": b"", "headers": headers}
    await GUARD({**scope, "client": (client, 1)}, receive, send)
    return answers[0]


@pytest.mark.virtual_time
async def test_a_form_that_never_ends_is_not_waited_for() -> None:
    assert (await entered("192.0.2.1", "guess", ends=False))["status"] == 403


@pytest.mark.virtual_time
async def test_two_origins_count_as_none() -> None:
    answers: list[MutableMapping[str, object]] = []

    async def send(message: MutableMapping[str, object]) -> None:
        answers.append(message)

    cookie = RULES.cookie.partition(";")[0].encode()
    for origins in ([b"http://evil.example", b"http://127.0.0.1"], [b"http://127.0.0.1", b"null"]):
        headers = [(b"host", b"127.0.0.1"), (b"cookie", cookie), *((b"origin", each) for each in origins)]
        path = f"{RULES.settings.folder}/"
        scope = {"type": "http", "method": "GET", "path": path, "query_string": b"", "headers": headers}
        await GUARD(scope, entered, send)  # type: ignore[arg-type]
        assert answers[0]["status"] == 403
        answers.clear()
