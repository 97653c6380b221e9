"""The gripper in three dimensions.

The drawing follows from the description of the model. A scene is made before the model is known: until the
first status it is a 3-Finger. A simulation with physics tells where joints and parts are. Of any other
gripper only the positions are known, and its part is a guess (:mod:`.held`).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from math import pi
from typing import Any, Final

from nicegui import ui
from nicegui.elements.scene.scene_object3d import Object3D

from .....values import THREE_FINGER, Finger, Model, ObjectStatus, RobotiqStatus
from ....description import HandModel, Pose, Shape, hand_model
from ....description.geometry import turned
from ....description.kinematics import FINGER_NAMES, joint_names, requested_angles
from ....description.simulated import PART
from ..mirror import HandMirror
from .held import Thing, grasp
from .words import COLORS

SCALE: Final = 10.0
"""Scale: three.js works best with objects of size 1."""
GLOW: Final = "#ff5a1f"
GHOST: Final = "#0ea5e9"
STAGE_COLOR: Final = "#b9c3cf"
"""Background of the hand, which is grey and black, on a light and on a dark page."""
NAME_PLATE: Final = "color:#16202c;background:#ffffffe0;padding:0 .2em;border-bottom:.15em solid "
"""Style of a finger's names: dark on white on any background, above a line of its colour."""
LETTER_FONT: Final = "font:bold 17px sans-serif"
NAME_FONT: Final = "font:11px sans-serif;font-size:clamp(0px,(100vw - 640px) * 9,11px);margin-top:1.7em"
"""Style of the name below the letter, at the same point; a phone has no room for it."""
HELD: Final = "#f2c230"
STALE: Final = 0.25
APART: Final = 3
"""Minimum distance in counts between position and request for drawing the request."""
TURNED: Final = 2e-4
"""Minimum visible change of an angle in radians."""
MOVED: Final = 2e-5
"""The same of a joint that slides, in metres."""

SceneCalls = list[list[Any]]


class HandFigure:
    """The links of a hand as nested groups: turning a joint moves all links beyond it.

    A ghost cannot be found by the names of the links.
    """

    def __init__(self, model: HandModel, *, ghost: bool) -> None:
        self._model = model
        self._ghost = ghost
        self._angles: dict[str, float] = {}
        self._shapes: dict[str, list[tuple[Shape, Object3D]]] = {}
        self._looks: dict[str, tuple[str, float]] = {}
        x, y, z = model.stand.position
        self.root = ui.scene.group().move(x * SCALE, y * SCALE, z * SCALE).scale(SCALE)
        self.root.rotate_R([list(row) for row in model.stand.rotation])
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

    def turn(self, angles: Mapping[str, float]) -> SceneCalls:
        """Turn the joints; returns the calls for the browser."""
        calls: SceneCalls = []
        for joint in self._model.moving:
            angle = angles[joint.name]
            least = MOVED if joint.slides else TURNED
            if abs(angle - self._angles.get(joint.name, 0.0)) < least:
                continue
            self._angles[joint.name] = angle
            group, pose = self._groups[joint.child], joint.pose(angle)
            # All joints go in one message. The value is also kept: a returning browser gets all of it.
            if joint.slides:
                group.x, group.y, group.z = pose.position
                calls.append(["move", group.id, *pose.position, None])
            else:
                group.R = [list(row) for row in pose.rotation]
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


class SceneParts:
    """The parts before the gripper, where a simulation has them."""

    def __init__(self, root: Object3D) -> None:
        self._root = root
        self._kinds: list[tuple[str, tuple[float, ...]]] = []
        self._groups: list[Object3D] = []
        self._poses: list[Pose] = []

    def show(self, parts: Sequence[Shape]) -> SceneCalls:
        """Draw them where they are now; returns the calls for the browser."""
        kinds = [(part.kind, part.size) for part in parts]
        if parts and kinds != self._kinds:
            self._make(parts)
            self._kinds = kinds
        calls: SceneCalls = []
        for group in self._groups:
            group.visible(bool(parts))
        for number, part in enumerate(parts):
            group, pose = self._groups[number], part.origin
            if _is_as_near(pose, self._poses[number]):
                continue
            self._poses[number] = pose
            group.x, group.y, group.z = pose.position
            group.R = [list(row) for row in pose.rotation]
            calls += [["move", group.id, *pose.position, None], ["rotate", group.id, group.R]]
        return calls

    def _make(self, parts: Sequence[Shape]) -> None:
        for group in self._groups:
            group.delete()
        self._groups, self._poses = [], []
        for number, part in enumerate(parts):
            with self._root, _placed(ui.scene.group(), part.origin) as group:
                _drawn(replace(part, origin=Pose())).material(HELD).with_name(f"{PART}_{number}")
            self._groups.append(group)
            self._poses.append(part.origin)


def _is_as_near(one: Pose, other: Pose) -> bool:
    moved = max(abs(a - b) for a, b in zip(one.position, other.position, strict=True))
    pairs = zip(one.rotation, other.rotation, strict=True)
    return moved < MOVED and all(abs(a - b) < TURNED for rows in pairs for a, b in zip(*rows, strict=True))


class Drawing:
    """A gripper, its request, and the object that it holds."""

    def __init__(self, kind: Model, *, compact: bool) -> None:
        model = hand_model(kind)
        self.kind, self.model = kind, model
        self.ghost: HandFigure | None = None if compact else HandFigure(model, ghost=True)
        self.figure = HandFigure(model, ghost=False)
        with self.figure.root:
            # A cylinder of three.js lies along y, a 3-Finger's bar along z.
            self.bar = ui.scene.cylinder(1.0, 1.0, 1.0, 48).with_name("bar")
            if kind is THREE_FINGER:
                self.bar.rotate(pi / 2, 0, 0)
            self.ball = ui.scene.sphere(1.0).with_name("ball")
        self.parts = SceneParts(self.figure.root)
        for each in (self.bar, self.ball):
            each.material(HELD, 0.7).visible(False)
        if kind is THREE_FINGER and not compact:
            self._name_fingers()

    def _name_fingers(self) -> None:
        # The gripper's letter of each finger, and below it the name in joint states.
        for axis, color in zip(Finger.ALL, COLORS, strict=True):
            if axis in FINGER_NAMES:
                with self.figure.group(f"{FINGER_NAMES[axis]}_link_3"):
                    for words, font in ((str(axis.name), LETTER_FONT), (FINGER_NAMES[axis], NAME_FONT)):
                        ui.scene.text(words, f"{font};{NAME_PLATE}{color}").move(0.052, 0.032, 0.0)


class HandScene:
    """A scene with a gripper, its request, and the object that it holds; for a tile without the request."""

    def __init__(self, *, compact: bool = False) -> None:
        with ui.scene(grid=(4, 16), background_color=STAGE_COLOR, fps=30).classes("w-full h-full") as scene:
            self.scene = scene
        self._compact = compact
        self._drawing: Drawing | None = None

    def show(self, hand: HandMirror) -> None:
        """Draw the newest status; cheap if nothing has changed."""
        drawing = self._drawing_of(hand.model)
        if hand.status is None:
            drawing.figure.look_all(None, STALE)
            return
        angles, thing = grasp(drawing.model, hand.status)
        angles = drawing.model.completed(angles)
        parts: Sequence[Shape] = ()
        if hand.joints is not None and not hand.is_lost:
            angles, thing, parts = angles | hand.joints, None, hand.parts
        calls = drawing.figure.turn(angles) + drawing.parts.show(parts)
        if drawing.ghost is not None:
            calls += self._show_ghost(drawing.model, drawing.ghost, hand, hand.status)
        if calls:
            self.scene.run_method("run_methods", calls)
        self._show_contacts(drawing, hand, hand.status)
        self._show_held(drawing, None if hand.is_lost else thing)

    def _drawing_of(self, kind: Model) -> Drawing:
        if self._drawing is None or self._drawing.kind is not kind:
            self.scene.clear()
            with self.scene:
                self._drawing = Drawing(kind, compact=self._compact)
            near = _reach(self._drawing.model) * SCALE
            self.scene.move_camera(0.4 * near, -1.1 * near, 1.05 * near, 0, 0, 0.52 * near, duration=0)
        return self._drawing

    def _show_ghost(
        self, model: HandModel, ghost: HandFigure, hand: HandMirror, status: RobotiqStatus
    ) -> SceneCalls:
        away = _away(status) if status.go_echo and status.is_activated and not hand.is_lost else Finger(0)
        for finger, links in model.fingers.items():
            for link in links:
                ghost.show(link, is_shown=bool(finger & away))
        wanted = dict(zip(joint_names(status.model), requested_angles(status), strict=True))
        return ghost.turn(model.completed(wanted)) if away else []

    def _show_contacts(self, drawing: Drawing, hand: HandMirror, status: RobotiqStatus) -> None:
        opacity = STALE if hand.is_lost else 1.0
        glowing = Finger(0) if hand.is_lost else status.contacts
        if glowing & Finger.SCISSOR:
            glowing |= Finger.B | Finger.C
        touching = {
            link for finger, links in drawing.model.touching.items() if finger & glowing for link in links
        }
        for link in drawing.model.links:
            drawing.figure.look(link, GLOW if link in touching else None, opacity)

    def _show_held(self, drawing: Drawing, thing: Thing | None) -> None:
        is_bar = thing is not None and thing.length > 0
        drawing.bar.visible(is_bar)
        drawing.ball.visible(thing is not None and not is_bar)
        if thing is not None:
            drawn = drawing.bar if is_bar else drawing.ball
            drawn.move(*thing.middle)
            drawn.scale(thing.radius, thing.length if is_bar else thing.radius, thing.radius)


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


def _reach(model: HandModel) -> float:
    """The distance from the mounting face about to the ends of the fingers, in metres."""
    ends = ({joint.name: end for joint in model.moving} for end in (0.0, 0.4))
    poses = (pose for values in ends for pose in model.link_poses(values).values())
    return max((model.stand @ pose).position[2] for pose in poses) + 0.05


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
