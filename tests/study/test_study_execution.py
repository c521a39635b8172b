"""Studies in folders: continued, extended, refused."""

from dataclasses import replace

import pyarrow.parquet as pq
import pytest

from omnidrive.errors import CannotWrite, InvalidStore, InvalidStudy
from omnidrive.evaluation.statistics.stop_rule import StopRule
from omnidrive.scenario.scenario_file import scenario_data
from omnidrive.scenario.tasks import NoiseTask, StepTask, Tasks
from omnidrive.study import parse_definition, run_study
from omnidrive.study.progress import NullProgress
from omnidrive.study.storage.store import Store
from omnidrive.study.study_folder import load_study
from tests.study.small import small_scenario
from tests.study.synthetic import table_bytes

STEP = Tasks(step=StepTask(displacement=(0.3, 0.1, 0.2), duration=1.0))


def study(**changes):
    """Return a study of eight short step responses."""
    scenario = small_scenario(controllers=("feedforward", "pid"), tasks=STEP)
    data = {
        "format": "omnidrive-study-1",
        "name": "short",
        "scenario": scenario_data(scenario),
        "axes": {"sample_time": [0.05, 0.1]},
        "repetitions": 2,
    }
    return parse_definition({**data, **changes}, "test")


def stored(folder):
    with Store(folder, read_only=True) as store:
        return table_bytes(store.records())


class Interrupting(NullProgress):
    """Progress that is interrupted when three runs are finished."""

    def runs(self, progress):
        if progress.done >= 3:
            raise KeyboardInterrupt


class Seen(NullProgress):
    """Progress that keeps what it is notified of."""

    def __init__(self):
        self.seen, self.notes = [], []

    def runs(self, progress):
        self.seen.append(progress)

    def note(self, text):
        self.notes.append(text)


def run(definition, folder, **options):
    """Compute a study without figures."""
    return run_study(definition, folder, figures=(), **options)


def test_interrupted_study_continues_with_the_same_table(tmp_path):
    definition = study()
    run(definition, tmp_path / "whole")
    with pytest.raises(KeyboardInterrupt):
        run(definition, tmp_path / "cut", progress=Interrupting())
    again, rule = load_study(tmp_path / "cut")
    assert rule == ""
    progress = Seen()
    run(again, tmp_path / "cut", progress=progress)
    assert progress.seen[0].done >= 3
    assert stored(tmp_path / "whole") == stored(tmp_path / "cut")
    run(definition.with_repetitions(3), tmp_path / "cut")
    assert load_study(tmp_path / "cut")[0].repetitions == 3
    with Store(tmp_path / "cut", read_only=True) as store:
        assert store.records()["number"].to_pylist() == list(range(12))


def test_folder_of_another_study_or_of_other_files_is_refused(tmp_path):
    run(study(), tmp_path / "a")
    with pytest.raises(CannotWrite, match=r"holds another study, 'short'; choose another folder"):
        run(study(axes={"sample_time": [0.05]}), tmp_path / "a")
    with pytest.raises(CannotWrite, match="is not empty; choose a new folder"):
        run(study(), tmp_path)
    with pytest.raises(InvalidStore, match=r"there is no study in .*: no file study\.yaml"):
        load_study(tmp_path)


def test_series_are_kept_if_the_study_says_so(tmp_path):
    run(study(series="all"), tmp_path / "all")
    names = sorted(path.name for path in (tmp_path / "all" / "series").iterdir())
    assert names == [f"{number:06d}.parquet" for number in range(8)]
    assert pq.read_table(tmp_path / "all" / "series" / names[0])["t"].to_pylist()[-1] == 1.0
    run(study(series="failed"), tmp_path / "failed")
    assert not (tmp_path / "failed" / "series").exists()


def test_repetitions_are_added_until_the_interval_is_narrow(tmp_path):
    tasks = Tasks(noise=NoiseTask(durations=(20.0,)))
    scenario = small_scenario(controllers=("feedforward",), tasks=tasks)
    definition = study(scenario=scenario_data(scenario), axes={})
    rule, first, second = StopRule.parse("me:8mm"), Seen(), Seen()
    run(definition, tmp_path, until=rule, progress=first)
    with Store(tmp_path, read_only=True) as store:
        table = store.records()
        assert store.fact("until") == "me:0.008"
    assert 2 < table.num_rows < 200
    assert table["repetition"].to_pylist() == list(range(table.num_rows))
    assert "reached" in first.notes[-1]
    assert rule.check(table).reached
    assert load_study(tmp_path)[1] == "me:0.008"
    run(definition, tmp_path, until=rule, progress=second)
    assert second.notes[-1] == first.notes[-1]


def test_too_many_runs_need_a_confirmation(tmp_path):
    large = replace(study(), repetitions=1_000_000)
    large = replace(large, axes=(*large.axes, *study(axes={"seed": list(range(9))}).axes))
    with pytest.raises(InvalidStudy, match=r"confirm the number with --yes"):
        run(large, tmp_path / "large")
    assert not (tmp_path / "large").exists()
