"""Properties of every controller. A new controller only has to be added to CONTROLLERS.

Those of one file in ``control/laws`` are found.
"""

from functools import partial
from math import hypot, nan

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.control import (
    Command,
    DetailedController,
    FeedforwardController,
    Status,
    classical_pid,
    fuzzy_pid,
    holonomic_nmpc,
    unicycle_nmpc,
)
from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits
from omnidrive.estimation import LatestFix, State
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Eight, Hold, ShapeReference
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, Outcome, PlanarPlant, simulate
from omnidrive.testing import check_controller
from omnidrive.testing.laws import Circle, rotated
from tests.examples import examples
from tests.laws.one_file_laws import ONE_FILE_LAWS, one_file_law

DT = 0.1
SMALL = named_robot("small")
CONTROLLERS = {
    "feedforward": lambda dt=DT: FeedforwardController(dt),
    "fuzzy_t1": lambda dt=DT: fuzzy_pid("t1", "paper", dt),
    "fuzzy_t2": lambda dt=DT: fuzzy_pid("t2", "paper", dt),
    "fuzzy_t1_published": lambda dt=DT: fuzzy_pid("t1", "published-code", dt),
    "fuzzy_t2_published": lambda dt=DT: fuzzy_pid("t2", "published-code", dt),
    "fuzzy_t1_recommended": lambda dt=DT: fuzzy_pid("t1", "recommended", dt, SMALL),
    "fuzzy_t2_recommended": lambda dt=DT: fuzzy_pid("t2", "recommended", dt, SMALL),
    "fuzzy_t3": lambda dt=DT: fuzzy_pid("t3", "paper", dt),
    "fuzzy_t3_published": lambda dt=DT: fuzzy_pid("t3", "published-code", dt),
    "fuzzy_t3_recommended": lambda dt=DT: fuzzy_pid("t3", "recommended", dt, SMALL),
    "pid": lambda dt=DT: classical_pid("paper", dt),
    "pid_published": lambda dt=DT: classical_pid("published-code", dt),
    "pid_recommended": lambda dt=DT: classical_pid("recommended", dt, SMALL),
    "nmpc": lambda dt=DT: unicycle_nmpc("paper", dt),
    "nmpc_published": lambda dt=DT: unicycle_nmpc("published-code", dt),
    "nmpc_recommended": lambda dt=DT: holonomic_nmpc(SMALL.chassis, dt),
} | {name: partial(one_file_law, name, SMALL) for name in ONE_FILE_LAWS}
DOES_NOT_WRAP = {
    "fuzzy_t1_published",
    "fuzzy_t2_published",
    "fuzzy_t3_published",
    "pid_published",
}  # as the published code
POSITION_ERROR = {"nmpc_published": 0.13}  # m: a unicycle cannot move sideways at rest
every_controller = pytest.mark.parametrize("name", CONTROLLERS)


@every_controller
def test_obeys_the_public_laws(name):
    """Protocol, determinism and reset; the laws of rotation and convergence are stricter below."""
    wraps = name not in DOES_NOT_WRAP
    check_controller(CONTROLLERS[name], dt=DT, wraps=wraps, invariant=False, converges=False)


@every_controller
def test_follows_a_circle(name):
    start = Circle().at(0.0).pose
    run = simulate(KinematicPlant(SMALL), CONTROLLERS[name](), Circle(), start=start, dt=DT)
    assert run.outcome is Outcome.FINISHED
    # the paper's controllers lag by up to 1.5 samples: 0.15 s of 0.8 m/s
    assert hypot(*(run.pose[-1, :2] - run.target[-1, :2])) < 0.15


@every_controller
@examples(15)
@given(angle=st.floats(-3.0, 3.0), whole_turns=st.integers(-2, 2))
def test_command_is_invariant_to_rotation_of_the_world(name, angle, whole_turns):
    """Equivariance: the body twist does not depend on the orientation of the world frame."""
    if name in DOES_NOT_WRAP:
        whole_turns = 0
    a, b = CONTROLLERS[name](), CONTROLLERS[name]()
    pose = Pose(0.1, -1.1, 0.1)
    other = rotated(pose, angle)
    other = other._replace(yaw=other.yaw + 2 * np.pi * whole_turns)
    a.reset(State(0.0, pose))
    b.reset(State(0.0, other))
    for t in (0.0, DT):
        one = a.step(t, State(t, pose), Circle()).twist
        two = b.step(t, State(t, other), Circle(turn=angle)).twist
        assert np.array(one) == pytest.approx(np.array(two), abs=1e-5)


@every_controller
def test_reaches_a_pose_and_stays(name):
    goal = Pose(0.6, 0.6, np.pi / 4)
    hold = Hold(goal, 15.0)
    start = Pose(0.0, 0.0, 0.0)
    run = simulate(KinematicPlant(SMALL), CONTROLLERS[name](), hold, start=start, dt=DT)
    late = run.pose[-20:]
    assert np.hypot(late[:, 0] - goal.x, late[:, 1] - goal.y).max() < POSITION_ERROR.get(name, 0.02)
    assert np.abs(late[:, 2] - goal.yaw).max() < 0.02


@pytest.mark.parametrize("name", ["feedforward", *ONE_FILE_LAWS])
def test_feedforward_tracks_an_eight_exactly(name):
    """From 0.1 m beside its start; an eight of 20 s is within the limits of the wheels."""
    reference = ShapeReference(Eight(), 20.0)
    start = reference.at(0.0).pose
    start = start._replace(x=start.x + 0.1)
    run = simulate(KinematicPlant(SMALL), CONTROLLERS[name](), reference, start=start, dt=DT)
    error = np.hypot(*(run.pose[:, :2] - run.target[:, :2]).T)
    assert error[0] == pytest.approx(0.1)
    assert error[run.t > 5.0].max() < 1e-3


class OneSampleLate:
    """A controller whose commands are executed one sample later."""

    def __init__(self, law):
        self.law = law

    def reset(self, state):
        self.law.reset(state)
        self.last = Command(BodyTwist(0.0, 0.0, 0.0))

    def step(self, t, state, reference):
        command, self.last = self.last, self.law.step(t, state, reference)
        return command


@pytest.mark.parametrize("robot", ["paper", "small", "mecanum", "kiwi"])
@pytest.mark.parametrize("name", ONE_FILE_LAWS)
def test_default_parameters_are_stable_with_a_delay_of_one_sample(name, robot):
    robot, goal = named_robot(robot), Pose(0.1, 0.05, 0.3)
    late = OneSampleLate(one_file_law(name, robot, DT, forces=True))
    hold, start = Hold(goal, 6.0), Pose(0.0, 0.0, 0.0)
    run = simulate(PlanarPlant(robot), late, hold, start=start, dt=DT)
    assert np.abs(run.pose[-10:] - goal).max() < 2e-3


class FailingEstimator(LatestFix):
    """An estimator whose pose becomes NaN."""

    def update(self, readings):
        state = super().update(readings)
        return state._replace(pose=Pose(nan, nan, nan)) if readings.stamp > 0.35 else state


@every_controller
def test_estimate_that_stays_invalid_stops_the_robot_as_silent_sensors_do(name):
    """The last pose is kept and grows old; the watchdog stops the robot after age and patience."""
    run = simulate(
        KinematicPlant(SMALL),
        CONTROLLERS[name](),
        Circle(),
        start=Circle().at(0.0).pose,
        dt=DT,
        estimator=FailingEstimator(),
        supervisor=SafetySupervisor(SMALL, Watchdog(WatchdogLimits(error=9.0))),
    )
    assert run.outcome is Outcome.STOPPED
    assert "at 2.20 s its pose is lost: last fix 1.90 s ago" in run.reason
    assert run.status[4:20].min() == Status.FALLBACK
    assert np.isfinite(run.measured).all()


@every_controller
def test_details_are_logged_with_their_units(name):
    controller = CONTROLLERS[name]()
    run = simulate(KinematicPlant(SMALL), controller, Circle(), start=Circle().at(0.0).pose, dt=DT)
    units = controller.detail_units if isinstance(controller, DetailedController) else {}
    assert list(run.details) == list(units)
    assert run.detail_units == units
    for column in run.details.values():
        assert column.shape == run.t.shape
        assert np.isfinite(column[:-1]).all()
        assert np.isnan(column[-1])
