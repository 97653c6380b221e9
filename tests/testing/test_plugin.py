"""The plugin for pytest, as applications use it: in small projects of their own, run inside this process."""

from __future__ import annotations

import tomllib
from collections.abc import Callable
from importlib.metadata import entry_points

import pytest

from tests.docs.pages import ROOT, blocks, read

pytest_plugins = ["pytester"]

PLUGIN = "pytest_robotiq_async.plugin"
IS_FOUND = any(each.value == PLUGIN for each in entry_points(group="pytest11"))
"""Whether the library is installed here as it is now; else the tests name the plugin."""
OTHERS = ("hypothesispytest", "xdist", "xdist.looponfail", "cacheprovider", "faulthandler", "rosbags")
"""Plugins that only take time here."""
WITHOUT = [word for name in OTHERS for word in ("-p", f"no:{name}")]
TESTS = """
import asyncio
import pytest
from robotiq_async import ConnectionLostError, Finger, State
from robotiq_async.simulator import Trouble
{marks}

@pytest.fixture
def robotiq_speedup():
    return 200.0

async def test_a_grasp(robotiq_gripper, robotiq_hand):
    assert robotiq_hand.state is State.RUNNING_IDLE
    assert robotiq_gripper.speedup == 200
    robotiq_gripper.place_object(Finger.ABC, 150)
    assert (await robotiq_hand.close()).contacts == Finger.ABC
    assert robotiq_hand.status.is_activated

async def test_trouble(robotiq_hand, robotiq_troubles, robotiq_server):
    async with robotiq_troubles.making(Trouble("drop", on="write")):
        with pytest.raises(ConnectionLostError):
            await robotiq_hand.set_position(200)
    assert robotiq_server.gripper.request_registers[1] == 200

async def test_an_application_with_a_hand_of_its_own(robotiq_address, robotiq_gripper):
    from robotiq_async import RobotiqHand
    async with RobotiqHand(robotiq_address) as hand:
        await hand.set_position(7)
    assert asyncio.get_running_loop().is_running()
"""

Run = Callable[..., pytest.RunResult]


@pytest.fixture
def run(pytester: pytest.Pytester) -> Run:
    """Runs a project with one file of tests."""

    def run(tests: str, *options: str, ini: str = "") -> pytest.RunResult:
        if "no:asyncio" not in options:
            ini += "\nasyncio_default_fixture_loop_scope = function"
        pytester.makeini(f"[pytest]\nfilterwarnings = error\n{ini}\n")
        pytester.makepyfile(tests)
        return pytester.runpytest_inprocess(*(() if IS_FOUND else ("-p", PLUGIN)), *WITHOUT, *options)

    return run


@pytest.mark.parametrize(
    ("marks", "ini"),
    [
        ("", "asyncio_mode = auto"),
        ("pytestmark = pytest.mark.asyncio", "asyncio_mode = strict"),
        ("pytestmark = pytest.mark.anyio\n@pytest.fixture\ndef anyio_backend(): return 'asyncio'", ""),
    ],
    ids=["auto", "strict", "anyio"],
)
def test_the_fixtures_live_in_the_loop_of_the_test(run: Run, marks: str, ini: str) -> None:
    run(TESTS.format(marks=marks), ini=ini).assert_outcomes(passed=3)


def test_the_page_about_it(run: Run, pytester: pytest.Pytester) -> None:
    page = read("how-to/testing.md")
    (settings,) = blocks(page, "toml")
    options = tomllib.loads(settings.text)["tool"]["pytest"]["ini_options"]
    tests = [block.text for block in blocks(page, "python")]
    others = {f"test_{number}": text for number, text in enumerate(tests[1:])}
    pytester.makepyfile(**others)
    result = run(tests[0], ini=f"asyncio_mode = {options['asyncio_mode']}")
    result.assert_outcomes(passed=sum(text.count("def test_") for text in tests))


def test_anyios_plugin_alone_is_enough(run: Run) -> None:
    marks = "pytestmark = pytest.mark.anyio\n@pytest.fixture\ndef anyio_backend(): return 'asyncio'"
    run(TESTS.format(marks=marks), "-p", "no:asyncio", "-k", "grasp").assert_outcomes(passed=1, deselected=2)


def test_wrong_places_are_reported(run: Run) -> None:
    pytest.importorskip("trio")
    result = run(
        """
        import pytest

        def test_plain(robotiq_hand):
            pass

        @pytest.mark.anyio
        @pytest.mark.parametrize("anyio_backend", ["trio"])
        async def test_under_trio(robotiq_hand):
            pass
        """
    )
    result.assert_outcomes(errors=2)
    printed = result.stdout.str()
    assert "robotiq_server is for tests that are coroutines (async def)" in printed
    assert "robotiq_async.sync.RobotiqHand" in printed
    assert "trio is not supported" in printed


WITH_TRIO = """
import functools
import pytest
import trio

@pytest.hookimpl(tryfirst=True)
def pytest_pyfunc_call(pyfuncitem):
    if pyfuncitem.get_closest_marker("trio"):
        names = pyfuncitem._fixtureinfo.argnames
        trio.run(functools.partial(pyfuncitem.obj, **{name: pyfuncitem.funcargs[name] for name in names}))
        return True
"""
"""A plugin that does as pytest-trio."""


@pytest.mark.parametrize("ini", ["asyncio_mode = strict", "asyncio_mode = auto"])
def test_a_trio_test_gets_no_hand(run: Run, pytester: pytest.Pytester, ini: str) -> None:
    pytest.importorskip("trio")
    pytester.makeconftest(WITH_TRIO)
    result = run(
        """
        import pytest

        @pytest.mark.trio
        async def test_under_trio(robotiq_hand):
            await robotiq_hand.close()
        """,
        ini=f"{ini}\nmarkers = trio: run by trio",
    )
    result.assert_outcomes(errors=1)
    assert "robotiq_server lives in asyncio's event loop, and trio runs this test" in result.stdout.str()


def test_a_coroutine_test_without_a_plugin_gets_no_hand(run: Run) -> None:
    result = run("async def test_it(robotiq_hand): pass", ini="asyncio_mode = strict")
    result.assert_outcomes(errors=1)
    assert "mark it with pytest.mark.anyio" in result.stdout.str()


def test_without_an_async_plugin_the_error_says_so(run: Run) -> None:
    result = run("async def test_it(robotiq_hand): pass", "-p", "no:asyncio", "-p", "no:anyio")
    assert "mark it with pytest.mark.anyio, or with pytest.mark.asyncio where" in result.stdout.str()


def test_the_fixtures_are_listed_with_what_they_are(run: Run) -> None:
    listed = run("", "--fixtures").stdout.str()
    for name in ("speedup", "gripper", "server", "address", "troubles", "hand"):
        assert f"robotiq_{name} -- " in listed
    assert "_robotiq_server_with" not in listed


def test_pytest_finds_it() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["entry-points"]["pytest11"] == {"robotiq_async": PLUGIN}


def test_it_imports_nothing_of_the_library_before_a_fixture_is_used(pytester: pytest.Pytester) -> None:
    """Every project whose environment has the library imports the plugin with pytest."""
    pytester.makeini("[pytest]\nasyncio_default_fixture_loop_scope = function\n")
    pytester.makepyfile(
        """
        import sys

        def test_it():
            assert "pytest_robotiq_async.with_anyio" in sys.modules
            assert "pytest_robotiq_async.with_asyncio" in sys.modules
            print([name for name in sys.modules if name.startswith(("robotiq_async", "pymodbus"))])
            assert not any(name.startswith(("robotiq_async", "pymodbus")) for name in sys.modules)
        """
    )
    found = () if IS_FOUND else ("-p", PLUGIN)
    pytester.runpytest_subprocess(*found, *WITHOUT).assert_outcomes(passed=1)


def test_a_test_that_two_plugins_claim_gets_no_hand(run: Run) -> None:
    """pytest-asyncio's auto mode runs the tests that are marked for anyio, whose fixtures anyio makes."""
    tests = TESTS.format(
        marks="pytestmark = pytest.mark.anyio\n@pytest.fixture\ndef anyio_backend(): return 'asyncio'"
    )
    result = run(tests, ini="asyncio_mode = auto")
    result.assert_outcomes(errors=3)
    assert "set asyncio_mode = strict" in result.stdout.str()
