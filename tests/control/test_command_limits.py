"""Limits of controllers: where they come from, and the warning about faster references."""

import logging

import numpy as np
import pytest

from omnidrive.components import configure
from omnidrive.control import CommandLimits, LimitedController, unicycle_nmpc
from omnidrive.control.components import ControllerContext
from omnidrive.control.nmpc.unicycle import PRESETS, robot_limits, tracking_problem
from omnidrive.control.pid import classical_pid
from omnidrive.evaluation.tables.robot_summary import RobotSummary
from omnidrive.execution.engine import log_new
from omnidrive.geometry import Pose
from omnidrive.reference import Hold, ShapeReference
from omnidrive.reference.shapes import Circle
from omnidrive.robot import ROBOTS, named_robot
from omnidrive.simulation import KinematicPlant, Outcome, simulate
from omnidrive.simulation.run_log import warn_once

DT = 0.1
PAPER = named_robot("paper")
FAST = ShapeReference(Circle(radius=1.0), 3.0)  # up to 2.7 m/s


@pytest.fixture(autouse=True)
def _tell_again():
    warn_once.cache_clear()


def run_on(controller, reference=FAST):
    start = reference.at(0.0).pose
    return simulate(KinematicPlant(PAPER), controller, reference, start=start, dt=DT)


@pytest.mark.parametrize("name", ROBOTS)
def test_top_speeds_and_accelerations_are_reached_in_every_direction(name):
    """As the directions of the summary of a robot show, which are sampled."""
    robot = named_robot(name)
    summary = RobotSummary.of(robot)
    for (top, top_yaw), polytope in (
        (robot.top_speeds, summary.speed),
        (robot.top_accelerations, summary.acceleration),
    ):
        assert top == pytest.approx(polytope.extremes[0], rel=1e-3)
        assert top <= polytope.extremes[0] * (1.0 + 1e-12)
        assert top_yaw == pytest.approx(polytope.yaw)


def test_limits_of_the_paper_are_kept_in_its_presets():
    assert classical_pid("paper", DT).command_limits(FAST) == CommandLimits(1.5, 3.14)
    assert classical_pid("published-code", DT).command_limits(FAST) == CommandLimits()
    assert unicycle_nmpc("paper", DT).command_limits(FAST) == CommandLimits(1.5, 3.14)
    assert unicycle_nmpc("published-code", DT).command_limits(FAST).speed == 15.0 / 3.0


@pytest.mark.parametrize("name", ROBOTS)
def test_unicycle_of_the_preset_recommended_has_the_limits_of_the_robot(name):
    robot = named_robot(name)
    context = ControllerContext(robot, DT, np.random.default_rng(0))
    made = configure("controllers", "unicycle-nmpc").make(context)
    assert made.command_limits(FAST) == pytest.approx(robot.top_speeds)
    assert made.parameters.position_weight == PRESETS["paper"].position_weight


def test_unicycle_uses_its_limits_where_the_reference_needs_them():
    parameters, start = robot_limits(PAPER), FAST.at(0.0).pose
    problem = tracking_problem(parameters, 1.0, start, FAST, horizon=5, dt=DT)
    assert problem.limits.speed == pytest.approx(2.7, rel=0.1)
    hold = Hold(Pose(1.0, 1.0, 0.0), 5.0)
    problem = tracking_problem(parameters, 0.0, start, hold, horizon=5, dt=DT)
    assert problem.limits == (1.5, 3.14)


def warnings_of_runs(caplog):
    """Messages without the notes on the compilation of kernels, which depend on the cache."""
    return [each.getMessage() for each in caplog.records if each.name != "omnidrive.compiled"]


@pytest.mark.parametrize("make", [classical_pid, unicycle_nmpc])
def test_reference_beyond_the_limits_is_one_warning_with_both_figures(make, caplog):
    with caplog.at_level(logging.WARNING, "omnidrive"):
        runs = [run_on(make("paper", DT)) for _ in range(2)]
    (message,) = warnings_of_runs(caplog)
    peak = np.hypot(*FAST.window(0.0, 31, DT)[:, 3:5].T).max()
    assert f"moves at up to {peak:.3g} m/s, and the controller commands at most 1.5 m/s" in message
    for run in runs:  # also where the warning is not repeated
        assert [event.what for event in run.events if event.t == 0.0] == [message]


def test_reference_within_the_limits_is_no_warning(caplog):
    slow = ShapeReference(Circle(radius=1.0), 8.0)
    run_on(classical_pid("paper", DT), slow)
    run_on(classical_pid("recommended", DT, PAPER))
    assert not warnings_of_runs(caplog)


def test_both_limits_are_told(caplog):
    turning = ShapeReference(Circle(radius=1.0), 1.5)
    run_on(classical_pid("paper", DT), turning)
    assert "; it turns at up to " in caplog.text
    assert "commands at most 3.14 rad/s" in caplog.text


def test_limits_that_fail_end_the_run():
    class Broken:
        def __init__(self):
            self.inner = classical_pid("paper", DT)

        def reset(self, state):
            self.inner.reset(state)

        def step(self, t, state, reference):
            return self.inner.step(t, state, reference)

        def command_limits(self, reference):
            return 1.5

    assert isinstance(Broken(), LimitedController)
    run = run_on(Broken())
    assert run.outcome is Outcome.CONTROLLER_FAILED
    assert "command_limits must return CommandLimits" in run.reason


def test_warnings_of_worker_processes_are_logged_once(caplog):
    record = logging.LogRecord("omnidrive", logging.WARNING, "", 0, "too %s", ("fast",), None)
    logged = set()
    log_new([record, record], logged)
    log_new([record], logged)
    assert [each.getMessage() for each in caplog.records] == ["too fast"]
