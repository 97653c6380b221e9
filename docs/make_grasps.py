"""Ten parts in each simulated gripper: the figures of docs/how-to/physics.md, and the pictures. A minute.

    MUJOCO_GL=egl python docs/make_grasps.py

Needs the extra physics, Pillow, and Debian's libegl1 or libosmesa6. Made by hand when the bodies have
changed, and looked at.
"""

from __future__ import annotations

import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any, Final

import mujoco
from PIL import Image

ROOT: Final = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from robotiq_async import RobotiqStatus  # noqa: E402
from robotiq_async.simulator import Physics, SimulatedGripper  # noqa: E402
from robotiq_async.values.enums import Finger  # noqa: E402
from robotiq_async.values.model import MODELS, THREE_FINGER, Model  # noqa: E402

PICTURE: Final = ROOT / "docs" / "measured" / "grasps.webp"
PARTS: Final = (
    ("box:30x40x50,0.2", "box"),
    ("box:45x60x40,0.4", "wide box"),
    ("box:8x40x40,0.05", "plate"),
    ("box:30x40x50,5", "heavy box"),
    ("cylinder:40x50,0.2", "cylinder"),
    ("cylinder:66x60,0.35", "can"),
    ("cylinder:12x60,0.03", "pen"),
    ("rod:25x120,0.3", "rod"),
    ("sphere:40,0.1", "ball"),
    ("sphere:65,0.06", "tennis ball"),
)
FORCE: Final = 128
LIFT_MM: Final = 60.0
HEIGHT_3F: Final = 155
THIN_MM: Final = 50
SIZE: Final = 150
POLL_S: Final = 0.005


def main() -> None:
    """All of them."""
    sheet = Image.new("RGB", (SIZE * len(PARTS), SIZE * len(MODELS)))
    print(f"| | {' | '.join(f'{name} `{scene}`' for scene, name in PARTS)} |")
    print(f"|{' -- |' * (len(PARTS) + 1)}")
    for row, model in enumerate(MODELS.values()):
        cells = []
        for column, (scene, _) in enumerate(PARTS):
            said, picture = grasp(model, scene)
            cells.append(said)
            if picture is not None:
                sheet.paste(picture, (column * SIZE, row * SIZE))
        print(f"| {model.title} | {' | '.join(cells)} |", flush=True)
    sheet.save(PICTURE, quality=80)


def grasp(model: Model, scene: str) -> tuple[str, Image.Image | None]:
    """Grip a part and lift it: what became of it in words, and a picture."""
    # The tips of a 3-Finger rise by 40 mm as they close, and would pass above low parts: somebody holds them.
    now, physics = [0.0], Physics(f"{scene}@{HEIGHT_3F}" if model is THREE_FINGER else scene)
    try:
        gripper = SimulatedGripper(lambda: now[0], model=model, physics=physics)
    except ValueError:
        return "no room", None

    def statuses(seconds: float) -> Iterator[RobotiqStatus]:
        for _ in range(round(seconds / POLL_S)):
            now[0] += POLL_S
            yield RobotiqStatus.from_registers(gripper.status_registers(), model=model)

    # Between the basic fingers of a 3-Finger what is thin finds no opposite: it is pinched.
    pinch = 0x0200 if model is THREE_FINGER and float(re.findall(r"[0-9]+", scene)[0]) < THIN_MM else 0
    gripper.write(0, [0x0100 | pinch, 0, 0])
    list(statuses(6))
    gripper.write(0, [0x0900 | pinch, 255, 128 << 8 | FORCE])
    *_, status = statuses(6)
    before, opening, position = physics.part, physics.opening_mm, status.position(Finger.A)
    physics.lift(LIFT_MM)
    list(statuses(2))
    after = physics.part
    assert before is not None
    assert after is not None
    is_held = after[2] - before[2] > 0.8 * LIFT_MM
    width = f", {opening:.0f} mm" if len(model.axes) == 1 else ""
    words = "held" if is_held else "slips" if status.contacts else "not met"
    return f"{words}, {position}{width}", picture(physics)


def picture(physics: Physics) -> Image.Image:
    world: Any = physics._world  # noqa: SLF001
    camera = mujoco.MjvCamera()
    camera.lookat, camera.distance = [0, 0, 0.16], 0.5
    camera.azimuth, camera.elevation = 110, -15
    with mujoco.Renderer(world._model, SIZE, SIZE) as renderer:  # noqa: SLF001
        renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
        renderer.update_scene(world._data, camera)  # noqa: SLF001
        return Image.fromarray(renderer.render())


if __name__ == "__main__":
    main()
