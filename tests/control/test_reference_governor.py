"""Reference governor: what it leaves as it is, what it governs, and how long runs last."""

import logging
from dataclasses import dataclass, field
from math import inf

import numpy as np
import pytest

from omnidrive.compiled.compilation import compile_listeners
from omnidrive.components import configure
from omnidrive.control import (
    FeedforwardController,
    ReferenceGovernor,
    Retiming,
    RetimingController,
    holonomic_nmpc,
)
from omnidrive.control.components import ControllerContext, HolonomicNmpcOptions
from omnidrive.control.components import holonomic_nmpc as make_nmpc
from omnidrive.control.nmpc.holonomic import Actuation
from omnidrive.control.reference_governor import TOLERATED_DELAY
from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits
from omnidrive.estimation import State
from omnidrive.evaluation import path_errors
from omnidrive.evaluation.measures.metrics import position_error
from omnidrive.evaluation.measures.path_error import arrival
from omnidrive.geometry import Pose
from omnidrive.maps import paper_map
from omnidrive.planning import PathOptions, Waypoint
from omnidrive.planning import plan as plan_path
from omnidrive.reference import (
    DelayedReference,
    Eight,
    Hold,
    MotionLimits,
    ShapeReference,
    Square,
    UniformReference,
    time_within_limits,
)
from omnidrive.robot import ROBOTS, force_share, named_robot
from omnidrive.scenario.planned_scenario import plan_scenario
from omnidrive.scenario.scenario import paper_scenario
from omnidrive.scenario.sections import TimingSection
from omnidrive.simulation import KinematicPlant, Outcome, PlanarPlant, simulate

KIWI = named_robot("kiwi")
STILL = Pose(0.0, 0.0, 0.0)


def governor(robot=KIWI, traction=force_share.PLANS):
    return ReferenceGovernor(robot.chassis, robot.acceleration_faces / traction)


@pytest.mark.parametrize("name", ROBOTS)
def test_motion_within_the_limits_of_the_robot_is_followed_in_time(name):
    """Timing and controller have one reserve: the governor has nothing to delay."""
    robot = named_robot(name)
    start, goal = Waypoint(1, 1, 0), Waypoint(8, 6)
    path = plan_path(paper_map(), start, goal, inflation=0.0, options=PathOptions()).spline
    reference = time_within_limits(path, robot.chassis, MotionLimits.of_robot(robot))
    controller = holonomic_nmpc(robot.chassis, dt=0.05, actuation=Actuation.of(robot))
    assert controller.retime(reference) == Retiming(reference)
    run = simulate(PlanarPlant(robot), controller, reference, start=reference.at(0.0).pose, dt=0.05)
    errors = position_error(run.raise_if_failed().pose, run.target)
    assert errors.mean() < 0.006
    assert errors.max() < 0.03


def test_shares_of_the_forces_leave_a_reserve_each():
    """Plans use less than the wheels can exert, governed references less, timed ones no more."""
    assert (
        force_share.REFERENCES <= force_share.GOVERNED * force_share.PLANS < force_share.PLANS < 1
    )
    assert HolonomicNmpcOptions().traction == Actuation.of(KIWI).traction == force_share.PLANS
    assert TimingSection().traction == force_share.REFERENCES
    faces = MotionLimits.of_robot(KIWI).acceleration_faces
    np.testing.assert_array_equal(faces, KIWI.acceleration_faces / force_share.REFERENCES)


def test_the_recommended_controller_is_the_best_in_the_example_of_the_readme():
    """Timed with 0.85 of the forces, it was governed and 180 mm late, feedforward 43 mm."""
    robot, dt = named_robot("paper"), 0.1
    start, goal = Waypoint(1, 1, 0), Waypoint(8, 6)
    path = plan_path(paper_map(), start, goal, inflation=0.0, options=PathOptions()).spline
    reference = time_within_limits(path, robot.chassis, MotionLimits.of_robot(robot))
    context = ControllerContext(robot, dt, np.random.default_rng(0), "recommended")
    errors = {}
    for name in ("holonomic-nmpc", "feedforward", "pid", "lqr"):
        made = configure("controllers", name).make(context)
        run = simulate(PlanarPlant(robot), made, reference, start=reference.at(0.0).pose, dt=dt)
        errors[name] = position_error(run.raise_if_failed().pose, run.target).mean()
    best = errors.pop("holonomic-nmpc")
    assert best < 0.003 < 0.2 * min(errors.values()), errors


class Jump:
    """Reference of a user that jumps by 1 m at 1 s."""

    duration = 4.0

    def at(self, t):
        return Hold(Pose(float(t >= 1.0), 0.0, 0.0), 1.0).at(t)

    def window(self, t, n, dt):
        rows = np.zeros((n, 6))
        rows[:, 0] = t + dt * np.arange(n) >= 1.0
        return rows


class FailsLate(Jump):
    """Reference that cannot be evaluated from 3 s on."""

    def window(self, t, n, dt):
        if t + (n - 1) * dt > 3.0:
            raise RuntimeError("late")
        return np.zeros((n, 6))


@pytest.mark.parametrize(
    "reference",
    [
        ShapeReference(Eight(), 14.0),
        ShapeReference(Square(ramp=0.0), 20.0),  # jumps to its speed and stops at once
        Hold(Pose(5.0, 5.0, 1.0), 2.0),
        Jump(),
        FailsLate(),
    ],
    ids=["within limits", "jumps at its ends", "hold", "jump", "fails"],
)
def test_references_that_it_leaves_as_they_are(reference):
    ours = governor()
    assert ours.govern(reference) is reference
    assert ours.delay(reference, 1.0) == 0.0
    assert ours.retime(reference) == Retiming(reference)


@pytest.mark.parametrize("duration", [20.0, 30.0])
def test_references_of_the_papers_study_are_left_as_they_are(duration):
    planned = plan_scenario(paper_scenario("recommended"))
    reference = planned.reference(duration)
    assert isinstance(reference, UniformReference)  # which jumps to 1.6 m/s at its start
    assert governor(planned.robot).govern(reference) is reference


def test_small_violations_are_left_to_the_controller():
    reference = ShapeReference(Eight(), 8.0)
    robot = named_robot("paper")
    assert governor(robot).govern(reference) is reference  # 1.06 times the forces, for 2 ms
    late = governor(named_robot("small")).govern(reference)
    assert late.max_delay > TOLERATED_DELAY
    assert late.duration == 8.0  # it makes up for the delay


def test_reference_beyond_the_limits_is_followed_later():
    reference = ShapeReference(Eight(), 8.0)
    ours = governor()
    governed = ours.govern(reference)
    assert isinstance(governed, DelayedReference)
    assert governed.reference is reference
    assert ours.govern(reference) is governed  # computed once
    assert ours.delay(reference, 0.5) == 0.0 < ours.delay(reference, 7.0) == governed.delay(7.0)
    tracked, notice = ours.retime(reference)
    duration = governed.duration
    assert tracked is governed
    assert duration > 8.5
    assert "64.3 rad/s (limit 40 rad/s)" in notice
    assert f"at {duration:.2f} s instead of 8.00 s" in notice


@pytest.mark.parametrize("name", ["paper", "small", "kiwi", "mecanum"])
def test_nothing_is_compiled_after_preparation(name):
    ours, compilations = governor(named_robot(name)), []
    ours.prepare()
    compile_listeners.append(compilations.append)
    try:
        ours.govern(ShapeReference(Eight(), 4.0)).window(2.0, 5, 0.1)
    finally:
        compile_listeners.remove(compilations.append)
    assert not compilations


def test_without_limits_of_acceleration_only_the_speed_counts():
    reference = ShapeReference(Eight(), 8.0)
    ours = ReferenceGovernor(KIWI.chassis, None)
    assert 8.0 < ours.govern(reference).duration < governor().govern(reference).duration
    assert "forces" not in ours.retime(reference).notice


@dataclass
class Governed:
    """Controller that follows the governed reference."""

    law: FeedforwardController
    governor: ReferenceGovernor = field(default_factory=governor)

    def reset(self, state):
        self.law.reset(state)

    def step(self, t, state, reference):
        return self.law.step(t, state, self.governor.govern(reference))

    def retime(self, reference):
        return self.governor.retime(reference)


def test_run_lasts_until_the_governed_reference_ends(caplog):
    reference = ShapeReference(Eight(), 8.0)
    controller = Governed(FeedforwardController(0.05))
    assert isinstance(controller, RetimingController)
    with caplog.at_level(logging.WARNING, "omnidrive"):
        runs = [
            simulate(
                KinematicPlant(KIWI), controller, reference, start=Pose(0.0, 0.0, 0.0), dt=0.05
            )
            for _ in range(2)
        ]
    run = runs[0].raise_if_failed()
    end = controller.governor.govern(reference).duration
    assert run.t[-1] == pytest.approx(end, abs=0.03)
    assert run.target[-1] == pytest.approx(reference.at(8.0).pose)  # the target is the original
    assert run.pose[-1] == pytest.approx(run.target[-1], abs=0.02)
    event = run.events[0]
    assert event.t == 0.0
    assert event.what == controller.retime(reference).notice
    assert sum(each.getMessage() == event.what for each in caplog.records) == 1  # not once per run


@pytest.mark.parametrize(
    "answer",
    [None, 9.0, Retiming(9.0), Retiming(Hold(STILL, 1.0), None), Retiming(Hold(STILL, inf))],
)
def test_malformed_retiming_ends_the_run(answer):
    controller = Governed(FeedforwardController(0.1))
    controller.retime = lambda reference: answer
    run = simulate(KinematicPlant(KIWI), controller, Hold(STILL, 1.0), start=STILL, dt=0.1)
    assert run.outcome is Outcome.CONTROLLER_FAILED
    assert "Retiming" in run.reason


def test_shorter_motion_does_not_shorten_the_run():
    controller = Governed(FeedforwardController(0.1))
    controller.retime = lambda reference: Retiming(Hold(STILL, 0.2))
    run = simulate(KinematicPlant(KIWI), controller, Hold(STILL, 1.0), start=STILL, dt=0.1)
    assert run.t[-1] == 1.0


@pytest.mark.parametrize("governed", [True, False])
def test_watchdog_compares_with_the_governed_reference(governed):
    """Its limit of 1 m is less than the distance to the reference, which is 2 s ahead."""
    robot, reference = named_robot("mecanum"), ShapeReference(Eight(), 8.0)
    controller = Governed(FeedforwardController(0.05), governor(robot))
    if not governed:
        controller.retime = Retiming
    start = reference.at(0.0).pose
    supervisor = SafetySupervisor(robot, Watchdog(WatchdogLimits(error=1.0)))
    run = simulate(
        KinematicPlant(robot), controller, reference, start=start, dt=0.05, supervisor=supervisor
    )
    assert (run.outcome is Outcome.FINISHED) == governed
    if governed:
        assert np.hypot(*(run.pose - run.target)[:, :2].T).max() > 1.5


def test_state_does_not_change_the_governed_reference():
    reference = ShapeReference(Eight(), 8.0)
    one, other = Governed(FeedforwardController(0.05)), Governed(FeedforwardController(0.05))
    one.reset(State(0.0, Pose(0.0, 0.0, 0.0)))
    one.step(0.0, State(0.0, Pose(0.3, 0.1, 0.2)), reference)
    first, second = (each.governor.govern(reference) for each in (one, other))
    assert np.array_equal(first.setpoints, second.setpoints)


def eight_with_nmpc(**options):
    context = ControllerContext(KIWI, 0.1, np.random.default_rng(0))
    controller = make_nmpc(context, HolonomicNmpcOptions(**options))
    reference = ShapeReference(Eight(), 8.0)
    start = reference.at(0.0).pose
    run = simulate(PlanarPlant(KIWI), controller, reference, start=start, dt=0.1)
    return run.raise_if_failed(), path_errors(run)


def test_nmpc_stays_on_the_path_and_arrives_later():
    run, errors = eight_with_nmpc()
    assert errors.position.mean() < 0.003
    assert errors.position.max() < 0.015
    assert errors.heading.mean() < 0.01
    moving = (run.t > 2.0) & (run.t < 8.0)
    logged = run.details["reference_delay"]
    assert run.detail_units["reference_delay"] == "s"
    assert errors.delay[moving] == pytest.approx(logged[moving], abs=0.05)
    assert logged.max(initial=0.0, where=np.isfinite(logged)) > 1.0
    assert 8.5 < arrival(run) < 8.47 * 1.05  # of the exact retiming
    assert "wheel speeds of 64.3 rad/s" in run.events[0].what


def test_nmpc_without_governor_cuts_corners():
    run, errors = eight_with_nmpc(governor=False)
    assert run.t[-1] == pytest.approx(8.0)
    assert errors.position.max() > 0.1
    assert not run.details["reference_delay"][:-1].any()
    assert not run.events


class Changing:
    """A reference of another package, which may change between runs."""

    def __init__(self, reference):
        self.reference = reference

    def __getattr__(self, name):
        return getattr(self.reference, name)


def test_reset_forgets_references_that_may_change():
    controller = holonomic_nmpc(KIWI.chassis, 0.1)
    fixed = ShapeReference(Eight(), 5.0)
    for reference, kept in ((fixed, True), (Changing(fixed), False)):
        one = controller.retime(reference)
        assert controller.retime(reference) is one
        controller.reset(State(0.0, STILL))
        assert (controller.retime(reference) is one) is kept
    free = holonomic_nmpc(KIWI.chassis, 0.1, governor=False)
    assert free.retime(fixed) == Retiming(fixed)
