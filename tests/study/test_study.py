"""Studies: reproducible results, output folder, report and interruption."""

import json
from math import isfinite

import numpy as np
import pyarrow.parquet as pq
import pytest

from omnidrive.errors import CannotWrite, InvalidReference
from omnidrive.estimation.drive_estimate import DRIVE_UNITS
from omnidrive.evaluation.figures.catalogue import write_figures
from omnidrive.scenario import load_scenario, paper_scenario, study_tasks
from omnidrive.scenario.run_settings import settings_of_runs
from omnidrive.scenario.sections import MapSection, TimingSection
from omnidrive.scenario.tasks import DurationsTask, StepTask, Tasks
from omnidrive.study import run_study
from omnidrive.study.progress import NullProgress
from tests.study.small import small_scenario

NOT_REPRODUCIBLE = {"step_time_us", "timing_s"}


def numbers(folder):
    """Return the content of results.json without wall times."""

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


def test_saved_scenario_gives_equal_results_with_two_processes(folder, tmp_path):
    again = tmp_path / "again"
    run_study(load_scenario(folder / "scenario.yaml"), again, processes=2)
    assert numbers(again) == numbers(folder)
    for path in sorted((folder / "series").iterdir()):
        one, two = pq.read_table(path), pq.read_table(again / "series" / path.name)
        assert one.schema == two.schema
        for name in set(one.column_names) - {"step_time"}:
            assert one[name].to_numpy().tobytes() == two[name].to_numpy().tobytes()


def test_noise_depends_on_the_seed(folder, tmp_path):
    other = small_scenario(seed=2, controllers=("holonomic-nmpc",))
    run_study(other, tmp_path / "other")
    first, second = numbers(folder)["runs"], numbers(tmp_path / "other")["runs"]
    first = [r for r in first if r["controller"] == "holonomic-nmpc"]
    assert first[0] == second[0]  # without noise, the seed has no effect
    assert first[1]["me"] != second[1]["me"]


def test_noise_is_equal_for_all_controllers(folder):
    offsets = []
    for path in sorted((folder / "series").glob("noise-*.parquet")):
        table = pq.read_table(path).to_pydict()
        offsets.append(np.subtract(table["measured_x"], table["x"]))
    assert len(offsets) == 4
    for other in offsets[1:]:
        assert other == pytest.approx(offsets[0], abs=1e-12)


def test_results_follow_the_documented_schema(folder):
    data = json.loads((folder / "results.json").read_text())
    assert data["format"] == "omnidrive-results-2"
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


def test_metrics_can_be_computed_from_the_time_series(folder):
    for run in json.loads((folder / "results.json").read_text())["runs"]:
        table = pq.read_table(folder / run["series"])
        s = {k: np.array(v) for k, v in table.to_pydict().items()}
        error = np.hypot(s["x"] - s["target_x"], s["y"] - s["target_y"])
        assert error.mean() == pytest.approx(run["me"], abs=1e-15)
        yaw_error = np.abs(np.angle(np.exp(1j * (s["yaw"] - s["target_yaw"]))))
        assert yaw_error.mean() == pytest.approx(run["mae"], abs=1e-12)
        assert table.schema.field("x").metadata == {b"unit": b"m"}


def test_time_series_contain_gains_and_solver_details(folder):
    table = pq.read_table(folder / "series" / "noise-fuzzy_t1-20s.parquet")
    for name, unit in (("kp_position", b"1/s"), ("ki_heading", b"1/s^2"), ("kd_heading", b"1")):
        assert table.schema.field(name).metadata == {b"unit": unit}
    s = {name: column.to_numpy() for name, column in zip(table.column_names, table, strict=True)}
    assert np.ptp(s["kp_position"][:-1]) > 0.05
    assert np.isnan(s["kp_position"][-1])
    target, measured = (
        np.array([s[f"{what}_{k}"] for k in "xy"]) for what in ("target", "measured")
    )
    distance = np.hypot(*(target[:, 1:] - measured[:, :-1]))
    assert s["error_input_position"][:-1] == pytest.approx(0.5 * distance)
    nmpc = pq.read_table(folder / "series" / "track-holonomic-nmpc-20s.parquet")
    assert nmpc.column_names[-14 - len(DRIVE_UNITS) :] == [
        "step_time",
        "saturated",
        *(f"wheel_speed_{i}" for i in range(4)),
        "fallback_level",
        "solver_iterations",
        "kkt_residual",
        *(f"disturbance_{axis}" for axis in ("vx", "vy", "yaw_rate")),
        "pose_noise",
        "reference_delay",
        *DRIVE_UNITS,
    ]


def test_folder_contains_report_tables_and_figures(folder, tmp_path, monkeypatch):
    monkeypatch.setattr("omnidrive.evaluation.study_report.write_figures", write_figures)
    tasks = Tasks(step=StepTask(displacement=(1.0, 1.0, 0.7), duration=4.0))
    run_study(small_scenario(tasks=tasks, controllers=("feedforward",)), tmp_path / "run")
    figures = {path.name for path in (tmp_path / "run" / "figures").iterdir()}
    names = ("kinematics", "step_response", "tracking_error")
    assert figures == {f"{name}.svg" for name in names}
    tables = {p.name for p in (folder / "tables").iterdir()}
    assert {"verdict.tex", "verdict.csv", "step-response.tex", "step-response.csv"} <= tables
    assert "</html>" in (folder / "report.html").read_text()
    assert not list(tmp_path.rglob("*.part"))


def test_folder_of_another_study_is_not_overwritten(folder):
    before = (folder / "results.json").read_bytes()
    with pytest.raises(CannotWrite, match="holds the runs of another study"):
        run_study(small_scenario(seed=2), folder)
    assert (folder / "results.json").read_bytes() == before


class Interrupts(NullProgress):
    """Progress that raises KeyboardInterrupt after two runs."""

    def runs(self, progress):
        if progress.done >= 2:
            raise KeyboardInterrupt


@pytest.mark.parametrize("processes", [1, pytest.param(2, marks=pytest.mark.long)])
def test_results_before_an_interruption_are_readable(tmp_path, processes):
    folder = tmp_path / "run"
    with pytest.raises(KeyboardInterrupt):
        run_study(small_scenario(), folder, processes=processes, progress=Interrupts())
    data = json.loads((folder / "results.json").read_text())
    done = len(data["runs"]) + len({s["controller"] for s in data["step_response"]})
    assert done >= 2  # a run that ends beside the interruption is kept, too
    for path in (folder / "series").iterdir():
        assert pq.read_table(path).num_rows > 10


def test_full_disk_is_reported_and_results_are_kept(tmp_path, monkeypatch):
    write, calls = pq.write_table, []

    def full(table, file, **options):
        calls.append(file)
        if len(calls) > 2:
            raise OSError(28, "No space left on device")
        write(table, file, **options)

    monkeypatch.setattr(pq, "write_table", full)
    with pytest.raises(CannotWrite, match="No space left on device"):
        run_study(small_scenario(), tmp_path / "run")
    data = json.loads((tmp_path / "run" / "results.json").read_text())
    assert len(data["runs"]) == 2
    assert len(list((tmp_path / "run" / "series").glob("*.parquet"))) == 2


def test_infeasible_duration_is_rejected_before_any_run(tmp_path):
    infeasible = paper_scenario().model_copy(update={"tasks": study_tasks(12.0)})
    with pytest.raises(InvalidReference, match="12 s is too short"):
        run_study(infeasible, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_study_with_the_preset_recommended(tmp_path):
    names = ("pid", "fuzzy_t1", "holonomic-nmpc")
    scenario = small_scenario(preset="recommended", controllers=names)
    study = run_study(scenario, tmp_path / "run")
    plans = [each.log for each in study.logs.runs if each.controller == "holonomic-nmpc"]
    assert len(plans) == 4
    assert all((log.details["fallback_level"][:-1] == 0.0).all() for log in plans)
    pid, fuzzy = (r.log for r in study.logs.select("noise") if r.controller in names[:2])
    assert list(pid.details) == list(fuzzy.details)
    assert np.ptp(pid.details["kp_x"][:-1]) == 0.0
    assert np.ptp(fuzzy.details["kp_x"][:-1]) > 0.1


def test_number_of_runs_in_the_study_of_the_paper():
    jobs = settings_of_runs(paper_scenario())
    assert len(jobs) == len(set(jobs)) == 22


@pytest.mark.parametrize(("law", "compared"), [("uniform", True), ("limits", False)])
def test_published_errors_are_shown_for_the_published_timing_only(law, compared):
    tasks = Tasks(track=DurationsTask(durations=(20.0,)))
    study = run_study(
        small_scenario(tasks=tasks, controllers=("fuzzy_t1",), timing=TimingSection(law=law))
    )
    (tracking,) = (t for t in study.tables if t.title == "Tracking error without noise")
    assert ("paper ME, mm" in tracking.columns) == compared


def test_nonempty_folder_is_rejected_before_planning(tmp_path):
    (tmp_path / "something").touch()
    without_map = small_scenario(map=MapSection(source="no.map"))
    with pytest.raises(CannotWrite, match="is not empty"):
        run_study(without_map, tmp_path)
