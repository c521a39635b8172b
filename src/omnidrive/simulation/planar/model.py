"""The numbers by which the planar robot moves, under given disturbances."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt, tan
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.robot import GRAVITY, Mount, OmniWheel, Robot
from omnidrive.simulation.disturbances.disturbances import WEAK, Disturbances, Motor, Payload
from omnidrive.simulation.mujoco.mjcf_wheels import ROLLER_ARMATURE, ROLLER_DAMPING

FRAME = np.dtype(
    [
        ("mass", float),  # kg, wheels and payload included
        ("com_x", float),  # centre of mass in B, m
        ("com_y", float),
        ("com_height", float),  # above the floor, m
        ("inertia", float),  # yaw, about B's origin, kg m^2
        ("pull_x", float),  # gravity along the floor, in W, m/s^2
        ("pull_y", float),
        ("max_wheel_speed", float),  # rad/s, of commands
        ("motor_lag", float),  # s
        ("patch_x", float),  # disc of other friction, in W, m; none if its radius is negative
        ("patch_y", float),
        ("patch_radius", float),
        ("patch_friction", float),
    ]
)
"""What there is once per robot."""

WHEEL = np.dtype(
    [
        ("push_x", float),  # unit vector along which the wheel pushes, in B
        ("push_y", float),
        ("push_turn", float),  # its moment about B's origin, m
        ("radius", float),  # speed of the push per wheel speed without slip, m/rad
        ("pitch", float),  # angle from roller to roller, rad
        ("axle_x", float),  # unit vector along the axle, in B
        ("axle_y", float),
        ("lever", float),  # moment of the push per contact's shift along the axle
        ("row", float),  # distance of two rows from the wheel's middle, m
        ("gauss_markov", float),  # how far along the axle the contact gets on a tilted roller, m
        ("roll", float),  # speed of a roller's surface per wheel speed, m/rad
        ("roller_mass", float),  # what a roller's inertia counts for at the floor, kg
        ("roller_decay", float),  # rate at which rollers in the air come to rest, 1/s
        ("drive_x", float),  # wheel speed asked for, per unit of commanded twist, rad/m
        ("drive_y", float),
        ("drive_turn", float),
        ("x", float),  # place in B, m
        ("y", float),
        ("inertia", float),  # of all that turns with the wheel, about the axle, kg m^2
        ("gain", float),  # of the servo, N m s/rad
        ("limit", float),  # most torque of the motor, N m
        ("locked", bool),  # the wheel does not turn
        ("friction", float),  # Coulomb coefficient
        ("load", float),  # on the floor at rest, N
        ("share_x", float),  # less of it per moment of weight or push along x of B, 1/m
        ("share_y", float),
    ]
)
"""What there is once per wheel."""

_LOCK = 1e6  # a locked wheel turns as if so many of the robot's masses moved at its rim
_TORQUE = {Motor.HEALTHY: 1.0, Motor.WEAK: WEAK, Motor.DEAD: 0.0, Motor.LOCKED: 1.0}


class Model(NamedTuple):
    """The robot as the kernel knows it."""

    frame: Array
    """One record of :data:`FRAME`."""
    wheels: Array
    """A record of :data:`WHEEL` per wheel."""


def model_of(robot: Robot, disturbances: Disturbances) -> Model:
    """``robot`` as ``disturbances`` let it move.

    A payload counts at the height of the robot's centre of mass. Poses on a slope are those seen
    along the floor's normal.

    Raises:
        InvalidInput: The disturbances speak of wheels that the robot does not have.
    """
    frame, wheels = np.zeros(1, FRAME), np.zeros(len(robot.mounts), WHEEL)
    rise = hypot(1.0, *disturbances.slope)
    _fill_frame(frame, robot, disturbances, rise)
    _fill_mounts(wheels, robot)
    _fill_motors(wheels, robot, disturbances.motors)
    _fill_loads(wheels, robot, frame, GRAVITY / rise)
    return Model(frame, wheels)


def _fill_frame(frame: Array, robot: Robot, disturbances: Disturbances, rise: float) -> None:
    payload = disturbances.payload or Payload(0.0, 0.0, 0.0)
    mass = robot.mass + payload.mass
    frame["mass"] = mass
    frame["com_x"] = (robot.mass * robot.com[0] + payload.mass * payload.x) / mass
    frame["com_y"] = (robot.mass * robot.com[1] + payload.mass * payload.y) / mass
    frame["com_height"] = robot.com_height
    wheels = sum(upright_inertia(robot.wheel, mount) for mount in robot.mounts)
    carried = payload.mass * (payload.x**2 + payload.y**2)
    frame["inertia"] = robot.yaw_inertia + wheels + carried
    frame["pull_x"], frame["pull_y"] = (-GRAVITY * s / rise for s in disturbances.slope)
    frame["max_wheel_speed"], frame["motor_lag"] = robot.max_wheel_speed, robot.motor_lag
    frame["patch_radius"] = -1.0
    if disturbances.patch is not None:
        for name, value in disturbances.patch._asdict().items():
            frame[f"patch_{name}"] = value


def _fill_mounts(wheels: Array, robot: Robot) -> None:
    rolling = np.array([cos(mount.roller_angle) for mount in robot.mounts])
    names = ("x", "y", "turn")
    for k, name in enumerate(names):
        wheels[f"push_{name}"] = robot.rim_jacobian[:, k] * rolling
        wheels[f"drive_{name}"] = robot.drive.jacobian[:, k]
    wheels["radius"] = robot.wheel.radius * rolling
    wheels["x"], wheels["y"] = np.array([(m.x, m.y) for m in robot.mounts]).T
    wheels["inertia"] = [axle_inertia(robot.wheel, mount) for mount in robot.mounts]
    _fill_rollers(wheels, robot)
    wheels["friction"] = robot.friction


def _fill_rollers(wheels: Array, robot: Robot) -> None:
    wheel, mounts = robot.wheel, robot.mounts
    pitch, tilts = 2.0 * pi / wheel.rollers, np.array([mount.roller_angle for mount in mounts])
    wheels["pitch"] = pitch
    axles = np.array([mount.axle_angle for mount in mounts])
    wheels["axle_x"], wheels["axle_y"] = np.cos(axles), np.sin(axles)
    wheels["lever"] = np.cos(tilts)
    wheels["row"] = 0.5 * wheel.row_gap if wheel.rows == 2 else 0.0
    # ahead of the axle a tilted roller touches the floor behind its middle, so beside the wheel's
    wheels["gauss_markov"] = (wheel.radius - wheel.roller_radius) * tan(0.5 * pitch) * np.tan(tilts)
    wheels["roll"] = wheel.radius * np.sin(tilts)
    inertia = 0.5 * wheel.roller_mass * wheel.roller_radius**2 + ROLLER_ARMATURE
    radii = np.array([handing_over_radius(wheel, mount) for mount in mounts])
    wheels["roller_mass"] = inertia / radii**2
    wheels["roller_decay"] = ROLLER_DAMPING / inertia


def _fill_motors(wheels: Array, robot: Robot, motors: tuple[Motor, ...]) -> None:
    if motors and len(motors) != len(wheels):
        raise InvalidInput(f"disturbances of {len(motors)} motors for {len(wheels)} wheels")
    states = motors or (Motor.HEALTHY,) * len(wheels)
    wheels["gain"] = robot.servo_gain
    wheels["limit"] = [robot.max_torque * _TORQUE[state] for state in states]
    wheels["locked"] = [state == Motor.LOCKED for state in states]
    held = _LOCK * robot.mass * wheels["radius"] ** 2
    wheels["inertia"] = np.where(wheels["locked"], held, wheels["inertia"])


def _fill_loads(wheels: Array, robot: Robot, frame: Array, gravity: float) -> None:
    """As :attr:`Robot.loads`, and how moments shift them."""
    sharing = np.linalg.pinv(np.array([np.ones(len(wheels)), wheels["x"], wheels["y"]]))
    weight = float(frame["mass"][0]) * gravity
    at_rest = [1.0, float(frame["com_x"][0]), float(frame["com_y"][0])]
    wheels["load"] = weight * (sharing @ at_rest)
    wheels["share_x"], wheels["share_y"] = sharing[:, 1], sharing[:, 2]


def mass_matrix(frame: Array) -> Float[Array, "3 3"]:
    """M of ``momentum = M @ twist``, about B's origin and in B; kg, kg m and kg m^2."""
    m, cx, cy, inertia = (float(frame[name][0]) for name in ("mass", "com_x", "com_y", "inertia"))
    return np.array([[m, 0.0, -m * cy], [0.0, m, m * cx], [-m * cy, m * cx, inertia]])


def axle_inertia(wheel: OmniWheel, mount: Mount) -> float:
    """Of rotor, hub and rollers about the axle, in kg m^2."""
    ring = (wheel.radius - wheel.roller_radius) ** 2 + _own(wheel, mount)
    return wheel.rotor_inertia + wheel.hub_inertia + _rollers(wheel) * ring


def upright_inertia(wheel: OmniWheel, mount: Mount) -> float:
    """Of a wheel about the vertical through its middle, in kg m^2."""
    hub = 0.5 * wheel.hub_inertia + wheel.mass * wheel.row_gap**2 / 12.0
    ring = 0.5 * (wheel.radius - wheel.roller_radius) ** 2
    own = 0.5 * (2.5 * wheel.roller_radius**2 - _own(wheel, mount))
    apart = 0.25 * wheel.row_gap**2 if wheel.rows == 2 else 0.0
    return hub + _rollers(wheel) * (ring + own + apart)


def handing_over_radius(wheel: OmniWheel, mount: Mount) -> float:
    """Radius in m of a roller where it touches the floor at first and at last.

    Half a roller's share of a turn from its middle; it is an ellipsoid on which the wheel stands
    as high there as on its middle.
    """
    turned, b = pi / wheel.rollers, wheel.roller_radius
    support = wheel.radius - (wheel.radius - b) * cos(turned)
    return b * b * sqrt(1.0 - (sin(turned) * cos(mount.roller_angle)) ** 2) / support


def _rollers(wheel: OmniWheel) -> float:
    """Mass of all rollers, in kg."""
    return wheel.rollers * wheel.roller_mass


def _own(wheel: OmniWheel, mount: Mount) -> float:
    """Inertia per mass of a roller about a line through its middle as the axle, in m^2.

    About its own axis it is half of ``b^2``, across that ``b^2``.
    """
    return wheel.roller_radius**2 * (1.0 - 0.5 * sin(mount.roller_angle) ** 2)
