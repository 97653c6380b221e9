"""The server from outside: by plain clients, which may lie."""

# ruff: noqa: E402  # what follows needs(...) cannot be imported without the extra

from __future__ import annotations

import asyncio
import contextlib
import http.client
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from urllib.parse import urlsplit

import pytest
import pytest_asyncio

from tests.extras import needs

needs("nicegui", "the page needs the extra web")
from websockets.asyncio.client import connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Origin

from robotiq_async.tools.actions import ACTIONS
from robotiq_async.tools.errors import ViewerError
from robotiq_async.tools.web.server import PageServer
from robotiq_async.tools.web.settings import PageSettings
from tests.conftest import watched
from tests.fake_hand import FakeHand
from tests.forked import PAGE, forking
from tests.patience import patience

pytestmark = pytest.mark.asyncio(loop_scope="module")

WORD = "correct horse"
HANDS = 13


def settings(**options: object) -> PageSettings:
    return PageSettings(port=0, addresses=("fake://hand",), **options)  # type: ignore[arg-type]


@pytest.fixture(autouse=True, scope="module")
def forked_pages() -> Iterator[None]:
    with forking(PAGE):
        yield


@pytest_asyncio.fixture(loop_scope="module", scope="module")
async def page() -> AsyncIterator[PageServer]:
    """One for all who try, of more hands than a browser has scenes for."""
    many = PageSettings(port=0, addresses=tuple(f"fake://{number}" for number in range(HANDS)))
    async with PageServer([FakeHand() for _ in many.addresses], many) as page:
        yield page


@pytest_asyncio.fixture(loop_scope="module")
async def nothing_left_running(page: PageServer, caplog: pytest.LogCaptureFixture) -> AsyncIterator[None]:
    with watched(caplog):
        yield


class Answer:
    def __init__(self, url: str, path: str, method: str, body: str, headers: dict[str, str]) -> None:
        parts = urlsplit(url)
        connection = http.client.HTTPConnection(parts.hostname or "", parts.port, timeout=patience(20))
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
    assert answer.headers["referrer-policy"] == "same-origin", "a browser's form has an origin"
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


async def test_a_page_that_only_looks_has_nothing_to_press(page: PageServer) -> None:
    folder, cookie = await let_in(page)
    text = (await ask(page.url, f"{folder}hand/3", Cookie=cookie)).text
    assert "read-only" in text
    for name in (*ACTIONS, "speed", "force"):
        assert f'"data-testid":"{name}"' not in text
    assert '"data-testid":"state"' in text


async def test_of_many_hands_no_tile_has_a_scene(page: PageServer) -> None:
    """A browser takes the first scenes away again when there are more than some sixteen."""
    folder, cookie = await let_in(page)
    tiles = (await ask(page.url, folder, Cookie=cookie)).text
    assert f'"data-testid":"tile-{HANDS - 1}"' in tiles
    one = (await ask(page.url, f"{folder}hand/{HANDS - 1}", Cookie=cookie)).text
    assert [text.count('"rq-stage"') for text in (tiles, one)] == [0, 1]
    assert "There is no hand 99" in (await ask(page.url, f"{folder}hand/99", Cookie=cookie)).text


async def test_headers_without_end_are_not_kept(page: PageServer) -> None:
    """Any client that reaches the port can send them."""
    parts = urlsplit(page.url)
    _, writer = await asyncio.open_connection(parts.hostname, parts.port)
    writer.write(b"GET / HTTP/1.1\r\n")
    with contextlib.suppress(ConnectionError):
        async with asyncio.timeout(patience(20)):
            for _ in range(1000):
                writer.write(b"X: " + b"x" * 10_000 + b"\r\n")
                await writer.drain()
                await asyncio.sleep(0)
            pytest.fail("it takes them all")
    writer.close()
    with contextlib.suppress(ConnectionError):
        await writer.wait_closed()


async def test_connections_that_ask_nothing_keep_nobody_out(page: PageServer) -> None:
    """A thousand of them took the files of the page, and browsers that were there lost their connection."""
    from robotiq_async.tools.web.page.serve import MOST_CONNECTIONS  # noqa: PLC0415  # it imports NiceGUI

    folder, cookie = await let_in(page)
    parts = urlsplit(page.url)
    async with asyncio.timeout(patience(30)):
        opened = [
            await asyncio.open_connection(parts.hostname, parts.port) for _ in range(2 * MOST_CONNECTIONS)
        ]
        opened[-1][1].write(b"GET / HTTP/1.1\r\n")
        answer, stranger = opened[-2]  # the oldest are gone
        stranger.write(f"GET / HTTP/1.1\r\nHost: {parts.netloc}\r\n\r\n".encode())
        await answer.readuntil(b"holds the token")
        stranger.write(b"GET")
        for reader, writer in opened:
            with contextlib.suppress(ConnectionError):
                await reader.read()
            writer.close()
    assert (await ask(page.url, folder, Cookie=cookie)).status == 200


def files_of(process: int) -> list[str]:
    """The soft and the hard limit of a process."""
    limits = Path(f"/proc/{process}/limits")
    if not limits.exists():
        pytest.skip("needs /proc")
    (line,) = (each for each in limits.read_text().splitlines() if each.startswith("Max open files"))
    return line.removeprefix("Max open files").split()[:2]


async def test_a_browser_gets_in_while_strangers_keep_every_connection(page: PageServer) -> None:
    """Two hundred silent ones kept the operators out: 3 of 78 requests were answered."""
    from robotiq_async.tools.web.page.serve import MOST_CONNECTIONS  # noqa: PLC0415  # it imports NiceGUI

    folder, cookie = await let_in(page)
    parts = urlsplit(page.url)
    async with asyncio.timeout(patience(30)):
        opened = [await asyncio.open_connection(parts.hostname, parts.port) for _ in range(MOST_CONNECTIONS)]
        for _ in range(20):
            opened.append(await asyncio.open_connection(parts.hostname, parts.port))
            assert (await ask(page.url, folder, Cookie=cookie)).status == 200
        for _, writer in opened:
            writer.close()
            with contextlib.suppress(ConnectionError):
                await writer.wait_closed()


async def test_the_page_may_have_all_the_files_that_there_are(page: PageServer) -> None:
    """Connections that do not shake hands for https are counted nowhere else."""
    soft, hard = files_of(page._process.pid)
    assert soft == hard


async def test_a_password_is_asked_for() -> None:
    async with PageServer([FakeHand()], settings(password=WORD)) as page:
        assert "token" not in page.url
        here = page.url.removesuffix("/")
        assert "Password" in (await ask(page.url, "/")).text
        assert (await ask(page.url, "/", "POST", f"password={WORD}")).status == 403, "a form of another site"
        right = await ask(page.url, "/", "POST", f"password={WORD.replace(' ', '+')}", Origin=here)
        assert right.status == 303
        assert right.headers["set-cookie"].startswith("robotiq_async=")


async def test_a_port_that_is_taken(page: PageServer) -> None:
    taken = PageSettings(port=urlsplit(page.url).port or 0, addresses=("fake://hand",))
    with pytest.raises(ViewerError, match="in use"):
        async with PageServer([FakeHand()], taken):
            pass
