"""The self-tuning PID: its laws, its presets and the loop they close."""

import pickle
from math import cos, hypot, pi, sin

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from omnidrive.control import Controller, Status
from omnidrive.control.pid import (
    FuzzyPidController,
    MemorylessParameters,
    SelfTuningParameters,
    fuzzy_pid,
)
from omnidrive.control.pid.laws import Gains, PidState, self_tuning_law, tuned
from omnidrive.errors import InvalidInput
from omnidrive.geometry import Pose, to_world, wrap
from omnidrive.parameter import bounds_of
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, simulate

DT = 0.1
PRESETS = [(kind, preset) for kind in ("t1", "t2") for preset in ("paper", "published-code")]

relaxed = settings(deadline=None)  # the first call compiles
metres = st.floats(-3.0, 3.0)
angles = st.floats(-3.0, 3.0)
poses = st.builds(Pose, metres, metres, angles)
errors = st.builds(complex, metres, metres)


@pytest.fixture(params=PRESETS, ids="-".join, scope="module")
def controller(request):
    return fuzzy_pid(*request.param, DT)


def first_command(controller, pose, goal):
    controller.reset(pose)
    return controller.step(0.0, pose, Hold(goal, 1.0)).twist


def closed_loop(controller, start, goal, seconds=10.0):
    plant = KinematicPlant(named_robot("paper"))
    return simulate(plant, controller, Hold(goal, seconds), start=start, dt=DT)


class TestEveryPreset:
    def test_is_a_controller(self, controller):
        assert isinstance(controller, Controller)
        assert isinstance(controller, FuzzyPidController)

    @relaxed
    @given(poses, poses)
    def test_drives_towards_the_goal_in_the_world(self, controller, pose, goal):
        twist = to_world(first_command(controller, pose, goal), pose.yaw)
        dx, dy = goal.x - pose.x, goal.y - pose.y
        speed = hypot(twist.vx, twist.vy)
        assert twist.vx * dy == pytest.approx(twist.vy * dx, abs=1e-9)
        assert twist.vx * dx + twist.vy * dy == pytest.approx(speed * hypot(dx, dy), abs=1e-9)

    @relaxed
    @given(poses, poses, angles)
    def test_turning_the_world_changes_nothing(self, controller, pose, goal, angle):
        def turn(p):
            c, s = cos(angle), sin(angle)
            return Pose(c * p.x - s * p.y, s * p.x + c * p.y, p.yaw + angle)

        here = first_command(controller, pose, goal)
        there = first_command(controller, turn(pose), turn(goal))
        assert there == pytest.approx(here, abs=1e-6)

    def test_reaches_the_goal_and_stays(self, controller):
        run = closed_loop(controller, Pose(1.0, 1.0, 0.0), Pose(2.0, 2.0, pi / 4))
        error = np.abs(run.pose - run.target)[-20:]
        assert (run.status == Status.OK).all()
        assert error[:, :2].max() < 1e-3
        assert error[:, 2].max() < 1e-3

    def test_reset_forgets_and_runs_repeat(self, controller):
        runs = [
            closed_loop(controller, Pose(1.0, 1.0, 0.0), Pose(2.0, 1.5, -1.0), 2.0)
            for _ in range(2)
        ]
        assert (runs[0].command == runs[1].command).all()

    def test_travels_to_another_process(self, controller):
        pose, goal = Pose(1.0, 1.0, 0.0), Pose(1.3, 1.2, 0.2)
        copy = pickle.loads(pickle.dumps(controller))
        assert first_command(copy, pose, goal) == first_command(controller, pose, goal)

    def test_stands_still_on_the_goal(self, controller):
        pose = Pose(1.0, 2.0, 0.3)
        assert first_command(controller, pose, pose) == pytest.approx((0.0, 0.0, 0.0))


class TestPublishedCode:
    @pytest.mark.parametrize(("kind", "most"), [("t1", 7.2231), ("t2", 7.2827)])
    def test_is_proportional_with_a_slight_bend(self, kind, most):
        controller = fuzzy_pid(kind, "published-code", DT)
        gains = [
            first_command(controller, Pose(-e, 0.0, 0.0), Pose(0.0, 0.0, 0.0)).vx / e
            for e in np.linspace(1e-3, 2.0, 800).tolist()
        ]
        assert min(gains) > 6.999
        assert most - 1e-3 < max(gains) < most + 1e-3

    def test_beyond_one_metre_nothing_tunes(self):
        controller = fuzzy_pid("t1", "published-code", DT)
        twist = first_command(controller, Pose(0.0, 0.0, 0.0), Pose(1.5, 0.0, 0.0))
        assert twist.vx == pytest.approx(7.0 * 1.5)

    @relaxed
    @given(poses, poses)
    def test_has_no_memory(self, pose, goal):
        controller = fuzzy_pid("t1", "published-code", DT)
        first = controller.step(0.0, pose, Hold(goal, 1.0))
        assert controller.step(DT, pose, Hold(goal, 1.0)) == first

    def test_does_not_wrap_the_heading(self):
        controller = fuzzy_pid("t1", "published-code", DT)
        twist = first_command(controller, Pose(0.0, 0.0, 3.0), Pose(0.0, 0.0, -3.0))
        assert twist.yaw_rate == pytest.approx(-7.0 * 6.0)


@pytest.mark.parametrize("kind", ["t1", "t2"])
class TestPaper:
    def test_turns_the_short_way(self, kind):
        controller = fuzzy_pid(kind, "paper", DT)
        run = closed_loop(controller, Pose(0.0, 0.0, 3.0), Pose(0.0, 0.0, -3.0))
        assert np.abs(np.diff(run.pose[:, 2])).sum() < 2.0 * abs(wrap(-6.0))
        assert abs(wrap(run.pose[-1, 2] + 3.0)) < 1e-3

    def test_respects_its_limits(self, kind):
        controller = fuzzy_pid(kind, "paper", DT)
        run = closed_loop(controller, Pose(0.0, 0.0, 0.0), Pose(10.0, -10.0, 3.0), 20.0)
        assert np.hypot(run.command[:, 0], run.command[:, 1]).max() <= 1.5 + 1e-9
        assert np.abs(run.command[:, 2]).max() <= 3.14 + 1e-9

    def test_a_long_saturated_run_does_not_wind_up(self, kind):
        controller = fuzzy_pid(kind, "paper", DT)
        run = closed_loop(controller, Pose(0.0, 0.0, 0.0), Pose(10.0, 0.0, 0.0), 20.0)
        assert run.pose[:, 0].max() < 10.02

    def test_follows_a_moving_goal_without_lag(self, kind):
        """The integral: a ramp leaves no error, where proportional control would."""

        class Ramp(Hold):
            def at(self, t):
                return super().at(t)._replace(pose=Pose(0.5 * t, 0.0, 0.0))

        plant = KinematicPlant(named_robot("paper"))
        ramp = Ramp(Pose(0.0, 0.0, 0.0), 20.0)
        run = simulate(plant, fuzzy_pid(kind, "paper", DT), ramp, start=Pose(0.0, 0.0, 0.0), dt=DT)
        # its goal is one sample ahead: it arrives there at once, half a decimetre early
        assert run.pose[-1, 0] - run.target[-1, 0] == pytest.approx(0.5 * DT, abs=2e-3)

    def test_memory_is_cleared_by_reset(self, kind):
        controller = fuzzy_pid(kind, "paper", DT)
        goal = Hold(Pose(1.0, 0.0, 0.0), 1.0)
        pose = Pose(0.9, 0.0, 0.0)
        controller.reset(pose)
        first, second = controller.step(0.0, pose, goal), controller.step(DT, pose, goal)
        assert second != first
        controller.reset(pose)
        assert controller.step(0.0, pose, goal) == first


class TestLaw:
    @relaxed
    @given(errors, errors, errors)
    def test_is_cut_without_turning(self, integral, last, error):
        parameters = SelfTuningParameters()
        gains = Gains(4.0, 3.0, 0.2)
        free = parameters._replace(limit=1e9)
        state = PidState(integral, last, abs(last))
        command, _ = self_tuning_law(parameters, gains, state, error, DT)
        wanted, _ = self_tuning_law(free, gains, state, error, DT)
        assert abs(command) <= parameters.limit + 1e-12
        assert (command * wanted.conjugate()).imag == pytest.approx(0.0, abs=1e-9)
        assert (command * wanted.conjugate()).real >= -1e-12

    def test_is_the_textbook_sum_while_free(self):
        free = SelfTuningParameters(limit=20.0)
        state = PidState(0.3, 0.1, 0.1)
        command, integral = self_tuning_law(free, Gains(4.0, 3.0, 0.2), state, 0.15, DT)
        assert integral == pytest.approx(0.3 + 3.0 * 0.15 * DT)
        assert command == pytest.approx(4.0 * 0.15 + integral + 0.2 * (0.15 - 0.1) / DT)

    def test_the_cut_part_drains_the_integral(self):
        parameters = SelfTuningParameters(limit=1.0, tracking_time=0.5)
        command, integral = self_tuning_law(
            parameters, Gains(2.0, 0.0, 0.0), PidState(0.0, 1.0, 1.0), 1.0, DT
        )
        assert command == pytest.approx(1.0)
        assert integral == pytest.approx(-0.2)

    @relaxed
    @given(*[st.floats(-0.1, 0.1)] * 3)
    def test_gains_are_bounded_and_never_negative(self, dkp, dki, dkd):
        gains = tuned(SelfTuningParameters(), (dkp, dki, dkd))
        assert 3.0 <= gains.kp <= 5.0
        assert 2.0 <= gains.ki <= 4.0
        assert 0.0 <= gains.kd <= 1.0


@pytest.mark.parametrize("parameters", [SelfTuningParameters(), MemorylessParameters()])
def test_defaults_lie_within_their_bounds(parameters):
    bounds = bounds_of(type(parameters))
    assert list(bounds) == list(parameters._fields)
    for name, bound in bounds.items():
        bound.check(getattr(parameters, name))


@pytest.mark.parametrize("dt", [0.0, -0.1, float("nan"), float("inf")])
def test_a_sample_time_that_is_none_is_refused(dt):
    with pytest.raises(InvalidInput, match="positive"):
        fuzzy_pid("t1", "paper", dt)
