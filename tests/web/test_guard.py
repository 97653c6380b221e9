"""The server from outside: by plain clients, which may lie."""

from __future__ import annotations

import asyncio
import http.client
from collections.abc import AsyncIterator, MutableMapping
from pathlib import Path
from urllib.parse import urlsplit

import pytest

pytest.importorskip("nicegui", reason="the page needs the extra web")
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin

from robotiq_async.errors import ViewerError
from robotiq_async.web.page.access import Access
from robotiq_async.web.page.guard import Guard
from robotiq_async.web.server import PageServer
from robotiq_async.web.settings import PageSettings
from tests.fake_hand import FakeHand

WORD = "correct horse"


def settings(**options: object) -> PageSettings:
    return PageSettings(port=0, addresses=("fake://hand",), **options)  # type: ignore[arg-type]


@pytest.fixture
async def page() -> AsyncIterator[PageServer]:
    async with PageServer([FakeHand()], settings()) as page:
        yield page


class Answer:
    def __init__(self, url: str, path: str, method: str, body: str, headers: dict[str, str]) -> None:
        parts = urlsplit(url)
        connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=20)
        try:
            connection.request(method, path, body, headers)
            response = connection.getresponse()
            self.status, self.headers = response.status, response.headers
            self.text = response.read().decode("utf-8", "replace")
        finally:
            connection.close()


async def ask(url: str, path: str, method: str = "GET", body: str = "", **headers: str) -> Answer:
    return await asyncio.to_thread(Answer, url, path, method, body, headers)


def inside(url: str) -> str:
    parts = urlsplit(url)
    return f"{parts.path}?{parts.query}"


async def let_in(page: PageServer) -> tuple[str, str]:
    """The folder, and the cookie."""
    answer = await ask(page.url, inside(page.url))
    assert answer.status == 303
    return answer.headers["location"], answer.headers["set-cookie"].partition(";")[0]


async def test_no_token_no_page_and_no_other_site(page: PageServer) -> None:
    folder, cookie = await let_in(page)
    for path in ("/", "/?token=wrong", folder, f"{folder}hand/0", "/favicon.ico", "/_nicegui/static/x.js"):
        answer = await ask(page.url, path)
        assert answer.status == 403
        assert "holds the token" in answer.text
        assert "nicegui" not in answer.text
    answer = await ask(page.url, folder, Cookie=cookie)
    assert answer.status == 200
    assert answer.headers["x-frame-options"] == "DENY"
    assert "default-src 'self'" in answer.headers["content-security-policy"]
    for headers in ({"Host": "evil.example"}, {"Origin": "http://evil.example"}, {"Origin": "null"}):
        answer = await ask(page.url, folder, Cookie=cookie, **headers)
        assert (answer.status, "set-cookie" in answer.headers) == (403, False)


async def test_a_websocket_of_another_site_is_refused(page: PageServer) -> None:
    folder, cookie = await let_in(page)
    ours, headers = page.url.partition("/?")[0], {"Cookie": cookie}
    url = f"{ours.replace('http', 'ws')}{folder}_nicegui_ws/socket.io/?EIO=4&transport=websocket"
    async with connect(url, origin=Origin(ours), additional_headers=headers) as connection:
        assert str(await connection.recv()).startswith("0{")
    for origin in ("http://evil.example", "http://127.0.0.1:1", "null", None):
        with pytest.raises(InvalidStatus, match="403"):
            await connect(url, origin=None if origin is None else Origin(origin), additional_headers=headers)
    with pytest.raises(InvalidStatus, match="403"):
        await connect(url, origin=Origin(ours))


async def test_a_password_is_asked_for_and_a_wrong_one_takes_its_time() -> None:
    async with PageServer([FakeHand()], settings(password=WORD)) as page:
        assert "token" not in page.url
        here = page.url.removesuffix("/")
        assert "Password" in (await ask(page.url, "/")).text
        began = asyncio.get_running_loop().time()
        wrong = await ask(page.url, "/", "POST", "password=guess", Origin=here)
        assert (wrong.status, "set-cookie" in wrong.headers) == (403, False)
        assert asyncio.get_running_loop().time() - began >= 1
        assert (await ask(page.url, "/", "POST", f"password={WORD}")).status == 403, "a form of another site"
        right = await ask(page.url, "/", "POST", f"password={WORD.replace(' ', '+')}", Origin=here)
        assert right.status == 303
        assert right.headers["set-cookie"].startswith("robotiq_async=")


async def test_a_port_that_is_taken(page: PageServer) -> None:
    taken = PageSettings(port=urlsplit(page.url).port or 0, addresses=("fake://hand",))
    with pytest.raises(ViewerError, match="in use"):
        async with PageServer([FakeHand()], taken):
            pass


async def test_a_certificate_that_is_none(tmp_path: Path) -> None:
    file = tmp_path / "cert.pem"
    file.write_text("no certificate")
    with pytest.raises(ViewerError, match=r"cert\.pem"):
        async with PageServer([FakeHand()], settings(certificate=str(file), key=str(file))):
            pass


# -- without a server --------------------------------------------------------------------------------------


@pytest.mark.virtual_time
async def test_whoever_tries_passwords_holds_up_nobody_who_sits_elsewhere() -> None:
    """A wrong one takes a second, and the next from there waits for it: others do not."""
    tries = [asyncio.create_task(entered("198.51.100.7", f"guess {n}")) for n in range(50)]
    await asyncio.sleep(0.5)
    began = asyncio.get_running_loop().time()
    assert (await entered("192.0.2.1", WORD))["status"] == 303
    assert asyncio.get_running_loop().time() == began
    answers = await asyncio.gather(*tries)
    assert {answer["status"] for answer in answers} == {403}
    assert asyncio.get_running_loop().time() - began >= 49


RULES = Access(settings(password=WORD), 80)
GUARD = Guard(None, RULES)  # type: ignore[arg-type]


async def entered(client: str, password: str, *, ends: bool = True) -> dict[str, object]:
    """What is answered to somebody who enters a password."""
    answers: list[dict[str, object]] = []
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
async def test_two_origins_are_none() -> None:
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
