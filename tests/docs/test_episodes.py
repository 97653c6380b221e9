"""The programs of their page: pictures and statuses are aligned, and what is incomplete is left out."""

from __future__ import annotations

import asyncio
import re
import sys
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from robotiq_async import TWO_FINGER_85
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.recording.recordings import recover
from tests.docs.pages import DOCS, ROOT, blocks, read
from tests.forked import CORE, forking
from tests.patience import patience

PAGE = DOCS / "how-to" / "episodes.md"
RECORD, CONVERT = (each.text for each in blocks(read(PAGE), "python"))
PART = 120
Array = npt.NDArray[Any]


def program(text: str) -> dict[str, Any]:
    """What a program of the page defines."""
    names: dict[str, Any] = {"__name__": "page"}
    exec(text, names)
    return names


CONVERTING = program(CONVERT)
FPS: int = CONVERTING["FPS"]
PREAMBLE = """import resource, signal
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, ({0}, {0}))
"""
"""A disk on which a file can have so many bytes."""


async def record(folder: Path, text: str = RECORD) -> tuple[int | None, str]:
    """Run the first program; its code and its words."""
    file = folder / "record_episodes.py"
    file.write_text(text, encoding="utf-8")
    gripper = SimulatedGripper(speedup=5, model=TWO_FINGER_85)
    gripper.place_object(1, position=PART)
    async with SimulatorServer(gripper) as server:
        with forking(CORE):
            process = await asyncio.create_subprocess_exec(
                *(sys.executable, str(file), str(folder / "today")),
                env={"GRIPPER": server.address, "PYTHONPATH": str(ROOT)},
                stdin=DEVNULL,
                stdout=PIPE,
                stderr=STDOUT,
            )
        printed, _ = await asyncio.wait_for(process.communicate(), patience(60))
    return process.returncode, printed.decode()


async def test_pictures_and_statuses_are_aligned(tmp_path: Path) -> None:
    """The camera of the page sees how wide the jaw is open, so that each picture has the true state."""
    code, words = await record(tmp_path)
    assert code == 0, words
    folder = tmp_path / "today"
    found = list(CONVERTING["episodes"](folder / "episodes.mcap"))
    assert [name for name, *_ in found] == [f"episode {number}" for number in range(3)]
    for name, values, rows in found:
        assert values == {"task": "grip the part", "success": True}
        with np.load(folder / f"{name}.npz") as file:
            times, images = file["times"], file["images"]
        picture, states, actions = CONVERTING["frames"](rows, times)
        assert len(picture) == len(states) == len(actions) > 3
        assert all(was_just_seen(images[number], times[number], rows) for number in picture)
        assert rows[:, 3].max() == 1, "it has met the part"
        assert rows[:, 4].min() == 0, "it was closed beyond the part"


def was_just_seen(image: Array, at: float, rows: Array) -> bool:
    """Whether a status right before has the opening that the picture shows; a busy machine takes it late."""
    near = rows[(rows[:, 0] <= at) & (rows[:, 0] >= at - patience(0.05))]
    return bool(np.min(np.abs(near[:, 1] - image.mean() / 2.55)) < 1)


async def test_an_episode_on_a_full_disk_is_left_out(tmp_path: Path) -> None:
    pytest.importorskip("resource")
    many = RECORD.replace("EPISODES = 3", "EPISODES = 50")
    code, words = await record(tmp_path, PREAMBLE.format(60_000) + many)
    assert code != 0
    assert re.search("RecordingError: .*episodes.mcap: File too large", words)
    folder = tmp_path / "today"
    assert (folder / "episodes.mcap").stat().st_size == 60_000
    names = [name for name, *_ in CONVERTING["episodes"](folder / "episodes.mcap")]
    assert names == [f"episode {number}" for number in range(len(names))]
    assert 0 < len(names) <= len(list(folder.glob("*.npz"))) < 50, "no further one has begun"


async def test_an_episode_without_an_end_is_left_out(tmp_path: Path) -> None:
    code, words = await record(tmp_path)
    assert code == 0, words
    file, whole = tmp_path / "today" / "episodes.mcap", tmp_path / "whole.mcap"
    data = file.read_bytes()
    for part in (2, 3, 5, 8):
        file.write_bytes(data[: len(data) * part // 10])
        recover(file, whole)
        names = [name for name, *_ in CONVERTING["episodes"](whole)]
        assert names == [f"episode {number}" for number in range(len(names))]
        assert len(names) < 3
        whole.unlink()


# -- frames ------------------------------------------------------------------------------------------------


def polls(begin: float, end: float) -> Array:
    """Rows each 5 ms; the state is the time, and so is the action."""
    at = np.arange(begin, end, 0.005)
    return np.stack([at, at, at, at, at, at], axis=1)


@pytest.mark.parametrize("rate", [7, 15, 30, 100, 500])
def test_a_camera_may_be_slower_or_quicker(rate: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(CONVERTING, "STALE_S", 0.2)
    rows, times = polls(10.0, 13.0), np.arange(9.0, 14.0, 1 / rate)
    picture, states, actions = CONVERTING["frames"](rows, times)
    assert len(picture) == pytest.approx(3 * FPS, abs=1 + FPS / rate)
    late = times[picture] - states[:, 0]
    assert late.min() >= 0, "no status from after its picture"
    assert late.max() <= 0.005 + 1e-9
    ahead = actions[:, 0] - states[:, 0]
    assert ahead.min() >= 1 / FPS - 0.005 - 1e-9, "an action follows what was seen"
    assert list(picture) == sorted(picture)
    assert (
        len(set(picture)) == len(picture)
        if rate > FPS
        else len(set(picture)) >= (len(picture) - 1) * rate // FPS
    )


@pytest.mark.parametrize("silent", ["camera", "link"])
def test_a_gap_is_refused(silent: str) -> None:
    rows, times = polls(10.0, 13.0), np.arange(10.0, 13.0, 1 / 30)
    if silent == "camera":
        times = times[(times < 11) | (times > 11.5)]
    else:
        rows = rows[(rows[:, 0] < 11) | (rows[:, 0] > 11.5)]
    with pytest.raises(ValueError, match=r"no picture or no status for 0\.[45]\d s"):
        CONVERTING["frames"](rows, times)
