"""Shortest duration with limits of the jerk by IPOPT, in time instead of along the path."""

import numpy as np

from omnidrive.reference.path_optimisation.transcription import casadi

_STEPS = 100
_SHARES = (0.0, 0.5, 1.0)  # of each step, where limits hold


def shortest_duration_by_ipopt(reference, chassis, limits):
    """Return the shortest duration along the path of a reference, from which IPOPT starts.

    The unknowns are s, its first two derivatives at equal times, its third one on each step, and
    the duration.
    """
    ca = casadi()
    pieces = reference.path.pieces
    opti = ca.Opti()
    duration, state, jerk = opti.variable(), opti.variable(3, _STEPS + 1), opti.variable(1, _STEPS)
    step = duration / _STEPS
    opti.minimize(duration)
    opti.subject_to(state[:, 0] == 0)
    opti.subject_to(state[0, -1] == len(pieces))
    opti.subject_to(state[1:, -1] == 0)
    opti.subject_to(ca.vec(state[1, :]) >= 0)
    used = _limit_function(ca, pieces, chassis, limits)
    for k in range(_STEPS):
        for share in _SHARES:
            t, (s, v, a), j = share * step, ca.vertsplit(state[:, k]), jerk[k]
            at = s + t * (v + t * (a / 2 + t * j / 6)), v + t * (a + t * j / 2), a + t * j
            if share == 1.0:
                opti.subject_to(state[:, k + 1] == ca.vertcat(*at))
            else:
                opti.subject_to(opti.bounded(-1, used(*at, j), 1))
    opti.set_initial(duration, 1.05 * reference.duration)
    times = np.linspace(0.0, reference.duration, _STEPS + 1)
    k = np.clip(
        np.searchsorted(reference.times, times, side="right") - 1, 0, len(reference.times) - 2
    )
    share = (times - reference.times[k]) / np.diff(reference.times)[k]
    *guess, third = reference._progress(k, share)
    opti.set_initial(state, np.stack(guess))
    opti.set_initial(jerk, third[:-1])
    options = {"print_level": 0, "max_iter": 1000, "tol": 1e-5, "sb": "yes"}
    opti.solver("ipopt", {"print_time": False, "expand": True}, options)
    return float(opti.solve().value(duration))


def _limit_function(ca, pieces, chassis, limits):
    """Return the used shares of all limits as a function of s and its three derivatives."""
    s, v, a, j = (ca.SX.sym(name) for name in "svaj")
    knots = ca.DM(np.arange(1.0, len(pieces)))
    r = s - ca.pw_const(s, knots, ca.DM(np.arange(float(len(pieces)))))
    c = [
        ca.vertcat(*[ca.pw_const(s, knots, ca.DM(pieces[:, power, axis])) for axis in range(3)])
        for power in range(4)
    ]
    yaw = (c[0] + r * (c[1] + r * (c[2] + r * c[3])))[2]
    first, second, third = c[1] + r * (2 * c[2] + 3 * r * c[3]), 2 * c[2] + 6 * r * c[3], 6 * c[3]
    cos, sin = ca.cos(yaw), ca.sin(yaw)
    twist, acceleration = (
        ca.vertcat(cos * q[0] + sin * q[1], cos * q[1] - sin * q[0], q[2])
        for q in (first * v, first * a + second * v**2)
    )
    change = acceleration + twist[2] * ca.vertcat(twist[1], -twist[0], 0)
    jerk = first * j + 3 * second * v * a + third * v**3
    shares = ca.vertcat(
        chassis.jacobian @ twist / chassis.max_wheel_speed,
        chassis.jacobian @ change / limits.wheel_acceleration,
        ca.sumsqr(jerk[:2]) / limits.jerk**2,
        jerk[2] / limits.yaw_jerk,
    )
    return ca.Function("used", [s, v, a, j], [shares])
