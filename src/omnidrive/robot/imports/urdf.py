"""Robots described in URDF, the Unified Robot Description Format of ROS."""

from __future__ import annotations

import numpy as np
from scipy.spatial.transform import Rotation

from omnidrive.files.xml_elements import Element
from omnidrive.robot.imports.attributes import (
    direction,
    malformed,
    number,
    numbers,
    positive_or_zero,
    words,
)
from omnidrive.robot.imports.mechanism import Body, Joint, Matrix, Mechanism, Motion, Shape
from omnidrive.robot.imports.wheel_mounts import Vector, listed

_HINGES = {"continuous", "revolute"}
_ROOT_TAGS = {
    "link", "joint", "material", "transmission", "gazebo", "ros2_control", "sensor", "mujoco",
}  # fmt: skip
_LINK_TAGS = {
    "inertial", "visual", "collision", "contact", "sensor", "self_collision_checking", "verbose",
    "material",
}  # fmt: skip
_MECHANICAL = {
    "link", "joint", "inertial", "mass", "inertia", "body", "transmission", "actuator", "motor",
}  # fmt: skip
_LOCKED = 1e-6  # rad or m; range of a locked joint
_JOINTS = _HINGES | {"fixed", "prismatic", "floating", "planar"}


def read_urdf(root: Element) -> Mechanism:
    """Return the mechanism that a URDF describes, with all joints at zero.

    The frame of the base is that of the root link (http://wiki.ros.org/urdf/XML).

    Raises:
        InvalidRobot: The text is not the URDF of one tree of links.
    """
    unread = _unread(root)
    links: dict[str, Element] = {}
    for link in root.all("link"):
        if link.get("name") in links:
            raise malformed(link.position, f"there are two links '{link.get('name')[:40]}'")
        links[link.get("name")] = link
    joints = list(root.all("joint"))
    children: dict[str, list[Element]] = {}
    parents: dict[str, str] = {}
    for joint in joints:
        if joint.get("type") not in _JOINTS:
            raise malformed(joint.position, f"unknown type of joint '{joint.get('type')[:40]}'")
        parent, child = (joint.one(tag).get("link") for tag in ("parent", "child"))
        for name in (parent, child):
            if name not in links:
                raise malformed(joint.position, f"there is no link '{name[:40]}'")
        if child in parents:
            raise malformed(joint.position, f"link '{child[:40]}' has two parents")
        parents[child] = parent
        children.setdefault(parent, []).append(joint)
    roots = [name for name in links if name not in parents]
    if len(roots) != 1:
        raise malformed(root.position, f"expected one root link, got {len(roots)}")
    bodies = [_body(links[roots[0]], roots[0], -1, np.eye(3), np.zeros(3))]
    hinges: list[Joint] = []
    queue = [0]
    for index in queue:  # breadth first; it grows
        for joint in children.get(bodies[index].name, []):
            bodies.append(_child(joint, index, links, bodies, hinges))
            queue.append(len(bodies) - 1)
    return Mechanism(root.attributes.get("name", "robot")[:64], bodies, hinges, words(root), unread)


def _unread(root: Element) -> tuple[str, ...]:
    """Return a warning about elements that URDF does not define; refuse those of a mechanism."""
    unknown: list[Element] = []
    for element, tags in [(root, _ROOT_TAGS), *((link, _LINK_TAGS) for link in root.all("link"))]:
        unknown += [each for each in element.children if each.qualified[0] not in tags]
    for each in unknown:
        inner = next((part for part in each.walk() if part.tag in _MECHANICAL), None)
        if inner is not None:
            raise malformed(
                each.position,
                f"<{each.qualified[0][:40]}> is no element of URDF here, but holds "
                f"<{inner.qualified[0][:40]}>; write it as link and joint, or remove it",
            )
    names = list(dict.fromkeys(f"<{each.qualified[0]}>" for each in unknown))
    return (f"elements that URDF does not define are not read: {listed(names)}",) if names else ()


def _child(
    joint: Element,
    index: int,
    links: dict[str, Element],
    bodies: list[Body],
    hinges: list[Joint],
) -> Body:
    """Return the child of a joint on body ``index``; append the joint if it is a hinge."""
    parent = bodies[index]
    rotation, position = _origin(joint)
    rotation, position = parent.rotation @ rotation, parent.position + parent.rotation @ position
    name, kind = joint.one("child").get("link"), joint.get("type")
    axis, limit = joint.first("axis"), joint.first("limit")
    along = rotation @ (direction(axis, "xyz") if axis else np.array([1.0, 0.0, 0.0]))
    body = _body(links[name], name, index, rotation, position)
    if kind in _HINGES | {"prismatic"}:
        limited = kind != "continuous"
        if not (limited and limit and _is_locked(limit)):
            body.motions.append(Motion(joint.get("name"), along, kind in _HINGES, limited))
    elif kind != "fixed":
        body.motions.append(Motion(joint.get("name")))
    if kind in _HINGES:
        hinges.append(
            Joint(
                joint.get("name"),
                len(bodies),
                along,
                position,
                number(limit, "velocity", 0.0) or None if limit else None,
                number(limit, "effort", 0.0) or None if limit else None,
                turns_freely=kind == "continuous",
            )
        )
    return body


def _is_locked(limit: Element) -> bool:
    """Return whether equal limits are given, which lock a joint."""
    given = {"lower", "upper"} & limit.attributes.keys()
    lower, upper = number(limit, "lower", 0.0), number(limit, "upper", 0.0)
    return bool(given) and abs(upper - lower) < _LOCKED


def _body(link: Element, name: str, parent: int, rotation: Matrix, position: Vector) -> Body:
    body = Body(name, parent, rotation, position)
    inertial = link.first("inertial")
    if inertial is not None:
        turned, offset = _origin(inertial)
        body.mass = positive_or_zero(inertial.one("mass"), "value")
        body.com = position + rotation @ offset
        inertia = inertial.first("inertia")
        if inertia is not None:
            xx, xy, xz, yy, yz, zz = (
                number(inertia, key, 0.0) for key in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
            )
            tensor = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
            up = (rotation @ turned)[2]
            body.yaw_inertia = float(up @ tensor @ up)
    tag = "collision" if any(_shapes(link, "collision", body)) else "visual"
    body.shapes = _shapes(link, tag, body)
    return body


def _shapes(link: Element, tag: str, body: Body) -> list[Shape]:
    """Return the shapes of a link; meshes are not read."""
    shapes = []
    for each in link.all(tag):
        geometry = each.first("geometry")
        if geometry is None:
            continue
        turned, offset = _origin(each)
        axes, centre = body.rotation @ turned, body.position + body.rotation @ offset
        for shape in geometry.children:
            if shape.tag == "box":
                half = 0.5 * numbers(shape, "size", 3)
            elif shape.tag == "cylinder":
                radius = number(shape, "radius")
                half = np.array([radius, radius, 0.5 * number(shape, "length")])
            elif shape.tag == "sphere":
                half = np.full(3, number(shape, "radius"))
            else:
                continue
            shapes.append(Shape(centre, axes, np.abs(half), shape.tag != "box"))
    return shapes


def _origin(element: Element) -> tuple[Matrix, Vector]:
    """Return rotation and translation of the child `origin`, which may be absent."""
    origin = element.first("origin")
    if origin is None:
        return np.eye(3), np.zeros(3)
    rotation = Rotation.from_euler("xyz", numbers(origin, "rpy", 3, (0.0, 0.0, 0.0)))
    return rotation.as_matrix(), numbers(origin, "xyz", 3, (0.0, 0.0, 0.0))
