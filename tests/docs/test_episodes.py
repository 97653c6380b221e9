"""The programs of their page: pictures and statuses are aligned, and what is incomplete is left out."""

from __future__ import annotations

import asyncio
import re
import sys
import types
from asyncio.subprocess import DEVNULL, PIPE, STDOUT
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pytest

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.recording.recordings import recover
from tests.docs.pages import DOCS, ROOT, blocks, read
from tests.forked import CORE, forking
from tests.patience import patience

PAGE = DOCS / "how-to" / "episodes.md"
RECORD, CONVERT = (each.text for each in blocks(read(PAGE), "python"))
Array = npt.NDArray[Any]


def program(text: str) -> dict[str, Any]:
    """The names that a program of the page defines."""
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


async def record(folder: Path, text: str = RECORD, *, part: int = 120) -> tuple[int | None, str]:
    """Run the first program; its code and its words. A part at 255 is none."""
    file = folder / "record_episodes.py"
    file.write_text(text, encoding="utf-8")
    gripper = SimulatedGripper(speedup=5, model=TWO_FINGER_85)
    gripper.place_object(JAW, position=part)
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
        assert not gripper.is_moving
    return process.returncode, printed.decode()


def changed(old: str, new: str) -> str:
    """The first program, with other words in one place."""
    assert RECORD.count(old) == 1
    return RECORD.replace(old, new)


async def test_pictures_and_statuses_are_aligned(tmp_path: Path) -> None:
    """A picture is what its camera saw and when; it was taken after the picture before had its time."""
    sees = "np.full((32, 32, 3), 255 * self.hand.status.open_fraction(JAW), np.uint8)"
    notes = "np.array([100 * self.hand.status.open_fraction(JAW), time.monotonic()])"
    code, words = await record(tmp_path, changed(sees, notes))
    assert code == 0, words
    folder = tmp_path / "today"
    found = list(CONVERTING["episodes"](folder / "episodes.mcap"))
    assert [name for name, *_ in found] == [f"episode {number}" for number in range(3)]
    for name, values, rows in found:
        assert values == {"task": "grip the part", "success": True}
        with np.load(folder / f"{name}.npz") as file:
            times, (seen, taken) = file["times"], file["images"].T
        assert all(taken <= times)
        assert all(times[:-1] <= taken[1:])
        picture, states, actions = CONVERTING["frames"](rows, times)
        assert len(picture) == len(states) == len(actions) > 3
        for number in picture[1:]:
            newest = rows[rows[:, 0] <= taken[number]][-2:, 1]  # the last may not have been told yet
            assert np.min(np.abs(newest - seen[number])) < 0.01
        assert rows[:, 3].max() == 1, "it has met the part"
        assert rows[:, 4].min() == 0, "it was closed beyond the part"


async def test_an_episode_on_a_full_disk_is_left_out(tmp_path: Path) -> None:
    pytest.importorskip("resource")
    many = changed("EPISODES = 3", "EPISODES = 50")
    code, words = await record(tmp_path, PREAMBLE.format(60_000) + many)
    assert code != 0
    assert re.search("RecordingError: .*episodes.mcap: File too large", words)
    folder = tmp_path / "today"
    assert (folder / "episodes.mcap").stat().st_size == 60_000
    names = [name for name, *_ in CONVERTING["episodes"](folder / "episodes.mcap")]
    assert names == [f"episode {number}" for number in range(len(names))]
    assert 0 < len(names) <= len(list(folder.glob("*.npz"))) < 50, "no further one has begun"


async def test_an_episode_without_an_end_is_left_out(tmp_path: Path) -> None:
    ends = 'recorder.mark("", success=success)'
    code, words = await record(tmp_path, changed(ends, f'file.stem == "episode 1" or {ends}'))
    assert code == 0, words
    found = CONVERTING["episodes"](tmp_path / "today" / "episodes.mcap")
    assert [name for name, *_ in found] == ["episode 0", "episode 2"]


async def test_an_episode_of_a_killed_program_is_left_out(tmp_path: Path) -> None:
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


async def test_a_camera_that_fails_ends_the_episode_and_the_motion(tmp_path: Path) -> None:
    breaks = "time.sleep(1 / 30)\n        assert self.hand.status.position(JAW) < 40, 'gone'"
    code, words = await record(tmp_path, changed("time.sleep(1 / 30)", breaks))
    assert code != 0
    assert "AssertionError: gone" in words
    ((name, values, _),) = CONVERTING["episodes"](tmp_path / "today" / "episodes.mcap")
    assert (name, values["success"]) == ("episode 0", False)


async def test_an_empty_grasp_is_no_success(tmp_path: Path) -> None:
    code, words = await record(tmp_path, part=255)
    assert code == 0, words
    found = CONVERTING["episodes"](tmp_path / "today" / "episodes.mcap")
    assert [values["success"] for _, values, _ in found] == [False] * 3


class Dataset:
    """Stands for LeRobot's, which is in tests/lerobot/live.py."""

    made: Dataset

    def __init__(self, *about: object, **options: object) -> None:
        self.about, self.options = about, options
        self.frames: list[dict[str, Any]] = []
        self.episodes: list[list[dict[str, Any]]] = []
        self.is_final = False

    @classmethod
    def create(cls, *about: object, **options: object) -> Dataset:
        cls.made = cls(*about, **options)
        return cls.made

    def add_frame(self, frame: dict[str, Any]) -> None:
        self.frames.append(frame)

    def save_episode(self) -> None:
        self.episodes.append(self.frames)
        self.frames = []

    def finalize(self) -> None:
        self.is_final = True


async def test_what_is_incomplete_is_named_and_not_in_the_dataset(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    code, words = await record(tmp_path)
    assert code == 0, words
    folder = tmp_path / "today"
    (folder / "episode 1.npz").unlink()
    with np.load(folder / "episode 2.npz") as file:
        times, images = file["times"], file["images"]
    times[len(times) // 2 :] += 0.5
    np.savez(folder / "episode 2.npz", times=times, images=images)
    module = types.ModuleType("lerobot.datasets.lerobot_dataset")
    module.LeRobotDataset = Dataset  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, module.__name__, module)
    CONVERTING["convert"](folder, tmp_path / "data")
    lines = capsys.readouterr().out.splitlines()
    assert lines[0].startswith("episode 1 is left out: [Errno 2] No such file")
    assert lines[1].startswith("episode 2 is left out: no picture or no status for 0.")
    dataset = Dataset.made
    assert dataset.is_final
    assert dataset.frames == []
    (episode,) = dataset.episodes
    assert {frame["task"] for frame in episode} == {"grip the part"}
    features: Any = dataset.about[2]
    for frame in episode:
        for key, feature in features.items():
            assert frame[key].shape == feature["shape"]
            assert frame[key].dtype == ("uint8" if feature["dtype"] == "image" else feature["dtype"])


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
