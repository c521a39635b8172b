"""MPPI: weights, terms of the cost, seeds, improvement of a plan, limits."""

from math import exp, hypot

import numpy as np
import pytest

from omnidrive.control.compiled_law import UNKNOWN_TWIST, UNKNOWN_VARIANCES, SampleState
from omnidrive.control.laws import mppi
from omnidrive.control.laws.mppi import MppiController, MppiParameters, draw_noise
from omnidrive.errors import InvalidInput
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, move, to_body
from omnidrive.reference import Eight, Hold, ShapeReference
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, simulate
from omnidrive.testing.laws import Circle

SMALL = named_robot("small")
DT = 0.1
REST = BodyTwist(0.0, 0.0, 0.0)


def controller(seed=1, chassis=SMALL.chassis, **values):
    parameters = MppiParameters(**values)
    return MppiController(
        DT, chassis, draw_noise(np.random.default_rng(seed), parameters), parameters
    )


def cost(law, pose, last, reference, deviation):
    """Cost of the feedforward of a reference plus a deviation."""
    data, setpoints = law.compiled_law().data, reference.window(0.0, law.parameters.horizon + 1, DT)
    feedforward = mppi.feedforward_twists(pose, setpoints, DT)
    return mppi.cost_of_motion(data, pose, last, setpoints, feedforward, deviation)


def test_weights_are_exponential_and_sum_to_one():
    costs = np.array([3.0, 5.0, 4.0, 1e9])
    weights = mppi.weights_of(costs, 2.0)
    assert weights.sum() == pytest.approx(1.0, abs=1e-15)
    assert weights[1] / weights[0] == pytest.approx(exp(-1.0))
    assert weights[3] == 0.0
    assert mppi.weights_of(costs + 1e6, 2.0) == pytest.approx(weights, abs=1e-9)


def test_noise_is_normal_with_the_stated_deviations():
    noise = draw_noise(
        np.random.default_rng(3), MppiParameters(speed_noise=0.2, yaw_rate_noise=0.2)
    )
    assert noise.shape == (16, 150, 12, 3)
    assert noise.std((0, 1, 2)) == pytest.approx([0.2, 0.2, 0.2], rel=0.02)
    assert np.abs(noise.mean((0, 1, 2))).max() < 0.005


def test_cost_of_the_reference_is_zero():
    circle = Circle(1.0, 12.0)
    law = controller()
    start, twist = circle.at(0.0)
    last = to_body(twist, start.yaw)
    assert cost(law, start, last, circle, np.zeros((12, 3))) == pytest.approx(0.0, abs=1e-12)


def test_cost_of_a_kept_error_is_that_of_its_distance_and_heading():
    law, hold = controller(position=0.02, heading=0.1), Hold(Pose(0.0, 0.0, 0.0), 9.0)
    pose = Pose(0.3, -0.4, 0.2)
    expected = 12 * (hypot(1.0, 0.5 / 0.02) - 1.0 + hypot(1.0, 0.2 / 0.1) - 1.0)
    assert cost(law, pose, REST, hold, np.zeros((12, 3))) == pytest.approx(expected)


def test_wheel_speeds_beyond_the_limit_cost():
    hold, spin = Hold(Pose(0.0, 0.0, 0.0), 9.0), np.zeros((12, 3))
    spin[:, 2] = np.linspace(1.0, 40.0, 12)
    free, charged = (
        cost(
            controller(wheel_cost=w, max_yaw_acceleration=1e4),
            Pose(0.0, 0.0, 0.0),
            REST,
            hold,
            spin,
        )
        for w in (0.0, 7.0)
    )
    chassis = SMALL.chassis
    speeds = np.abs(spin @ chassis.jacobian.T).max(1) / chassis.max_wheel_speed
    excess = np.maximum(0.0, speeds - 1.0).sum()
    assert excess > 0.5
    assert charged - free == pytest.approx(7.0 * excess)


def run(law, samples=25):
    """Commands on the way to a pose, with exact motion."""
    pose, hold, found = Pose(0.0, 0.0, 0.0), Hold(Pose(0.3, -0.2, 0.5), 9.0), []
    law.reset(State(0.0, pose))
    for k in range(samples):
        command = law.step(k * DT, State(k * DT, pose), hold)
        found.append((*command.twist, *command.details))
        pose = move(pose, command.twist, DT)
    return np.array(found), pose


def test_equal_seeds_give_equal_commands():
    law = controller(5)
    commands, end = run(law)
    assert np.array_equal(commands, run(law)[0])
    assert np.array_equal(commands, run(controller(5))[0])
    other, other_end = run(controller(6))
    assert np.abs(commands - other)[:, :3].max() > 1e-3
    for pose in (end, other_end):
        assert pose == pytest.approx((0.3, -0.2, 0.5), abs=0.02)
    assert 1.0 <= commands[:, 4].min() <= commands[:, 4].max() <= 300.0


def test_plan_after_a_step_of_the_pose_costs_less_than_the_nominal_one():
    """In the first sample, and less in every one of the next two at the same pose."""
    law, hold, pose = controller(), Hold(Pose(0.1, -0.05, 0.2), 9.0), Pose(0.0, 0.0, 0.0)
    step, data, memory, _ = law.compiled_law()
    now = SampleState(0.0, pose, UNKNOWN_TWIST, UNKNOWN_VARIANCES, 0.0, 0.0, 0)
    command, details = np.zeros(3), np.zeros(2)
    costs = [cost(law, pose, REST, hold, np.zeros((12, 3)))]
    for _ in range(3):
        memory.state["twist"] = 0.0
        assert step(data, memory, now, hold.window(0.0, 13, DT), command, details) == 0
        plan = np.vstack((command, memory.corrections[:-1]))
        costs.append(cost(law, pose, REST, hold, plan))
        memory.corrections[:] = plan
    assert np.all(np.diff(costs) < -0.05 * costs[0])


def test_noise_with_opposite_signs_leaves_the_feedforward():
    """The eight is tracked from its start on, to 1 cm, without noise in the command."""
    eight = ShapeReference(Eight(), 20.0)
    found = simulate(KinematicPlant(SMALL), controller(), eight, start=eight.at(0.0).pose, dt=DT)
    assert np.hypot(*(found.pose[:, :2] - found.target[:, :2]).T).max() < 0.01
    noisy = np.diff(found.command[20:-1, :2], 3, axis=0)
    assert np.abs(noisy).max() < 0.02


@pytest.mark.parametrize("acceleration", [0.5, 1e3])
def test_commands_are_within_the_limits_of_acceleration_and_wheels(acceleration):
    law = controller(max_acceleration=acceleration, speed_noise=1.0)
    hold, pose, last = Hold(Pose(9.0, 5.0, 0.0), 9.0), State(0.0, Pose(0.0, 0.0, 0.0)), REST
    law.reset(pose)
    peaks = []
    for k in range(30):
        twist = law.step(k * DT, pose, hold).twist
        changes = np.abs(np.subtract(twist, last))
        peaks.append(np.abs(SMALL.chassis.wheel_speeds(twist)).max())
        assert changes[:2].max() <= acceleration * DT * (1.0 + 1e-9) or peaks[-1] > 49.0
        last = twist
    assert max(peaks) <= SMALL.chassis.max_wheel_speed * (1.0 + 1e-12)
    assert peaks[-1] > 0.8 * SMALL.chassis.max_wheel_speed


def test_noise_of_another_horizon_is_an_error():
    with pytest.raises(InvalidInput, match=r"noise must have the shape \(16, 150, 12, 3\)"):
        MppiController(DT, SMALL.chassis, np.zeros((16, 150, 11, 3)))
