"""Writes a description as MJCF for MuJoCo, with the couplings and springs that a URDF has no form for.

Coupled joints are equality constraints; a motor that drives several joints pulls a tendon. Every drive is a
position actuator whose limit is the full force; the simulator lowers the limit to the force of the
force register. The gripper collides with everything but itself.

Frictions, dampings and the gains of the drives are estimates: stiff enough to stop within a count, and soft
enough for steps of 2 ms.
"""

from __future__ import annotations

import xml.etree.ElementTree as ET
from collections.abc import Mapping
from typing import Final

from ...values import Finger
from .geometry import Pose
from .model import HandModel, Joint, Mimic, RigidLink, Shape
from .shapes import inertia
from .urdf_writer import as_text, numbers

_TIMESTEP: Final = 0.002
_PAD_FRICTION: Final = (0.9, 0.02, 0.0005)
"""Sliding, turning, rolling: rubber on a smooth part (ESTIMATE). The manual of the Hand-E has 0.3 for
silicone on oiled steel."""
_BODY_FRICTION: Final = (0.4, 0.005, 0.0001)
_GAINS: Final = {False: (500.0, 7.0, 0.02), True: (30_000.0, 500.0, 2.0)}
"""Stiffness, damping and inertia of the geared motor of a turning drive, and of a sliding drive."""
_SHARED_GAINS: Final = (150.0, 2.5, 0.006)
"""The same of a drive that pulls a tendon."""
_DAMPING: Final = {False: 0.02, True: 5.0}
_PAD_HARDNESS: Final = {False: "0.999 0.9999 0.0005", True: "0.99 0.9999 0.0005"}
"""The softness of a contact grows as the mass of the part and the number of points shrink: between softer
pads a ball of 2 g trembled. Fingers that pull tendons lose their hold on a part with pads that are harder."""
_HARD: Final = {"solref": "0.004 1", "solimp": "0.95 0.999 0.001"}


def write_mjcf(model: HandModel, note: str) -> str:
    """The MJCF as text, with a note as its first comment. It stands in the origin, and opens upwards."""
    mujoco = ET.Element("mujoco", model=model.name)
    mujoco.append(ET.Comment(f" {note} "))
    ET.SubElement(mujoco, "compiler", angle="radian", autolimits="true")
    ET.SubElement(
        mujoco,
        "option",
        timestep=numbers([_TIMESTEP]),
        integrator="implicitfast",
        cone="elliptic",
        impratio="10",
    )
    world = ET.SubElement(mujoco, "worldbody")
    _add_bodies(world, model)
    if model.tendons:
        tendons = ET.SubElement(mujoco, "tendon")
        for tendon in model.tendons:
            options = {"name": tendon.name}
            if tendon.lower is not None and tendon.upper is not None:
                options["range"] = numbers([tendon.lower, tendon.upper])
            if tendon.stiffness:
                options |= {"stiffness": numbers([tendon.stiffness]), "springlength": "0"}
            fixed = ET.SubElement(tendons, "fixed", options)
            for joint, weight in tendon.joints.items():
                ET.SubElement(fixed, "joint", joint=joint, coef=numbers([weight]))
    _add_couplings(mujoco, model)
    drives = ET.SubElement(mujoco, "actuator")
    drives.extend(_drive(model, axis, name) for axis, name in model.drives.items())
    return as_text(mujoco)


def _add_bodies(world: ET.Element, model: HandModel) -> None:
    bodies = {model.root: _body(world, model, model.root, model.stand)}
    for joint in model.joints:
        body = _body(bodies[joint.parent], model, joint.child, joint.origin)
        bodies[joint.child] = body
        if joint.axis is not None:
            # After the inertial element, before the shapes: the order that MuJoCo's own files have.
            body.insert(1, _joint(model, joint))


def _body(parent: ET.Element, model: HandModel, name: str, pose: Pose) -> ET.Element:
    link = model.links[name]
    body = ET.SubElement(parent, "body", name=link.name, pos=numbers(pose.position), quat=_quaternion(pose))
    centre, moments, products = inertia(link)
    ET.SubElement(
        body,
        "inertial",
        pos=numbers(centre),
        mass=numbers([link.mass]),
        fullinertia=numbers([*moments, *products]),
    )
    for shape in link.shapes:
        body.append(_geom(model, link, shape))
    return body


def _geom(model: HandModel, link: RigidLink, shape: Shape) -> ET.Element:
    halved = {
        "box": [edge / 2 for edge in shape.size],
        "cylinder": [shape.size[0], shape.size[-1] / 2],
        "sphere": list(shape.size),
    }
    geom = ET.Element(
        "geom",
        type=shape.kind,
        size=numbers(halved[shape.kind]),
        pos=numbers(shape.origin.position),
        quat=_quaternion(shape.origin),
        rgba=numbers(shape.color),
        # Other things have 1 for both: they meet the gripper, and the gripper does not meet itself.
        contype="2",
        conaffinity="1",
    )
    if shape.name:
        geom.set("name", f"{link.name}_{shape.name}")
        geom.set("friction", numbers(_PAD_FRICTION))
        geom.set("condim", "4")
        geom.set("priority", "1")
        geom.set("solref", "0.004 1")
        geom.set("solimp", _PAD_HARDNESS[bool(model.tendons)])
    else:
        geom.set("friction", numbers(_BODY_FRICTION))
    return geom


def _joint(model: HandModel, joint: Joint) -> ET.Element:
    assert joint.axis is not None, "only a joint that moves is written"
    driven = joint.name in model.drives.values()
    shared = any(joint.name in tendon.joints for tendon in model.tendons)
    element = ET.Element(
        "joint",
        name=joint.name,
        type="slide" if joint.slides else "hinge",
        axis=numbers(joint.axis),
        range=numbers([joint.lower, joint.upper]),
        damping=numbers([_DAMPING[joint.slides]]),
        armature=numbers([_GAINS[joint.slides][2] if driven else _SHARED_GAINS[2] if shared else 0.0005]),
        solreflimit="0.004 1",
        solimplimit="0.95 0.999 0.001",
    )
    if joint.name in model.springs:
        stiffness, rest = model.springs[joint.name]
        element.set("stiffness", numbers([stiffness]))
        element.set("springref", numbers([rest]))
    return element


def _add_couplings(mujoco: ET.Element, model: HandModel) -> None:
    couplings: dict[str, Mimic] = {
        joint.name: joint.mimic for joint in model.moving if joint.mimic is not None
    }
    couplings |= model.couplings
    if couplings:
        equality = ET.SubElement(mujoco, "equality")
        for name, mimic in couplings.items():
            ET.SubElement(
                equality,
                "joint",
                {
                    "name": name,
                    "joint1": name,
                    "joint2": mimic.joint,
                    "polycoef": numbers([0, mimic.multiplier, 0, 0, 0]),
                    **_HARD,
                },
            )


def _drive(model: HandModel, axis: Finger, name: str) -> ET.Element:
    joints = {joint.name: joint for joint in model.moving}
    weights: Mapping[str, float] = {name: 1.0}
    for tendon in model.tendons:
        if tendon.name == name:
            weights = tendon.joints
    ends = [
        sum(weight * end for weight, end in zip(weights.values(), side, strict=True))
        for side in zip(*((joints[each].lower, joints[each].upper) for each in weights), strict=True)
    ]
    is_joint = name in joints
    stiffness, damping, _ = _GAINS[joints[name].slides] if is_joint else _SHARED_GAINS
    effort = joints[next(iter(weights))].effort
    return ET.Element(
        "position",
        {
            "name": str(axis.name),
            "joint" if is_joint else "tendon": name,
            "kp": numbers([stiffness]),
            "kv": numbers([damping]),
            "ctrlrange": numbers(ends),
            "forcerange": numbers([-effort, effort]),
        },
    )


def _quaternion(pose: Pose) -> str:
    x, y, z, w = pose.quaternion
    return numbers([w, x, y, z])
