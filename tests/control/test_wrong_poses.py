"""Controllers after seconds of wrong but usable poses: integrals and estimates leave nothing."""

import numpy as np
import pytest

from omnidrive.components import configure
from omnidrive.control.components import ControllerContext
from omnidrive.geometry import Pose
from omnidrive.reference import Circle, ShapeReference
from omnidrive.robot import named_robot
from omnidrive.simulation import PerfectSensors, PlanarPlant, simulate

DT, DURATION = 0.05, 26.0  # s
BEGIN, END = 6.0, 10.0  # s, of the wrong poses
AFTER = 2.0  # s
BOUND = 0.005  # m
WRONG = {
    "offset": lambda pose, t, first: Pose(pose.x + 0.5, pose.y, pose.yaw),
    "drift": lambda pose, t, first: Pose(pose.x + 0.3 * t, pose.y - 0.3 * t, pose.yaw + 0.1 * t),
    "frozen": lambda pose, t, first: first,
    "turned": lambda pose, t, first: Pose(pose.x, pose.y, pose.yaw + 0.5),
    "scaled": lambda pose, t, first: Pose(0.7 * pose.x, 0.7 * pose.y, pose.yaw),
}


class WrongPoses(PerfectSensors):
    """Exact poses, except from BEGIN to END."""

    def __init__(self, wrong):
        super().__init__()
        self.wrong, self.first = wrong, None

    def read(self, t, state):
        readings = super().read(t, state)
        if not BEGIN - 1e-9 <= t < END - 1e-9:
            return readings
        (fix,) = readings.fixes
        self.first = self.first or fix.pose
        pose = WRONG[self.wrong](fix.pose, t - BEGIN, self.first)
        return readings._replace(fixes=(fix._replace(pose=pose),))


class ResetAtEnd:
    """The same controller without memory of what was before the first right pose."""

    def __init__(self, controller):
        self.controller = controller
        self.prepare, self.reset = controller.prepare, controller.reset

    def step(self, t, state, reference):
        if abs(t - END) < 1e-9:
            self.reset(state)
        return self.controller.step(t, state, reference)


def errors(controller, robot, wrong):
    """Return the errors, m, from 2 s after the first right pose on."""
    reference = ShapeReference(Circle(laps=2), DURATION)
    run = simulate(
        PlanarPlant(robot),
        controller,
        reference,
        start=reference.at(0.0).pose,
        dt=DT,
        sensors=WrongPoses(wrong),
    ).raise_if_failed()
    counted = (run.t >= END + AFTER) & (run.t <= END + AFTER + 1.0)
    return np.hypot(*(run.pose[counted, :2] - run.target[counted, :2]).T)


@pytest.mark.parametrize("wrong", WRONG)
@pytest.mark.parametrize(
    ("robot", "name"),
    [
        ("kiwi", "pid"),
        ("small", "holonomic-nmpc"),
        pytest.param("kiwi", "holonomic-nmpc", marks=pytest.mark.long),
        pytest.param("paper", "holonomic-nmpc", marks=pytest.mark.long),
        pytest.param("small", "adrc", marks=pytest.mark.long),
        pytest.param("small", "fuzzy_t2", marks=pytest.mark.long),
        pytest.param("small", "pid", marks=pytest.mark.long),
        pytest.param("kiwi", "fuzzy_t2", marks=pytest.mark.long),
    ],
)
def test_wrong_poses_leave_nothing(robot, name, wrong):
    """What remains is the way back: a controller that was just reset errs as much."""
    robot = named_robot(robot)
    context = ControllerContext(robot, DT, np.random.default_rng(0), "recommended")

    def made():
        return configure("controllers", name).make(context)

    found = errors(made(), robot, wrong)
    fresh = errors(ResetAtEnd(made()), robot, wrong)
    print(f"{robot.name} {name} {wrong}: {1e3 * found.max():.1f}, {1e3 * fresh.max():.1f} mm")
    assert (found - fresh).max() < BOUND
