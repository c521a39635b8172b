"""Contact impulses of one time step, compared with a search that does not use the kernel."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.robot import named_robot
from omnidrive.simulation import Disturbances
from omnidrive.simulation.planar.contact import solve_twist
from omnidrive.simulation.planar.model import mass_matrix, planar_model
from omnidrive.simulation.planar.state import WHEEL_STATE
from tests.examples import examples


def impulse_by_bisection(wheel, spin, v, h):
    """Return the floor's impulse on one wheel, found by bisection."""
    ground = wheel["direction_x"] * v[0] + wheel["direction_y"] * v[1] + spin["moment_arm"] * v[2]

    def speed_under(q):  # solves inertia (w - speed) = h torque(w) - radius q
        low, high = -1e4, 1e4
        for _ in range(70):
            w = 0.5 * (low + high)
            torque = wheel["gain"] * (spin["target"] - w)
            torque = min(max(torque, -wheel["limit"]), wheel["limit"])
            excess = wheel["inertia"] * (w - spin["speed"]) - h * torque + wheel["radius"] * q
            low, high = (low, w) if excess > 0.0 else (w, high)
        return w

    low, high = -spin["max_impulse"], spin["max_impulse"]
    for _ in range(60):  # a larger impulse gives a slower wheel
        q = 0.5 * (low + high)
        is_faster = wheel["radius"] * speed_under(q) > ground
        low, high = (q, high) if is_faster else (low, q)
    return q


numbers = st.floats(-1.0, 1.0).map(lambda v: round(v, 3))


@examples(20)
@given(st.lists(numbers, min_size=18, max_size=18), st.sampled_from(["small", "kiwi"]))
def test_step_satisfies_the_momentum_balance(draws, name):
    """Residual of the momentum balance, with impulses found without the kernel."""
    h, robot = 0.002, replace(named_robot(name), com=(0.03, 0.01), friction=0.3)
    model = planar_model(robot, Disturbances())
    count = len(robot.mounts)
    spins = np.zeros(count, WHEEL_STATE)
    spins["speed"], spins["target"] = (np.array(draws[k : k + count]) * 40.0 for k in (0, 4))
    spins["max_impulse"] = h * robot.friction * robot.loads * (1.0 + np.array(draws[8 : 8 + count]))
    spins["moment_arm"] = model.wheels["direction_yaw"]
    free, guess = (tuple((2.0 * np.array(draws[k : k + 3])).tolist()) for k in (12, 15))
    given = tuple((mass_matrix(model.body) @ free).tolist())
    v = solve_twist(model.body[0], model.wheels, spins, given, guess, h)
    pushed = np.zeros(3)
    for records in zip(model.wheels, spins, strict=True):
        wheel, spin = (dict(zip(r.dtype.names, r.item(), strict=True)) for r in records)
        q = impulse_by_bisection(wheel, spin, v, h)
        pushed += q * np.array([wheel["direction_x"], wheel["direction_y"], spin["moment_arm"]])
    gained = mass_matrix(model.body) @ np.subtract(v, free)
    assert gained == pytest.approx(pushed, abs=1e-6)
