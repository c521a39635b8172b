"""Parameters of the planar robot under given disturbances."""

from __future__ import annotations

from math import cos, hypot, pi, sin, sqrt
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.errors import InvalidInput
from omnidrive.robot import GRAVITY, Mount, OmniWheel, Robot
from omnidrive.robot.wheel import contact_drift
from omnidrive.simulation.disturbances.disturbances import (
    WEAK_TORQUE_FACTOR,
    Disturbances,
    Motor,
    Payload,
)
from omnidrive.simulation.mujoco.wheels import ROLLER_ARMATURE, ROLLER_DAMPING

BODY = np.dtype(
    [
        ("mass", float),  # with wheels and payload, kg
        ("com_x", float),  # centre of mass in B, m
        ("com_y", float),
        ("com_height", float),  # above the floor, m
        ("inertia", float),  # yaw inertia about B's origin, kg m^2
        ("gravity_x", float),  # component of gravity along the floor, in W, m/s^2
        ("gravity_y", float),
        ("max_wheel_speed", float),  # limit of commanded wheel speeds, rad/s
        ("motor_lag", float),  # s
        ("patch_x", float),  # centre of the disc of other friction, in W, m
        ("patch_y", float),
        ("patch_radius", float),  # m; negative: no disc
        ("patch_friction", float),
    ]
)
"""Record of the body."""

WHEEL = np.dtype(
    [
        ("direction_x", float),  # unit vector of the wheel's force, in B
        ("direction_y", float),
        ("direction_yaw", float),  # its moment about B's origin, m
        ("radius", float),  # speed along the force per wheel speed without slip, m/rad
        ("pitch", float),  # angle from roller to roller, rad
        ("axle_x", float),  # unit vector along the axle, in B
        ("axle_y", float),
        ("moment_per_offset", float),  # change of direction_yaw per offset of the contact
        ("row_offset", float),  # distance of each of two rows from the wheel's centre, m
        ("contact_drift", float),  # largest offset of the contact on a tilted roller, m
        ("roller_speed_ratio", float),  # surface speed of a roller per wheel speed, m/rad
        ("roller_mass", float),  # effective mass of a roller at its contact, kg
        ("roller_decay", float),  # rate at which rollers in the air slow down, 1/s
        ("drive_x", float),  # commanded wheel speed per unit of commanded twist, rad/m
        ("drive_y", float),
        ("drive_yaw", float),
        ("x", float),  # position in B, m
        ("y", float),
        ("inertia", float),  # of all parts that turn with the wheel, about the axle, kg m^2
        ("gain", float),  # of the servo, N m s/rad
        ("limit", float),  # largest torque of the motor, N m
        ("locked", bool),  # whether the wheel cannot turn
        ("friction", float),  # Coulomb coefficient
        ("load", float),  # normal force at rest, N
        ("share_x", float),  # decrease of the load per moment of a force along x of B, 1/m
        ("share_y", float),
    ]
)
"""Record of one wheel."""

_LOCKED_INERTIA = 1e6  # inertia of a locked wheel, over the robot's mass at the wheel's radius
_TORQUE_SHARE = {
    Motor.HEALTHY: 1.0,
    Motor.WEAK: WEAK_TORQUE_FACTOR,
    Motor.DEAD: 0.0,
    Motor.LOCKED: 1.0,
}


class PlanarModel(NamedTuple):
    """Parameters of the robot as arrays for the compiled functions."""

    body: Array
    """One record of :data:`BODY`."""
    wheels: Array
    """One record of :data:`WHEEL` per wheel."""


def planar_model(robot: Robot, disturbances: Disturbances) -> PlanarModel:
    """Return the parameters of ``robot`` under ``disturbances``.

    A payload is placed at the height of the robot's centre of mass. On a slope, poses are those in
    the plane of the floor.

    Raises:
        InvalidInput: The number of motors in ``disturbances`` differs from the number of wheels.
    """
    body, wheels = np.zeros(1, BODY), np.zeros(len(robot.mounts), WHEEL)
    rise = hypot(1.0, *disturbances.slope)
    _fill_body(body, robot, disturbances, rise)
    _fill_mounts(wheels, robot)
    _fill_motors(wheels, robot, disturbances.motors)
    _fill_loads(wheels, robot, body, GRAVITY / rise)
    return PlanarModel(body, wheels)


def _fill_body(body: Array, robot: Robot, disturbances: Disturbances, rise: float) -> None:
    payload = disturbances.payload or Payload(0.0, 0.0, 0.0)
    mass = robot.mass + payload.mass
    body["mass"] = mass
    body["com_x"] = (robot.mass * robot.com[0] + payload.mass * payload.x) / mass
    body["com_y"] = (robot.mass * robot.com[1] + payload.mass * payload.y) / mass
    body["com_height"] = robot.com_height
    wheels = sum(wheel_yaw_inertia(robot.wheel, mount) for mount in robot.mounts)
    carried = payload.mass * (payload.x**2 + payload.y**2)
    body["inertia"] = robot.yaw_inertia + wheels + carried
    body["gravity_x"], body["gravity_y"] = (-GRAVITY * s / rise for s in disturbances.slope)
    body["max_wheel_speed"], body["motor_lag"] = robot.max_wheel_speed, robot.motor_lag
    body["patch_radius"] = -1.0
    if disturbances.patch is not None:
        for name, value in disturbances.patch._asdict().items():
            body[f"patch_{name}"] = value


def _fill_mounts(wheels: Array, robot: Robot) -> None:
    rolling = np.array([cos(mount.roller_angle) for mount in robot.mounts])
    for k, name in enumerate(("x", "y", "yaw")):
        wheels[f"direction_{name}"] = robot.rim_jacobian[:, k] * rolling
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
    wheels["moment_per_offset"] = np.cos(tilts)
    wheels["row_offset"] = 0.5 * wheel.row_gap if wheel.rows == 2 else 0.0
    wheels["contact_drift"] = [contact_drift(wheel, tilt) for tilt in tilts.tolist()]
    wheels["roller_speed_ratio"] = wheel.radius * np.sin(tilts)
    inertia = 0.5 * wheel.roller_mass * wheel.roller_radius**2 + ROLLER_ARMATURE
    radii = np.array([handover_radius(wheel, mount) for mount in mounts])
    wheels["roller_mass"] = inertia / radii**2
    wheels["roller_decay"] = ROLLER_DAMPING / inertia


def _fill_motors(wheels: Array, robot: Robot, motors: tuple[Motor, ...]) -> None:
    if motors and len(motors) != len(wheels):
        raise InvalidInput(f"disturbances of {len(motors)} motors for {len(wheels)} wheels")
    states = motors or (Motor.HEALTHY,) * len(wheels)
    wheels["gain"] = robot.servo_gain
    wheels["limit"] = [robot.max_torque * _TORQUE_SHARE[state] for state in states]
    wheels["locked"] = [state == Motor.LOCKED for state in states]
    locked = _LOCKED_INERTIA * robot.mass * wheels["radius"] ** 2
    wheels["inertia"] = np.where(wheels["locked"], locked, wheels["inertia"])


def _fill_loads(wheels: Array, robot: Robot, body: Array, gravity: float) -> None:
    """Set the loads as :attr:`Robot.loads` does, and their change by moments."""
    sharing = np.linalg.pinv(np.array([np.ones(len(wheels)), wheels["x"], wheels["y"]]))
    weight = float(body["mass"][0]) * gravity
    at_rest = [1.0, float(body["com_x"][0]), float(body["com_y"][0])]
    wheels["load"] = weight * (sharing @ at_rest)
    wheels["share_x"], wheels["share_y"] = sharing[:, 1], sharing[:, 2]


def mass_matrix(body: Array) -> Float[Array, "3 3"]:
    """Return M of ``momentum = M @ twist``, about B's origin and in B; kg, kg m and kg m^2."""
    m, cx, cy, inertia = (float(body[name][0]) for name in ("mass", "com_x", "com_y", "inertia"))
    return np.array([[m, 0.0, -m * cy], [0.0, m, m * cx], [-m * cy, m * cx, inertia]])


def servo_lags(robot: Robot) -> tuple[float, float]:
    """Return the time constants of translation and rotation while no wheel slips, s.

    They are the inertia, with that of the wheels about their axles, over the damping by the servos;
    for wheels whose columns of the wheel matrix are orthogonal.
    """
    body, wheels = planar_model(robot, Disturbances())
    rows = np.column_stack([wheels[f"direction_{name}"] for name in ("x", "y", "yaw")])
    per_square = 1.0 / wheels["radius"][:, None] ** 2
    inertia = mass_matrix(body) + rows.T @ (rows * wheels["inertia"][:, None] * per_square)
    damping = rows.T @ (rows * wheels["gain"][:, None] * per_square)
    lags = np.diag(inertia) / np.diag(damping)
    return float(lags[0]), float(lags[2])


def axle_inertia(wheel: OmniWheel, mount: Mount) -> float:
    """Return the inertia of rotor, hub and rollers about the axle, kg m^2."""
    ring = (wheel.radius - wheel.roller_radius) ** 2 + _roller_inertia_per_mass(wheel, mount)
    return wheel.rotor_inertia + wheel.hub_inertia + _rollers_mass(wheel) * ring


def wheel_yaw_inertia(wheel: OmniWheel, mount: Mount) -> float:
    """Return the inertia of a wheel about the vertical through its centre, kg m^2."""
    hub = 0.5 * wheel.hub_inertia + wheel.mass * wheel.row_gap**2 / 12.0
    ring = 0.5 * (wheel.radius - wheel.roller_radius) ** 2
    own = 0.5 * (2.5 * wheel.roller_radius**2 - _roller_inertia_per_mass(wheel, mount))
    rows = 0.25 * wheel.row_gap**2 if wheel.rows == 2 else 0.0
    return hub + _rollers_mass(wheel) * (ring + own + rows)


def handover_radius(wheel: OmniWheel, mount: Mount) -> float:
    """Return the radius of a roller at its first and last contact with the floor, m.

    These contacts are half a pitch from the roller's centre. The roller is an ellipsoid on which
    the wheel is as high there as at its centre.
    """
    turned, b = pi / wheel.rollers, wheel.roller_radius
    support = wheel.radius - (wheel.radius - b) * cos(turned)
    return b * b * sqrt(1.0 - (sin(turned) * cos(mount.roller_angle)) ** 2) / support


def _rollers_mass(wheel: OmniWheel) -> float:
    """Return the mass of all rollers, kg."""
    return wheel.rollers * wheel.roller_mass


def _roller_inertia_per_mass(wheel: OmniWheel, mount: Mount) -> float:
    """Return the inertia per mass of a roller about its centre, along the wheel's axle, m^2.

    It is ``b^2 / 2`` about the roller's own axis and ``b^2`` across it, with its radius b.
    """
    return wheel.roller_radius**2 * (1.0 - 0.5 * sin(mount.roller_angle) ** 2)
