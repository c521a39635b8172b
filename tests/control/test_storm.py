"""Storms of bad numbers over every controller, and over a whole pipeline."""

import time
from collections import Counter
from itertools import product
from math import hypot, inf, isfinite, nan

import numpy as np
import pytest

from omnidrive.control import HolonomicController, Pipeline, Status, holonomic_nmpc
from omnidrive.control.components import ControllerContext, HolonomicNmpcOptions
from omnidrive.control.components import holonomic_nmpc as recommended
from omnidrive.control.nmpc.holonomic import Actuation, FallbackLevel
from omnidrive.control.supervision import SafetySupervisor, Watchdog, WatchdogLimits, WheelMonitor
from omnidrive.estimation import SensorReadings, State
from omnidrive.geometry import BodyTwist, Pose, move, wrap
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import PlanarPlant
from omnidrive.testing.laws import Circle
from tests.laws.test_controllers import CONTROLLERS, SMALL

STORMED = CONTROLLERS | {
    "nmpc_with_forces": lambda dt: holonomic_nmpc(
        SMALL.chassis, dt, actuation=Actuation.of(SMALL, delay=1.5 * dt)
    ),
    "nmpc_without_forces": lambda dt: holonomic_nmpc(
        SMALL.chassis, dt, actuation=Actuation(SMALL.acceleration_faces / 0.85)
    ),
    "nmpc_rti": lambda dt: holonomic_nmpc(SMALL.chassis, dt, solver="rti"),
}
SAMPLE_TIMES = (1e-3, 1e-2, 0.1, 1.0)
BAD = (nan, inf, -inf, 1e300, -1e300, 1.7e308, 1e12)
LEAD = 0.1  # m/s and rad/s; of the feedforward by the robot's lag, on the circle
LONG_STEPS = 1400  # for each of 22 controllers and 4 sample times: 123,200


def bad_state(rng, t, pose):
    """Return a time and a state of which at least one number is bad."""
    numbers = [t, *pose]
    for i in rng.choice(4, size=rng.integers(1, 5), replace=False):
        numbers[i] = float(rng.choice(BAD))
    return numbers[0], State(numbers[0], Pose(*numbers[1:]))


def good_state(rng, t, reference):
    """Return a state near the reference, or far from it; what laws do not use may be bad."""
    near = rng.random() < 0.7
    spread = np.array([0.1, 0.1, 0.1] if near else [50.0, 50.0, 50.0])
    if rng.random() < 0.02:
        spread *= 1e7
    pose = Pose(*(np.array(reference.at(t).pose) + spread * rng.normal(size=3)).tolist())
    twist = BodyTwist(*rng.choice(BAD, size=3).tolist()) if rng.random() < 0.2 else None
    covariance = np.full((3, 3), nan) if rng.random() < 0.2 else None
    return State(t, pose, twist, covariance, float(rng.choice(BAD)))


def exceeds_limits(name, controller, command, pose, t, reference):
    """Return whether a command is beyond the stated limits of its controller."""
    twist = command.twist
    speed, yaw_rate = hypot(twist.vx, twist.vy), abs(twist.yaw_rate)
    if hasattr(controller, "chassis"):
        wheel_speeds = np.abs(controller.chassis.wheel_speeds(twist))
        return wheel_speeds.max() > controller.chassis.max_wheel_speed * (1.0 + 1e-12)
    if name in {"pid", "fuzzy_t1", "fuzzy_t2", "fuzzy_t3", "nmpc"}:  # those of the paper
        return speed > 1.5 + 1e-9 or yaw_rate > 3.14 + 1e-9
    if name.endswith("_recommended"):  # their corrections are limited
        if max(map(abs, pose)) > 1e4 or command.status is not Status.OK:
            return False  # differences of such poses are inaccurate
        moved = np.subtract(move(pose, twist, controller.dt), pose) / controller.dt
        rows = reference.window(t, 3, 0.5 * controller.dt)[:, 3:]
        x, y, yaw = moved - (rows[0] + 4.0 * rows[1] + rows[2]) / 6.0
        top = controller.x.parameters.limit, controller.heading.parameters.limit
        return hypot(x, y) > top[0] + LEAD or abs(yaw) > top[1] + LEAD
    unlimited = {"feedforward", "sliding-mode"}
    assert name in unlimited or name.endswith("_published"), name
    return False


def sees_good_steps_only(controller, shadow):
    """Return a controller that did not see the bad steps.

    For most it is the shadow, which is called in good steps only. The memory of a
    HolonomicController is stated to be the observed motion, which bad steps continue, and the
    latest plan.
    """
    if isinstance(controller, HolonomicController):
        shadow._copy_state(controller)
    return shadow


def storm(name, dt, steps, seed):
    """Call one controller with good and bad numbers, and return how many were bad."""
    rng = np.random.default_rng(seed)
    controller, shadow = STORMED[name](dt), STORMED[name](dt)
    start = State(0.0, Circle().at(0.0).pose)
    controller.reset(start)
    shadow.reset(start)
    found, period = Counter(), max(dt, 0.05)
    for k in range(steps):
        t, where = (k * dt) % 8.0, f"{name}, dt={dt:g} s, seed {seed}, step {k}"
        reference = Circle() if (k * dt) % 1.0 < 0.5 + period else Hold(Pose(0.3, 0.2, 1.0), 8.0)
        found["steps"] += 1
        if rng.random() < 0.3:
            bad_t, state = bad_state(rng, t, reference.at(t).pose)
            command = controller.step(bad_t, state, reference)
            found["bad"] += 1
            assert command.status is not Status.OK, where
            assert all(map(isfinite, command.value)), where
            continue
        state = good_state(rng, t, reference)
        expected = sees_good_steps_only(controller, shadow)
        command = controller.step(t, state, reference)
        other = expected.step(t, state, reference)
        assert all(map(isfinite, command.value)), where
        assert repr(command) == repr(other), where
        assert not exceeds_limits(name, controller, command, state.pose, t, reference), where
        found[command.status.name] += 1
    return found


@pytest.mark.parametrize("steps", [10, pytest.param(LONG_STEPS, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", STORMED)
def test_storm_of_bad_numbers(name, steps):
    """No exception, no bad command, and no effect of bad steps on later good ones."""
    begin, total = time.perf_counter(), Counter()
    for seed, dt in enumerate(SAMPLE_TIMES):
        total += storm(name, dt, steps, seed)
    print(f"{name}: {dict(total)} in {time.perf_counter() - begin:.1f} s")
    assert total["steps"] == steps * len(SAMPLE_TIMES)
    assert total["bad"] > 0.2 * total["steps"]
    assert total["OK"] > 0


ROBOT_NAMES = ("paper", "small", "kiwi", "mecanum")
FAULTS = ("bad", "lost", "outlier", "twist", "covariance", "old", "repeated", "late")
RECOVERY = 4.0  # s of good states after the last fault
LEFT, LEFT_BY_A_DELAY = (0.05, 0.15), (0.3, 0.5)  # m and rad, of any run, and of the worst ones
DELAYED = 1e-3  # share of runs in which old poses, which look like a delay, may leave more


def faulty_state(rng, fault, t, pose, older):
    """Return the time and the state of one sample, None for a controller that is not called."""
    state = State(t, pose)
    if fault == "bad":
        t, state = bad_state(rng, t, pose)
    elif fault == "lost":
        state = state._replace(pose=Pose(nan, nan, nan))
    elif fault == "outlier":
        offset = 10.0 ** rng.uniform(-1.0, 9.0) * rng.normal(size=3) * (rng.random(3) < 0.5)
        state = state._replace(pose=Pose(*np.add(pose, offset).tolist()))
    elif fault == "twist":
        twist = 10.0 ** rng.uniform(0.0, 9.0) * rng.normal(size=3)
        state = state._replace(twist=BodyTwist(*twist.tolist()))
    elif fault == "covariance":
        state = state._replace(covariance=10.0 ** rng.uniform(-9.0, 9.0) * np.eye(3))
    elif fault == "old":
        state = State(t, older, fix_age=float(rng.uniform(0.0, 1.0)))
    elif fault == "repeated":
        t -= float(rng.uniform(0.0, 1.0))
    return None if fault == "late" else (t, state)


def run_of_faults(robot, controller, plant, dt, rng, where):
    """Drive one run with a burst of faults and a recovery; return the counted levels."""
    reference, levels = Circle(), Counter()
    begin = float(rng.uniform(0.0, 2.0))
    poses = [reference.at(begin).pose]
    controller.reset(State(begin, poses[0]))
    plant.reset(poses[0])
    first = int(rng.integers(1, 8))
    last = first + int(rng.integers(1, 14))
    kinds = rng.choice(FAULTS, size=rng.integers(1, 4), replace=False)
    twist, units = BodyTwist(0.0, 0.0, 0.0), len(controller.detail_units)
    for k in range(last + round(RECOVERY / dt)):
        t = begin + k * dt
        given = t, State(t, poses[-1])
        if first <= k < last:
            fault = str(rng.choice(kinds))
            given = faulty_state(rng, fault, t, poses[-1], poses[max(-4, -len(poses))])
        if given is not None:
            command = controller.step(*given, reference)
            twist, level = command.twist, FallbackLevel(int(command.details[0]))
            speeds = np.abs(controller.chassis.wheel_speeds(twist))
            assert all(map(isfinite, twist)), (where, k)
            assert speeds.max() <= controller.chassis.max_wheel_speed * (1.0 + 1e-12), (where, k)
            assert len(command.details) == units, (where, k)
            assert STATUS[level] is command.status, (where, k)
            levels[level] += 1
            if not first <= k < last:  # planned from what is measured
                assert level in {FallbackLevel.CONVERGED, FallbackLevel.FEASIBLE}, (where, k)
        poses.append(plant.step(twist, dt).pose)
    goal = reference.at(t + dt).pose
    left = hypot(goal.x - poses[-1].x, goal.y - poses[-1].y), abs(wrap(goal.yaw - poses[-1].yaw))
    assert left[0] < LEFT_BY_A_DELAY[0], (where, kinds, left)
    assert left[1] < LEFT_BY_A_DELAY[1], (where, kinds, left)
    levels["far"] = left[0] > LEFT[0] or left[1] > LEFT[1]
    return levels


STATUS = {
    FallbackLevel.CONVERGED: Status.OK,
    FallbackLevel.FEASIBLE: Status.FALLBACK,
    FallbackLevel.OLD_PLAN: Status.FALLBACK,
    FallbackLevel.RAMP: Status.FALLBACK,
    FallbackLevel.STOP: Status.FAILED,
}


@pytest.mark.parametrize("runs", [24, pytest.param(10_000, marks=pytest.mark.long)])
def test_runs_with_faults(runs):
    """NaN, late, lost and outlying states: the recommended controller recovers."""
    total, failures = Counter(), []
    for number, (name, dt) in enumerate(product(ROBOT_NAMES, (0.02, 0.05, 0.1))):
        robot = named_robot(name)
        context = ControllerContext(robot, dt, np.random.default_rng(0))
        controller = recommended(context, HolonomicNmpcOptions())
        plant = PlanarPlant(robot)
        for run in range(number, runs, 12):
            where = f"{name}, dt={dt:g} s, run {run}"
            rng = np.random.default_rng(run)
            try:
                total += run_of_faults(robot, controller, plant, dt, rng, where)
            except AssertionError as error:
                failures.append(error)
    print(dict(total))
    assert not failures, "\n".join(map(str, failures))
    assert total.pop("far", 0) <= DELAYED * runs
    assert set(total) | {FallbackLevel.FEASIBLE} == set(FallbackLevel)  # few plans stop early


@pytest.mark.parametrize("run", [249, 404, 493, 3008, 3225])
def test_a_lost_pose_among_noisy_ones_leaves_all_estimates_finite(run):
    """The identification restarts where poses are noisy, but not at a pose that is not a number."""
    name, dt = list(product(ROBOT_NAMES, (0.02, 0.05, 0.1)))[run % 12]
    robot = named_robot(name)
    context = ControllerContext(robot, dt, np.random.default_rng(0))
    controller = recommended(context, HolonomicNmpcOptions())
    run_of_faults(robot, controller, PlanarPlant(robot), dt, np.random.default_rng(run), name)
    assert all(map(isfinite, controller.drive.parameters["gains"][0]))


@pytest.mark.parametrize("run", [1163, 1472, 2759])
def test_poses_of_three_samples_ago_are_no_lasting_delay(run):
    """For 0.6 to 1.2 s they look like a response that is three samples later."""
    name, dt = list(product(ROBOT_NAMES, (0.02, 0.05, 0.1)))[run % 12]
    robot = named_robot(name)
    context = ControllerContext(robot, dt, np.random.default_rng(0))
    controller = recommended(context, HolonomicNmpcOptions())
    rng = np.random.default_rng(run)
    assert not run_of_faults(robot, controller, PlanarPlant(robot), dt, rng, name)["far"]


class Careless:
    """An estimator of which any number may be bad."""

    def __init__(self, rng):
        self.rng = rng

    def reset(self, pose):
        pass

    def update(self, readings):
        t = readings.stamp
        numbers = np.array([t, *Circle().at(t).pose, 0.0, 0.0, 0.0, 0.1, *np.eye(3).ravel()])
        is_bad = self.rng.random(len(numbers)) < 0.03
        numbers[is_bad] = self.rng.choice(BAD, size=int(is_bad.sum()))
        stamp, x, y, yaw, *twist, age = numbers[:8].tolist()
        return State(stamp, Pose(x, y, yaw), BodyTwist(*twist), numbers[8:].reshape(3, 3), age)


def bad_readings(rng, t):
    """Return readings of four wheels of which any number may be bad."""
    numbers = np.zeros(9)
    is_bad = rng.random(9) < 0.1
    numbers[is_bad] = rng.choice(BAD, size=int(is_bad.sum()))
    return SensorReadings(t, tuple(numbers[:4]), tuple(numbers[4:8]), float(numbers[8]))


@pytest.mark.parametrize("steps", [60, pytest.param(3000, marks=pytest.mark.long)])
@pytest.mark.parametrize("name", ["feedforward", "fuzzy_t1", "pid_recommended", "nmpc_with_forces"])
def test_storm_over_a_pipeline(name, steps):
    """The state for the controller stays finite, and the pipeline raises nothing."""
    rng, dt, start = np.random.default_rng(5), 0.1, Circle().at(0.0).pose
    watchdog = Watchdog(WatchdogLimits(1e6, 1e6, 1e6, 60.0))
    line = Pipeline(
        STORMED[name](dt), Careless(rng), SafetySupervisor(SMALL, watchdog, WheelMonitor(SMALL))
    )
    line.prepare()
    kept = 0
    for k in range(steps):
        if k % 80 == 0:
            line.reset(start)
        t = (k % 80) * dt
        step = line.step(t, bad_readings(rng, t), Circle(), dt)
        assert step.failed is None, (k, step.command.message)
        assert all(map(isfinite, (*step.state.pose, step.state.fix_age)))
        assert all(map(isfinite, step.command.value))
        kept += step.command.status is not Status.OK
    assert kept > 0.1 * steps


def test_bad_time_fails_one_step_of_a_pipeline():
    line = Pipeline(STORMED["pid"](0.1))
    line.reset(Pose(0.0, 0.0, 0.0))
    line.step(0.0, SensorReadings(0.0), Circle(), 0.1)
    for t in BAD:
        step = line.step(t, SensorReadings(0.1), Circle(), 0.1)
        assert step.failed == "reference"
        assert "the time of the sample is not usable" in step.command.message
    assert line.step(0.1, SensorReadings(0.1), Circle(), 0.1).command.status is Status.OK
