"""Self-tuning PID: laws, presets and closed-loop behaviour."""

import pickle
import re
from dataclasses import replace
from math import cos, hypot, inf, pi, sin

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from omnidrive.control import Controller, FeedforwardController, Status
from omnidrive.control.pid import (
    FuzzyPidController,
    PidChannel,
    SelfTuningParameters,
    TrackingParameters,
    TrackingPidController,
    classical_pid,
    fuzzy_pid,
    gain_inference,
    no_tuning,
)
from omnidrive.control.pid.channel import TuningRecord
from omnidrive.control.pid.laws import (
    Gains,
    SelfTuningState,
    TrackingState,
    braking,
    fuzzy_inputs,
    low_pass,
    mirror_to_negative,
    self_tuning_law,
    tracking_integral,
    tracking_law,
    tune_bounded_gains,
    tune_gains,
)
from omnidrive.control.pid.presets import robot_parameters
from omnidrive.control.pid.tracking import Pair, lead, missing_motion
from omnidrive.control.pid.tuners import FuzzyTuner
from omnidrive.errors import InvalidInput
from omnidrive.estimation import LatestFix, State
from omnidrive.fuzzy import Inference
from omnidrive.geometry import (
    BodyTwist,
    Pose,
    WorldTwist,
    move,
    to_body,
    to_world,
    twist_between,
    wrap,
)
from omnidrive.reference import Hold, ShapeReference
from omnidrive.reference.shapes import Eight
from omnidrive.robot import ROBOTS, named_robot
from omnidrive.simulation import KinematicPlant, Outcome, PlanarPlant, simulate
from omnidrive.testing.laws import Circle

DT = 0.1
PRESETS = [(kind, preset) for kind in ("t1", "t2") for preset in ("paper", "published-code")]

metres = st.floats(-3.0, 3.0)
angles = st.floats(-3.0, 3.0)
poses = st.builds(Pose, metres, metres, angles)
errors = st.builds(complex, metres, metres)


@pytest.fixture(params=PRESETS, ids="-".join, scope="module")
def controller(request):
    return fuzzy_pid(*request.param, DT)


def first_command(controller, pose, goal):
    controller.reset(State(0.0, pose))
    return controller.step(0.0, State(0.0, pose), Hold(goal, 1.0)).twist


def closed_loop(controller, start, goal, seconds=10.0):
    plant = KinematicPlant(named_robot("paper"))
    return simulate(plant, controller, Hold(goal, seconds), start=start, dt=DT)


class TestEveryPreset:
    def test_is_a_controller(self, controller):
        assert isinstance(controller, Controller)
        assert isinstance(controller, FuzzyPidController)

    @given(poses, poses)
    def test_velocity_points_to_goal(self, controller, pose, goal):
        twist = to_world(first_command(controller, pose, goal), pose.yaw)
        dx, dy = goal.x - pose.x, goal.y - pose.y
        speed = hypot(twist.vx, twist.vy)
        assert twist.vx * dy == pytest.approx(twist.vy * dx, abs=1e-9)
        assert twist.vx * dx + twist.vy * dy == pytest.approx(speed * hypot(dx, dy), abs=1e-9)

    @given(poses, poses, angles)
    def test_command_is_invariant_to_world_rotation(self, controller, pose, goal, angle):
        def turn(p):
            c, s = cos(angle), sin(angle)
            return Pose(c * p.x - s * p.y, s * p.x + c * p.y, p.yaw + angle)

        here = first_command(controller, pose, goal)
        there = first_command(controller, turn(pose), turn(goal))
        assert there == pytest.approx(here, abs=1e-6)

    def test_reaches_and_holds_goal(self, controller):
        run = closed_loop(controller, Pose(1.0, 1.0, 0.0), Pose(2.0, 2.0, pi / 4))
        error = np.abs(run.pose - run.target)[-20:]
        assert (run.status == Status.OK).all()
        assert error[:, :2].max() < 1e-3
        assert error[:, 2].max() < 1e-3

    def test_runs_after_reset_are_identical(self, controller):
        runs = [
            closed_loop(controller, Pose(1.0, 1.0, 0.0), Pose(2.0, 1.5, -1.0), 2.0)
            for _ in range(2)
        ]
        assert (runs[0].command == runs[1].command).all()

    def test_is_picklable(self, controller):
        pose, goal = Pose(1.0, 1.0, 0.0), Pose(1.3, 1.2, 0.2)
        copy = pickle.loads(pickle.dumps(controller))
        assert first_command(copy, pose, goal) == first_command(controller, pose, goal)

    def test_zero_command_at_goal(self, controller):
        pose = Pose(1.0, 2.0, 0.3)
        assert first_command(controller, pose, pose) == pytest.approx((0.0, 0.0, 0.0))


class TestPublishedCode:
    @pytest.mark.parametrize(("kind", "most"), [("t1", 7.2231), ("t2", 7.2827)])
    def test_total_gain_is_nearly_constant(self, kind, most):
        controller = fuzzy_pid(kind, "published-code", DT)
        gains = [
            first_command(controller, Pose(-e, 0.0, 0.0), Pose(0.0, 0.0, 0.0)).vx / e
            for e in np.linspace(1e-3, 2.0, 800).tolist()
        ]
        assert min(gains) > 6.999
        assert most - 1e-3 < max(gains) < most + 1e-3

    def test_gains_are_not_tuned_beyond_one_metre(self):
        controller = fuzzy_pid("t1", "published-code", DT)
        twist = first_command(controller, Pose(0.0, 0.0, 0.0), Pose(1.5, 0.0, 0.0))
        assert twist.vx == pytest.approx(7.0 * 1.5)

    @given(poses, poses)
    def test_has_no_memory(self, pose, goal):
        controller = fuzzy_pid("t1", "published-code", DT)
        first = controller.step(0.0, State(0.0, pose), Hold(goal, 1.0))
        assert controller.step(DT, State(DT, pose), Hold(goal, 1.0)) == first

    def test_heading_difference_is_not_wrapped(self):
        controller = fuzzy_pid("t1", "published-code", DT)
        twist = first_command(controller, Pose(0.0, 0.0, 3.0), Pose(0.0, 0.0, -3.0))
        assert twist.yaw_rate == pytest.approx(-7.0 * 6.0)


@pytest.mark.parametrize("kind", ["t1", "t2"])
class TestPaper:
    def test_heading_difference_is_wrapped(self, kind):
        controller = fuzzy_pid(kind, "paper", DT)
        run = closed_loop(controller, Pose(0.0, 0.0, 3.0), Pose(0.0, 0.0, -3.0))
        assert np.abs(np.diff(run.pose[:, 2])).sum() < 2.0 * abs(wrap(-6.0))
        assert abs(wrap(run.pose[-1, 2] + 3.0)) < 1e-3

    def test_command_respects_limits(self, kind):
        controller = fuzzy_pid(kind, "paper", DT)
        run = closed_loop(controller, Pose(0.0, 0.0, 0.0), Pose(10.0, -10.0, 3.0), 20.0)
        assert np.hypot(run.command[:, 0], run.command[:, 1]).max() <= 1.5 + 1e-9
        assert np.abs(run.command[:, 2]).max() <= 3.14 + 1e-9

    def test_saturation_causes_no_windup(self, kind):
        controller = fuzzy_pid(kind, "paper", DT)
        run = closed_loop(controller, Pose(0.0, 0.0, 0.0), Pose(10.0, 0.0, 0.0), 20.0)
        assert run.pose[:, 0].max() < 10.02

    def test_follows_ramp_without_lag(self, kind):
        """The integral removes the error on a ramp, which proportional control would leave."""

        class Ramp(Hold):
            def at(self, t):
                return super().at(t)._replace(pose=Pose(0.5 * t, 0.0, 0.0))

        plant = KinematicPlant(named_robot("paper"))
        ramp = Ramp(Pose(0.0, 0.0, 0.0), 20.0)
        run = simulate(plant, fuzzy_pid(kind, "paper", DT), ramp, start=Pose(0.0, 0.0, 0.0), dt=DT)
        # the goal is one sample ahead, so that the robot leads by 0.5 m/s for 0.1 s
        assert run.pose[-1, 0] - run.target[-1, 0] == pytest.approx(0.5 * DT, abs=2e-3)

    def test_reset_clears_integrator(self, kind):
        controller = fuzzy_pid(kind, "paper", DT)
        goal = Hold(Pose(1.0, 0.0, 0.0), 1.0)
        pose = Pose(0.9, 0.0, 0.0)
        controller.reset(State(0.0, pose))
        first, second = (
            controller.step(0.0, State(0.0, pose), goal),
            controller.step(DT, State(DT, pose), goal),
        )
        assert second != first
        controller.reset(State(0.0, pose))
        assert controller.step(0.0, State(0.0, pose), goal) == first


class TestLaw:
    @given(errors, errors, errors)
    def test_saturation_keeps_direction(self, integral, last, error):
        parameters = SelfTuningParameters()
        gains = Gains(4.0, 3.0, 0.2)
        free = parameters._replace(limit=1e9)
        state = SelfTuningState(integral, last, abs(last))
        command, _ = self_tuning_law(parameters, gains, state, error, DT)
        desired, _ = self_tuning_law(free, gains, state, error, DT)
        assert abs(command) <= parameters.limit + 1e-12
        assert (command * desired.conjugate()).imag == pytest.approx(0.0, abs=1e-9)
        assert (command * desired.conjugate()).real >= -1e-12

    def test_unsaturated_law_is_textbook_pid(self):
        free = SelfTuningParameters(limit=20.0)
        state = SelfTuningState(0.3, 0.1, 0.1)
        command, integral = self_tuning_law(free, Gains(4.0, 3.0, 0.2), state, 0.15, DT)
        assert integral == pytest.approx(0.3 + 3.0 * 0.15 * DT)
        assert command == pytest.approx(4.0 * 0.15 + integral + 0.2 * (0.15 - 0.1) / DT)

    def test_saturation_corrects_integral(self):
        parameters = SelfTuningParameters(limit=1.0, tracking_time=0.5)
        command, integral = self_tuning_law(
            parameters, Gains(2.0, 0.0, 0.0), SelfTuningState(0.0, 1.0, 1.0), 1.0, DT
        )
        assert command == pytest.approx(1.0)
        assert integral == pytest.approx(-0.2)

    @given(*[st.floats(-0.1, 0.1)] * 3)
    def test_gains_are_bounded_and_not_negative(self, dkp, dki, dkd):
        gains = tune_gains(SelfTuningParameters(), (dkp, dki, dkd))
        assert 3.0 <= gains.kp <= 5.0
        assert 2.0 <= gains.ki <= 4.0
        assert 0.0 <= gains.kd <= 1.0


class Jump(Hold):
    """A constant reference that jumps to another pose at 0.95 s."""

    def pose_at(self, t):
        x, y, yaw = self.pose
        jumped = t > 0.95
        return Pose(x + jumped, y + jumped, yaw + 0.5 * jumped)

    def at(self, t):
        return super().at(t)._replace(pose=self.pose_at(t))

    def window(self, t, n, dt):
        rows = super().window(t, n, dt)
        rows[:, :3] = [self.pose_at(t + k * dt) for k in range(n)]
        return rows


def tracking_pid(parameters, dt=DT, tune=no_tuning):
    return TrackingPidController(dt, *(PidChannel(tune, dt, parameters) for _ in range(3)))


def run_on(controller, reference, start, dt=DT, estimator=None, robot="paper"):
    plant = KinematicPlant(named_robot(robot))
    return simulate(plant, controller, reference, start=start, dt=dt, estimator=estimator)


class Scaled(KinematicPlant):
    """A plant that executes ``gain`` times the commanded twist."""

    def __init__(self, robot, gain):
        super().__init__(robot)
        self.gain = gain

    def step(self, command, dt):
        return super().step(BodyTwist(*(self.gain * each for each in command)), dt)


def far_apart():
    return Pose(0.0, 0.0, 0.0), Pose(5.0, -3.0, 2.0)


RECOMMENDED = {
    "pid": lambda dt: classical_pid("recommended", dt),
    "t1": lambda dt: fuzzy_pid("t1", "recommended", dt),
    "t2": lambda dt: fuzzy_pid("t2", "recommended", dt),
    "t3": lambda dt: fuzzy_pid("t3", "recommended", dt),
}


@pytest.fixture(params=RECOMMENDED)
def make(request):
    return RECOMMENDED[request.param]


class TestRecommended:
    def test_equals_feedforward_controller_with_kp_only(self):
        plain = TrackingParameters(ki=0.0, kd=0.0)
        start = Pose(0.1, -1.1, 0.1)
        one = run_on(tracking_pid(plain), Circle(), start)
        two = run_on(FeedforwardController(DT), Circle(), start)
        assert one.command == pytest.approx(two.command, abs=1e-5)

    @pytest.mark.parametrize("dt", [0.01, 0.1, 0.5])
    def test_follows_circle_at_any_sample_time(self, make, dt):
        run = run_on(make(dt), Circle(), Circle().at(0.0).pose, dt)
        assert np.abs(run.pose - run.target)[-3:].max() < 0.01

    def test_reference_jump_gives_no_derivative_kick(self, make):
        """Neither through the feedforward before it nor through the rate of the error."""
        start = Pose(0.0, 0.0, 0.0)
        run = run_on(make(DT), Jump(start, 2.0), start)
        jump = round(1.0 / DT)
        assert not run.command[:jump].any()
        for axis in ("x", "y", "heading"):
            assert run.details[f"change_input_{axis}"][: jump + 1] == pytest.approx(0.0)
            assert run.details[f"error_input_{axis}"][jump] == 1.0
        # proportional to the error of (1 m, 1 m, 0.5 rad): no more than kp times it
        assert np.hypot(run.command[:, 0], run.command[:, 1]).max() < 6.0 * hypot(1.0, 1.0)
        assert np.abs(run.command[:, 2]).max() < 5.0 * 0.5

    def test_error_rate_of_blocked_robot_is_reference_velocity(self):
        """The measured pose is constant while the reference moves."""
        controller = tracking_pid(TrackingParameters(filter_time=0.0))
        pose = Circle().at(0.0).pose
        controller.reset(State(0.0, pose))
        units = list(controller.detail_units)
        details = [controller.step(t, State(t, pose), Circle()).details for t in (0.0, DT)]
        column = units.index("change_input_x")
        assert details[0][column] == 0.0
        assert details[1][column] == pytest.approx(2 * pi / 8.0, rel=0.01)

    def test_saturation_causes_no_windup(self, make):
        start = Pose(0.0, 0.0, 0.0)
        run = run_on(make(DT), Hold(Pose(10.0, -5.0, 3.0), 20.0), start)
        assert run.pose[:, 0].max() < 10.01
        assert run.pose[:, 1].min() > -5.01
        assert np.abs(run.pose - run.target)[-10:].max() < 1e-3

    def test_saturation_of_x_and_y_keeps_direction(self):
        controller = tracking_pid(TrackingParameters(limit=1.5))
        twist = first_command(controller, Pose(0.0, 0.0, 0.0), Pose(4.0, 1.0, 0.0))
        assert twist.vy / twist.vx == pytest.approx(0.25)
        assert hypot(twist.vx, twist.vy) == pytest.approx(1.5)

    @pytest.mark.parametrize("name", ROBOTS)
    def test_limits_are_those_of_the_robot(self, name):
        """No speed of another robot limits a command far from the goal."""
        robot = named_robot(name)
        controller = classical_pid("recommended", DT, robot)
        speed, yaw_rate = robot.top_speeds
        origin, slope = Pose(0.0, 0.0, 0.0), -np.expm1(-5.0 * DT) / DT
        vx, vy, _ = first_command(controller, Pose(1e3, 1e3, 0.0), origin)
        assert hypot(vx, vy) == pytest.approx(speed)
        turn = first_command(controller, origin, Pose(0.0, 0.0, 3.0)).yaw_rate
        p = controller.heading.parameters
        factor = braking(slope, 3.0, p.braking_share * p.acceleration)
        assert turn == pytest.approx(min(yaw_rate, factor * slope * 3.0))

    def test_robot_without_forces_has_neither_lag_nor_acceleration(self):
        robot = named_robot("small")
        position, heading = robot_parameters(robot, forces=False)
        assert position == TrackingParameters(limit=2.5)
        assert heading.lag == 0.0
        assert robot_parameters(replace(robot, motor_lag=0.5))[0].lag == robot.lag[0] + 0.5

    def test_robot_without_friction_is_accepted(self):
        slippery = replace(named_robot("small"), friction=0.0)
        twist = first_command(classical_pid("recommended", DT, slippery), *far_apart())
        assert np.isfinite(twist).all()

    def test_heading_difference_is_wrapped(self, make):
        run = run_on(make(DT), Hold(Pose(0.0, 0.0, -3.0), 10.0), Pose(0.0, 0.0, 3.0))
        assert np.abs(np.diff(run.pose[:, 2])).sum() < 1.1 * abs(wrap(-6.0))
        assert abs(wrap(run.pose[-1, 2] + 3.0)) < 1e-3

    def test_wrapped_measurement_has_no_effect(self, make):
        """The measured heading jumps by 2 pi."""

        class Wrapped(LatestFix):
            def update(self, readings):
                state = super().update(readings)
                return state._replace(pose=state.pose._replace(yaw=wrap(state.pose.yaw)))

        start = Circle().at(0.0).pose
        plain = run_on(make(DT), Circle(), start)
        wrapped = run_on(make(DT), Circle(), start, estimator=Wrapped())
        assert wrapped.command == pytest.approx(plain.command, abs=1e-9)

    def test_integral_removes_constant_error(self, make):
        """A drift of 0.1 m/s: proportional control alone would leave an error of 0.1 / 5 m."""

        class Drifting(KinematicPlant):
            def step(self, twist, dt):
                return super().step(twist._replace(vx=twist.vx - 0.1), dt)

        start = Pose(0.0, 0.0, 0.0)
        plant = Drifting(named_robot("paper"))
        run = simulate(plant, make(DT), Hold(start, 30.0), start=start, dt=DT)
        assert np.abs(run.pose[:, 0]).max() > 0.01
        assert abs(run.pose[-1, 0]) < 1e-6

    @pytest.mark.parametrize("dt", [0.02, 0.1])
    @pytest.mark.parametrize("name", ROBOTS)
    def test_step_does_not_overshoot(self, name, dt):
        robot = named_robot(name)
        goal = Hold(Pose(1.0, 1.0, pi / 4), 3.0)
        controller = classical_pid("recommended", dt, robot)
        run = simulate(PlanarPlant(robot), controller, goal, start=Pose(0.0, 0.0, 0.0), dt=dt)
        done = run.pose / goal.pose
        assert done.max() < 1.005
        assert done[-1].min() > 0.98

    @pytest.mark.parametrize("gain", [0.9, 1.1])
    def test_integral_halves_the_error_of_a_wrong_gain(self, make, gain):
        """Of a wheel radius that is 10 % wrong; the error after the first lap's half."""
        start = Circle().at(0.0).pose
        plant = Scaled(named_robot("paper"), gain)
        with_integral = simulate(plant, make(DT), Circle(), start=start, dt=DT)
        without = tracking_pid(TrackingParameters(ki=0.0))
        without = simulate(plant, without, Circle(), start=start, dt=DT)
        late = with_integral.t > 4.0
        errors = [np.abs(run.pose - run.target)[late].mean() for run in (with_integral, without)]
        assert errors[0] < 0.5 * errors[1]

    def test_lag_of_the_robot_is_led(self):
        robot = named_robot("small")
        motion = ShapeReference(Eight(length=2.0, width=1.0), 10.0)
        me = []
        for known in (robot, replace(robot, lag=(0.0, 0.0))):
            controller = classical_pid("recommended", DT, known)
            start = motion.at(0.0).pose
            run = simulate(PlanarPlant(robot), controller, motion, start=start, dt=DT)
            me.append(np.hypot(*(run.pose - run.target)[:, :2].T).mean())
        assert me[0] < 0.5 * me[1]

    def test_late_sample_is_no_missing_motion(self):
        """The command was held until the late sample, and the robot executed it all that time."""
        controller, goal = tracking_pid(TrackingParameters(kd=0.0)), Pose(0.02, 0.0, 0.0)
        controller.reset(State(0.0, Pose(0.0, 0.0, 0.0)))
        speed = controller.step(0.0, State(0.0, Pose(0.0, 0.0, 0.0)), Hold(goal, 9.0)).twist.vx
        late = 1.3 * DT
        pose = Pose(late * speed, 0.0, 0.0)
        command = controller.step(late, State(late, pose), Hold(goal, 9.0))
        assert command.twist.vx == pytest.approx(speed * (goal.x - pose.x) / goal.x)

    def test_outlier_does_not_enter_the_integral(self):
        """Neither when it comes nor when it goes."""
        controller, goal = classical_pid("recommended", DT), Hold(Pose(0.0, 0.0, 0.0), 9.0)
        controller.reset(State(0.0, goal.pose))
        for k in range(6):
            pose = Pose(0.5 * (k == 3), 0.0, 0.0)
            command = controller.step(DT * k, State(DT * k, pose), goal)
        kd = controller.x.parameters.kd
        assert abs(command.twist.vx) < kd * 0.5 / DT
        no_kd = tracking_pid(TrackingParameters(kd=0.0))
        no_kd.reset(State(0.0, goal.pose))
        for k in range(6):
            command = no_kd.step(DT * k, State(DT * k, Pose(0.5 * (k == 3), 0.0, 0.0)), goal)
        assert command.twist.vx == 0.0

    @pytest.mark.parametrize("lost", [0, 1, 4])
    def test_rate_after_lost_measurements_is_the_mean_since_the_last_one(self, make, lost):
        """At a constant 0.1 m/s away from the goal; the filter halves the first rate."""
        controller, goal = make(DT), Hold(Pose(0.0, 0.0, 0.0), 9.0)
        controller.reset(State(0.0, goal.pose))
        controller.step(0.0, State(0.0, goal.pose), goal)
        t = DT * (lost + 1)
        details = controller.step(t, State(t, Pose(0.1 * t, 0.0, 0.0)), goal).details
        change = dict(zip(controller.detail_units, details, strict=True))["change_input_x"]
        assert change == pytest.approx(-0.05, abs=1e-12)

    def test_lost_measurement_fails_one_step(self, make):
        controller, pose = make(DT), Circle().at(0.0).pose
        controller.reset(State(0.0, pose))
        controller.step(0.0, State(0.0, pose), Circle())
        lost = controller.step(DT, State(DT, Pose(float("nan"), 0.0, 0.0)), Circle())
        after = controller.step(2 * DT, State(2 * DT, pose), Circle())
        assert lost.status is Status.FAILED
        assert after.status is Status.OK
        assert np.isfinite([*after.twist, *after.details]).all()

    def test_tuned_gains_stay_within_deviation(self):
        p = TrackingParameters()
        run = run_on(fuzzy_pid("t1", "recommended", DT), Circle(), Pose(0.1, -1.3, -0.2))
        for axis in ("x", "y", "heading"):
            for gain in ("kp", "ki", "kd"):
                column = run.details[f"{gain}_{axis}"][:-1]
                middle, deviation = getattr(p, gain), getattr(p, f"{gain}_deviation")
                assert np.ptp(column) > 0.1 * deviation
                assert column.min() >= max(0.0, middle - deviation)
                assert column.max() <= middle + deviation
            for name in ("error_input", "change_input"):
                assert np.abs(run.details[f"{name}_{axis}"][:-1]).max() <= 1.0

    def test_is_picklable(self, make):
        controller, pose, goal = make(DT), Pose(1.0, 1.0, 0.0), Pose(1.03, 1.02, 0.2)
        copy = pickle.loads(pickle.dumps(controller))
        assert first_command(copy, pose, goal) == first_command(controller, pose, goal)


changes = st.tuples(*[st.floats(-0.1, 0.1)] * 3)
small = st.floats(-5.0, 5.0)


class TestTrackingLaw:
    @given(changes)
    def test_gains_are_bounded_and_not_negative(self, change):
        p = TrackingParameters(kd=0.02)
        kp, ki, kd = tune_bounded_gains(p, change)
        assert 4.5 - 1e-9 <= kp <= 5.5 + 1e-9
        assert 7.0 - 1e-9 <= ki <= 8.0 + 1e-9
        assert 0.0 <= kd <= 0.05 + 1e-9

    @given(small, small)
    def test_inputs_are_clamped(self, error, rate):
        p = TrackingParameters()
        a, b = fuzzy_inputs(p, error, rate)
        assert a == pytest.approx(np.clip(error / p.error_range, -1.0, 1.0))
        assert b == pytest.approx(np.clip(rate / p.rate_range, -1.0, 1.0))

    @given(small, small)
    def test_tuning_is_symmetric_in_error_sign(self, error, change):
        assert mirror_to_negative(error, change) == mirror_to_negative(-error, -change)
        assert mirror_to_negative(error, change)[0] == -abs(error)
        assert set(np.abs(mirror_to_negative(error, change))) == set(np.abs((error, change)))

    def test_filter_has_time_constant(self):
        value, dt = 0.0, 1e-4
        for _ in range(2000):
            value = low_pass(0.2, value, 1.0, dt)
        assert value == pytest.approx(1.0 - np.exp(-1.0), abs=1e-3)
        assert low_pass(0.0, 5.0, 1.0, DT) == 1.0

    @pytest.mark.parametrize("dt", [0.001, 0.1, 1.0])
    def test_proportional_part_decays_exactly(self, dt):
        p = TrackingParameters()
        left = 1.0 - dt * tracking_law(p, Gains(5.0, 0.0, 0.0), 0.0, 1.0, 1.0, 0.0, dt)
        assert left == pytest.approx(np.exp(-5.0 * dt))

    def test_law_is_sum_of_its_parts(self):
        law = tracking_law(TrackingParameters(), Gains(5.0, 9.0, 0.2), 0.3, 0.1, 0.1, -0.5, 1e-9)
        assert law == pytest.approx(5.0 * 0.1 + 0.3 - 0.2 * 0.5, rel=1e-6)

    def test_automatic_reset_is_a_pi_controller(self):
        """On ``dx/dt = u + d`` it removes d as ``u = kp e + ki integral(e dt)`` does, filtered."""
        p, dt, d = TrackingParameters(), 1e-3, -0.1
        gains, x, state, u = Gains(5.0, 7.5, 0.0), 0.0, TrackingState(0.0, 0.0, 0.0, 0.0), 0.0
        total = 0.0
        for _ in range(6000):
            x += dt * (u + d)
            integral, missing = tracking_integral(p, gains, state, abs(x), u - (u + d), dt)
            state = TrackingState(integral, missing, 0.0, abs(x))
            u = tracking_law(p, gains, integral, -x, abs(x), 0.0, dt)
            total -= x * dt
        assert u == pytest.approx(-d, abs=1e-4)
        assert 7.5 * total == pytest.approx(-d, rel=0.01)

    def test_integral_decays_beyond_the_error_range(self):
        p, gains = TrackingParameters(error_range=0.05), Gains(5.0, 7.5, 0.0)
        near, far = TrackingState(0.3, 0.3, 0.0, 0.05), TrackingState(0.3, 0.3, 0.0, 0.051)
        assert tracking_integral(p, gains, near, 0.05, 1.0, DT)[0] > 0.3
        assert tracking_integral(p, gains, near, 0.051, 1.0, DT)[0] < 0.3
        assert tracking_integral(p, gains, far, 0.0, 1.0, DT)[0] < 0.3
        assert tracking_integral(p, Gains(0.0, 7.5, 0.0), near, 0.0, 1.0, DT) == (0.0, 0.0)

    @given(st.floats(0.1, 20.0), st.floats(1e-6, 50.0), st.floats(1e-3, 100.0))
    def test_braking_decelerates_within_the_limit(self, slope, distance, acceleration):
        speed = slope * distance * braking(slope, distance, acceleration)
        step = 1e-6 * distance
        nearer = distance - step
        change = speed - slope * nearer * braking(slope, nearer, acceleration)
        assert 0.0 < speed <= slope * distance
        assert speed * change / step <= acceleration * (1.0 + 1e-3)

    @given(st.floats(0.0, 0.5), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0))
    def test_motion_of_a_first_order_lag_is_not_missing(self, lag, before, command):
        """The exact response to a constant command along x, without rotation."""
        fallen = -np.expm1(-DT / lag) if lag else 1.0
        travelled = command * DT + (before - command) * lag * fallen
        origin = Pose(0.0, 0.0, 0.7)
        there = Pose(travelled * cos(0.7), travelled * sin(0.7), 0.7)
        missing, response = missing_motion(
            there,
            origin,
            BodyTwist(command, 0.0, 0.0),
            BodyTwist(before, 0.0, 0.0),
            Pair(lag, 0.0),
            Pair(inf, inf),
            DT,
        )
        assert missing == pytest.approx((0.0, 0.0, 0.0), abs=1e-12)
        assert response.vx == pytest.approx(before + (command - before) * fallen)

    def test_prediction_keeps_its_direction_in_w(self):
        """A robot that turns, and whose velocity in W is that of its command."""
        turn, speed = 0.4, 0.8
        start, end = Pose(0.0, 0.0, 0.0), Pose(DT * speed, 0.0, turn)
        command = twist_between(start, end, DT)
        at_end = to_body(WorldTwist(speed, 0.0, turn / DT), turn)
        before = BodyTwist(speed, 0.0, turn / DT)
        _, response = missing_motion(
            end, start, command, before, Pair(1e9, 1e9), Pair(inf, inf), DT
        )
        assert response == pytest.approx(at_end, abs=1e-6)

    def test_motion_that_needs_slip_is_not_missing(self):
        """The prediction rises with the greatest acceleration."""
        origin, rest = Pose(0.0, 0.0, 0.0), BodyTwist(0.0, 0.0, 0.0)
        command = BodyTwist(3.0, 4.0, 0.0)
        missing, response = missing_motion(
            origin, origin, command, rest, Pair(0.0, 0.0), Pair(5.0, 9.0), DT
        )
        assert missing == (0.0, 0.0, 0.0)
        assert response == pytest.approx((0.3, 0.4, 0.0))
        near = BodyTwist(2.8, 3.7, 0.0)
        missing, _ = missing_motion(
            origin, origin, command, near, Pair(0.0, 0.0), Pair(5.0, 9.0), DT
        )
        assert missing == pytest.approx(command)

    def test_lead_of_a_jump_is_that_of_the_greatest_acceleration(self):
        led = lead(
            WorldTwist(0.0, 0.0, 0.0),
            (0.0,) * 3,
            (3.0, 4.0, -9.0),
            Pair(0.2, 0.1),
            Pair(2.0, 1.0),
            DT,
        )
        assert led == pytest.approx((0.2 * 2.0 * 0.6, 0.2 * 2.0 * 0.8, -0.1))


def nothing_tuned(error, change):
    return 0.0, 0.0, 0.0


class Proportional:
    """A channel of a user, with memory."""

    parameters = SelfTuningParameters()

    def __init__(self):
        self.samples = 0

    def reset(self):
        self.samples = 0

    def step(self, error, magnitude):
        self.samples += 1
        return 2.0 * error, TuningRecord(2.0, 0.0, 0.0, float(self.samples), 0.0)


def commands(controller):
    return run_on(controller, Circle(), Pose(0.1, -1.2, 0.1)).command.tobytes()


class TestPartsOfTheUser:
    """Python executes the law that is compiled for tuners of this package."""

    def test_tuner_gives_the_commands_of_the_same_tuner_of_the_package(self):
        own = tracking_pid(TrackingParameters(kd=0.1), tune=nothing_tuned)
        assert own.compiled_law() is None
        assert commands(own) == commands(tracking_pid(TrackingParameters(kd=0.1)))

    @pytest.mark.parametrize("preset", ["paper", "published-code"])
    def test_tuner_of_a_waypoint_controller(self, preset):
        ours = classical_pid(preset, DT)
        channels = (replace(each, tune=nothing_tuned) for each in (ours.position, ours.heading))
        own = FuzzyPidController(DT, *channels, ours.wraps_heading)
        assert own.compiled_law() is None
        assert commands(own) == commands(ours)

    def test_channel_is_called_in_every_sample_and_reset(self):
        heading = classical_pid("paper", DT).heading
        controller = FuzzyPidController(DT, Proportional(), heading, wraps_heading=True)
        assert controller.compiled_law() is None
        for _ in range(2):
            twist = first_command(controller, Pose(0.0, 0.0, 0.0), Pose(1.0, -2.0, 0.0))
            assert twist == (2.0, -4.0, 0.0)
            assert controller.position.samples == 1

    @pytest.mark.parametrize("tune", [no_tuning, nothing_tuned])
    def test_copy_keeps_the_memory(self, tune):
        controller = tracking_pid(TrackingParameters(), tune=tune)
        start = State(0.0, Pose(0.1, -1.2, 0.1))
        controller.reset(start)
        controller.step(0.0, start, Circle())
        copy = pickle.loads(pickle.dumps(controller))
        later = State(DT, Pose(0.15, -1.2, 0.1))
        assert copy.step(DT, later, Circle()) == controller.step(DT, later, Circle())


@pytest.mark.parametrize("preset", ["paper", "published-code"])
def test_input_that_the_fuzzy_system_refuses_is_named(preset):
    """Of an error of 6 m the first input is 3."""
    system = gain_inference("t1", preset).system
    tuner = FuzzyTuner(Inference(system, out_of_range="raise"))
    usual = fuzzy_pid("t1", preset, DT)
    channels = (replace(each, tune=tuner) for each in (usual.position, usual.heading))
    controller = FuzzyPidController(DT, *channels, usual.wraps_heading)
    assert first_command(controller, Pose(0.0, 0.0, 0.0), Pose(0.1, 0.0, 0.0)).vx > 0.0
    command = controller.step(0.0, State(0.0, Pose(6.0, 0.0, 0.0)), Hold(Pose(0.0, 0.0, 0.0), 1.0))
    assert command.status is Status.FAILED
    assert re.fullmatch(r"the input 'error' is [36], outside its range \[-1, 1\]", command.message)


class TestClassical:
    """The presets with constant gains."""

    def test_paper_preset_has_initial_gains(self):
        run = run_on(classical_pid("paper", DT), Circle(), Pose(0.1, -1.2, 0.1))
        for axis in ("position", "heading"):
            gains = [run.details[f"{gain}_{axis}"][:-1] for gain in ("kp", "ki", "kd")]
            assert [set(column) for column in gains] == [{4.0}, {3.0}, {0.0}]

    @given(poses, poses)
    def test_published_code_preset_is_proportional(self, pose, goal):
        twist = to_world(first_command(classical_pid("published-code", DT), pose, goal), pose.yaw)
        desired = [7.0 * (b - a) for a, b in zip(pose, goal, strict=True)]
        assert list(twist) == pytest.approx(desired, abs=1e-9)

    def test_units_of_the_gains(self):
        units = classical_pid("paper", DT).detail_units
        assert [units[f"k{k}_position"] for k in "pid"] == ["1/s", "1/s^2", "1"]
        units = classical_pid("published-code", DT).detail_units
        assert [units[f"k{k}_heading"] for k in "pid"] == ["1/s"] * 3
        assert units["error_input_heading"] == "1"


def test_controller_without_detail_units_logs_no_details():
    class Wrapper:
        def __init__(self):
            self.inner = classical_pid("recommended", DT)

        def reset(self, state):
            self.inner.reset(state)

        def step(self, t, state, reference):
            return self.inner.step(t, state, reference)

    assert run_on(Wrapper(), Circle(), Circle().at(0.0).pose).details == {}


def test_details_that_do_not_match_units_are_refused():
    class Mismatched(FeedforwardController):
        @property
        def detail_units(self):
            return {"a": "1"}

        def step(self, t, state, reference):
            return super().step(t, state, reference)._replace(details=(1.0, 2.0))

    run = run_on(Mismatched(DT), Circle(), Circle().at(0.0).pose)
    assert run.outcome is Outcome.CONTROLLER_FAILED
    assert "holds 2 details, its detail_units 1" in run.reason


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), float("inf")])
def test_invalid_sample_time_is_refused(dt):
    with pytest.raises(InvalidInput, match=r"the sample time is .* s, need 1e-09 to 3600 s"):
        fuzzy_pid("t1", "paper", dt)
    with pytest.raises(InvalidInput, match=r"the sample time is .* s, need 1e-09 to 3600 s"):
        classical_pid("recommended", dt)


def test_command_that_no_robot_executes_predicts_rest():
    pose, impossible = Pose(0.0, 0.0, 0.0), BodyTwist(1e7, 0.0, 0.0)
    rest = BodyTwist(0.0, 0.0, 0.0)
    for command, response in ((impossible, rest), (rest, impossible)):
        found = missing_motion(pose, pose, command, response, Pair(0.0, 0.0), Pair(inf, inf), DT)
        assert found == ((0.0, 0.0, 0.0), rest)


def commands_with_outlier(controller, outlier):
    """Return the commands on a circle whose position is wrong by ``outlier`` m in one sample."""
    reference = Circle()
    pose = reference.at(0.0).pose
    controller.reset(State(0.0, pose))
    commands = []
    for k in range(60):
        measured = pose._replace(x=pose.x + outlier) if k == 20 else pose
        twist = controller.step(k * DT, State(k * DT, measured), reference).twist
        commands.append(twist)
        pose = move(pose, BodyTwist(0.0, 0.0, 0.0) if k == 20 else twist, DT)
    return np.array(commands)


@pytest.mark.parametrize("kind", [None, "t1"])
@pytest.mark.parametrize("preset", ["paper", "published-code", "recommended"])
@pytest.mark.parametrize("robot", [None, "small"])
def test_outlier_does_not_last(kind, preset, robot):
    """With a robot or without: neither the integral part nor the filtered rate keeps it."""

    def make():
        of_robot = None if robot is None else named_robot(robot)
        return (
            fuzzy_pid(kind, preset, DT, of_robot) if kind else classical_pid(preset, DT, of_robot)
        )

    usual = commands_with_outlier(make(), 0.0)
    for outlier in (1e3, -1e6, 1e9):
        deviation = np.abs(commands_with_outlier(make(), outlier) - usual).max(axis=1)
        assert deviation[20] > 0.1
        assert deviation[21:].max() < 0.15
        assert deviation[31:].max() < 0.01
