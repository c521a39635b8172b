"""Robots described in MJCF, the XML of MuJoCo."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from math import pi
from typing import Any

import numpy as np

from omnidrive.files.position import Position
from omnidrive.files.xml_elements import Element
from omnidrive.robot.imports.attributes import (
    direction,
    malformed,
    number,
    numbers,
    positive_or_zero,
    words,
)
from omnidrive.robot.imports.mechanism import Body, Joint, Mechanism, Motion, Shape
from omnidrive.robot.imports.rotations import Matrix, Vector, about, from_quaternion, from_z

_MACROS = {"include", "replicate", "composite", "flexcomp", "attach"}
_DENSITY = 1000.0  # kg/m^3, the default of MuJoCo
_AXES = {"x": 0, "y": 1, "z": 2}


def read_mjcf(root: Element) -> Mechanism:
    """Return the mechanism of the first free body, or else of the first body, of an MJCF model.

    The frame of the base is that of this body. Bodies, hinges, inertias, primitive shapes, default
    classes and actuators are read; meshes are not.

    Raises:
        InvalidRobot: The text is not such a model, or uses macros such as `include`.
    """
    return _Reader(root).mechanism()


@dataclass(slots=True)
class _Reader:
    root: Element
    degrees: bool = True
    sequence: str = "xyz"
    defaults: dict[str, dict[str, dict[str, str]]] = field(default_factory=dict)
    bodies: list[Body] = field(default_factory=list)
    joints: list[Joint] = field(default_factory=list)

    def mechanism(self) -> Mechanism:
        """Read the model."""
        _refuse_macros(self.root)
        for compiler in self.root.all("compiler"):
            self.degrees = compiler.attributes.get("angle", "degree") != "radian"
            self.sequence = compiler.attributes.get("eulerseq", self.sequence)
        if len(self.sequence) != 3 or not set(self.sequence.lower()) <= set(_AXES):
            raise malformed(self.root.position, f"invalid eulerseq '{self.sequence[:40]}'")
        for default in self.root.all("default"):
            self._add_defaults(default, {}, "main")
        base = _base(self.root)
        self._add_body(base, -1, np.eye(3), np.zeros(3), base.attributes.get("childclass", "main"))
        for group in self.root.all("actuator"):
            for actuator in group.children:
                self._add_actuator(actuator)
        return Mechanism(
            self.root.attributes.get("model", "robot")[:64],
            self.bodies,
            self.joints,
            words(self.root),
        )

    def _add_defaults(
        self, element: Element, inherited: dict[str, dict[str, str]], name: str
    ) -> None:
        name = element.attributes.get("class", name)
        own = {tag: dict(values) for tag, values in inherited.items()}
        for each in element.children:
            if each.tag != "default":
                own[each.tag] = own.get(each.tag, {}) | each.attributes
        self.defaults[name] = own
        for each in element.all("default"):
            self._add_defaults(each, own, "")

    def _full(self, element: Element, group: str) -> Element:
        """Return an element with the values of its default class."""
        values = self.defaults.get(element.attributes.get("class", group), {})
        attributes = values.get(element.tag, {}) | element.attributes
        return Element(element.tag, attributes, element.position, element.malformed)

    def _add_body(
        self, element: Element, parent: int, rotation: Matrix, position: Vector, group: str
    ) -> None:
        """Append a body, its hinges and its descendants; ``rotation`` and ``position`` are its."""
        index = len(self.bodies)
        body = Body(element.attributes.get("name", f"body{index}"), parent, rotation, position)
        self.bodies.append(body)
        group = element.attributes.get("childclass", group)
        self._add_content(element, index, rotation, position, group)
        inertial = element.first("inertial")
        if inertial is not None:
            self._set_inertial(body, inertial)

    def _add_content(
        self, element: Element, index: int, rotation: Matrix, position: Vector, group: str
    ) -> None:
        body, masses = self.bodies[index], []
        for each in element.children:
            if each.tag in {"body", "frame"}:
                turned, offset = self._pose(each)
                axes, origin = rotation @ turned, position + rotation @ offset
                if each.tag == "body":
                    self._add_body(each, index, axes, origin, group)
                else:
                    inner = each.attributes.get("childclass", group)
                    self._add_content(each, index, axes, origin, inner)
            elif each.tag == "joint":
                self._add_joint(self._full(each, group), index, rotation, position)
            elif each.tag == "geom":
                found = self._shape(self._full(each, group), rotation, position)
                if found is not None:
                    body.shapes.append(found[0])
                    masses.append(found)
        _add_mass_of_shapes(body, masses)

    def _set_inertial(self, body: Body, inertial: Element) -> None:
        turned, _ = self._pose(inertial)
        body.mass = positive_or_zero(inertial, "mass")
        body.com = body.position + body.rotation @ numbers(inertial, "pos", 3)
        if "fullinertia" in inertial.attributes:
            xx, yy, zz, xy, xz, yz = numbers(inertial, "fullinertia", 6).tolist()
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
        else:
            tensor = np.diag(numbers(inertial, "diaginertia", 3, (0.0, 0.0, 0.0)))
        up = (body.rotation @ turned)[2]
        body.yaw_inertia = float(up @ tensor @ up)

    def _add_joint(self, element: Element, index: int, rotation: Matrix, position: Vector) -> None:
        kind = element.attributes.get("type", "hinge")
        axis = direction(element, "axis", (0.0, 0.0, 1.0))
        name = element.attributes.get("name", f"joint{len(self.joints)}")
        if index > 0:
            along = rotation @ axis if kind in {"hinge", "slide"} else None
            limited = "range" in element.attributes
            self.bodies[index].motions.append(Motion(name, along, kind == "hinge", limited))
        if kind != "hinge":
            return
        point = position + rotation @ numbers(element, "pos", 3, (0.0, 0.0, 0.0))
        armature = number(element, "armature", 0.0)
        self.joints.append(
            Joint(
                name,
                index,
                rotation @ axis,
                point,
                inertia=armature or None,
                turns_freely="range" not in element.attributes,
            )
        )

    def _add_actuator(self, element: Element) -> None:
        """Add torque limit and servo gain to the joint of an actuator."""
        element = self._full(element, "main")
        names = [joint.name for joint in self.joints]
        if element.attributes.get("joint") not in names:
            return
        k = names.index(element.attributes["joint"])
        joint, gear = self.joints[k], abs(_first(element, "gear", 1.0))
        limits = numbers(element, "forcerange", 2, (0.0, 0.0))
        changes: dict[str, Any] = {}
        if limits[1] > limits[0]:
            changes["max_torque"] = gear * float(np.abs(limits).max())
        if element.tag == "velocity":
            changes["servo_gain"] = gear**2 * number(element, "kv", 1.0)
            speeds = numbers(element, "ctrlrange", 2, (0.0, 0.0))
            if speeds[1] > speeds[0]:
                changes["max_speed"] = float(np.abs(speeds).max()) / max(gear, 1e-9)
        elif element.tag == "motor" and "max_torque" not in changes:
            torques = numbers(element, "ctrlrange", 2, (0.0, 0.0))
            if torques[1] > torques[0]:
                changes["max_torque"] = gear * float(np.abs(torques).max())
        self.joints[k] = replace(joint, **changes)

    def _pose(self, element: Element) -> tuple[Matrix, Vector]:
        """Return rotation and position of an element in its parent."""
        given, unit = element.attributes, pi / 180.0 if self.degrees else 1.0
        rotation = np.eye(3)
        if "quat" in given:
            rotation = from_quaternion(*numbers(element, "quat", 4).tolist())
        elif "euler" in given:
            for letter, angle in zip(self.sequence, numbers(element, "euler", 3), strict=True):
                turn = about(_AXES[letter.lower()], unit * float(angle))
                rotation = rotation @ turn if letter.islower() else turn @ rotation
        elif "axisangle" in given:
            x, y, z, angle = numbers(element, "axisangle", 4).tolist()
            frame = from_z(np.array([x, y, z]))
            rotation = frame @ about(2, unit * angle) @ frame.T
        elif "xyaxes" in given:
            axes = numbers(element, "xyaxes", 6)
            rotation = _orthonormal(element.position, axes[:3], axes[3:])
        elif "zaxis" in given:
            rotation = from_z(numbers(element, "zaxis", 3))
        return rotation, numbers(element, "pos", 3, (0.0, 0.0, 0.0))

    def _shape(
        self, element: Element, rotation: Matrix, position: Vector
    ) -> tuple[Shape, float] | None:
        """Return a primitive shape and its mass, kg; None for a mesh and other shapes."""
        kind = element.attributes.get("type", "sphere")
        if kind not in {"sphere", "capsule", "ellipsoid", "cylinder", "box"}:
            return None
        size = [abs(_nth(element, "size", i)) for i in range(3)]
        turned, offset = self._pose(element)
        if "fromto" in element.attributes:
            ends = numbers(element, "fromto", 6)
            turned, offset = from_z(ends[3:] - ends[:3]), 0.5 * (ends[:3] + ends[3:])
            size[1] = 0.5 * float(np.linalg.norm(ends[3:] - ends[:3]))
        a, b, c = size
        half, volume = {
            "sphere": ((a, a, a), 4.0 / 3.0 * pi * a**3),
            "capsule": ((a, a, a + b), pi * a * a * (2.0 * b + 4.0 / 3.0 * a)),
            "cylinder": ((a, a, b), 2.0 * pi * a * a * b),
            "ellipsoid": ((a, b, c), 4.0 / 3.0 * pi * a * b * c),
            "box": ((a, b, c), 8.0 * a * b * c),
        }[kind]
        density = positive_or_zero(element, "density", _DENSITY)
        mass = positive_or_zero(element, "mass", density * volume)
        shape = Shape(
            position + rotation @ offset, rotation @ turned, np.array(half), kind != "box"
        )
        return shape, mass


def _refuse_macros(root: Element) -> None:
    queue = [root]
    for element in queue:  # it grows
        if element.tag in _MACROS:
            raise malformed(
                element.position,
                f"<{element.tag}> is not supported; save the compiled model by mj_saveLastXML",
            )
        queue += element.children


def _base(root: Element) -> Element:
    """Return the first body with a free joint, or else the first body."""
    bodies = [body for world in root.all("worldbody") for body in world.all("body")]
    if not bodies:
        raise malformed(root.position, "there is no body in worldbody")
    for body in bodies:
        if body.first("freejoint") or any(
            joint.attributes.get("type") == "free" for joint in body.all("joint")
        ):
            return body
    return bodies[0]


def _add_mass_of_shapes(body: Body, shapes: list[tuple[Shape, float]]) -> None:
    """Add masses of shapes as boxes of the same extent; an element `inertial` replaces them."""
    for shape, mass in shapes:
        if not mass > 0.0:
            continue
        before, total = body.mass, body.mass + mass
        centre = (before * body.com + mass * shape.centre) / total
        squares = shape.half**2 / (4.0 if shape.is_round else 3.0)
        up = shape.axes[2]
        own = mass * float(squares.sum() - squares @ up**2)
        for part, com in ((before, body.com), (mass, shape.centre)):
            body.yaw_inertia += part * float(((com - centre)[:2] ** 2).sum())
        body.yaw_inertia += own
        body.mass, body.com = total, centre


def _orthonormal(position: Position, x: Vector, y: Vector) -> Matrix:
    z = np.cross(x, y)
    if not (np.linalg.norm(x) > 0.0 and np.linalg.norm(z) > 0.0):
        raise malformed(position, "xyaxes needs two independent vectors")
    x, z = x / np.linalg.norm(x), z / np.linalg.norm(z)
    return np.column_stack([x, np.cross(z, x), z])


def _first(element: Element, name: str, default: float) -> float:
    return _nth(element, name, 0) if name in element.attributes else default


def _nth(element: Element, name: str, i: int) -> float:
    """Return the number i of an attribute that may hold fewer; 0 if it is missing."""
    words = element.attributes.get(name, "").split()
    part = Element(element.tag, {name: words[i] if i < len(words) else "0"}, element.position,
                   element.malformed)  # fmt: skip
    return number(part, name)
