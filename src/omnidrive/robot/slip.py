"""Motion of a robot whose wheels slip."""

from __future__ import annotations

from jaxtyping import Float

from omnidrive.arrays import Array
from omnidrive.compiled import compiled

Vector = tuple[float, float, float]


@compiled
def accelerate(velocity: Vector, wrench: Vector, inertia: Float[Array, " 3"], dt: float) -> Vector:
    """Return the body twist after one explicit Euler step of ``inertia (db/dt + w x b) = wrench``.

    Args:
        velocity: b, of yaw rate w, in m/s, m/s and rad/s.
        wrench: On the robot, in N, N and N m, in B.
        inertia: Mass, mass and yaw inertia, in kg, kg and kg m^2.
        dt: Length of the step, in s.
    """
    (vx, vy, w), (fx, fy, torque) = velocity, wrench
    ax, ay = fx / inertia[0] + w * vy, fy / inertia[1] - w * vx
    return vx + dt * ax, vy + dt * ay, w + dt * torque / inertia[2]


@compiled
def friction_limit(
    at_rest: float, load_transfer: Float[Array, " 2"], force: Vector, motor_limit: float
) -> float:
    """Return the largest force of a wheel, in N: of friction under its load, or of its motor.

    Args:
        at_rest: Limit of friction of a robot at rest, in N.
        load_transfer: Change of this limit per force along x and y of B, in N/N.
        force: Of the wheels on the robot, in N, N and N m: acceleration shifts the load.
        motor_limit: Largest force of the motor at the rim, in N.
    """
    friction = at_rest + load_transfer[0] * force[0] + load_transfer[1] * force[1]
    return float(min(max(friction, 0.0), motor_limit))


@compiled
def slip_velocity(  # noqa: PLR0917
    velocity: Vector,
    forces: Float[Array, " wheels"],
    limits: Float[Array, " wheels"],
    rim_jacobian: Float[Array, "wheels 3"],
    inertia: Float[Array, " 3"],
    dt: float,
) -> tuple[Vector, Vector]:
    """Return the body twist after one explicit Euler step, and the force of all wheels.

    Wheel i transmits the force that its slip calls for up to its limit (Pacejka, "Tire and Vehicle
    Dynamics", 3rd ed. 2012, section 1.2: force in proportion to slip, up to friction)::

        f_i = clip(forces_i, -limits_i, limits_i)
        inertia (db/dt + w x b) = rim_jacobian^T f

    with the body twist b, of yaw rate w. The models of slip differ in ``forces`` and ``limits``
    only.

    Args:
        velocity: b, in m/s, m/s and rad/s.
        forces: Force along the drive direction of each wheel without saturation, at the rim, in N.
        limits: Largest force of each wheel, in N; not negative.
        rim_jacobian: Rim speed of each wheel per unit of body twist, in 1, 1 and m/rad.
        inertia: Mass, mass and yaw inertia, in kg, kg and kg m^2.
        dt: Length of the step, in s.

    Returns:
        b after the step; ``rim_jacobian^T f``, in N, N and N m, in B.
    """
    fx, fy, torque = 0.0, 0.0, 0.0
    for i in range(len(rim_jacobian)):
        force = min(max(forces[i], -limits[i]), limits[i])
        fx, fy = fx + rim_jacobian[i, 0] * force, fy + rim_jacobian[i, 1] * force
        torque += rim_jacobian[i, 2] * force
    wrench = (fx, fy, torque)
    return accelerate(velocity, wrench, inertia, dt), wrench
