"""Studies with sensors and a state estimator."""

import numpy as np
import pytest
import yaml

from omnidrive.cli.main import load_verb
from omnidrive.errors import InvalidScenario
from omnidrive.estimation import (
    EstimatorSettings,
    GyroSettings,
    LatestFix,
    PoseEstimator,
    PoseFixSettings,
)
from omnidrive.evaluation import measure
from omnidrive.geometry import BodyTwist, Pose
from omnidrive.robot import named_robot
from omnidrive.scenario import (
    RunSettings,
    SensorsSection,
    load_scenario,
    make_controller,
    make_estimator,
    make_sensors,
    paper_scenario,
    plan_and_check,
    save_scenario,
    simulate_run,
)
from omnidrive.scenario.sections import robot_of
from omnidrive.scenario.tasks import NoiseTask, Tasks
from omnidrive.simulation import Outcome, PaperNoise, PerfectSensors, PlantState, SensorSuite
from tests.estimates import Perception
from tests.study.small import small_scenario

HARD = PoseFixSettings(latency=0.1, dropout=0.2, outliers=0.01, outlier_size=1.0)
"""Late, lost and outlying fixes, in addition to the paper's noise."""


def with_sensors(**changes):
    return paper_scenario().model_copy(update={"sensors": SensorsSection(**changes)})


@pytest.mark.parametrize(
    ("fixes", "limit", "repeats"),
    [
        pytest.param(PoseFixSettings(), 0.010, 2, marks=pytest.mark.long),
        pytest.param(HARD, 0.015, 2, marks=pytest.mark.long),
        (HARD, 0.015, 1),
    ],
)
def test_estimator_reduces_the_errors_of_the_noise_task(fixes, limit, repeats):
    """The paper's errors are 0.0566 m and 0.0586 rad."""
    planned = plan_and_check(with_sensors(fixes=fixes))
    for repeat in range(repeats):
        run = simulate_run(planned, RunSettings("noise", "holonomic-nmpc", 30.0, 15, repeat))
        assert run.outcome is Outcome.FINISHED
        metrics = measure(run, planned.robot.drive)
        assert metrics.me <= limit
        assert metrics.mae <= 0.006
        assert (run.position_sigma[1:] > 0.0).all()


def test_wheels_may_not_spin_with_an_estimator_by_default():
    def may_spin(scenario):
        robot = robot_of(scenario.robot)
        return make_controller(scenario, robot, "holonomic-nmpc").actuation.may_spin

    assert may_spin(paper_scenario())
    assert not may_spin(with_sensors())
    assert may_spin(with_sensors(estimator=None))
    spinning = {"holonomic-nmpc": {"type": "holonomic-nmpc", "may_spin": True}}
    assert may_spin(with_sensors().with_values(controllers=spinning))


def test_scenario_with_sensors_round_trips(tmp_path):
    for scenario in (
        with_sensors(),
        with_sensors(gyro=None, fixes=HARD),
        with_sensors(fixes=None, gyro=GyroSettings(bias=0.1)),
        with_sensors(estimator=None),
        with_sensors(estimator=EstimatorSettings(memory=1.0)),
    ):
        save_scenario(scenario, tmp_path / "s.yaml")
        assert load_scenario(tmp_path / "s.yaml") == scenario


@pytest.mark.parametrize(
    ("sensors", "message"),
    [
        ({"fixes": {"latncy": 1}}, "unknown key 'sensors.fixes.latncy'; did you mean 'latency'?"),
        ({"fixes": {"dropout": 2}}, "sensors.fixes.dropout is 2, need 0 to 1"),
        ({"gyro": {"bias": "1 deg"}}, "sensors.gyro.bias must be a plain number"),
        ({"estimator": None, "fixes": None}, "neither fixes nor an estimator"),
        ({"lidar": {}}, "unknown key 'sensors.lidar'"),
    ],
)
def test_invalid_sensors_are_rejected_with_a_message(tmp_path, sensors, message):
    save_scenario(paper_scenario(), tmp_path / "s.yaml")
    data = yaml.safe_load((tmp_path / "s.yaml").read_text())
    (tmp_path / "s.yaml").write_text(yaml.safe_dump({**data, "sensors": sensors}))
    with pytest.raises(InvalidScenario) as caught:
        load_scenario(tmp_path / "s.yaml")
    assert message in str(caught.value)


def test_sensors_and_estimator_of_a_scenario():
    robot, rng = named_robot("paper"), np.random.default_rng(0)
    plain = paper_scenario()
    exact, noisy = (make_sensors(plain, robot, rng, noise=noise) for noise in (False, True))
    assert type(exact) is PerfectSensors
    assert type(noisy) is PaperNoise
    assert isinstance(make_estimator(plain, robot, exact), LatestFix)
    for scenario, kind in (
        (with_sensors(), PoseEstimator),
        (with_sensors(estimator=None), LatestFix),
    ):
        sensors = make_sensors(scenario, robot, rng)
        assert isinstance(sensors, SensorSuite)
        assert isinstance(make_estimator(scenario, robot, sensors), kind)


def test_fixes_in_every_sample_without_an_estimator_equal_the_paper_noise():
    robot, start = named_robot("paper"), Pose(0.0, 0.0, 0.0)
    state = PlantState(start, BodyTwist(0.0, 0.0, 0.0), 0.0, (0.0,) * 4)
    poses = {}
    for name, scenario in (("plain", paper_scenario()), ("fix", with_sensors(estimator=None))):
        sensors = make_sensors(scenario, robot, np.random.default_rng(5), noise=True)
        perception = Perception(sensors, make_estimator(scenario, robot, sensors))
        perception.reset(start)
        poses[name] = [perception.update(0.1 * k, state).pose for k in range(100)]
    assert np.array(poses["fix"]) == pytest.approx(np.array(poses["plain"]), abs=1e-12)


def test_every_task_runs_with_an_estimator():
    scenario = small_scenario(sensors=SensorsSection(), controllers=("feedforward",))
    planned = plan_and_check(scenario)
    for task in ("track", "noise", "step"):
        seconds = 4.0 if task == "step" else 20.0
        run = simulate_run(planned, RunSettings(task, "feedforward", seconds))
        assert run.outcome is Outcome.FINISHED
        assert np.hypot(*(run.pose - run.measured)[:, :2].T).max() < 0.1
        again = simulate_run(planned, RunSettings(task, "feedforward", seconds))
        assert (again.pose == run.pose).all()


@pytest.mark.long
def test_command_line_enables_and_disables_the_estimator(tmp_path, capsys):
    tasks = Tasks(noise=NoiseTask(durations=(20.0,)))
    path = tmp_path / "s.yaml"
    save_scenario(small_scenario(tasks=tasks), path)
    for option, sensors in (("--estimator", SensorsSection()), ("--no-estimator", None)):
        folder = tmp_path / option
        line = [str(path), "--controller", "feedforward", option, "--out", str(folder)]
        load_verb("run")([*line, "--task", "noise"], standalone_mode=False)
        assert load_scenario(folder / "scenario.yaml").sensors == sensors
        printed = " ".join(capsys.readouterr().out.split())
        assert ("error of the estimated pose" in printed) == (option == "--estimator")
        assert ("error of the noisy pose" in printed) == (option == "--no-estimator")
