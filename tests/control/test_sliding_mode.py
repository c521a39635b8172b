"""Sliding-mode control: reaching time, boundary layer, disturbance."""

import numpy as np
import pytest

from omnidrive.control.laws.sliding_mode import SlidingModeController, SlidingModeParameters
from omnidrive.estimation import State
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.reference import Hold

DT = 0.05
GOAL = Hold(Pose(0.0, 0.0, 0.0), 9.0)
RATES = {"speed": 0.5, "layer": 0.1, "yaw_rate": 1.5, "heading_layer": 0.3}


def closed_loop(start, samples, disturbance=(0.0, 0.0, 0.0), **parameters):
    """Poses of a robot that executes every command plus a disturbance, with `RATES`."""
    law = SlidingModeController(DT, SlidingModeParameters(**RATES | parameters))
    poses = [start]
    law.reset(State(0.0, start))
    for k in range(samples):
        twist = law.step(k * DT, State(k * DT, poses[-1]), GOAL).twist
        executed = BodyTwist(*(a + b for a, b in zip(twist, disturbance, strict=True)))
        poses.append(move(poses[-1], executed, DT))
    return np.array(poses)


def test_reaches_the_boundary_layer_in_the_time_of_the_reaching_law():
    """0.4 m at 0.5 m/s take 0.8 s, 0.9 rad at 1.5 rad/s take 0.6 s; then the layers begin."""
    poses = closed_loop(Pose(0.3, 0.4, 1.2), 16)
    distance = np.hypot(poses[:, 0], poses[:, 1])
    assert distance == pytest.approx(0.5 - 0.5 * DT * np.arange(17))
    assert distance[-1] == pytest.approx(0.1)
    assert poses[:13, 2] == pytest.approx(1.2 - 1.5 * DT * np.arange(13))
    assert poses[:, 1] == pytest.approx(poses[:, 0] * 4.0 / 3.0)  # straight to the goal


def test_error_in_the_layer_decays_without_chatter():
    """At the rate speed / layer = 5 1/s: by a quarter in each sample of 0.05 s."""
    poses = closed_loop(Pose(0.1, 0.0, -0.3), 40)
    assert poses[:, 0] == pytest.approx(0.1 * 0.75 ** np.arange(41))
    assert poses[:, 2] == pytest.approx(-0.3 * 0.75 ** np.arange(41))


def test_layer_thinner_than_a_step_does_not_chatter():
    """Steps of 0.025 m and a layer of 0.1 mm: the error never changes its sign."""
    poses = closed_loop(Pose(0.11, 0.0, 0.2), 30, layer=1e-4, heading_layer=1e-4)
    for column in (poses[:, 0], poses[:, 2]):
        assert (np.diff(column) < 0.0).all()
        assert (column > 0.0).all()
    assert poses[-1, 0] < 1e-6


@pytest.mark.parametrize("start", [0.0, 0.4])
def test_disturbance_leaves_its_share_of_the_layer(start):
    """0.3 m/s of 0.5 m/s: 0.6 of a layer of 0.1 m; 0.5 rad/s of 1.5 rad/s: a third of 0.3 rad."""
    poses = closed_loop(Pose(start, 0.0, 0.0), 100, BodyTwist(0.3, 0.0, 0.0))
    assert poses[-1] == pytest.approx([0.06, 0.0, 0.0], abs=1e-9)
    turned = closed_loop(Pose(0.0, 0.0, start), 100, BodyTwist(0.0, 0.0, 0.5))
    assert turned[-1] == pytest.approx([0.0, 0.0, 0.1], abs=1e-9)


def test_defaults_damp_both_errors_alike_at_every_sample_time():
    """The tuned heading layer is the narrowest one that is not widened at 0.1 s."""
    p = SlidingModeParameters()
    assert p.heading_layer == pytest.approx(2.0 * p.yaw_rate * 0.1)
    assert 2.0 * p.speed * 0.1 <= p.layer
