"""Studies that keep all logs: interrupted ones continue, with the same results."""

import json

import pytest

from omnidrive.errors import CannotWrite, InvalidInput
from omnidrive.scenario import load_scenario
from omnidrive.scenario.run_settings import settings_of_runs
from omnidrive.scenario.run_simulation import simulate_run
from omnidrive.scenario.tasks import DurationsTask, NoiseTask, StepTask, Tasks
from omnidrive.study import run_study
from omnidrive.study.output_paths import check_study_folder
from omnidrive.study.progress import NullProgress
from tests.study.small import small_scenario

SHORT = small_scenario(
    controllers=("feedforward",),
    plant="kinematic",
    tasks=Tasks(
        track=DurationsTask(durations=(20.0,)),
        noise=NoiseTask(durations=(20.0,), repeats=2),
        step=StepTask(displacement=(0.3, 0.1, 0.2), duration=2.0),
    ),
)


class Interrupting(NullProgress):
    """Progress that is interrupted when ``count`` runs are finished."""

    def __init__(self, count):
        self.count, self.finished = count, []

    def runs(self, progress):
        self.finished += [each.name for each in progress.latest]
        if progress.latest and len(self.finished) == self.count:
            raise KeyboardInterrupt


def executed(monkeypatch):
    """Return a list to which the runs are added that are executed."""
    found = []

    def noted(planned, settings, observers=()):
        found.append(settings.task)
        return simulate_run(planned, settings, observers)

    monkeypatch.setattr("omnidrive.study.computation.block_runner.simulate_run", noted)
    return found


def test_second_call_on_one_folder_shares_the_runs(tmp_path, monkeypatch):
    seen, others = executed(monkeypatch), []

    class Second(NullProgress):
        def runs(self, progress):
            if progress.latest and not others:
                others.append(None)
                others.append(run_study(SHORT, tmp_path / "s", figures=()))

    study = run_study(SHORT, tmp_path / "s", progress=Second(), figures=())
    count = len(settings_of_runs(SHORT))
    assert len(study.records) == len(others[1].records) == count
    assert len(seen) == count


def without_times(value):
    """Return results without computing times."""
    if isinstance(value, dict):
        kept = {k: v for k, v in value.items() if k != "timing_s" and "step_time" not in k}
        return {k: without_times(v) for k, v in kept.items()}
    return [without_times(each) for each in value] if isinstance(value, list) else value


def interrupt(folder, count=2):
    with pytest.raises(KeyboardInterrupt):
        run_study(SHORT, folder, progress=Interrupting(count))


def test_interrupted_study_continues_with_the_same_results(tmp_path, monkeypatch):
    run_study(SHORT, tmp_path / "whole")
    interrupt(tmp_path / "study")
    assert not (tmp_path / "study" / "report.html").exists()
    seen = executed(monkeypatch)
    scenario = load_scenario(tmp_path / "study" / "scenario.yaml")  # also the copy in the folder
    progress = Interrupting(0)
    run_study(scenario, tmp_path / "study", progress=progress)
    assert len(seen) == 2
    assert len(progress.finished) == 2
    whole, continued = (
        json.loads((tmp_path / name / "results.json").read_text()) for name in ("whole", "study")
    )
    assert without_times(whole) == without_times(continued)


def test_run_whose_log_is_damaged_is_executed_again(tmp_path, monkeypatch):
    interrupt(tmp_path, 3)
    series = sorted((tmp_path / "series").iterdir())
    series[0].write_bytes(b"PAR1 damaged")
    series[1].unlink()
    seen = executed(monkeypatch)
    run_study(SHORT, tmp_path)
    assert len(seen) == 3


def test_folder_of_another_study_is_refused(tmp_path):
    interrupt(tmp_path)
    other = SHORT.with_values(seed=2)
    with pytest.raises(CannotWrite, match=r"holds the runs of another study.*; choose a new f"):
        run_study(other, tmp_path)
    check_study_folder(tmp_path)


def test_finished_study_is_reported_again_without_runs(tmp_path, monkeypatch):
    run_study(SHORT, tmp_path)
    before = json.loads((tmp_path / "results.json").read_text())
    (tmp_path / "report.html").unlink()
    seen = executed(monkeypatch)
    study = run_study(SHORT, tmp_path)
    assert (seen, len(study.records)) == ([], 4)
    assert (tmp_path / "report.html").exists()
    again = json.loads((tmp_path / "results.json").read_text())
    assert without_times(again) == without_times(before)


def test_a_scenario_is_needed_and_a_study_is_shown_in_one_line():
    with pytest.raises(InvalidInput, match=r"the study is 'a\.yaml', need a Scenario"):
        run_study("a.yaml")
    study = run_study(SHORT)
    assert repr(study) == f"<Study {study.facts.name!r}: 4 runs, folder 'None'>"
