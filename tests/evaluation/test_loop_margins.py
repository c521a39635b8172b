"""Stability margins compared with closed forms and with python-control."""

from math import asin, degrees, inf, isnan, nan, pi

import control
import numpy as np
import pytest

from omnidrive.control import Command, FeedforwardController, WheelSpeeds, classical_pid
from omnidrive.control.laws.lqr import LqrController
from omnidrive.errors import InvalidInput, RunFailed
from omnidrive.evaluation import loop_margins
from omnidrive.evaluation.measures.loop_margins import margins_of_response
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import KinematicPlant, PlanarPlant

ROBOT = named_robot("small")
REST = Hold(Pose(0.3, -0.2, 0.5), 24.0)


class Late:
    """A controller whose commands are late by whole samples."""

    def __init__(self, controller, samples):
        self.controller, self.samples, self.detail_units = controller, samples, {}

    def reset(self, state):
        self.controller.reset(state)
        self.waiting = [Command(BodyTwist(0.0, 0.0, 0.0))] * self.samples

    def step(self, t, state, reference):
        self.waiting.append(self.controller.step(t, state, reference))
        return self.waiting.pop(0)


def integrator(gain, dt):
    """Phase margin, deg, delay margin, s, and crossover, rad/s, of L = gain dt / (z - 1)."""
    turn = 2.0 * asin(0.5 * gain * dt)
    phase = 0.5 * (pi - turn)
    return degrees(phase), phase / turn * dt, turn / dt


@pytest.mark.parametrize("dt", [0.02, 0.1])
@pytest.mark.parametrize("gain", [0.8, 3.0, 9.0])
def test_margins_of_an_integrator(gain, dt):
    k = np.arange(round(20.0 / (gain * dt)))
    response = -gain * dt * (1.0 - gain * dt) ** (k - 1.0)
    response[0] = 1.0
    found = margins_of_response(response, dt)
    phase, delay, frequency = integrator(gain, dt)
    assert found.stable
    assert found.phase_margin == pytest.approx(phase, rel=1e-2)
    assert found.delay_margin == pytest.approx(delay, rel=1e-2)
    assert found.delay_margin_samples == pytest.approx(delay / dt, rel=1e-2)
    assert found.delay_frequency == pytest.approx(frequency, rel=1e-2)
    assert found.gain_margin == pytest.approx(2.0 / (gain * dt), rel=1e-2)
    assert found.gain_frequency == pytest.approx(pi / dt)
    assert found.gain_reduction == 0.0
    assert found.peak == pytest.approx(2.0 / (2.0 - gain * dt), rel=1e-2)  # at Nyquist


@pytest.mark.parametrize("late", [1, 3])
def test_agrees_with_python_control(late):
    """An unstable plant: the closed loop becomes so with a smaller gain and with a larger one."""
    dt = 0.05
    z = control.tf("z")
    z.dt = dt
    loop = 0.1 * (z - 0.96) / ((z - 1.0) * (z - 1.01) * z**late)
    closed = control.feedback(control.tf([1.0], [1.0], dt), loop)
    assert max(abs(closed.poles())) < 1.0
    _, response = control.impulse_response(closed, T=dt * np.arange(4000))
    found = margins_of_response(np.asarray(response).ravel() * dt, dt)
    gains, phases, _, gain_at, phase_at, _ = control.stability_margins(loop, returnall=True)
    above = gains > 1.0
    assert found.gain_margin == pytest.approx(gains[above].min(), rel=1e-2)
    assert found.gain_frequency == pytest.approx(gain_at[above][gains[above].argmin()], rel=1e-2)
    assert found.gain_reduction == pytest.approx(gains[~above].max(), rel=1e-2)
    assert found.phase_margin == pytest.approx(np.abs(phases).min(), rel=1e-2)
    delays = np.radians(phases) / phase_at
    assert found.delay_margin == pytest.approx(delays.min(), rel=1e-2)


def test_the_margin_of_lqr_is_that_of_its_gain():
    """Without lag, the loop of an axis is its gain and an integrator."""
    dt = 0.1
    controller = LqrController(dt, ROBOT.chassis)
    for axis, data in (("x", controller.compiled_law().data.x),
                       ("yaw", controller.compiled_law().data.heading)):  # fmt: skip
        found = loop_margins(KinematicPlant(ROBOT), controller, REST, dt=dt, axis=axis)
        phase, delay, _ = integrator(data.pose_gain, dt)
        assert found.phase_margin == pytest.approx(phase, rel=1e-3)
        assert found.delay_margin == pytest.approx(delay, rel=1e-3)
        assert found.nonlinearity < 1e-3


def test_a_delay_is_lost_from_the_margin():
    dt = 0.05
    plant = PlanarPlant(ROBOT)
    controller = FeedforwardController(dt)
    margins = [
        loop_margins(plant, Late(controller, late), REST, dt=dt, axis="y").delay_margin
        for late in (0, 1, 3)
    ]
    assert margins[0] - margins[1] == pytest.approx(dt, rel=1e-3)
    assert margins[0] - margins[2] == pytest.approx(3 * dt, rel=1e-3)


def test_an_unstable_loop_has_no_margins():
    dt = 0.1
    late = Late(classical_pid("recommended", dt, ROBOT, forces=False), 10)
    found = loop_margins(KinematicPlant(ROBOT), late, REST, dt=dt)
    assert not found.stable
    assert all(isnan(value) for value in found[1:-1])


def test_a_loop_without_feedback_has_infinite_margins():
    found = margins_of_response(np.array([1.0] + [0.0] * 50), 0.1)
    assert found.stable
    assert found.gain_margin == found.phase_margin == found.delay_margin == inf
    assert found.peak == 1.0


class Drawn:
    """A controller of random commands, which `reset` does not start anew."""

    detail_units = {}

    def __init__(self):
        self.rng = np.random.default_rng(1)

    def reset(self, state):
        pass

    def step(self, t, state, reference):
        return Command(BodyTwist(self.rng.normal(), 0.0, 0.0))


class Wheels(Drawn):
    def step(self, t, state, reference):
        return Command(WheelSpeeds([0.0] * len(ROBOT.mounts)))


class Failing(Drawn):
    def step(self, t, state, reference):
        raise ArithmeticError


@pytest.mark.parametrize(
    ("controller", "options", "message"),
    [
        (FeedforwardController(0.1), {"axis": "z"}, "component of the command"),
        (FeedforwardController(0.1), {"at": 10.0}, "the reference lasts 24 s"),
        (
            FeedforwardController(0.05),
            {"dt": 0.05, "response": 0.5},
            "after 0.5 s: give it more time to decay",
        ),
        (FeedforwardController(0.1), {"amplitude": 0.0}, "amplitude"),
        (FeedforwardController(0.1), {"dt": 0.2}, "0.1 s"),
        (Drawn(), {}, "does not repeat its commands"),
        (Wheels(), {}, "commands wheels"),
    ],
)
def test_what_cannot_be_measured_is_refused(controller, options, message):
    with pytest.raises(InvalidInput, match=message):
        loop_margins(KinematicPlant(ROBOT), controller, REST, **{"dt": 0.1} | options)


@pytest.mark.parametrize(
    ("plant", "reference", "message"),
    [
        (None, REST, "the first argument is the plant, got None"),
        (KinematicPlant(ROBOT), REST.pose, "the third argument is the reference, got a Pose"),
        (KinematicPlant(ROBOT), Hold(REST.pose, nan), "the duration of the reference is nan"),
    ],
)
def test_parts_are_checked(plant, reference, message):
    with pytest.raises(InvalidInput, match=message):
        loop_margins(plant, FeedforwardController(0.1), reference, dt=0.1)


def test_a_failed_run_is_reported():
    with pytest.raises(RunFailed, match="ArithmeticError"):
        loop_margins(KinematicPlant(ROBOT), Failing(), REST, dt=0.1)
