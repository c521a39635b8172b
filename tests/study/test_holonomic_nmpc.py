"""The controller `holonomic-nmpc` on the path of the paper, with simulated forces."""

from math import pi

import numpy as np
import pytest

from omnidrive.evaluation import measure
from omnidrive.geometry import Pose, WorldTwist
from omnidrive.reference import Setpoint
from omnidrive.scenario import paper_scenario, plan_and_check
from omnidrive.scenario.plants import make_plant
from omnidrive.scenario.run_parts import make_controller
from omnidrive.simulation import simulate

LAWS = {
    "quintic": lambda s: s**3 * (10.0 - s * (15.0 - 6.0 * s)),
    "raised cosine": lambda s: 0.5 - 0.5 * np.cos(pi * s),
}
"""Motion laws from rest to rest: share of the spline parameter as a function of that of time."""


class FromRestToRest:
    """Motion along a spline in 20 s with one of :data:`LAWS`."""

    duration = 20.0

    def __init__(self, spline, law):
        self.spline, self.law = spline, law

    def window(self, t, n, dt):
        at = t + dt * np.arange(n)
        before, here, after = (self._poses(at + step) for step in (-1e-4, 0.0, 1e-4))
        return np.hstack([here, (after - before) / 2e-4])

    def _poses(self, t):
        return self.spline.poses(self.law(np.clip(t / self.duration, 0.0, 1.0)))

    def at(self, t):
        row = self.window(t, 1, 0.0)[0].tolist()
        return Setpoint(Pose(*row[:3]), WorldTwist(*row[3:]))


@pytest.fixture(scope="module")
def paper():
    return plan_and_check(paper_scenario())


def tracking_errors(paper, reference, **changes):
    scenario = paper.scenario.with_values(
        controllers={"holonomic-nmpc": {"type": "holonomic-nmpc", **changes}}
    )
    controller = make_controller(scenario, paper.robot, "holonomic-nmpc")
    start = reference.at(0.0).pose
    run = simulate(
        make_plant(paper.robot, "mujoco-rollers"), controller, reference, start=start, dt=0.1
    )
    return measure(run, paper.robot.drive)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("may_spin", [True, False])
def test_motion_from_rest_to_rest_is_tracked_closely(paper, law, may_spin):
    metrics = tracking_errors(paper, FromRestToRest(paper.path, LAWS[law]), may_spin=may_spin)
    assert metrics.me <= 0.0003
    assert metrics.mae <= 0.0003


def test_kinematic_plant_needs_no_lag_compensation(paper):
    controller = make_controller(
        paper.scenario.with_values(plant="kinematic"), paper.robot, "holonomic-nmpc"
    )
    reference = FromRestToRest(paper.path, LAWS["quintic"])
    start = reference.at(0.0).pose
    run = simulate(make_plant(paper.robot, "kinematic"), controller, reference, start=start, dt=0.1)
    assert measure(run, paper.robot.drive).me < 1e-6
