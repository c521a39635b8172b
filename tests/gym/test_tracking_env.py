"""The environment `omnidrive/Tracking-v0`."""

from functools import partial
from inspect import unwrap
from math import nan, pi

import numpy as np
import pytest

gymnasium = pytest.importorskip("gymnasium", reason="needs the extra gymnasium")

from gymnasium.utils.env_checker import check_env  # noqa: E402

from omnidrive.components import component_names  # noqa: E402
from omnidrive.control import FeedforwardController, holonomic_nmpc  # noqa: E402
from omnidrive.control.nmpc.holonomic import Actuation  # noqa: E402
from omnidrive.errors import InvalidInput  # noqa: E402
from omnidrive.estimation import State  # noqa: E402
from omnidrive.geometry import BodyTwist, Pose  # noqa: E402
from omnidrive.gym import ENVIRONMENT, TrackingEnv  # noqa: E402
from omnidrive.gym.tracking import max_axis_twist  # noqa: E402
from omnidrive.reference import Hold  # noqa: E402
from omnidrive.robot import ROBOTS, named_robot  # noqa: E402
from omnidrive.simulation import (  # noqa: E402
    KinematicPlant,
    MujocoPlant,
    PaperNoise,
    PlantState,
    simulate,
)
from omnidrive.testing.laws import Circle  # noqa: E402

SMALL = named_robot("small")
CIRCLE = Circle(duration=8.0)
SIMULATED = [name for name in component_names("plants") if name != "coppeliasim"]
make = partial(gymnasium.make, f"omnidrive.gym:{ENVIRONMENT}", robot="small", reference=CIRCLE)


def small(**changes):
    return TrackingEnv(**{"robot": SMALL, "plant": "kinematic", "reference": CIRCLE, **changes})


@pytest.mark.parametrize("plant", SIMULATED)
def test_environment_passes_gymnasiums_check(plant):
    """Warnings are errors; pictures are checked too."""
    env = make(plant=plant, render_size=(64, 48))
    check_env(env.unwrapped)
    env.close()


@pytest.mark.parametrize("robot", ROBOTS)
def test_every_robot_has_an_environment(robot):
    env = TrackingEnv(plant="kinematic", robot=robot)
    observation, _ = env.reset(seed=1)
    assert observation in env.observation_space
    assert env.step(np.zeros(3))[0] in env.observation_space


def test_environment_with_noise_and_a_plant_factory_passes_the_check():
    check_env(make(plant=KinematicPlant, sensors=PaperNoise, render_size=(64, 48)).unwrapped)


def drive(env, controller, **reset):
    """Return the poses of a controller in the environment."""
    _, info = env.reset(**reset)
    exact = np.zeros((3, 3))
    controller.reset(State(0.0, Pose(*info["measured"]), None, exact))
    poses, ended = [info["pose"]], False
    while not ended:
        state = State(info["t"], Pose(*info["measured"]), None, exact)
        twist = controller.step(info["t"], state, CIRCLE).twist
        _, _, lost, ended, info = env.step(np.array(twist) / env.max_twist)
        assert not lost
        poses.append(info["pose"])
    return np.array(poses)


CONTROLLERS = {
    "feedforward": lambda: FeedforwardController(0.1),
    "holonomic-nmpc": lambda: holonomic_nmpc(SMALL.chassis, 0.1, actuation=Actuation.of(SMALL)),
}


@pytest.mark.parametrize("name", CONTROLLERS)
def test_controller_gives_the_same_poses_as_simulate(name):
    start = CIRCLE.at(0.0).pose
    run = simulate(MujocoPlant(SMALL, "ball"), CONTROLLERS[name](), CIRCLE, start=start, dt=0.1)
    env = small(plant="mujoco-balls")
    poses = drive(env, CONTROLLERS[name](), options={"offset": (0.0, 0.0, 0.0)})
    assert poses == pytest.approx(run.pose, abs=1e-9)


def test_noise_depends_on_the_seed_only():
    first, again, other = (
        drive(small(sensors=PaperNoise), FeedforwardController(0.1), seed=seed)
        for seed in (5, 5, 6)
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


def test_observation_by_hand():
    env = small(preview=2, max_twist=BodyTwist(2.0, 4.0, 5.0))
    observation, info = env.reset(options={"offset": (0.1, -0.2, 0.5 * pi)})
    # the circle starts at (0, -1) with heading 0; the robot's heading is along y
    assert info["pose"] == pytest.approx([0.1, -1.2, 0.5 * pi])
    assert observation[:3] == pytest.approx([0.2, 0.1, -0.5], abs=1e-6)
    assert observation[3:6] == pytest.approx([0.0, 0.0, 0.0])
    speed = 2 * pi / 8.0
    assert observation[6:9] == pytest.approx([0.0, -speed / 4.0, speed / 5.0], abs=1e-6)
    for k in (1, 2):
        x, y, yaw = CIRCLE.at(0.1 * k).pose
        scale = 1.0 + 0.1 * k * speed
        expected = [(y + 1.2) / scale, -(x - 0.1) / scale, (yaw - 0.5 * pi) / pi]
        assert observation[6 + 3 * k : 9 + 3 * k] == pytest.approx(expected, abs=1e-6)
    action = np.array([0.25, -0.5, 0.1])
    observation, *_ = env.step(action)
    assert observation[-3:] == pytest.approx(action, abs=1e-7)
    assert observation[3:6] == pytest.approx(action, abs=1e-6)  # exact: kinematic
    assert len(observation) == 18


def test_reward_by_hand():
    env = TrackingEnv(
        robot=SMALL, plant="kinematic", reference=Hold(Pose(0.0, 0.0, 0.0), 1.0),
        max_error=(0.5, 1.0), smoothness_weight=0.3, max_twist=BodyTwist(1.0, 1.0, 1.0),
    )  # fmt: skip
    env.reset(options={"offset": (0.2, 0.0, 0.1)})
    *_, reward, lost, ended, info = env.step(np.zeros(3))
    assert reward == pytest.approx(-((0.2 / 0.5) ** 2 + 0.1**2))
    assert info["error"] == pytest.approx([0.2, 0.1])
    assert (lost, ended) == (False, False)
    *_, reward, _, _, info = env.step(np.array([1.0, 0.0, -1.0]))
    distance, heading = info["error"]
    assert heading == pytest.approx(0.0, abs=1e-12)
    assert reward == pytest.approx(-((distance / 0.5) ** 2) - 0.3 * 2.0)


def test_termination_costs_all_remaining_steps():
    env = TrackingEnv(
        robot=SMALL, plant="kinematic", reference=Hold(Pose(0.0, 0.0, 0.0), 1.0),
        max_error=(0.5, 3.0), smoothness_weight=0.0, max_twist=BodyTwist(1.0, 1.0, 1.0),
    )  # fmt: skip
    env.reset(options={"offset": (0.45, 0.0, 0.0)})
    *_, reward, lost, ended, _ = env.step(np.array([1.0, 0.0, 0.0]))
    assert (lost, ended) == (True, False)
    assert reward == pytest.approx(-2.0 * 10)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(np.zeros(3))


def test_heading_error_terminates():
    env = small(max_error=(1.0, 0.2))
    env.reset(options={"offset": (0.0, 0.0, 0.3)})
    assert env.step(np.zeros(3))[2]


def test_the_end_of_the_reference_truncates():
    env = small(plant=KinematicPlant, reference=Hold(Pose(0.0, 0.0, 0.0), 0.4))
    env.reset(seed=1)
    ends = [env.step(np.zeros(3))[2:4] for _ in range(4)]
    assert ends == [(False, False)] * 3 + [(False, True)]


def test_failing_plant_terminates_with_finite_numbers():
    class Failing(KinematicPlant):
        def step(self, twist, dt):
            return PlantState(Pose(nan, nan, nan), BodyTwist(nan, nan, nan), nan)

    env = small(plant=Failing)
    env.reset(seed=1)
    observation, reward, lost, ended, info = env.step(np.zeros(3))
    assert (lost, ended) == (True, False)
    assert np.isfinite([*observation, reward, *info["pose"]]).all()


def test_large_actions_are_clipped_and_invalid_ones_refused():
    env = small()
    env.reset(options={"offset": (0, 0, 0)})
    observation, *_ = env.step(np.array([7.0, 0.0, -3.0]))
    assert observation[-3:] == pytest.approx([1.0, 0.0, -1.0])


BAD_ACTIONS = {
    "nan": [nan, 0.0, 0.0], "infinite": np.full(3, np.inf), "short": [0.0, 0.0], "none": None,
    "text": "abc", "texts": ["0", "0", "0"], "nested": [[0.0], [0.0, 0.0], 0.0], "number": 1.0,
    "objects": [None] * 3, "complex": [1j, 0.0, 0.0], "large": np.zeros((3, 1000)),
    "mapping": {"vx": 1.0}, "infinite integer": [10**400, 0, 0],
}  # fmt: skip


@pytest.mark.parametrize("name", BAD_ACTIONS)
@pytest.mark.filterwarnings("error")
def test_invalid_action_is_one_sentence_and_the_run_goes_on(name):
    env, same = small(), small()
    for each in (env, same):
        each.reset(seed=1)
        each.step(np.full(3, 0.3))
    with pytest.raises(InvalidInput, match="an action must be 3 numbers") as refusal:
        unwrap(TrackingEnv.step)(env, BAD_ACTIONS[name])  # without run-time type checks
    assert len(str(refusal.value)) < 200
    assert "\n" not in str(refusal.value)
    after, unaffected = (each.step(np.zeros(3)) for each in (env, same))
    assert repr(after) == repr(unaffected)


@pytest.mark.parametrize("robot", ROBOTS)
def test_action_of_one_is_the_largest_twist_along_its_axis(robot):
    chassis = named_robot(robot).chassis
    for axis, speed in enumerate(max_axis_twist(named_robot(robot))):
        twist = BodyTwist(*(speed * np.eye(3)[axis]).tolist())
        fastest = np.abs(chassis.wheel_speeds(twist)).max()
        assert fastest == pytest.approx(chassis.max_wheel_speed)


def test_start_offsets_are_within_start_spread():
    env = small(start_spread=(0.2, 0.4))
    offsets = np.array([env.reset(seed=k)[1]["pose"] - CIRCLE.at(0.0).pose for k in range(60)])
    largest = np.abs(offsets).max(axis=0)
    assert (largest <= [0.2, 0.2, 0.4]).all()
    assert (largest > [0.15, 0.15, 0.3]).all()


@pytest.mark.parametrize("plant", ["kinematic", "mujoco-balls"])
def test_pictures_change_with_the_pose(plant):
    env = small(plant=plant, render_mode="rgb_array", render_size=(160, 90))
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.render()
    env.reset(seed=1)
    before = env.render()
    assert before.shape == (90, 160, 3)
    for _ in range(5):
        env.step(np.array([0.3, 0.0, 0.0]))
    after = env.render()
    assert np.abs(after.astype(int) - before).mean() > 0.5
    env.close()
    env.close()


def test_render_without_a_mode_returns_none():
    env = small()
    env.reset(seed=1)
    assert env.render() is None


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"plant": "roller"}, "there is no plant 'roller'; did you mean 'mujoco-rollers'"),
        ({"robot": "big"}, "there is no robot 'big'"),
        ({"dt": 0.0}, "dt is 0 s"),
        ({"dt": nan}, "dt is nan s"),
        ({"preview": 101}, "preview is 101"),
        ({"preview": 2.5}, "preview is 2.5, need a whole number"),
        ({"preview": None}, "preview must be a number, got None"),
        ({"start_spread": (-0.1, 0.0)}, "start_spread is -0.1 m, need 0 to 10 m"),
        ({"start_spread": 0.1}, r"start_spread must be 2 numbers \(m, rad\), got 0.1"),
        ({"max_error": (1.0, 4.0)}, "max_error is 4 rad"),
        ({"smoothness_weight": nan}, "smoothness_weight is nan"),
        ({"render_mode": "human"}, "no render_mode 'human'; there are rgb_array"),
        ({"render_size": (8, 8)}, "a picture of"),
        ({"max_twist": BodyTwist(1.0, 0.0, 1.0)}, "max_twist is 0 m/s"),
    ],
)
@pytest.mark.filterwarnings("ignore")
def test_invalid_settings_are_refused(change, message):
    env, make_env = object.__new__(TrackingEnv), unwrap(TrackingEnv.__init__)
    with pytest.raises(InvalidInput, match=message):  # without run-time type checks
        make_env(env, **{"robot": SMALL, "plant": "kinematic", "reference": CIRCLE, **change})


@pytest.mark.parametrize("options", [{"ofset": 1}, {"offset": (1, 2)}, {"offset": (nan, 0, 0)}])
def test_invalid_options_are_refused(options):
    with pytest.raises(InvalidInput, match=r"offset|option"):
        small().reset(options=options)
