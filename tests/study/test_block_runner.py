"""Blocks of runs: compiled loops give the records of single runs, in any process and order."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from omnidrive.control.supervision import WheelMonitor
from omnidrive.evaluation import measure
from omnidrive.evaluation.measures.metrics import commanded_wheel_speeds
from omnidrive.evaluation.measures.path_error import _Path, path_errors, path_errors_of
from omnidrive.robot import ROBOTS, named_robot, save_robot
from omnidrive.study import RunPlan, parse_definition, run_block
from omnidrive.study.computation import block_runner as runner
from omnidrive.study.computation.batched_runs import batched_records

TASKS = {
    "track": {"durations": [10]},
    "noise": {"durations": [10], "repeats": 2},
    "step": {"displacement": [1, 1, 0.7], "duration": 3},
}
CIRCLE = {"type": "circle", "radius": 0.8}


def plan_of(tasks=TASKS, repetitions=1, scenario="recommended", axes=None, **settings):
    data = {
        "format": "omnidrive-study-1",
        "name": "test",
        "scenario": scenario,
        "set": {"plant": "kinematic", "reference": CIRCLE, "tasks": tasks, **settings},
        "axes": axes or {},
        "repetitions": repetitions,
    }
    return RunPlan(parse_definition(data, "test"))


def batched(runs):
    return dict(batched_records(runs, runner._plans.planned))


def alone(run):
    return runner._record(run)[0]


def assert_equal(record, other):
    """All but the computing times is equal, bit for bit."""
    assert replace(record, metrics={}, timing={}) == replace(other, metrics={}, timing={})
    assert record.metrics.keys() == other.metrics.keys()
    values, expected = (np.array(list(each.metrics.values())) for each in (record, other))
    np.testing.assert_array_equal(values, expected)


@pytest.mark.parametrize("plant", ["kinematic", "planar"])
def test_compiled_loops_have_the_records_of_single_runs(plant):
    plan = plan_of(plant=plant, controllers=["fuzzy_t1", "feedforward"], repetitions=2)
    runs = plan[:]
    found = batched(runs)
    assert sorted(found) == list(range(len(runs)))
    for index in range(0, len(runs), 1 if plant == "kinematic" else 5):
        assert_equal(found[index], alone(runs[index]))


@pytest.mark.long
@pytest.mark.parametrize("plant", ["kinematic", "planar"])
@pytest.mark.parametrize("robot", ["paper", "kiwi", "mecanum"])
def test_all_compiled_loops_have_the_records_of_single_runs(plant, robot):
    """Also with retimed motion, a random wheel phase, another plant and another sample time."""
    tasks = {**TASKS, "track": {"durations": [20]}, "noise": {"durations": [20]}}
    plan = plan_of(
        tasks,
        scenario={
            "robot": {"name": robot},
            "reference": "eight",
            "controllers": ["pid", "fuzzy_t1", "fuzzy_t3", "feedforward", "holonomic-nmpc"],
            "tasks": TASKS,
        },
        plant=plant,
        reference="eight",
        axes={"sample_time": [0.05, 0.1], "plant_robot.friction": {"times": [0.5]}},
        **{"plant_robot.roller_phase": True},
    )
    runs = plan[:]
    found = batched(runs)
    assert len(found) >= 0.5 * len(runs)
    for index, record in list(found.items())[::4]:
        assert_equal(record, alone(runs[index]))


def test_record_depends_neither_on_the_block_nor_on_the_process():
    plan = plan_of(controllers=["fuzzy_t1", "feedforward"], repetitions=3)
    whole = run_block(plan[:])
    assert [record.number for record in whole] == list(range(len(plan)))
    for index in (4, 11, 2):
        (record,) = run_block([plan[index]])
        assert_equal(record, whole[index])
    for record, other in zip(
        run_block(pickle.loads(pickle.dumps(plan[3:6]))), whole[3:6], strict=True
    ):
        assert_equal(record, other)


def test_runs_that_compiled_loops_cannot_simulate_are_left_to_single_runs():
    only_track = {"track": {"durations": [10]}}
    for settings in (
        {"controllers": ["unicycle-nmpc"]},
        {"sensors": {}},
        {"faults": [{"kind": "period-jitter", "at": 5}]},
        {"plant": "mujoco-balls"},
    ):
        assert (
            batched(plan_of(**({"tasks": only_track, "controllers": ["pid"]} | settings))[:]) == {}
        )


def test_runs_in_which_the_supervisor_acts_are_single_runs():
    """A watchdog that stops at 1 cm; the record says so."""
    tasks = {"noise": {"durations": [10]}}
    plan = plan_of(tasks, controllers=["feedforward"], **{"watchdog.error": 0.01})
    assert batched(plan[:]) == {}
    (record,) = run_block(plan[:])
    assert record.outcome == "stopped"
    assert not record.finished
    assert "from the reference" in record.detail


def test_wheel_monitor_reports_only_runs_that_it_may_report():
    """Of the same records of healthy and dead motors, one sample at a time and all at once."""
    robot = named_robot("paper")
    rng = np.random.default_rng(0)
    runs, samples, wheels, dt = 40, 60, 4, 0.1
    twists = np.repeat(rng.uniform(-0.4, 0.4, (runs, samples // 10, 3)), 10, axis=1)
    commanded = robot.drive.limited_speeds_of(twists)
    speeds = commanded * rng.uniform(0.9, 1.0, commanded.shape)
    speeds[::5, 20:, 1] *= 0.0  # a locked wheel
    angles = np.zeros_like(speeds)
    angles[:, 1:] = np.cumsum(dt * speeds[:, :-1], axis=1)
    torques = np.zeros_like(speeds)
    torques[:, 1:] = robot.servo_gain * (commanded - speeds)[:, :-1]
    torques[1::5, 30:, 2] = 0.0  # a dead motor
    may = WheelMonitor(robot).may_report(twists, dt, angles, torques)
    reports = []
    for r in range(runs):
        from omnidrive.geometry import BodyTwist

        monitor = WheelMonitor(robot)
        found = [
            monitor.update(
                BodyTwist(*twists[r, k].tolist()), dt, angles[r, k + 1].tolist(),
                torques[r, k + 1].tolist(),
            )
            for k in range(samples - 1)
        ]  # fmt: skip
        reports.append(any(found))
    assert any(reports)
    assert not all(may)
    assert not (np.array(reports) & ~may).any()
    assert wheels == speeds.shape[2]


def test_refused_runs_have_a_record_with_the_reason():
    plan = plan_of(
        tasks={"track": {"durations": [1, 10]}}, controllers=["pid"], axes={"plant": ["kinematic"]}
    )
    short, long = run_block(plan[:])
    assert short.outcome == "refused"
    assert "1 s is too short" in short.detail
    assert short.metrics == {}
    assert long.finished


def test_recovery_is_that_from_the_run_without_the_fault():
    """The record of a fault does not depend on whether its undisturbed run is in the block."""
    tasks = {"faults": {"duration": 10, "faults": [{"kind": "pose-jump", "at": 5}]}}
    plan = plan_of(tasks, controllers=["pid"])
    nominal, jump = run_block(plan[:])
    assert "recovered" not in nominal.metrics
    assert {"recovered", "time_to_recover", "worst_error"} <= jump.metrics.keys()
    runner._undisturbed._values.clear()
    (again,) = run_block([plan[1]])
    assert_equal(again, jump)


def test_files_may_be_edited_between_runs_of_one_process(tmp_path):
    """Robot and path count by their content, also where a study is executed again."""
    robot, path = tmp_path / "robot.yaml", tmp_path / "path.csv"
    reference = {"type": "waypoints", "file": str(path)}
    errors = []
    for mass, x in ((10.0, 1.0), (20.0, 1.0), (20.0, 2.0)):
        save_robot(replace(ROBOTS["paper"], mass=mass), robot)
        path.write_text(f"x,y\n1,1\n{x},2\n3,3\n", encoding="utf-8")
        plan = plan_of(
            {"track": {"durations": [8]}}, plant="planar", controllers=["pid"],
            reference=reference, robot={"name": str(robot)},
        )  # fmt: skip
        errors.append(run_block(plan[:])[0].metrics["me"])
    assert len(set(errors)) == 3


def test_logs_are_given_as_the_study_asks():
    tasks = {"track": {"durations": [1]}, "noise": {"durations": [10]}}
    plan = plan_of(tasks, controllers=["feedforward"], **{"watchdog.error": 0.01})
    for series, count in (("none", 0), ("failed", 1), ("all", 1)):
        kept = []
        records = run_block(plan[:], lambda run, log, kept=kept: kept.append(log), series=series)
        assert len(kept) == count
        assert all(log.t[-1] <= 10 for log in kept)
    assert np.isfinite(records[1].timing["step_time_median"])


def test_nearest_points_of_many_runs_are_those_of_each():
    """Also where the reference stands, where the path crosses itself, and far from it."""
    rng = np.random.default_rng(3)
    t = 0.1 * np.arange(200)
    s = np.clip(t - 3.0, 0.0, 12.0)
    target = np.column_stack([np.sin(s), np.sin(2.0 * s), s])
    poses = target + rng.normal(0.0, [0.3, 0.3, 0.1], (30, 200, 3)) * rng.uniform(0, 1, (30, 1, 1))
    poses[0] = target
    path = _Path.of(t, target)
    many = path_errors_of(t, poses, target)
    for pose, *errors in zip(poses, *many, strict=True):
        single = path.errors(pose, path.nearest(pose))
        for value, expected in zip(errors, single, strict=True):
            np.testing.assert_array_equal(value, expected)


def test_metrics_of_one_run_are_those_of_many():
    from omnidrive.evaluation.measures.metrics import LoggedRuns, measure_many
    from omnidrive.scenario import plan_and_check, simulate_run

    plan = plan_of({"noise": {"durations": [10]}}, controllers=["feedforward"])
    planned = plan_and_check(plan[0].scenario)
    run = simulate_run(planned, plan[0].settings)
    drive = planned.robot.drive
    three = LoggedRuns(
        run.t, run.target, np.stack([run.pose] * 3), np.stack([run.measured] * 3),
        np.stack([commanded_wheel_speeds(run, drive)] * 3), np.repeat(run.work[-1:], 3),
        np.zeros(3, np.int64),
    )  # fmt: skip
    expected = measure(run, drive)._replace(step_time_median=np.nan, step_time_p99=np.nan)
    for each in measure_many(three):
        np.testing.assert_array_equal(each, expected)
    assert path_errors(run).position.shape == run.t.shape
