"""Run folders: their names, temporary files in them, and results of lost runs."""

import json
import os
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor

import pyarrow.parquet as pq
import pytest

from omnidrive.cli.terminal import conclude
from omnidrive.errors import CannotWrite, RunFailed
from omnidrive.evaluation.figures import catalogue
from omnidrive.evaluation.figures.catalogue import Drawing, write_figures
from omnidrive.evaluation.figures.kinematics import kinematics
from omnidrive.files import output_file
from omnidrive.scenario import simulate_run
from omnidrive.scenario.tasks import DurationsTask, StepTask, Tasks
from omnidrive.study import RunFolder, check_figure, check_new_folder, run_study
from tests.study.small import small_scenario

STEP = small_scenario(
    controllers=("feedforward",),
    tasks=Tasks(step=StepTask(displacement=(0.3, 0.1, 0.2), duration=2.0)),
)


def test_studies_that_start_at_the_same_time_have_different_folders(tmp_path):
    path = tmp_path / "runs" / "paper-20260101-120000"
    with ThreadPoolExecutor(16) as threads:
        made = list(threads.map(lambda _: RunFolder(path, numbered=True).path, range(64)))
    assert len(set(made)) == 64
    assert {path, path.with_name(f"{path.name}-2"), path.with_name(f"{path.name}-64")} <= set(made)


def test_numbered_folder_is_that_of_the_study(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "precious").touch()
    study = run_study(STEP, tmp_path / "run", numbered=True)
    assert study.folder == tmp_path / "run-2"
    assert (tmp_path / "run-2" / "report.html").exists()
    with pytest.raises(CannotWrite, match="not empty"):
        run_study(STEP, tmp_path / "run")


@pytest.mark.skipif(sys.platform != "linux", reason="needs names of any bytes")
def test_folder_whose_name_is_not_utf_8(tmp_path, capsys, monkeypatch):
    def one_figure(logs):
        return {"kinematics": Drawing(lambda: kinematics(logs.robot))}

    monkeypatch.setattr(catalogue, "log_drawings", one_figure)
    monkeypatch.setattr("omnidrive.evaluation.study_report.write_figures", write_figures)
    folder = tmp_path / "run\udcff"
    run_study(STEP, folder)
    assert json.loads((folder / "results.json").read_text())["step_response"]
    with open(folder / "series" / "step-feedforward.parquet", "rb") as file:
        assert pq.read_table(file).num_rows > 10
    assert len(list((folder / "figures").iterdir())) == 1
    conclude(f"results: {folder}")
    assert capsys.readouterr().out.endswith("run\\udcff\n")


@pytest.fixture
def parts(tmp_path):
    """Create temporary files of a process that ended and of this one; return their paths."""
    with subprocess.Popen([sys.executable, "-S", "-c", ""]) as ended:
        ended.wait()

    def create(name):
        """Create the temporary files of ``name``."""
        found = []
        for process in (ended.pid, os.getpid()):
            found.append(tmp_path / f".{name}.{output_file._COMPUTER}-{process}-0.part")
            found[-1].touch()
        return found

    return create


def test_folder_with_temporary_files_of_a_killed_command_is_new(parts, tmp_path):
    dead, alive = parts("scenario.yaml")
    with pytest.raises(CannotWrite, match="not empty"):
        check_new_folder(tmp_path)
    assert (dead.exists(), alive.exists()) == (False, True)
    alive.unlink()
    dead.touch()
    check_new_folder(tmp_path)
    assert not list(tmp_path.iterdir())


def test_link_to_nothing_is_no_folder(tmp_path):
    (tmp_path / "link").symlink_to(tmp_path / "nothing")
    for path in (tmp_path / "link", tmp_path / "link" / "new"):
        with pytest.raises(CannotWrite, match="link is a link to nothing; choose another path"):
            check_new_folder(path)


def test_temporary_files_of_other_names_are_kept_beside_an_output_file(parts, tmp_path):
    others = parts("plan[1].png")
    _, alive = parts("plan1.png")
    check_figure(tmp_path / "plan1.png")
    assert {*tmp_path.iterdir()} == {alive, *others}
    check_figure(tmp_path / "plan[1].png")
    assert {*tmp_path.iterdir()} == {alive, others[1]}


def test_lost_run_is_named_in_results_and_report(tmp_path, monkeypatch):
    def simulated(planned, settings, observers=()):
        if settings.task == "step":
            raise KeyboardInterrupt
        return simulate_run(planned, settings, observers)

    monkeypatch.setattr("omnidrive.study.computation.block_runner.simulate_run", simulated)
    monkeypatch.setattr("omnidrive.study.computation.block_runner.is_worker", lambda: True)
    track = DurationsTask(durations=(20.0,))
    study = run_study(STEP.with_values(tasks=Tasks(step=STEP.tasks.step, track=track)), tmp_path)
    outcome = "the process of the run was killed: by KeyboardInterrupt of a component"
    data = json.loads((tmp_path / "results.json").read_text())
    assert {(row["finished"], row["outcome"]) for row in data["step_response"]} == {
        (False, outcome)
    }
    assert data["runs"][0]["finished"]
    assert {row["series"] for row in data["step_response"]} == {None}
    assert not (tmp_path / "series" / "step-feedforward.parquet").exists()
    assert outcome in (tmp_path / "report.html").read_text()
    table = (tmp_path / "tables" / "runs-that-ended-early.csv").read_text()
    assert table.splitlines()[1] == f"step-feedforward,{outcome}"
    with pytest.raises(RunFailed, match=f"step-feedforward .{outcome}"):
        study.raise_if_failed()
