"""Who sees a run changes nothing of it, and sees all of it."""

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
from omnidrive.visualization import Observer, Recorder, observe, replay
from tests.laws.motions import Circle

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
    part = Part(reference, duration)
    return simulate(plant, FeedforwardController(dt), part, start=start, dt=dt)


class Part:
    """The beginning of a reference."""

    def __init__(self, whole, duration):
        self.whole, self.duration = whole, duration
        self.at, self.window = whole.at, whole.window


class Notes:
    """Writes down what it sees."""

    period = 0.03

    def __init__(self):
        self.runs, self.times, self.positions = 0, [], []

    def begin(self, scene):
        self.runs, self.times, self.positions, self.scene = self.runs + 1, [], [], scene

    def update(self, t):
        self.times.append(t)
        self.positions.append(self.scene.position)


@every_plant
def test_a_run_that_is_seen_is_the_same_run(make):
    alone, seen = run(make()), run(observe(make(), ROBOT, CIRCLE, [Recorder(), Notes()]))
    for field in fields(alone):
        one, other = getattr(alone, field.name), getattr(seen, field.name)
        if isinstance(one, np.ndarray) and field.name != "step_time":
            assert np.array_equal(one, other, equal_nan=True), field.name
    assert alone.ending == seen.ending


def test_nobody_looks_at_the_plant_itself():
    plant = KinematicPlant(ROBOT)
    assert observe(plant, ROBOT, CIRCLE, []) is plant


@every_plant
@pytest.mark.parametrize("dt", [0.1, 0.02, 0.07])
def test_is_seen_at_steady_times_whatever_the_sample_time(make, dt):
    notes, recorder = Notes(), Recorder()
    log = run(observe(make(), ROBOT, CIRCLE, [notes, recorder]), dt)
    end = log.t[-1]
    assert notes.runs == 1
    for seen, period in ((notes.times, 0.03), (recorder.recording.t, 0.04)):
        assert len(seen) == int(end / period + 1e-6) + 1
        late = np.array(seen) - period * np.arange(len(seen))
        assert (late > -1e-9).all()
        assert (late < 2.1e-3).all()  # the next physics step


@every_plant
def test_a_second_run_is_seen_anew(make):
    notes, recorder = Notes(), Recorder()
    plant = observe(make(), ROBOT, CIRCLE, [notes, recorder])
    run(plant)
    first = recorder.recording
    run(plant)
    assert notes.runs == 2
    assert np.array_equal(first.positions, recorder.recording.positions)


@every_plant
def test_what_is_recorded_lies_on_the_way_between_the_samples(make):
    recorder = Recorder()
    log = run(observe(make(), ROBOT, CIRCLE, [recorder]), dt=0.08)
    recording = recorder.recording
    at_samples = recording.positions[::2, :2]
    assert at_samples == pytest.approx(log.pose[: len(at_samples), :2], abs=1e-12)
    assert np.hypot(*recording.positions[:, :2].T) == pytest.approx(1.0, abs=0.05)
    assert recording.target == pytest.approx(
        np.array([CIRCLE.at(t).pose for t in recording.t]), abs=1e-12
    )


def test_a_model_is_put_on_the_cubic_between_two_samples():
    """Over an arc of 0.1 rad the cubic is within 1e-5 of it; a straight line is 1.2e-3 off."""
    notes, twist = Notes(), BodyTwist(1.0, 0.0, 1.0)
    plant = observe(KinematicPlant(ROBOT), ROBOT, CIRCLE, [notes])
    start = Pose(0.2, -0.4, 3.1)
    plant.reset(start)
    plant.step(twist, 0.1)  # from rest, as far as the plant tells
    plant.step(twist, 0.1)
    late = [(t, place) for t, place in zip(notes.times, notes.positions, strict=True) if t > 0.1]
    assert len(late) == 3
    for t, place in late:
        assert place == pytest.approx(move(start, twist, t)[:2], abs=1e-5)


def test_wheels_turn_as_the_plant_says_or_else_as_if_they_did_not_slip():
    recorder = Recorder()
    plant = observe(KinematicPlant(ROBOT), ROBOT, CIRCLE, [recorder])
    plant.reset(Pose(0.0, 0.0, 0.0))
    twist = BodyTwist(0.3, 0.2, 0.5)
    for _ in range(4):
        plant.step(twist, 0.1)
    recording = recorder.recording
    joints = [int(recording.model.joint(f"wheel{i}").qposadr[0]) for i in range(4)]
    turned = recording.positions[-1, joints] - recording.positions[5, joints]
    assert turned == pytest.approx(0.2 * ROBOT.chassis.wheel_speeds(twist), abs=1e-9)


def test_what_is_not_finite_is_not_recorded():
    class Failing:
        def reset(self, pose):
            self.steps = 0
            return PlantState(pose, BodyTwist(0.0, 0.0, 0.0), nan)

        def step(self, twist, dt):
            self.steps += 1
            x = 0.01 * self.steps if self.steps < 3 else nan
            return PlantState(Pose(x, 0.0, 0.0), BodyTwist(0.1, 0.0, 0.0), nan)

    recorder = Recorder()
    run(observe(Failing(), ROBOT, CIRCLE, [recorder]))
    assert np.isfinite(recorder.recording.positions).all()
    assert recorder.recording.t[-1] == pytest.approx(0.2)


def test_a_watched_plant_can_be_disturbed_if_it_could_before():
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
    seen = observe(plant, ROBOT, CIRCLE, [Notes()])
    assert isinstance(seen, DisturbablePlant)
    disturbances = Disturbances(impulse=Impulse(1.0, 0.0, 0.0))
    seen.apply(disturbances)
    assert plant.applied == disturbances
    alone = observe(Undisturbed(), ROBOT, CIRCLE, [Notes()])
    assert isinstance(alone, Plant)
    assert not isinstance(alone, DisturbablePlant)


def test_satisfies_the_protocol():
    assert isinstance(Recorder(), Observer)
    assert isinstance(Notes(), Observer)


def test_a_long_run_keeps_every_second_frame(monkeypatch):
    monkeypatch.setattr("omnidrive.visualization.recording.MOST_FRAMES", 10)
    recorder = Recorder()
    run(observe(KinematicPlant(ROBOT), ROBOT, CIRCLE, [recorder]), duration=1.2)
    t = recorder.recording.t
    assert len(t) < 10
    assert np.diff(t) == pytest.approx(np.diff(t)[0])
    assert t[0] == 0.0
    assert t[-1] > 1.0


def test_nothing_recorded_is_an_error():
    with pytest.raises(InvalidInput, match="nothing was recorded"):
        _ = Recorder().recording


@every_plant
def test_a_log_alone_can_be_replayed(make):
    recorder = Recorder()
    log = run(observe(make(), ROBOT, CIRCLE, [recorder]), dt=0.08, duration=0.8)
    again = replay(log, ROBOT)
    assert again.t == pytest.approx(recorder.recording.t, abs=2.1e-3)
    kept = recorder.recording.positions[:, :2]
    assert again.positions[:, :2] == pytest.approx(kept, abs=2e-3)
    assert again.target[-1] == pytest.approx(log.target[-1])


def test_a_log_that_ends_badly_is_replayed_up_to_there():
    log = run(KinematicPlant(ROBOT))
    log.pose[4:] = nan
    assert replay(log, ROBOT).t[-1] == pytest.approx(0.3)
    log.pose[1:] = nan
    assert len(replay(log, ROBOT).t) == 1


def test_obstacles_stand_and_move_around_plants_that_have_none():
    grid = OccupancyGrid(np.array([[False, True], [False, False]]), 0.5)
    disc = MovingObstacle(0.2, (0.0, 1.0), ((0.0, 1.0), (1.0, 1.0)))
    recorder = Recorder()
    hold = Hold(Pose(0.2, 0.2, 0.0), 0.4)
    plant = observe(KinematicPlant(ROBOT), ROBOT, hold, [recorder], obstacles=grid, moving=[disc])
    simulate(plant, FeedforwardController(0.1), hold, start=hold.pose, dt=0.1)
    moving = recorder.recording.moving
    assert moving[:, 0, 0] == pytest.approx(recorder.recording.t)
    assert moving[:, 0, 1] == pytest.approx(1.0)
    names = [recorder.recording.model.geom(i).name for i in range(recorder.recording.model.ngeom)]
    assert "wall0" in names
