"""Bodies and joints of a robot, and the wheels among them."""

from __future__ import annotations

import re
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from math import hypot

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidRobot, one_line, suggestion
from omnidrive.robot.imports.draft import RobotDraft
from omnidrive.robot.imports.wheel_mounts import Axle, Vector, is_roller, listed, mount_wheels, tidy
from omnidrive.robot.robot import MAX_WHEELS

Matrix = Float[Array, "3 3"]

_WHEEL_NAME = re.compile(r"wheel|mecanum|omni|rueda|roue|rad(?![a-z])|tire|tyre", re.IGNORECASE)
_OTHER_NAME = re.compile(r"roller|caster|castor|steer|swivel|suspension|spring", re.IGNORECASE)
_ROLLER_NAME = re.compile(r"roller", re.IGNORECASE)
_MAX_AXIS_SLOPE = 0.1  # vertical component of the axis of a wheel
_VERTICAL = 0.9  # vertical component of the axis of a suspension
_SAME = 0.01  # relative difference of wheel radii


@dataclass(slots=True)
class Body:
    """Rigid body; positions and axes are in the frame of the robot's base.

    Attributes:
        name: Name.
        parent: Index of the parent body; -1 for the base.
        rotation: Axes of the body's frame, as columns.
        position: Origin of the body's frame, m.
        mass: Mass, kg; 0: unknown or massless.
        com: Centre of mass, m.
        yaw_inertia: Inertia about the vertical through its centre of mass, kg m^2.
        shapes: Shapes.
        motions: How it may move relative to its parent.
    """

    name: str
    parent: int
    rotation: Matrix
    position: Vector
    mass: float = 0.0
    com: Vector = field(default_factory=lambda: np.zeros(3))
    yaw_inertia: float = 0.0
    shapes: list[Shape] = field(default_factory=list)
    motions: list[Motion] = field(default_factory=list)


@dataclass(frozen=True, eq=False, slots=True)
class Shape:
    """Ellipsoid, cylinder, capsule or box, as centre and half axes.

    Attributes:
        centre: Centre in the frame of the base, m.
        axes: Axes of the shape in the frame of the base, as columns.
        half: Half lengths along the axes, m.
        is_round: Whether the radius is the half length along x, as for cylinders along z.
    """

    centre: Vector
    axes: Matrix
    half: Vector
    is_round: bool

    @property
    def reach(self) -> float:
        """Largest horizontal distance from the origin, by the corners of the enclosing box, m."""
        if self.is_round and abs(self.axes[2, 2]) > 1.0 - 1e-6:
            return hypot(*self.centre[:2]) + float(self.half[0])
        signs = np.array(np.meshgrid([-1, 1], [-1, 1], [-1, 1])).reshape(3, -1)
        corners = self.centre[:, None] + self.axes @ (self.half[:, None] * signs)
        return float(np.hypot(corners[0], corners[1]).max())


@dataclass(frozen=True, eq=False, slots=True)
class Motion:
    """Freedom of a body relative to its parent.

    Attributes:
        joint: Name of the joint.
        axis: Unit vector in the frame of the base; None: more than one, as of a ball joint.
        turns: Whether it is a rotation about this axis, else a translation along it.
        is_limited: Whether it has limits.
    """

    joint: str
    axis: Vector | None = None
    turns: bool = False
    is_limited: bool = False

    @property
    def is_suspension(self) -> bool:
        """Whether a wheel on it keeps its place and direction, seen from above.

        Vertical slides and hinges with a horizontal axis and limits, such as rockers, do so.
        """
        if self.axis is None:
            return False
        if self.turns:
            return self.is_limited and abs(float(self.axis[2])) < _MAX_AXIS_SLOPE
        return abs(float(self.axis[2])) > _VERTICAL


@dataclass(frozen=True, eq=False, slots=True)
class Joint:
    """Hinge.

    Attributes:
        name: Name.
        body: Index of the body that it turns.
        axis: Unit vector in the frame of the base.
        point: A point of the axis, m.
        max_speed: Speed limit, rad/s; None: unknown.
        max_torque: Torque limit, N m; None: unknown.
        servo_gain: Gain of a velocity servo, N m s/rad; None: unknown.
        inertia: Inertia of the motor, kg m^2; None: unknown.
        turns_freely: Whether it has no limits of its angle.
    """

    name: str
    body: int
    axis: Vector
    point: Vector
    max_speed: float | None = None
    max_torque: float | None = None
    servo_gain: float | None = None
    inertia: float | None = None
    turns_freely: bool = True


@dataclass(frozen=True, eq=False, slots=True)
class Mechanism:
    """Tree of bodies; the first is the base.

    Attributes:
        name: Name.
        bodies: The bodies; parents come before children.
        joints: The hinges; parents come before children.
        words: Names and other texts of the description.
        warnings: Parts of the description that are not read.
    """

    name: str
    bodies: list[Body]
    joints: list[Joint]
    words: str = ""
    warnings: tuple[str, ...] = ()

    def draft(
        self, names: Sequence[str] = (), radius: float | None = None, *, mecanum: bool = False
    ) -> RobotDraft:
        """Return the draft of the robot with these wheels.

        Args:
            names: Names of the wheel joints; empty: found by axis and name.
            radius: Radius of the wheels, m; None: that of their shapes.
            mecanum: Whether wheels without rollers are mecanum wheels; False: by axles and names.

        Raises:
            InvalidRobot: There are no such joints, they are not fixed to the base, or the radius
                is unknown.
        """
        wheels = self._named_wheels(names) if names else self._found_wheels()
        suspension = self._suspension(wheels)
        groups = [self._descendants(joint.body) for joint in wheels]
        rollers = [self._rollers(joint, group) for joint, group in zip(wheels, groups, strict=True)]
        found = radius if radius is not None else self._radius(wheels, groups)
        axles = [
            Axle(wheel.name, wheel.axis, wheel.point, tuple((j.axis, j.point) for j in group))
            for wheel, group in zip(wheels, rollers, strict=True)
        ]
        mounting = mount_wheels(axles, self.words, mecanum=mecanum)
        draft = RobotDraft(self.name, mounting.mounts, found)
        text = f"{len(wheels)} wheels, in this order: {', '.join(joint.name for joint in wheels)}"
        if names:
            draft.read.append(text)
        else:
            draft.guessed.append(f"{text} (hinges with a horizontal axis and the name of a wheel)")
        (draft.read if mounting.is_read else draft.guessed).append(mounting.fact)
        draft.warnings += [mounting.warning] if mounting.warning else []
        draft.warnings += self.warnings
        if suspension:
            draft.guessed.append(f"a rigid suspension, without {listed(suspension)}")
        draft.read.append("positions and axes of the wheels")
        if radius is None:
            draft.read.append(f"wheel radius {found:g} m")
        self._add_masses(draft, wheels, groups, found)
        self._add_rollers(draft, rollers)
        _add_motors(draft, wheels)
        reach = max((shape.reach for body in self.bodies for shape in body.shapes), default=0.0)
        if reach > 0.0:
            draft.body_radius = reach
            draft.read.append(f"body radius {reach:.4g} m, that of the shapes")
        _note_origin(draft)
        return draft

    def _motions(self, wheels: Sequence[Joint]) -> list[list[Motion]]:
        """Return the motions of each wheel relative to the part that carries all of them."""
        if not wheels:
            return []
        chains = []
        for wheel in wheels:
            chain, body = [], wheel.body
            while body >= 0:
                chain.append(body)
                body = self.bodies[body].parent
            chains.append(chain)
        common = set(chains[0][1:]).intersection(*(chain[1:] for chain in chains))
        return [
            [
                motion
                for body in chain
                if body not in common
                for motion in self.bodies[body].motions
                if motion.joint != wheel.name
            ]
            for wheel, chain in zip(wheels, chains, strict=True)
        ]

    def _suspension(self, wheels: Sequence[Joint]) -> list[str]:
        """Return the joints of the wheels' suspension; refuse wheels that are steered."""
        pairs = list(zip(wheels, self._motions(wheels), strict=True))
        moved = {w.name: m.joint for w, ms in pairs for m in ms if not m.is_suspension}
        if moved:
            on = listed([f"{wheel} on {joint}" for wheel, joint in moved.items()])
            raise InvalidRobot(
                f"these wheels are on joints that move relative to the base: {on}; steered wheels, "
                "casters and rollers are not supported: name wheels with a fixed axle by --wheel"
            )
        return list(dict.fromkeys(motion.joint for _, ms in pairs for motion in ms))

    def _named_wheels(self, names: Sequence[str]) -> list[Joint]:
        joints = {joint.name: joint for joint in self.joints}
        for name in names:
            if name not in joints:
                raise InvalidRobot(f"there is no hinge '{name[:60]}'{suggestion(name, joints)}")
        return [joints[name] for name in names]

    def _found_wheels(self) -> list[Joint]:
        """Return the hinges that look like wheels."""
        chosen = self._wheel_like(_OTHER_NAME)
        if len(chosen) < 3:
            self._suspension(self._wheel_like(_ROLLER_NAME))  # it refuses casters
        if not 3 <= len(chosen) <= MAX_WHEELS:
            hinges = [j.name for j in self.joints if abs(j.axis[2]) < _MAX_AXIS_SLOPE]
            count = f"more than {MAX_WHEELS}" if len(chosen) > MAX_WHEELS else len(chosen)
            raise InvalidRobot(
                f"{count} wheels found by axis and name, need 3 to {MAX_WHEELS}; name them "
                f"by --wheel JOINT, once per wheel; hinges with a horizontal axis: "
                f"{listed(hinges) or 'none'}"
            )
        return chosen

    def _wheel_like(self, other: re.Pattern[str]) -> list[Joint]:
        """Return free hinges with a horizontal axis and the name of a wheel, not of ``other``."""
        chosen: list[Joint] = []
        inside: set[int] = set()
        for joint in self.joints:  # parents come before children
            name = f"{joint.name} {self.bodies[joint.body].name}"
            if (
                joint.turns_freely
                and joint.body not in inside
                and abs(joint.axis[2]) < _MAX_AXIS_SLOPE
                and _WHEEL_NAME.search(name)
                and not other.search(name)
            ):
                chosen.append(joint)
                if len(chosen) > MAX_WHEELS:
                    break
                inside |= self._descendants(joint.body)
        return chosen

    def _descendants(self, body: int) -> set[int]:
        """Return a body and all bodies that it carries."""
        found = {body}
        for i in range(body + 1, len(self.bodies)):  # parents come before children
            if self.bodies[i].parent in found:
                found.add(i)
        return found

    def _rollers(self, wheel: Joint, group: Collection[int]) -> list[Joint]:
        return [
            j
            for j in self.joints
            if j.body in group and j.body != wheel.body and is_roller(j.axis, wheel.axis)
        ]

    def _radius(self, wheels: Sequence[Joint], groups: Sequence[Collection[int]]) -> float:
        """Return the radius of the wheels' shapes."""
        radii = []
        for wheel, group in zip(wheels, groups, strict=True):
            shapes = [shape for i in group for shape in self.bodies[i].shapes]
            found = max((_extent(shape, wheel) for shape in shapes), default=0.0)
            if not found > 0.0:
                raise InvalidRobot(
                    f"the radius of the wheel '{wheel.name[:60]}' is unknown, because it has no "
                    "cylinder, sphere or ellipsoid (meshes are not read); give it by --wheel-radius"
                )
            radii.append(found)
        if max(radii) > (1.0 + _SAME) * min(radii):
            raise InvalidRobot(
                f"the wheels have radii of {min(radii):.4g} to {max(radii):.4g} m; all wheels of a "
                "robot are equal here: give one radius by --wheel-radius, or select wheels by "
                "--wheel"
            )
        return float(f"{np.mean(radii):.9g}")

    def _add_masses(
        self,
        draft: RobotDraft,
        wheels: Sequence[Joint],
        groups: Sequence[Collection[int]],
        radius: float,
    ) -> None:
        for body in self.bodies:
            if not np.isfinite([body.mass, *body.com, body.yaw_inertia]).all():
                raise InvalidRobot(
                    f"mass, centre of mass or inertia of '{one_line(body.name, 60)}' is not finite"
                )
        total = sum(body.mass for body in self.bodies)
        if not total > 0.0:
            return
        com = sum((body.mass * body.com for body in self.bodies), np.zeros(3)) / total
        floor = float(np.mean([joint.point[2] for joint in wheels])) - radius
        draft.mass = float(f"{total:.9g}")
        draft.com = (tidy(com[0]), tidy(com[1]))
        draft.read.append(f"mass {total:.4g} kg, centre of mass ({com[0]:.3g}, {com[1]:.3g}) m")
        if com[2] > floor:
            draft.com_height = float(f"{com[2] - floor:.9g}")
        each = sum(self.bodies[i].mass for group in groups for i in group) / len(wheels)
        if each > 0.0:
            draft.wheel_mass = each
            draft.read.append(f"mass of a wheel {each:.4g} kg")
        in_wheels = set().union(*groups)
        frame = [body for i, body in enumerate(self.bodies) if i not in in_wheels and body.mass]
        mass = sum(body.mass for body in frame)
        if mass > 0.0 and any(body.yaw_inertia > 0.0 for body in frame):
            centre = sum((body.mass * body.com for body in frame), np.zeros(3)) / mass
            inertia = sum(
                body.yaw_inertia + body.mass * float(((body.com - centre)[:2] ** 2).sum())
                for body in frame
            )
            draft.body_inertia = float(f"{inertia:.9g}")
            draft.read.append(f"yaw inertia of the body {inertia:.4g} kg m^2")

    def _add_rollers(self, draft: RobotDraft, rollers: Sequence[Sequence[Joint]]) -> None:
        if not all(rollers):
            return
        bodies = [self.bodies[joint.body] for group in rollers for joint in group]
        draft.rollers = len(rollers[0])
        shapes = [shape for body in bodies for shape in body.shapes]
        if shapes:
            draft.roller_radius = float(f"{np.mean([min(s.half) for s in shapes]):.9g}")
        masses = [body.mass for body in bodies]
        if min(masses) > 0.0:
            draft.roller_mass = float(f"{np.mean(masses):.9g}")
        draft.read.append(f"{draft.rollers} rollers per wheel")


def _extent(shape: Shape, wheel: Joint) -> float:
    """Return how far a round shape reaches from the axis of a wheel, m; 0 for another shape."""
    if not shape.is_round:
        return 0.0
    offset = shape.centre - wheel.point
    radial = float(np.linalg.norm(offset - (offset @ wheel.axis) * wheel.axis))
    return radial + float(shape.half[0])


def _add_motors(draft: RobotDraft, wheels: Sequence[Joint]) -> None:
    for key, attribute, unit in (
        ("max_wheel_speed", "max_speed", "rad/s"),
        ("max_torque", "max_torque", "N m"),
        ("servo_gain", "servo_gain", "N m s/rad"),
        ("rotor_inertia", "inertia", "kg m^2"),
    ):
        values = [getattr(joint, attribute) for joint in wheels]
        if None not in values and min(values) > 0.0:
            setattr(draft, key, min(values))
            draft.read.append(f"{key} {min(values):g} {unit}")


def _note_origin(draft: RobotDraft) -> None:
    x, y = np.mean([(m.x, m.y) for m in draft.mounts], axis=0)
    if hypot(x, y) > 0.05 * max(hypot(m.x - x, m.y - y) for m in draft.mounts):
        draft.guessed.append(
            f"frame B is that of the base, although the wheels' centre is at ({x:.3g}, {y:.3g}) m"
        )
