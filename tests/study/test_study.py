"""Studies: the same numbers on any number of cores, and a folder that is always readable."""

import json
from math import isfinite

import numpy as np
import pyarrow.parquet as pq
import pytest

from omnidrive.errors import CannotWrite, InvalidReference
from omnidrive.study import load_scenario, paper_scenario, run_study, study_tasks
from omnidrive.study.jobs import jobs_of
from omnidrive.study.scenario import MapSection, TimingSection
from omnidrive.study.tasks import DurationsTask, Tasks
from tests.study.small import small_scenario

NOT_REPRODUCIBLE = {"step_time_us", "timing_s"}


def numbers(folder):
    """results.json without wall times."""

    def strip(value):
        if isinstance(value, dict):
            return {k: strip(v) for k, v in value.items() if k not in NOT_REPRODUCIBLE}
        return [strip(v) for v in value] if isinstance(value, list) else value

    return strip(json.loads((folder / "results.json").read_text()))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("study") / "run"
    run_study(small_scenario(), path)
    return path


def test_same_numbers_on_two_cores_and_from_the_folders_own_scenario(folder, tmp_path):
    again = tmp_path / "again"
    run_study(load_scenario(folder / "scenario.yaml"), again, processes=2)
    assert numbers(again) == numbers(folder)
    for path in sorted((folder / "series").iterdir()):
        one, two = pq.read_table(path), pq.read_table(again / "series" / path.name)
        assert one.schema == two.schema
        for name in set(one.column_names) - {"step_time"}:
            assert one[name].to_numpy().tobytes() == two[name].to_numpy().tobytes()
    for path in sorted((folder / "figures").glob("xy_*.png")):
        assert path.read_bytes() == (again / "figures" / path.name).read_bytes()


def test_another_seed_gives_other_noise(folder, tmp_path):
    other = small_scenario(seed=2, controllers=("holonomic-nmpc",))
    run_study(other, tmp_path / "other")
    mine, theirs = numbers(folder)["runs"], numbers(tmp_path / "other")["runs"]
    mine = [r for r in mine if r["controller"] == "holonomic-nmpc"]
    assert mine[0] == theirs[0]  # without noise the seed changes nothing
    assert mine[1]["me"] != theirs[1]["me"]


def test_every_controller_sees_the_same_noise(folder):
    offsets = []
    for path in sorted((folder / "series").glob("noise-*.parquet")):
        table = pq.read_table(path).to_pydict()
        offsets.append(np.subtract(table["measured_x"], table["x"]))
    assert len(offsets) == 4
    for other in offsets[1:]:
        assert other == pytest.approx(offsets[0], abs=1e-12)


def test_results_follow_the_documented_schema(folder):
    data = json.loads((folder / "results.json").read_text())
    assert data["format"] == "omnidrive-results-1"
    tasks = {(r["controller"], r["task"]) for r in data["runs"]}
    assert len(tasks) == len(data["runs"]) == 9
    for run in data["runs"]:
        assert run["finished"] is True
        assert run["noise"] == (run["task"] == "noise")
        assert (run["horizon"] is None) == (
            run["controller"] not in {"unicycle-nmpc", "holonomic-nmpc"}
        )
        for key in ("me", "mae", "max_error", "me_measured", "mae_measured", "min_clearance"):
            assert isfinite(run[key])
        assert 0 < run["step_time_us"]["median"] <= run["step_time_us"]["p99"]
        assert (folder / run["series"]).exists()
    steps = {(s["controller"], s["axis"]) for s in data["step_response"]}
    assert len(steps) == 12
    assert {"overshoot", "rise_time", "settling_time"} <= set(data["step_response"][0])


def test_metrics_can_be_had_again_from_the_time_series(folder):
    for run in json.loads((folder / "results.json").read_text())["runs"]:
        table = pq.read_table(folder / run["series"])
        s = {k: np.array(v) for k, v in table.to_pydict().items()}
        error = np.hypot(s["x"] - s["target_x"], s["y"] - s["target_y"])
        assert error.mean() == pytest.approx(run["me"], abs=1e-15)
        turn = np.abs(np.angle(np.exp(1j * (s["yaw"] - s["target_yaw"]))))
        assert turn.mean() == pytest.approx(run["mae"], abs=1e-12)
        assert table.schema.field("x").metadata == {b"unit": b"m"}


def test_the_gains_are_in_the_time_series(folder):
    table = pq.read_table(folder / "series" / "noise-fuzzy_t1-20s.parquet")
    for name, unit in (("kp_position", b"1/s"), ("ki_heading", b"1/s^2"), ("kd_heading", b"1")):
        assert table.schema.field(name).metadata == {b"unit": unit}
    s = {name: column.to_numpy() for name, column in zip(table.column_names, table, strict=True)}
    assert np.ptp(s["kp_position"][:-1]) > 0.05
    assert np.isnan(s["kp_position"][-1])
    goal, seen = (np.array([s[f"{what}_{k}"] for k in "xy"]) for what in ("target", "measured"))
    distance = np.hypot(*(goal[:, 1:] - seen[:, :-1]))
    assert s["error_input_position"][:-1] == pytest.approx(0.5 * distance)
    plans = pq.read_table(folder / "series" / "track-holonomic-nmpc-20s.parquet")
    assert plans.column_names[-4:] == [
        "step_time",
        "fallback_level",
        "solver_iterations",
        "kkt_residual",
    ]


def test_the_folder_holds_report_and_figures(folder):
    names = {p.name for p in (folder / "figures").iterdir()}
    for figure in ("kinematics", "membership_functions", "xy_comparison", "heading_comparison",
                   "horizon_xy", "horizon_heading", "horizon_bars", "step_response", "noise_xy",
                   "noise_heading"):  # fmt: skip
        assert {f"{figure}.png", f"{figure}.svg"} <= names
    assert "</html>" in (folder / "report.html").read_text()
    assert not list(folder.rglob("*.part"))


def test_a_folder_in_use_is_not_overwritten(folder):
    before = (folder / "results.json").read_bytes()
    with pytest.raises(CannotWrite, match="not empty"):
        run_study(small_scenario(), folder)
    assert (folder / "results.json").read_bytes() == before


class Interrupts:
    """A watcher that loses patience after two runs."""

    def __init__(self):
        self.left = 2

    def part(self, name, steps):
        pass

    def done(self, what):
        self.left -= 1
        if self.left == 0:
            raise KeyboardInterrupt


@pytest.mark.parametrize("processes", [1, 2])
def test_what_was_finished_before_an_interruption_is_readable(tmp_path, processes):
    folder = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        run_study(small_scenario(), folder, processes=processes, progress=Interrupts())
    data = json.loads((folder / "results.json").read_text())
    done = len(data["runs"]) + len({s["controller"] for s in data["step_response"]})
    assert done == 2
    for path in (folder / "series").iterdir():
        assert pq.read_table(path).num_rows > 10


def test_a_full_disk_is_reported_and_leaves_what_was_there(tmp_path, monkeypatch):
    import omnidrive.study.folder as module

    write, calls = module.pq.write_table, []

    def full(table, path):
        calls.append(path)
        if len(calls) > 2:
            raise OSError(28, "No space left on device")
        write(table, path)

    monkeypatch.setattr(module.pq, "write_table", full)
    with pytest.raises(CannotWrite, match="No space left on device"):
        run_study(small_scenario(), tmp_path / "run")
    data = json.loads((tmp_path / "run" / "results.json").read_text())
    assert len(data["runs"]) == 2
    assert len(list((tmp_path / "run" / "series").glob("*.parquet"))) == 2


def test_a_duration_that_the_robot_cannot_do_is_refused_before_anything_runs(tmp_path):
    hasty = paper_scenario().model_copy(update={"tasks": study_tasks(12.0)})
    with pytest.raises(InvalidReference, match="12 s is too short"):
        run_study(hasty, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_a_study_of_the_recommended_preset(tmp_path):
    names = ("pid", "fuzzy_t1", "holonomic-nmpc")
    scenario = small_scenario(preset="recommended", controllers=names)
    study = run_study(scenario, tmp_path / "run")
    plans = [r.run for r in study.results.runs if r.controller == "holonomic-nmpc"]
    assert plans
    assert all((run.details["fallback_level"][:-1] == 0.0).all() for run in plans)
    pid, fuzzy = (r for r in study.results.select("noise") if r.controller in names[:2])
    assert list(pid.run.details) == list(fuzzy.run.details)
    assert np.ptp(pid.run.details["kp_x"][:-1]) == 0.0
    assert np.ptp(fuzzy.run.details["kp_x"][:-1]) > 0.1


def test_jobs_of_the_papers_study():
    jobs = jobs_of(paper_scenario())
    assert len(jobs) == len(set(jobs)) == 22


@pytest.mark.parametrize(("law", "beside"), [("uniform", True), ("limits", False)])
def test_the_papers_numbers_stand_beside_its_timing_only(law, beside):
    tasks = Tasks(track=DurationsTask(durations=(20.0,)))
    study = run_study(
        small_scenario(tasks=tasks, controllers=("fuzzy_t1",), timing=TimingSection(law=law))
    )
    assert ("paper ME" in study.tables[0].columns) == beside


def test_a_folder_in_use_is_refused_before_planning(tmp_path):
    (tmp_path / "something").touch()
    nowhere = small_scenario(map=MapSection(source="no.map"))
    with pytest.raises(CannotWrite, match="is not empty"):
        run_study(nowhere, tmp_path)
