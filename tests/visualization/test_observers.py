"""Observers do not change a run and are called at regular times."""

from dataclasses import fields
from math import nan

import numpy as np
import pytest

from omnidrive.control import FeedforwardController
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist, Pose, move
from omnidrive.maps import OccupancyGrid
from omnidrive.reference import Hold
from omnidrive.robot import named_robot
from omnidrive.simulation import (
    DisturbablePlant,
    Disturbances,
    Impulse,
    KinematicPlant,
    MovingObstacle,
    MujocoPlant,
    Plant,
    PlantCapabilities,
    PlantState,
    simulate,
)
from omnidrive.testing.laws import Circle
from omnidrive.visualization import Observer, Recorder, observe, replay

ROBOT = named_robot("small")
CIRCLE = Circle(duration=8.0)
PLANTS = {
    "kinematic": lambda: KinematicPlant(ROBOT),
    "ball": lambda: MujocoPlant(ROBOT, "ball"),
    "rollers": lambda: MujocoPlant(ROBOT, "rollers"),
}
every_plant = pytest.mark.parametrize("make", PLANTS.values(), ids=PLANTS)


def run(plant, dt=0.1, duration=0.6):
    reference = Circle(duration=8.0)
    start = reference.at(0.0).pose
    truncated = TruncatedReference(reference, duration)
    return simulate(plant, FeedforwardController(dt), truncated, start=start, dt=dt)


class TruncatedReference:
    """The first seconds of a reference."""

    def __init__(self, whole, duration):
        self.whole, self.duration = whole, duration
        self.at, self.window = whole.at, whole.window


class Log:
    """Stores times and positions."""

    period = 0.03

    def __init__(self):
        self.runs, self.times, self.positions = 0, [], []

    def begin(self, scene):
        self.runs, self.times, self.positions, self.scene = self.runs + 1, [], [], scene

    def update(self, t):
        self.times.append(t)
        self.positions.append(self.scene.position)


@every_plant
def test_observed_run_equals_unobserved_run(make):
    alone, seen = run(make()), run(observe(make(), ROBOT, CIRCLE, [Recorder(), Log()]))
    for field in fields(alone):
        one, other = getattr(alone, field.name), getattr(seen, field.name)
        if isinstance(one, np.ndarray) and field.name != "step_time":
            assert np.array_equal(one, other, equal_nan=True), field.name
    assert alone.ending == seen.ending


def test_without_observers_the_plant_is_returned():
    plant = KinematicPlant(ROBOT)
    assert observe(plant, ROBOT, CIRCLE, []) is plant


@every_plant
@pytest.mark.parametrize("dt", [0.1, 0.02, 0.07])
def test_observers_are_called_periodically_at_any_sample_time(make, dt):
    log_observer, recorder = Log(), Recorder()
    log = run(observe(make(), ROBOT, CIRCLE, [log_observer, recorder]), dt)
    end = log.t[-1]
    assert log_observer.runs == 1
    for seen, period in ((log_observer.times, 0.03), (recorder.recording.t, 0.04)):
        assert len(seen) == int(end / period + 1e-6) + 1
        late = np.array(seen) - period * np.arange(len(seen))
        assert (late > -1e-9).all()
        assert (late < 2.1e-3).all()  # the next physics step


@every_plant
def test_second_run_replaces_the_recording(make):
    log_observer, recorder = Log(), Recorder()
    plant = observe(make(), ROBOT, CIRCLE, [log_observer, recorder])
    run(plant)
    first = recorder.recording
    run(plant)
    assert log_observer.runs == 2
    assert np.array_equal(first.qpos, recorder.recording.qpos)


@every_plant
def test_recorded_poses_interpolate_the_samples(make):
    recorder = Recorder()
    log = run(observe(make(), ROBOT, CIRCLE, [recorder]), dt=0.08)
    recording = recorder.recording
    at_samples = recording.qpos[::2, :2]
    assert at_samples == pytest.approx(log.pose[: len(at_samples), :2], abs=1e-12)
    assert np.hypot(*recording.qpos[:, :2].T) == pytest.approx(1.0, abs=0.05)
    assert recording.target == pytest.approx(
        np.array([CIRCLE.at(t).pose for t in recording.t]), abs=1e-12
    )


def test_display_model_follows_the_cubic_between_samples():
    """On an arc of 0.1 rad the cubic's error is below 1e-5; that of a straight line is 1.2e-3."""
    log_observer, twist = Log(), BodyTwist(1.0, 0.0, 1.0)
    plant = observe(KinematicPlant(ROBOT), ROBOT, CIRCLE, [log_observer])
    start = Pose(0.2, -0.4, 3.1)
    plant.reset(start)
    plant.step(twist, 0.1)  # from rest: the initial twist is 0
    plant.step(twist, 0.1)
    late = [
        (t, position)
        for t, position in zip(log_observer.times, log_observer.positions, strict=True)
        if t > 0.1
    ]
    assert len(late) == 3
    for t, position in late:
        assert position == pytest.approx(move(start, twist, t)[:2], abs=1e-5)


def test_wheels_roll_without_slip_if_the_plant_reports_no_angles():
    recorder = Recorder()
    plant = observe(KinematicPlant(ROBOT), ROBOT, CIRCLE, [recorder])
    plant.reset(Pose(0.0, 0.0, 0.0))
    twist = BodyTwist(0.3, 0.2, 0.5)
    for _ in range(4):
        plant.step(twist, 0.1)
    recording = recorder.recording
    joints = [int(recording.model.joint(f"wheel{i}").qposadr[0]) for i in range(4)]
    turned = recording.qpos[-1, joints] - recording.qpos[5, joints]
    assert turned == pytest.approx(0.2 * ROBOT.chassis.wheel_speeds(twist), abs=1e-9)


def test_states_that_are_not_finite_are_not_recorded():
    class Failing:
        capabilities = PlantCapabilities()

        def reset(self, pose):
            self.steps = 0
            return PlantState(pose, BodyTwist(0.0, 0.0, 0.0), nan)

        def step(self, twist, dt):
            self.steps += 1
            x = 0.01 * self.steps if self.steps < 3 else nan
            return PlantState(Pose(x, 0.0, 0.0), BodyTwist(0.1, 0.0, 0.0), nan)

        def close(self):
            pass

    recorder = Recorder()
    run(observe(Failing(), ROBOT, CIRCLE, [recorder]))
    assert np.isfinite(recorder.recording.qpos).all()
    assert recorder.recording.t[-1] == pytest.approx(0.2)


def test_observed_plant_is_disturbable_if_the_plant_is():
    class Undisturbed:
        capabilities = PlantCapabilities()

        def __init__(self):
            plant = KinematicPlant(ROBOT)
            self.reset, self.step, self.close = plant.reset, plant.step, plant.close

    class Disturbable(KinematicPlant):
        applied = None

        def apply(self, disturbances):
            self.applied = disturbances

    plant = Disturbable(ROBOT)
    observed = observe(plant, ROBOT, CIRCLE, [Log()])
    assert isinstance(observed, DisturbablePlant)
    disturbances = Disturbances(impulse=Impulse(1.0, 0.0, 0.0))
    observed.apply(disturbances)
    assert plant.applied == disturbances
    alone = observe(Undisturbed(), ROBOT, CIRCLE, [Log()])
    assert isinstance(alone, Plant)
    assert not isinstance(alone, DisturbablePlant)


def test_observers_satisfy_the_protocol():
    assert isinstance(Recorder(), Observer)
    assert isinstance(Log(), Observer)


def test_long_run_keeps_every_second_frame(monkeypatch):
    monkeypatch.setattr("omnidrive.visualization.recording.MAX_FRAMES", 10)
    recorder = Recorder()
    run(observe(KinematicPlant(ROBOT), ROBOT, CIRCLE, [recorder]), duration=1.2)
    t = recorder.recording.t
    assert len(t) < 10
    assert np.diff(t) == pytest.approx(np.diff(t)[0])
    assert t[0] == 0.0
    assert t[-1] > 1.0


def test_recorder_without_a_run_is_an_error():
    with pytest.raises(InvalidInput, match="nothing was recorded"):
        _ = Recorder().recording


@every_plant
def test_replay_of_a_log_equals_the_recording(make):
    recorder = Recorder()
    log = run(observe(make(), ROBOT, CIRCLE, [recorder]), dt=0.08, duration=0.8)
    again = replay(log, ROBOT)
    assert again.t == pytest.approx(recorder.recording.t, abs=2.1e-3)
    kept = recorder.recording.qpos[:, :2]
    assert again.qpos[:, :2] == pytest.approx(kept, abs=2e-3)
    assert again.target[-1] == pytest.approx(log.target[-1])


def test_replay_ends_before_the_first_invalid_row():
    log = run(KinematicPlant(ROBOT))
    log.pose[4:] = nan
    assert replay(log, ROBOT).t[-1] == pytest.approx(0.3)
    log.pose[1:] = nan
    assert len(replay(log, ROBOT).t) == 1


def test_obstacles_are_drawn_for_plants_without_collisions():
    grid = OccupancyGrid(np.array([[False, True], [False, False]]), 0.5)
    disc = MovingObstacle(0.2, (0.0, 1.0), ((0.0, 1.0), (1.0, 1.0)))
    recorder = Recorder()
    hold = Hold(Pose(0.2, 0.2, 0.0), 0.4)
    plant = observe(KinematicPlant(ROBOT), ROBOT, hold, [recorder], obstacles=grid, moving=[disc])
    simulate(plant, FeedforwardController(0.1), hold, start=hold.pose, dt=0.1)
    moving = recorder.recording.mocap_positions
    assert moving[:, 0, 0] == pytest.approx(recorder.recording.t)
    assert moving[:, 0, 1] == pytest.approx(1.0)
    names = [recorder.recording.model.geom(i).name for i in range(recorder.recording.model.ngeom)]
    assert "wall0" in names
