"""Time-optimal parameterization against two independent solvers of the same problem."""

import numpy as np
import pytest
from scipy.interpolate import BSpline

from omnidrive.reference import MotionLimits, time_within_limits
from tests.reference.sample_paths import CHASSIS, wandering

ALPHA = 25.0
NODES = 2001


def wheel_path(path, s, jacobian, tangent=False):
    """Return first and second derivatives of the wheel angles by s in [0, 1], by SciPy's spline."""
    points = path.control_points
    inner = np.arange(len(points) - 2) / (len(points) - 3)
    spline = BSpline(np.concatenate([[0.0] * 3, inner, [1.0] * 3]), points, 3)
    (x1, y1, turn), (x2, y2, bend) = spline(s, 1).T, spline(s, 2).T
    yaw = spline(s)[:, 2]
    if tangent:
        (x3, y3, _), square = spline(s, 3).T, x1**2 + y1**2
        yaw, turn = np.arctan2(y1, x1), (x1 * y2 - y1 * x2) / square
        bend = (x1 * y3 - y1 * x3) / square - 2.0 * turn * (x1 * x2 + y1 * y2) / square
    c, s = np.cos(yaw), np.sin(yaw)
    vx, vy = c * x1 + s * y1, c * y1 - s * x1
    ax, ay = c * x2 + s * y2 + turn * vy, c * y2 - s * x2 - turn * vx
    first, second = np.stack([vx, vy, turn], axis=1), np.stack([ax, ay, bend], axis=1)
    return first @ jacobian.T, second @ jacobian.T


@pytest.mark.parametrize("name", CHASSIS)
@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("heading", ["path", "tangent"])
def test_duration_matches_toppra(name, seed, heading):
    """Wheel angles are the joints, with the velocity and acceleration limits of the wheels."""
    toppra = pytest.importorskip("toppra")
    from toppra import algorithm, constraint
    from toppra.interpolator import AbstractGeometricPath

    chassis, path = CHASSIS[name], wandering(seed)
    wheels = len(chassis.jacobian)

    class Wheels(AbstractGeometricPath):
        dof = wheels
        path_interval = np.array([0.0, 1.0])

        def __call__(self, s, order=0):
            s = np.atleast_1d(s)
            first, second = wheel_path(path, s, chassis.jacobian, heading == "tangent")
            return [np.zeros_like(first), first, second][order]

    toppra.setup_logging("ERROR")
    speed = constraint.JointVelocityConstraint(
        np.tile([-1.0, 1.0], (wheels, 1)) * chassis.max_wheel_speed
    )
    acceleration = constraint.JointAccelerationConstraint(
        np.tile([-ALPHA, ALPHA], (wheels, 1)),
        discretization_scheme=constraint.DiscretizationType.Interpolation,
    )
    grid = np.linspace(0.0, 1.0, NODES)
    solver = algorithm.TOPPRA(
        [speed, acceleration], Wheels(), gridpoints=grid, solver_wrapper="seidel"
    )
    _, speeds, _ = solver.compute_parameterization(0.0, 0.0)
    theirs = float((2.0 / (NODES - 1) / (speeds[1:] + speeds[:-1])).sum())
    limits = MotionLimits(wheel_acceleration=ALPHA)
    ours = time_within_limits(path, chassis, limits, heading=heading).duration
    assert ours == pytest.approx(theirs, rel=2e-3)


@pytest.mark.parametrize("name", [pytest.param("four", marks=pytest.mark.long), "three"])
def test_duration_matches_convex_program(name):
    """Verscheure et al. 2009: minimum time along a path is convex in the squared speeds."""
    ca = pytest.importorskip("casadi")
    chassis, path, nodes = CHASSIS[name], wandering(11), 801
    s = np.linspace(0.0, 1.0, nodes)
    width = s[1]
    first, second = wheel_path(path, s, chassis.jacobian)
    program = ca.Opti()
    x = program.variable(nodes)
    u = (x[1:] - x[:-1]) / (2.0 * width)
    program.subject_to(x >= 0.0)
    program.subject_to(x[0] == 1e-9)
    program.subject_to(x[-1] == 1e-9)
    for wheel in range(len(chassis.jacobian)):
        a, b = first[:, wheel], second[:, wheel]
        program.subject_to(a**2 * x <= chassis.max_wheel_speed**2)
        program.subject_to(program.bounded(-ALPHA, a[:-1] * u + b[:-1] * x[:-1], ALPHA))
        program.subject_to(program.bounded(-ALPHA, a[1:] * u + b[1:] * x[1:], ALPHA))
    program.minimize(ca.sum1(2.0 * width / (ca.sqrt(x[1:]) + ca.sqrt(x[:-1]))))
    program.set_initial(x, 0.01)
    program.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    theirs = float(program.solve().value(program.f))
    ours = time_within_limits(path, chassis, MotionLimits(wheel_acceleration=ALPHA)).duration
    assert ours == pytest.approx(theirs, rel=3e-3)
