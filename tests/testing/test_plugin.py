"""The plugin for pytest, as applications use it: in small projects of their own, run inside this process."""

from __future__ import annotations

import ast
import tomllib
from collections.abc import Callable
from importlib.metadata import entry_points

import pytest

from tests.docs.pages import DOCS, ROOT, blocks

pytest_plugins = ["pytester"]

PLUGIN = "robotiq_async.testing.plugin"
IS_FOUND = any(each.name == "robotiq_async" for each in entry_points(group="pytest11"))
"""Whether the library is installed here as it is now; else the tests name the plugin."""
OTHERS = ("hypothesispytest", "xdist", "xdist.looponfail", "cacheprovider", "faulthandler", "rosbags")
"""Plugins that only take time here."""
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
        without = [word for name in OTHERS for word in ("-p", f"no:{name}")]
        return pytester.runpytest_inprocess(*(() if IS_FOUND else ("-p", PLUGIN)), *without, *options)

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
    page = blocks((DOCS / "how-to" / "testing.md").read_text(encoding="utf-8"))
    (settings,) = [block for block in page if block.language == "toml"]
    options = tomllib.loads(settings.text)["tool"]["pytest"]["ini_options"]
    tests = [block.text for block in page if block.language == "python"]
    others = {f"test_{number}": text for number, text in enumerate(tests[1:])}
    pytester.makepyfile(**others)
    result = run(tests[0], ini=f"asyncio_mode = {options['asyncio_mode']}")
    result.assert_outcomes(passed=sum(text.count("def test_") for text in tests))


def test_anyios_plugin_alone_is_enough(run: Run) -> None:
    marks = "pytestmark = pytest.mark.anyio\n@pytest.fixture\ndef anyio_backend(): return 'asyncio'"
    run(TESTS.format(marks=marks), "-p", "no:asyncio", "-k", "grasp").assert_outcomes(passed=1, deselected=2)


def test_the_wrong_places_are_told(run: Run) -> None:
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


def test_without_anybody_who_runs_coroutines_it_says_so(run: Run) -> None:
    result = run("async def test_it(robotiq_hand): pass", "-p", "no:asyncio", "-p", "no:anyio")
    assert "mark it with pytest.mark.anyio, or install" in result.stdout.str()


def test_the_fixtures_are_listed_with_what_they_are(run: Run) -> None:
    listed = run("", "--fixtures").stdout.str()
    for name in ("speedup", "gripper", "server", "address", "troubles", "hand"):
        assert f"robotiq_{name} -- " in listed
    assert "_robotiq_server_with" not in listed


def test_pytest_finds_it() -> None:
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    assert project["project"]["entry-points"]["pytest11"] == {"robotiq_async": PLUGIN}


def test_it_imports_nothing_before_a_fixture_is_used() -> None:
    """Every project whose environment has the library imports it with pytest."""
    for name in ("plugin", "with_anyio", "with_asyncio"):
        tree = ast.parse((ROOT / "robotiq_async" / "testing" / f"{name}.py").read_text(encoding="utf-8"))
        imports = [each for each in tree.body if isinstance(each, ast.Import | ast.ImportFrom)]
        assert not any(isinstance(each, ast.ImportFrom) and each.level for each in imports)
        assert "robotiq_async" not in ast.unparse(ast.Module([*imports], []))
