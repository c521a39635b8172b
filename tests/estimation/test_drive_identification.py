"""Online identification of drive gains, lag and delay."""

from collections import deque
from dataclasses import replace

import numpy as np
import pytest

from omnidrive.control.nmpc.holonomic.actuation import Actuation
from omnidrive.errors import InvalidInput
from omnidrive.estimation.drive.drive_identification import CONTINUE, START, DriveSample, identify
from omnidrive.estimation.drive.identification_state import (
    command_count,
    identification_memory,
)
from omnidrive.estimation.drive_estimate import (
    DRIVE_ESTIMATE,
    DRIVE_UNITS,
    DriveEstimate,
    DriveSettings,
    check_start,
    drive_estimate,
    identified_robot,
    settings_around,
    write_estimate,
)
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.reference import ShapeReference
from omnidrive.reference.shapes import Eight
from omnidrive.robot import load_robot, named_robot, save_robot
from omnidrive.robot.drive_model import DriveModel
from omnidrive.simulation import PlanarPlant
from omnidrive.simulation.disturbances.disturbances import Disturbances

DT = 0.05
EXACT = (0.0, 0.0, 0.0)
REST = (0.0, 0.0, 0.0)
ONE = (1.0, 1.0, 1.0)
SHORT = {"gains": (0.95, 0.95, 0.9)}
"""Worn wheels."""


NOTHING = DriveEstimate()
"""Before the first sample."""


class Identification:
    """The identification of a run, as a controller calls it."""

    def __init__(self, robot, dt, known=NOTHING, settings=None):
        self.model, self.dt, self.settings = drive_model(robot), dt, settings or DriveSettings()
        self.known = known._replace(yaw_lag=known.lag).parameters
        self.memory = identification_memory(command_count(known.delay, dt))

    def start(self, pose=REST):
        self._send(START, DriveSample(REST, self.dt, tuple(pose), REST, EXACT, True))
        return self

    def update(self, command, pose, variances=EXACT, *, fresh=True, dt=None):
        sample = DriveSample(tuple(command), dt or self.dt, tuple(pose), REST, variances, fresh)
        self._send(CONTINUE, sample)

    def _send(self, event, sample):
        identify(event, self.model, self.settings, self.known, self.memory, sample)

    @property
    def state(self):
        return self.memory.state[0]

    @property
    def is_finite(self):
        return all(np.isfinite(each.view(float)).all() for each in self.memory)

    @property
    def found(self):
        return drive_estimate(self.state["estimate"])

    @property
    def applied(self):
        gains, lag, delay, _ = self.state["applied"].item()
        return tuple(gains.tolist()), lag, delay


def drive_model(robot):
    return DriveModel.of(robot)


def eight_commands(dt, duration=20.0):
    """Body twists along a figure eight, in which the robot also turns against the curve."""
    window = ShapeReference(Eight(), 20.0).window(0.0, round(duration / dt), dt)
    yaw = 0.3 * np.sin(window[:, 2])
    c, s = np.cos(yaw), np.sin(yaw)
    rates = np.gradient(yaw, dt)
    return np.column_stack(
        [
            c * window[:, 3] + s * window[:, 4],
            c * window[:, 4] - s * window[:, 3],
            rates,
        ]
    )


def jerky_commands(dt, duration=6.0):
    """Starts, stops and reversals, some at the friction limit, in all axes."""
    rng = np.random.default_rng(7)
    goals = np.repeat(rng.uniform(-0.8, 0.8, (round(duration / 0.5), 3)), round(0.5 / dt), axis=0)
    return goals * [1.0, 1.0, 1.5]


def drive(robot, commands, dt=DT, *, gains=ONE, late=0, slope=(0.0, 0.0), **changes):
    """Poses of the planar plant, whose drive differs from the robot that is known."""
    plant = PlanarPlant(replace(robot, **changes))
    poses = [plant.reset(Pose(0.0, 0.0, 0.0)).pose]
    plant.apply(Disturbances(slope=slope))
    queue = deque([np.zeros(3)] * late)
    for command in commands:
        queue.append(gains * command)
        poses.append(plant.step(BodyTwist(*queue.popleft().tolist()), dt).pose)
    plant.close()
    return np.array(poses)


def estimates(robot, commands, poses, dt=DT, *, noise=0.0, seed=0, settings=None):
    """Memory after every sample, as estimates and as parameters that a controller uses."""
    measured = poses + noise * np.random.default_rng(seed).normal(size=poses.shape)
    run = Identification(robot, dt, settings=settings).start(measured[0].tolist())
    run.state["hypotheses"]["state_covariance"][:, :, 0, 0] = noise**2
    rows = zip(commands.tolist(), measured[1:].tolist(), strict=True)
    for command, pose in rows:
        run.update(command, pose, (noise**2, noise**2, noise**2))
        yield run.found, run.applied


def final(*args, **kwargs):
    *_, last = estimates(*args, **kwargs)
    return last


def check_harmless(name, dt):
    """Without any difference from the model the parameters in use are the initial ones."""
    robot = named_robot(name)
    for commands in (eight_commands(dt), jerky_commands(dt)):
        for _, (gains, lag, delay) in estimates(robot, commands, drive(robot, commands, dt), dt):
            assert np.abs(np.subtract(gains, 1.0)).max() < 0.01, (name, dt)
            assert lag + delay < 0.005, (name, dt)


@pytest.mark.parametrize(("name", "dt"), [("paper", DT), ("kiwi", 0.02)])
def test_a_right_model_is_left_alone(name, dt):
    check_harmless(name, dt)


@pytest.mark.long
@pytest.mark.parametrize("dt", [0.02, 0.05, 0.1])
@pytest.mark.parametrize("name", ["paper", "small", "kiwi", "mecanum"])
def test_every_right_model_is_left_alone(name, dt):
    check_harmless(name, dt)


@pytest.mark.parametrize(
    ("name", "change", "gains", "response"),
    [
        ("paper", SHORT, (0.95, 0.95, 0.9), 0.0),
        ("small", {"gains": (1.05, 1.05, 1.1)}, (1.05, 1.05, 1.1), 0.0),
        ("paper", {"motor_lag": 0.08}, ONE, 0.08),
        ("small", {"late": 1}, ONE, 0.05),
        ("small", SHORT | {"late": 1, "motor_lag": 0.04}, (0.95, 0.95, 0.9), 0.09),
        ("paper", SHORT | {"slope": (0.05, 0.1)}, (0.95, 0.95, 0.9), 0.0),
    ],
)
def test_gains_and_response_time_are_found(name, change, gains, response):
    robot, commands = named_robot(name), eight_commands(DT)
    found = list(estimates(robot, commands, drive(robot, commands, **change)))
    early, late = found[round(5.0 / DT)][0], found[-1][0]
    assert early.lag + early.delay == pytest.approx(response, abs=0.01)
    assert late.lag + late.delay == pytest.approx(response, abs=0.006)
    for estimate, true, error in zip(late.gains, gains, late.gain_errors, strict=True):
        assert abs(estimate - true) < max(0.01, 3.0 * error)


def test_lag_and_delay_are_told_apart_by_hard_starts():
    robot, commands = named_robot("small"), jerky_commands(DT)
    lag, _ = final(robot, commands, drive(robot, commands, motor_lag=0.08))
    delay, _ = final(robot, commands, drive(robot, commands, late=1))
    assert lag.lag == pytest.approx(0.08, abs=0.01)
    assert lag.delay == 0.0
    assert delay.delay == DT
    assert delay.lag < 0.01
    assert lag.excited[3]


def test_a_lag_is_known_after_a_few_samples_of_a_start():
    robot = named_robot("paper")
    commands = np.tile([0.5, 0.3, 0.4], (10, 1)) * np.linspace(0.1, 1.0, 10)[:, None]
    _, (_, lag, delay) = final(robot, commands, drive(robot, commands, motor_lag=0.08))
    assert 0.05 < lag + delay < 0.1


@pytest.mark.parametrize("seeds", [8, pytest.param(100, marks=pytest.mark.long)])
def test_standard_errors_are_honest(seeds):
    """At least 90 % of the errors are within two standard errors, with noise of 1 cm."""
    robot, commands = named_robot("small"), eight_commands(DT)
    poses = drive(robot, commands, motor_lag=0.04, **SHORT)
    inside = []
    for seed in range(seeds):
        found, _ = final(robot, commands, poses, noise=0.01, seed=seed)
        errors = [*np.subtract(found.gains, SHORT["gains"]), found.lag + found.delay - 0.04]
        inside.append(np.abs(errors) < 2.0 * np.array([*found.gain_errors, found.sum_error]))
        assert found.sum_error < 0.02
        assert found.gain_errors[0] < 0.01
    assert (np.mean(inside, axis=0) >= 0.85).all()


def test_an_axis_without_motion_is_not_estimated():
    robot = named_robot("small")
    commands = eight_commands(DT) * [1.0, 0.0, 0.0]
    found, (gains, _, _) = final(robot, commands, drive(robot, commands, **SHORT))
    assert found.excited[:3] == (True, False, False)
    assert gains[0] == pytest.approx(0.95, abs=0.01)
    assert found.gains[1:] == gains[1:] == (1.0, 1.0)


def test_the_lag_of_an_axis_without_motion_is_not_used():
    """Motor lag delays all axes, a soft servo the yaw less."""
    robot, commands = named_robot("paper"), eight_commands(DT) * [1.0, 1.0, 0.0]
    run = Identification(robot, DT).start()
    for command, pose in zip(commands, drive(robot, commands, motor_lag=0.02)[1:], strict=True):
        run.update(command.tolist(), pose.tolist())
    assert run.state["applied"]["lag"] == pytest.approx(0.02, abs=0.003)
    assert run.state["applied"]["yaw_lag"] == 0.0
    assert run.found.yaw_lag_error > 0.01


def test_standard_errors_grow_with_what_no_hypothesis_explains():
    robot, commands = named_robot("small"), eight_commands(DT, 5.0)
    poses = drive(robot, commands)
    shaken = poses + 3e-4 * np.sin(12.0 * DT * np.arange(len(poses)))[:, None]
    right, _ = final(robot, commands, poses)
    wrong, _ = final(robot, commands, shaken)
    assert wrong.gain_errors[0] > 2.0 * right.gain_errors[0]
    assert wrong.sum_error > 2.0 * right.sum_error


def test_a_change_of_the_drive_is_learned_anew():
    robot, commands = named_robot("paper"), eight_commands(DT, 20.0)
    twice = np.vstack([commands, commands])
    factors = np.repeat([[1.0], [0.9]], len(commands), axis=0)
    poses = drive(robot, twice * factors)
    found, _ = final(robot, twice, poses, settings=DriveSettings(memory=5.0))
    assert found.gains[0] == pytest.approx(0.9, abs=0.015)


def test_standing_still_changes_nothing_and_the_covariance_stays_bounded():
    robot, commands = named_robot("small"), np.zeros((2000, 3))
    found, parameters = final(robot, commands, np.zeros((2001, 3)))
    assert parameters == (ONE, 0.0, 0.0)
    assert found[:3] == DriveEstimate()[:3]
    assert found.gain_errors == pytest.approx(DriveEstimate().gain_errors)
    assert not any(found.excited)


def test_estimates_stay_within_the_bounds():
    robot, commands = named_robot("small"), jerky_commands(DT)
    settings = DriveSettings(min_gain=0.9, max_lag=0.05, max_delay=0.02)
    poses = drive(robot, commands, gains=(0.6, 0.6, 0.6), motor_lag=0.2, late=2)
    for found, _ in estimates(robot, commands, poses, settings=settings):
        assert min(found.gains) >= 0.9
        assert 0.0 <= found.lag <= 0.05
        assert 0.0 <= found.delay <= 0.02


@pytest.mark.parametrize(
    ("settings", "initial", "message"),
    [
        (DriveSettings(min_gain=1.2), NOTHING, "min_gain is 1.2, need 0.01 to 1"),
        (DriveSettings(max_gain=0.8), NOTHING, "max_gain is 0.8, need 1 to 100"),
        (DriveSettings(min_gain=np.nan), NOTHING, "min_gain is nan"),
        (DriveSettings(max_lag=-0.1), NOTHING, "max_lag is -0.1 s, need 0 to 10 s"),
        (DriveSettings(memory=0.0), NOTHING, "memory is 0 s"),
        (
            DriveSettings(max_delay=0.01),
            DriveEstimate(delay=0.05),
            "the delay before adaptation is 0.05",
        ),
        (
            DriveSettings(),
            DriveEstimate(gains=(0.5, 1.0, 1.0)),
            "the gain before adaptation is 0.5",
        ),
    ],
)
def test_bounds_that_exclude_the_start_are_refused(settings, initial, message):
    with pytest.raises(InvalidInput, match=message):
        check_start(settings, initial)


def test_a_moved_robot_and_readings_that_are_not_numbers_do_not_mislead():
    robot, commands = named_robot("paper"), eight_commands(DT)
    poses = drive(robot, commands)
    run = Identification(robot, DT).start()
    for k, command in enumerate(commands.tolist()):
        x, y, yaw = poses[k + 1].tolist()
        pose = (x + (2.0 if k >= 100 else 0.0), y, np.nan if k % 7 == 3 else yaw)
        twist = (np.inf, 0.0, 0.0) if k == 150 else tuple(command)
        run.update(twist, pose, fresh=k % 5 > 0)
        assert run.is_finite, k
    gains, lag, delay = run.applied
    assert gains == pytest.approx(ONE, abs=0.01)
    assert lag + delay < 0.003
    assert run.found.gain_errors[0] < 0.01


def test_a_new_run_starts_from_the_initial_parameters():
    robot, commands = named_robot("small"), jerky_commands(DT, 2.0)
    poses = drive(robot, commands, **SHORT)
    initial = DriveEstimate(gains=(0.97, 0.97, 0.95), lag=0.01, delay=0.02)
    run, results = Identification(robot, DT, initial), []
    for _ in range(2):
        before = run.start().found
        assert (before.gains, before.lag, before.delay) == initial[:3]
        for command, pose in zip(commands.tolist(), poses[1:].tolist(), strict=True):
            run.update(command, pose)
        results.append(run.found)
    assert results[0] == results[1] != before


def test_what_was_learned_is_a_robot_file_that_moves_as_the_robot(tmp_path):
    robot, commands = named_robot("small"), jerky_commands(DT)
    true = {"gains": (0.95, 0.95, 0.9), "motor_lag": 0.05}
    poses = drive(robot, commands, **true)
    found, _ = final(robot, commands, poses)
    save_robot(identified_robot(robot, found), tmp_path / "learned.yaml")
    learned = load_robot(tmp_path / "learned.yaml")
    assert learned.motor_lag == pytest.approx(0.05, abs=0.01)
    assert learned.drive_gain == pytest.approx((0.95, 0.95, 0.9), abs=0.02)
    start = Actuation.of(learned, delay=0.1).drive
    assert start[:3] == (learned.drive_gain, learned.motor_lag, 0.1)
    before = np.linalg.norm(drive(robot, commands) - poses, axis=1).max()
    assert np.linalg.norm(drive(learned, commands) - poses, axis=1).max() < 0.3 * before


def test_what_the_motion_did_not_determine_keeps_its_value_in_the_file():
    robot = replace(named_robot("small"), drive_gain=(0.9, 0.9, 0.8), motor_lag=0.02)
    assert identified_robot(robot, DriveEstimate()) == robot


def test_the_state_starts_with_the_known_drive_and_holds_the_latest_commands():
    run = Identification(named_robot("small"), DT, DriveEstimate((0.9, 1.1, 0.8), 0.02, 0.04))
    state = run.start().state
    assert state["hypotheses"]["delay"] == pytest.approx([0.04, 0.04, 0.09, 0.14, 0.19, 0.24])
    assert (state["hypotheses"]["parameters"] == [0.9, 1.1, 0.8, 0.02, 0.0]).all()
    assert (state["initial"] == [0.9, 1.1, 0.8, 0.02, 0.0]).all()
    for k, twist in enumerate([[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]):
        run.update(twist, REST, dt=DT + 0.01 * k)
    commands = run.memory.commands
    assert commands["twist"][:2].tolist() == [[0.4, 0.5, 0.6], [0.1, 0.2, 0.3]]
    assert commands["duration"][:2].tolist() == [DT + 0.01, DT]


def test_details_have_the_names_of_their_estimates():
    record, values = np.arange(13.0).view(DRIVE_ESTIMATE)[0], np.zeros(13)
    estimate = drive_estimate(record)
    write_estimate(record, values)
    columns = dict(zip(DRIVE_UNITS, values.tolist(), strict=True))
    assert (columns["drive_gain_yaw"], columns["drive_delay"]) == (2.0, 4.0)
    assert columns["drive_yaw_lag"] == estimate.yaw_lag == 5.0
    assert columns["drive_gain_y_error"] == estimate.gain_errors[1] == 7.0
    assert (columns["drive_lag_error"], columns["drive_delay_error"]) == (9.0, 10.0)
    assert (estimate.lag_error, estimate.delay_error) == (9.0, 10.0)
    assert columns["drive_yaw_lag_error"] == estimate.yaw_lag_error == 11.0
    assert columns["drive_lag_and_delay_error"] == estimate.sum_error == 12.0


@pytest.mark.long
@pytest.mark.parametrize("seed", range(20))
def test_random_data_leaves_finite_estimates_within_the_bounds(seed):
    """Commands and poses that no robot produces, at irregular times."""
    rng = np.random.default_rng(seed)
    run = Identification(named_robot("kiwi"), 0.02).start()
    for _ in range(2000):
        command = (rng.normal(size=3) * 10.0 ** rng.uniform(-6, 3)).tolist()
        pose = (rng.normal(size=3) * 10.0 ** rng.uniform(-6, 6)).tolist()
        variances = tuple((10.0 ** rng.uniform(-14, 2, 3)).tolist())
        dt, fresh = float(10.0 ** rng.uniform(-3, 0)), bool(rng.random() < 0.8)
        run.update(command, pose, variances, fresh=fresh, dt=dt)
        assert run.is_finite, seed
        assert all(0.7 <= gain <= 1.3 for gain in run.found.gains)
        assert (np.linalg.eigvalsh(run.state["hypotheses"]["covariance"]) > -1e-12).all()


@pytest.mark.parametrize(
    "known", [DriveEstimate((0.5, 1.0, 2.0), lag=0.5, delay=0.5), DriveEstimate(lag=0.29)]
)
def test_default_bounds_contain_the_known_drive(known):
    settings = settings_around(known, DT)
    check_start(settings, known)
    assert settings.max_lag > 1.5 * known.lag
    assert settings.max_delay >= known.delay + 2 * DT
    assert settings_around(NOTHING, DT) == DriveSettings()
