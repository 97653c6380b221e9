"""Each simulated gripper open, closed and around parts: the table of docs/how-to/physics.md, and pictures.

    MUJOCO_GL=egl python docs/make_grasps.py

It takes a minute. Needs the extra physics, Pillow, and Debian's libegl1 or libosmesa6. Made by hand when the
bodies have changed, and looked at.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path
from typing import Any, Final

import mujoco
from PIL import Image

ROOT: Final = Path(__file__).parents[1]
if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))

from robotiq_async import RobotiqStatus  # noqa: E402
from robotiq_async.simulator import Physics, SimulatedGripper  # noqa: E402
from robotiq_async.tools.description import hand_model  # noqa: E402
from robotiq_async.values.enums import Finger  # noqa: E402
from robotiq_async.values.model import MODELS, THREE_FINGER, Model  # noqa: E402

PICTURES: Final = ROOT / "docs" / "measured"
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
HEIGHT_3F: Final = 175
THIN_MM: Final = 50
SIZE: Final = 180
BACKGROUND: Final = (226, 230, 236)
AROUND: Final = {"3f": "rod:60x140,0.3@105"}
"""Parts for the grippers for which the can is not the one that is shown."""
CAN: Final = "cylinder:45x60,0.2"
BLOCK: Final = "box:60x80x90,90"
"""One that a 3-Finger does not move: of a free one, A holds what B and C press."""
POLL_S: Final = 0.005


def main() -> None:
    """All of them."""
    sheet = Image.new("RGB", (SIZE * len(PARTS), SIZE * len(MODELS)), BACKGROUND)
    print(f"| | {' | '.join(f'{name} `{scene}`' for scene, name in PARTS)} |")
    print(f"|{' -- |' * (len(PARTS) + 1)}")
    for row, model in enumerate(MODELS.values()):
        cells = []
        for column, (scene, _) in enumerate(PARTS):
            said, shown = grasp(model, scene)
            cells.append(said)
            if shown is not None:
                sheet.paste(shown, (column * SIZE, row * SIZE))
        print(f"| {model.title} | {' | '.join(cells)} |", flush=True)
    sheet.save(PICTURES / "grasps.webp", quality=80)
    ends()
    print("\n| | speed 0 | speed 255 | force 0 | force 128 | force 255 |")
    print(f"|{' -- |' * 6}")
    for model in MODELS.values():
        both = [*speeds(model), *forces(model)]
        print(f"| {model.title} | {' | '.join(f'{found:.0f} ({table:.0f})' for found, table in both)} |")


def speeds(model: Model) -> list[tuple[float, float]]:
    """Of the opening, or of one finger of three, in mm/s at both ends; and what the manual has."""
    found, fingers = [], 2 if model is THREE_FINGER else 1
    for value, nominal in zip((0, 255), model.speeds_mm_s, strict=True):
        stage, curve = Stage(model, "table"), []
        stage.ask(255, speed=value, force=255)
        while stage.physics.opening_mm > 0.2 * model.stroke.mm:
            stage.wait(POLL_S)
            curve.append(stage.physics.opening_mm)
        middle = [each for each in curve if each < 0.8 * model.stroke.mm]
        found.append(((middle[0] - middle[-1]) / (len(middle) - 1) / POLL_S / fingers, nominal))
    return found


def forces(model: Model) -> list[tuple[float, float]]:
    """Of a finger on a box in newtons, at three forces, and what lies evenly between those of the manual."""
    found, (least, most) = [], model.forces_n
    for value in (0, 128, 255):
        stage = Stage(model, BLOCK if model is THREE_FINGER else PARTS[0][0])
        stage.ask(255, speed=0, force=value)
        stage.wait(6)
        found.append((stage.physics.grip_force, least + (most - least) * value / 255))
    return found


def ends() -> None:
    """Each gripper open, closed on nothing, and around a part."""
    size = 2 * SIZE
    sheet = Image.new("RGB", (size * len(MODELS), size * 3), BACKGROUND)
    for column, model in enumerate(MODELS.values()):
        for row, (scene, position) in enumerate((("table", 0), ("table", 255), (_around(model), 255))):
            stage = Stage(model, scene)
            stage.move(position)
            sheet.paste(stage.picture(size), (column * size, row * size))
    sheet.save(PICTURES / "bodies.webp", quality=80)


def _around(model: Model) -> str:
    return AROUND.get(model.name, CAN)


class Stage:
    """A gripper that is active, its world and the clock of both."""

    def __init__(self, model: Model, scene: str, pinch: int = 0) -> None:
        self.model, self.physics = model, Physics(scene)
        self._now = 0.0
        self._mode = pinch
        self._gripper = SimulatedGripper(lambda: self._now, model=model, physics=self.physics)
        self._gripper.write(0, [0x0100 | pinch, 0, 0])
        self.wait(6)

    def wait(self, seconds: float) -> RobotiqStatus:
        """Let time pass; the last status."""
        for _ in range(round(seconds / POLL_S)):
            self._now += POLL_S
            registers = self._gripper.status_registers()
        return RobotiqStatus.from_registers(registers, model=self.model)

    def move(self, position: int) -> RobotiqStatus:
        """Go there at half of the speed, and rest."""
        self.ask(position, speed=128, force=FORCE)
        return self.wait(6)

    def ask(self, position: int, *, speed: int, force: int) -> None:
        """Send it there."""
        self._gripper.write(0, [0x0900 | self._mode, position, speed << 8 | force])

    def picture(self, size: int) -> Image.Image:
        """Seen from the side, a little from above."""
        world: Any = self.physics._mechanism.world  # noqa: SLF001
        model, data = world._model, world._data  # noqa: SLF001
        palm = data.body(f"gripper/{hand_model(self.model).root}").xpos
        camera = mujoco.MjvCamera()
        camera.lookat, camera.distance = [0, 0, palm[2] - 0.095], 0.42
        camera.azimuth, camera.elevation = 110, -15
        with mujoco.Renderer(model, size, size) as renderer:
            renderer.scene.flags[mujoco.mjtRndFlag.mjRND_REFLECTION] = 0
            renderer.update_scene(data, camera)
            shown = renderer.render().copy()
            renderer.enable_segmentation_rendering()
            renderer.update_scene(data, camera)
            seen, table = renderer.render()[..., 0], model.geom("table").id
        shown[(seen < 0) | (seen == table)] = BACKGROUND
        return Image.fromarray(shown)


def grasp(model: Model, scene: str) -> tuple[str, Image.Image | None]:
    """Grip a part and lift it: a sentence and a picture of the outcome."""
    # The tips of a 3-Finger rise by 40 mm as they close, and would pass above low parts: somebody holds them.
    # Between the basic fingers of a 3-Finger what is thin finds no opposite: it is pinched.
    pinch = 0x0200 if model is THREE_FINGER and float(re.findall(r"[0-9]+", scene)[0]) < THIN_MM else 0
    try:
        stage = Stage(model, f"{scene}@{HEIGHT_3F}" if model is THREE_FINGER else scene, pinch)
    except ValueError:
        return "no room", None
    status = stage.move(255)
    before, opening, position = stage.physics.part, stage.physics.opening_mm, status.position(Finger.A)
    stage.physics.lift(LIFT_MM)
    stage.wait(2)
    after = stage.physics.part
    assert before is not None
    assert after is not None
    is_held = after[2] - before[2] > 0.8 * LIFT_MM
    width = f", {opening:.0f} mm" if len(model.axes) == 1 else ""
    words = "held" if is_held else "slips" if status.contacts else "not met"
    return f"{words}, {position}{width}", stage.picture(SIZE)


if __name__ == "__main__":
    main()
