"""The hand in three dimensions."""

from __future__ import annotations

from collections.abc import Mapping
from math import pi
from typing import Any, Final

from nicegui import ui
from nicegui.elements.scene.scene_object3d import Object3D

from .....values.enums import Finger, ObjectStatus
from .....values.model import THREE_FINGER, Model
from .....values.status import RobotiqStatus
from ....description import HandModel, Pose, Shape, hand_model
from ....description.geometry import turned
from ....description.kinematics import FINGER_NAMES, JOINTS, finger_angles, palm_angle
from ..mirror import HandMirror
from .held import Thing, grasp
from .words import COLORS

SCALE: Final = 10.0
"""Scale: three.js works best with objects of size 1."""
LIFT: Final = 0.45
"""Height at which the mounting face lies on the ground."""
GLOW: Final = "#ff5a1f"
GHOST: Final = "#0ea5e9"
STAGE: Final = "#b9c3cf"
"""Background of the hand, which is grey and black, on a light and on a dark page."""
HALO: Final = "text-shadow:0 0 2px #fff,0 0 2px #fff,0 0 4px #fff"
"""Around a letter, for any background."""
LETTER: Final = "font:bold 17px sans-serif"
NAME: Final = "font:11px sans-serif;font-size:clamp(0px,(100vw - 640px) * 9,11px);padding-top:2.2em"
"""Below the letter, at the same point; a phone has no room for it."""
HELD: Final = "#f2c230"
STALE: Final = 0.25
APART: Final = 3
"""Minimum distance in counts between position and request for drawing the request."""
TURNED: Final = 2e-4
"""Minimum visible change of an angle in radians."""

Calls = list[list[Any]]


class Figure:
    """The links of a hand as nested groups: turning a joint moves all links beyond it.

    A ghost cannot be found by the names of the links.
    """

    def __init__(self, model: HandModel, *, ghost: bool) -> None:
        self._model = model
        self._ghost = ghost
        self._angles: dict[str, float] = {}
        self._shapes: dict[str, list[tuple[Shape, Object3D]]] = {}
        self._looks: dict[str, tuple[str, float]] = {}
        self.root = ui.scene.group().move(0, 0, LIFT).scale(SCALE)
        self.root.rotate(pi / 2, 0, 0)  # the palm faces upwards
        self._groups: dict[str, Object3D] = {model.root: self.root}
        if not ghost:
            self.root.with_name(model.root)
        self._fill(model.root)
        for joint in model.joints:
            with self._groups[joint.parent]:
                group = _placed(ui.scene.group(), joint.pose())
            if not ghost:
                group.with_name(joint.child)
            self._groups[joint.child] = group
            self._fill(joint.child)

    def turn(self, angles: Mapping[str, float]) -> Calls:
        """Turn the joints; returns the calls for the browser."""
        calls: Calls = []
        for joint in self._model.moving:
            angle = angles[joint.name]
            if abs(angle - self._angles.get(joint.name, 0.0)) < TURNED:
                continue
            self._angles[joint.name] = angle
            group = self._groups[joint.child]
            # All joints go in one message. The value is also kept: a returning browser gets all of it.
            group.R = [list(row) for row in joint.pose(angle).rotation]
            calls.append(["rotate", group.id, group.R])
        return calls

    def group(self, link: str) -> Object3D:
        """The group that moves with a link."""
        return self._groups[link]

    def show(self, link: str, *, is_shown: bool) -> None:
        """Show or hide a link, and all links beyond it."""
        self._groups[link].visible(is_shown)

    def look(self, link: str, color: str | None, opacity: float) -> None:
        """Colour a link; None for its own colours."""
        if self._looks.get(link) == (color or "", opacity):
            return
        self._looks[link] = (color or "", opacity)
        for shape, drawn in self._shapes[link]:
            # The joints of a glowing link keep their colour: otherwise its shape is not visible.
            kept = color is None or (color == GLOW and shape.kind == "cylinder")
            drawn.material(_hex(shape) if kept else color, opacity)

    def look_all(self, color: str | None, opacity: float) -> None:
        for link in self._shapes:
            self.look(link, color, opacity)

    def _fill(self, link: str) -> None:
        # No palm for a ghost: drawn twice in one place, it would flicker.
        wanted = () if self._ghost and link == self._model.root else self._model.links[link].shapes
        with self._groups[link]:
            shapes = [(shape, _drawn(shape)) for shape in wanted]
        self._shapes[link] = shapes
        self.look(link, GHOST if self._ghost else None, STALE if self._ghost else 1.0)


class HandScene:
    """A scene with a hand, its request, and the object that it holds; for a tile without the request."""

    def __init__(self, *, compact: bool = False) -> None:
        model = hand_model()
        with ui.scene(grid=(4, 16), background_color=STAGE, fps=30).classes("w-full h-full") as scene:
            self.scene = scene
            self._ghost = None if compact else Figure(model, ghost=True)
            self._figure = Figure(model, ghost=False)
            # A cylinder of three.js lies along y, which is z of the palm.
            self._bar = ui.scene.cylinder(1.0, 1.0, 1.0, 48).with_name("bar")
            self._ball = ui.scene.sphere(1.0).with_name("ball")
            for each in (self._bar, self._ball):
                each.material(HELD, 0.7).visible(False)
            if not compact:
                self._labels()
        self._model = model
        self._is_left_out = False
        scene.move_camera(0.8, -2.2, 2.1, 0, 0, 1.05, duration=0)

    def show(self, hand: HandMirror) -> None:
        """Draw the newest status; cheap if nothing has changed."""
        if hand.status is None:
            self._figure.look_all(None, STALE)
            return
        if hand.model is not THREE_FINGER:
            self._leave_out(hand.model)
            return
        angles, thing = grasp(self._model, hand.status)
        calls = self._figure.turn(angles)
        if self._ghost is not None:
            calls += self._show_ghost(self._ghost, hand, hand.status)
        if calls:
            self.scene.run_method("run_methods", calls)
        self._show_contacts(hand, hand.status)
        self._show_held(None if hand.is_lost else thing)

    def _leave_out(self, model: Model) -> None:
        # The drawing is that of the 3-Finger.
        if not self._is_left_out:
            self._is_left_out = True
            self._figure.show(self._model.root, is_shown=False)
            if self._ghost is not None:
                self._ghost.show(self._model.root, is_shown=False)
            words = f"There is no drawing of a {model.title} yet."
            with self.scene:
                ui.scene.text(words, f"{LETTER};{HALO}").move(0, 0, LIFT)

    def _show_ghost(self, ghost: Figure, hand: HandMirror, status: RobotiqStatus) -> Calls:
        away = _away(status) if status.go_echo and status.is_activated and not hand.is_lost else Finger(0)
        for finger, prefix in FINGER_NAMES.items():
            ghost.show(f"{prefix}_link_0", is_shown=bool(finger & away))
        return ghost.turn(_asked_angles(status)) if away else []

    def _show_contacts(self, hand: HandMirror, status: RobotiqStatus) -> None:
        opacity = STALE if hand.is_lost else 1.0
        glowing = Finger(0) if hand.is_lost else status.contacts
        if glowing & Finger.SCISSOR:
            glowing |= Finger.B | Finger.C
        fingers = {f"{prefix}_link_{n}": finger for finger, prefix in FINGER_NAMES.items() for n in (2, 3)}
        for link in self._model.links:
            is_hot = bool(fingers.get(link, Finger(0)) & glowing)
            self._figure.look(link, GLOW if is_hot else None, opacity)

    def _show_held(self, thing: Thing | None) -> None:
        is_bar = thing is not None and thing.length > 0
        self._bar.visible(is_bar)
        self._ball.visible(thing is not None and not is_bar)
        if thing is not None:
            (x, y, z), radius = thing.middle, thing.radius * SCALE
            drawn = self._bar if is_bar else self._ball
            drawn.move(x * SCALE, -z * SCALE, y * SCALE + LIFT)
            drawn.scale(radius, thing.length * SCALE if is_bar else radius, radius)

    def _labels(self) -> None:
        # The gripper's letter of each finger, and below it the name in joint states.
        for axis, color in zip(Finger.ALL, COLORS, strict=True):
            if axis in FINGER_NAMES:
                with self._figure.group(f"{FINGER_NAMES[axis]}_link_3"):
                    for words, font in ((str(axis.name), LETTER), (FINGER_NAMES[axis], NAME)):
                        ui.scene.text(words, f"color:{color};{font};{HALO}").move(0.052, 0.032, 0.0)


def _away(status: RobotiqStatus) -> Finger:
    # The fingers on their way to a request; the scissor moves B and C.
    away = Finger(0)
    for axis in status.model.axes:
        # Only axes in motion. An open axis stops at 6 or 7 for a request of 0. An axis in contact goes no
        # further, and its request would be drawn inside the object.
        if status.finger_status(axis) is ObjectStatus.IN_MOTION:
            apart = abs(status.requested_position(axis) - status.position(axis)) > APART
            away |= (Finger.B | Finger.C if axis is Finger.SCISSOR else axis) if apart else Finger(0)
    return away


def _asked_angles(status: RobotiqStatus) -> dict[str, float]:
    palm = palm_angle(status.requested_position(Finger.SCISSOR))
    one, two, middle = (finger_angles(status.requested_position(finger)) for finger in FINGER_NAMES)
    return dict(zip(JOINTS, (palm, *one, -palm, *two, *middle), strict=True))


def _drawn(shape: Shape) -> Object3D:
    if shape.kind == "box":
        return _placed(ui.scene.box(shape.size[0], shape.size[1], shape.size[2]), shape.origin)
    if shape.kind == "sphere":
        return _placed(ui.scene.sphere(shape.size[0]), shape.origin)
    radius, length = shape.size
    upright = shape.origin @ turned((1, 0, 0), pi / 2)  # a cylinder of three.js lies along y
    return _placed(ui.scene.cylinder(radius, radius, length, 24), upright)


def _placed(drawn: Object3D, pose: Pose) -> Object3D:
    return drawn.move(*pose.position).rotate_R([list(row) for row in pose.rotation])


def _hex(shape: Shape) -> str:
    return "#" + "".join(f"{round(255 * each):02x}" for each in shape.color[:3])
