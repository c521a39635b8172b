"""Plans of studies: numbers, keys, pairs, samples and seeds."""

import sys
import tracemalloc
import types
from dataclasses import replace
from time import process_time

import numpy as np
import pytest

from omnidrive.errors import InvalidStudy
from omnidrive.scenario import settings_of_runs
from omnidrive.study import RunPlan, StudyDefinition, check_size, parse_definition
from omnidrive.study.design.random_factors import RandomFactors, parse_factor, repetition_seed
from tests.study.small import noise_scenario, small_scenario

HEAD = {"format": "omnidrive-study-1", "name": "test", "scenario": "paper"}


def plan_of(*, allow_code=False, **keys):
    return RunPlan(parse_definition({**HEAD, **keys}, "study.yaml", allow_code=allow_code))


def test_plan_of_a_scenario_has_its_runs_in_their_order():
    for scenario in (small_scenario(), noise_scenario(3)):
        plan = RunPlan(StudyDefinition.from_scenario(scenario))
        assert [run.settings for run in plan] == settings_of_runs(scenario)
        assert all(run.scenario is scenario for run in plan)
        assert len(set(plan.keys(0, len(plan)))) == len(plan)


def test_numbers_count_repetitions_then_axes_then_runs():
    plan = plan_of(axes={"sample_time": [0.05, 0.1], "plant_robot.mass": [10, 11]}, repetitions=3)
    runs = list(plan)
    assert [run.number for run in runs] == list(range(len(plan)))
    places = [
        (run.repetition, run.factors["sample_time"], run.factors["plant_robot.mass"])
        for run in runs
    ]
    assert places == sorted(places)
    assert len(set(places)) == 12
    assert plan[-1] == runs[-1]
    assert plan[5:8] == runs[5:8]
    with pytest.raises(IndexError):
        plan[len(plan)]


def test_further_repetitions_append_runs():
    factors = {"plant_robot.mass": {"low": 10, "high": 14}}
    for method in ("sobol", "independent"):
        few = plan_of(random={"method": method, "factors": factors}, repetitions=3)
        many = RunPlan(few.definition.with_repetitions(7))
        assert many.keys(0, len(few)) == few.keys(0, len(few))
        assert many[: len(few)] == few[:]


def test_controllers_and_axes_meet_the_same_random_numbers():
    plan = plan_of(
        axes={"sample_time": [0.05, 0.1]},
        random={"factors": {"plant_robot.mass": {"low": 10, "high": 14}}},
        repetitions=4,
    )
    met = {(run.repetition, run.scenario.seed, run.factors["plant_robot.mass"]) for run in plan}
    assert len(met) == 4
    assert len({seed for _, seed, _ in met}) == 4
    assert (0, 1) in {each[:2] for each in met}


def test_runs_that_differ_only_by_the_controller_are_a_pair():
    plan = plan_of(
        axes={"sample_time": [0.05, 0.1], "plant": ["planar", "kinematic"]}, repetitions=2
    )
    groups = {}
    for run in plan:
        groups.setdefault(run.pairing, []).append(run)
    assert sorted(groups) == list(range(len(groups)))
    for group in groups.values():
        what = {
            (
                run.repetition,
                *run.factors.values(),
                *run.settings._replace(controller="", horizon=None),
            )
            for run in group
        }
        assert len(what) == 1
        controllers = [run.settings.controller for run in group]
        assert len(set(controllers)) == len(controllers)


def test_keys_are_equal_if_and_only_if_runs_are():
    """An axis of one controller does not concern the others; names and files do not count."""
    plan = plan_of(axes={"controllers.unicycle-nmpc.horizon": [5, 15]}, set={"tasks.horizon": None})
    by_controller = {}
    for run in plan:
        by_controller.setdefault(
            (run.settings.controller, run.pairing % plan_pairs(plan)), set()
        ).add(run.key)
    for (controller, _), keys in by_controller.items():
        assert len(keys) == (2 if controller == "unicycle-nmpc" else 1)
    one, other = plan_of(name="a"), plan_of(name="b", scenario="paper")
    assert one.keys(0, 50) == other.keys(0, 50)
    for change in (
        {"seed": 2}, {"plant_robot.mass": 11.0}, {"watchdog.patience": 0.2}, {"start.x": 1.5},
        {"wheel_monitor": False}, {"plant": "mujoco-balls"}, {"map.margin": 0.1},
        {"robot.roller_phase": True}, {"preset": "recommended"}, {"sensors": {}},
    ):  # fmt: skip
        changed = plan_of(set=change)
        assert not set(changed.keys(0, 50)) & set(one.keys(0, 50)), change


def plan_pairs(plan):
    return (max(run.pairing for run in plan) + 1) // 2


def test_key_depends_on_the_content_of_files(tmp_path):
    from omnidrive.maps import OccupancyGrid, save_nav2_map

    keys = []
    for name, cell in (("a", 0), ("b", 0), ("c", 1)):
        occupied = np.zeros((20, 20), dtype=bool)
        occupied[0, cell] = True
        save_nav2_map(OccupancyGrid(occupied, 0.5), tmp_path / f"{name}.yaml")
        plan = plan_of(set={"map.source": str(tmp_path / f"{name}.yaml"), "goal": [8, 6]})
        keys.append(plan.keys(0, 1)[0])
    assert keys[0] == keys[1] != keys[2]


def test_key_depends_on_the_content_of_a_fuzzy_system(tmp_path):
    from omnidrive.control.pid import gain_inference
    from omnidrive.fuzzy import save

    path, key = tmp_path / "gains.fis", "controllers.fuzzy_t1.fuzzy.file"
    system, found = gain_inference("t1", "paper").system, []
    for rules in (system.rules, system.rules, system.rules[1:]):
        save(replace(system, rules=rules), path)
        varied = plan_of(axes={key: [str(path)]}), plan_of(set={key: str(path)})
        found.append(
            [{run.key for run in each if run.settings.controller == "fuzzy_t1"} for each in varied]
        )
    for each in zip(*found, strict=True):
        assert each[0]
        assert each[0] == each[1]
        assert not each[0] & each[2]


def test_names_of_files_do_not_count(tmp_path, monkeypatch):
    """A study may be continued from any working folder, and copied with its files."""
    from omnidrive.maps import OccupancyGrid, save_nav2_map

    def keys_in(folder):
        occupied = np.zeros((20, 20), dtype=bool)
        occupied[0, 0] = True
        save_nav2_map(OccupancyGrid(occupied, 0.5), folder / "m.yaml")
        (folder / "p.csv").write_text("x,y\n1,1\n5,5\n8,6\n", encoding="utf-8")
        found = []
        for name in (folder / "p.csv", "p.csv", "../" + folder.name + "/p.csv"):
            reference = {"type": "waypoints", "file": str(name)}
            found.append(plan_of(set={"reference": reference}).keys(0, 1)[0])
        for source in (folder / "m.yaml", "m.yaml"):
            grid = {"source": str(source)}
            found.append(plan_of(set={"map": grid, "goal": [8, 6]}).keys(0, 1)[0])
        return found

    keys = []
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        monkeypatch.chdir(tmp_path / name)
        keys.append(keys_in(tmp_path / name))
    assert keys[0] == keys[1]
    assert len(set(keys[0][:3])) == len(set(keys[0][3:])) == 1


def test_an_object_of_a_session_has_a_key_of_its_own():
    """A class that is defined again in a notebook is another one."""
    keys = []
    for _ in range(2):

        class Law:
            def reset(self, *_):
                pass

            def step(self, t, state, reference):
                pass

        Law.__module__ = "no_file"
        sys.modules["no_file"] = types.ModuleType("no_file")
        sys.modules["no_file"].Law = Law
        Law.__qualname__ = "Law"
        keys += [plan_of(set={"controllers": {"own": {"type": "no_file:Law"}}}, allow_code=True)
                 .keys(0, 1) for _ in range(2)]  # fmt: skip
    del sys.modules["no_file"]
    assert keys[0] == keys[1] != keys[2] == keys[3]


def test_changed_files_of_the_same_name_change_keys(tmp_path):
    """Code, robot, map and waypoints may be edited between two studies of one process."""
    from omnidrive.maps import OccupancyGrid, save_nav2_map
    from omnidrive.robot import ROBOTS, save_robot

    law, robot, grid, path = (tmp_path / name for name in ("law.py", "r.yaml", "m.yaml", "p.csv"))
    code = (
        "import omnidrive as od\n"
        "class Law:\n"
        "    def reset(self, *_): pass\n"
        "    def step(self, state, horizon): return od.Command(od.BodyTwist(0.0, 0.0, GAIN))\n"
        "def law(): return Law()\n"
    )

    def written(round_):
        law.write_text(code.replace("GAIN", f"{round_}.0"), encoding="utf-8")
        heavier = replace(ROBOTS["paper"], mass=10.0 + round_)
        save_robot(heavier, robot)
        occupied = np.zeros((20, 20), dtype=bool)
        occupied[0, round_] = True
        save_nav2_map(OccupancyGrid(occupied, 0.5), grid)
        path.write_text(f"x,y\n1,1\n{5 + round_},5\n8,6\n", encoding="utf-8")

    changes = (
        {"controllers": {"own": {"type": f"{law}:law"}}},
        {"robot": str(robot)},
        {"map.source": str(grid)},
        {"reference": {"type": "waypoints", "file": str(path)}},
    )
    keys = []
    for round_ in range(2):
        written(round_)
        keys.append(
            [plan_of(set={**c, "goal": [8, 6]}, allow_code=True).keys(0, 1) for c in changes]
        )
    same = [change for change, *pair in zip(changes, *keys, strict=True) if pair[0] == pair[1]]
    assert not same


def test_conditions_leave_runs_out():
    axes = {"sample_time": [0.05, 0.1], "plant_robot.mass": [10, 11]}
    whole = {(tuple(r.factors.values()), r.settings) for r in plan_of(axes=axes)}
    left = [
        {"sample_time": 0.1, "controller": "fuzzy_t1"},
        {"plant_robot.mass": 11, "task": "step"},
    ]

    def is_left_out(factors, job):
        return (factors[0] == 0.1 and job.controller == "fuzzy_t1") or (
            factors[1] == 11 and job.task == "step"
        )

    rest = {(tuple(r.factors.values()), r.settings) for r in plan_of(axes=axes, leave_out=left)}
    assert rest == {each for each in whole if not is_left_out(*each)}
    kept = {(tuple(r.factors.values()), r.settings) for r in plan_of(axes=axes, where=left)}
    assert kept == whole - rest
    with pytest.raises(InvalidStudy, match="leave all of them out"):
        plan_of(where=[{"controller": "fuzzy_t1"}], leave_out=[{"controller": ["fuzzy_t1"]}])


def test_axes_of_tasks_and_controllers_change_which_runs_there_are():
    plan = plan_of(
        axes={
            "controllers": {"named": {"one": ["pid"], "two": ["pid", "feedforward"]}},
            "tasks.noise.repeats": [1, 3],
        },
        set={"tasks": {"noise": {"durations": [20]}}},
    )
    assert [
        (run.factors["controllers"], run.factors["tasks.noise.repeats"], run.settings.repeat)
        for run in plan
        if run.settings.controller == "pid"
    ] == [(n, k, r) for n in ("one", "two") for k in (1, 3) for r in range(k)]
    assert len(plan) == 4 + 8


def test_values_that_are_not_possible_together_are_refused_runs():
    plan = plan_of(
        axes={"sample_time": [0.1, 0.005], "tasks.track.durations": [[20], [2000]]},
        set={"controllers": ["pid"], "tasks": {"track": {"durations": [20]}}},
    )
    refused = {tuple(run.factors.values()): run.refused for run in plan if run.refused}
    assert list(refused) == [(0.005, "2000")]
    assert "a run of 400000 samples" in refused[0.005, "2000"]


def test_random_factors_are_within_their_ranges():
    factors = {
        "plant_robot.mass": {"low": 10, "high": 14},
        "plant_robot.friction": {"low": 0.1, "high": 1.0, "scale": "log"},
        "controllers.unicycle-nmpc.horizon": {"low": 5, "high": 9},
        "sample_time": {"choices": [0.05, 0.1]},
        "goal": {"low": [7.9, 5.9], "high": [8.1, 6.1]},
        "plant_robot.servo_gain": {"times": {"low": 0.5, "high": 2.0}},
    }
    for method in ("sobol", "latin-hypercube", "independent"):
        plan = plan_of(random={"method": method, "factors": factors}, repetitions=16)
        runs = [plan[k * plan.per_repetition] for k in range(16)]
        masses = np.array([run.scenario.plant_robot.mass for run in runs])
        frictions = np.array([run.scenario.plant_robot.friction for run in runs])
        assert masses.min() >= 10
        assert masses.max() <= 14
        assert abs(masses.mean() - 12) < 0.7
        assert abs(np.log10(frictions).mean() + 0.5) < 0.2
        horizons = {run.scenario.controllers["unicycle-nmpc"].values["horizon"] for run in runs}
        assert horizons <= {5, 6, 7, 8, 9}
        assert len(horizons) > 2
        for run in (each for each in plan if each.settings.controller == "unicycle-nmpc"):
            own = run.scenario.controllers["unicycle-nmpc"].values["horizon"]
            assert run.settings.task == "horizon" or run.settings.horizon == own
        assert {run.scenario.sample_time for run in runs} == {0.05, 0.1}
        gains = [run.factors["plant_robot.servo_gain times"] for run in runs]
        assert 0.5 <= min(gains) < max(gains) <= 2.0


def test_sobol_samples_fill_the_range_evenly():
    """Also over the boundary of the blocks in which they are drawn."""
    factor = parse_factor("x", ("sample_time",), {"low": 8, "high": 12})
    factors = RandomFactors((factor,))
    values = [factors.sample(k, 1, seed=1)[0].value for k in range(2048)]
    assert set(np.histogram(values, bins=128, range=(8, 12))[0]) == {16}


def test_seeds_of_repetitions_differ():
    seeds = {repetition_seed(seed, k) for seed in (1, 2, 3) for k in range(1000)}
    assert len(seeds) == 3000
    assert repetition_seed(7, 0) == 7
    assert all(0 <= seed < 2**53 for seed in seeds)


def test_large_plan_takes_neither_memory_nor_time():
    grid = {"from": 0.5, "to": 2.0, "count": 10}
    tracemalloc.start()
    began = process_time()
    plan = plan_of(
        axes={
            "plant_robot.lag.0": grid,
            "plant_robot.friction": grid,
            "plant_robot.servo_gain": grid,
        },
        repetitions=10**6,
        set={
            "tasks": {"track": {"durations": [20]}},
            "controllers": ["pid"],
            "plant_robot.lag": [0.1, 0.1],
        },
    )
    assert len(plan) == 10**9
    assert plan[10**9 - 1].repetition == 10**6 - 1
    assert process_time() - began < 2.0
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < 20e6
    with pytest.raises(InvalidStudy, match=r"1,000,000,000 runs .*plant_robot.friction 10.*--yes"):
        check_size(plan)
    check_size(plan, confirmed=True)
