"""Verbs of `omnidrive study` that compute: run, status, resume, list."""

import json
import math

import pytest

from omnidrive.cli.main import load_verb
from omnidrive.cli.progress import runs_text
from omnidrive.cli.terminal import count_text
from omnidrive.errors import InvalidInput, InvalidStore, InvalidStudy
from omnidrive.study.progress import RunProgress

STUDY = """
format: omnidrive-study-1
name: short
question: Does the sample time matter?
scenario: paper
set:
  plant: kinematic
  controllers: [feedforward]
  tasks: {step: {displacement: [0.3, 0.1, 0.2], duration: 1.0}}
axes: {sample_time: [0.05, 0.1]}
repetitions: 2
"""


def study(*args):
    """Execute a verb of the group in this process."""
    load_verb("study")([*map(str, args)], standalone_mode=False)


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "short.yaml"
    path.write_text(STUDY, encoding="utf-8")
    return path


def test_study_is_computed_continued_and_shown(file, tmp_path, capsys):
    folder = tmp_path / "out"
    study(file, "--out", folder, "--jobs", 1, "--repetitions", 1)
    out, err = capsys.readouterr()
    assert "runs: 2 finished" in out
    assert out.splitlines()[-1].startswith(f"results: {folder}")
    assert "simulate" in err
    assert "2/2" in err
    assert "Step response" in out
    assert (folder / "report.html").is_file()
    study("run", file, "--out", folder, "--jobs", 1)
    assert "runs: 4 finished" in capsys.readouterr().out
    study("status", folder)
    shown = capsys.readouterr().out
    assert "study short: 4 runs planned" in shown
    assert "stored: 4 (100 %): 4 finished" in shown
    study("status", folder, "--json")
    facts = json.loads(capsys.readouterr().out)
    assert (facts["planned"], facts["runs"], facts["at_work"]) == (
        4,
        4,
        {"runs": 0, "processes": 0},
    )
    study("resume", folder, "--jobs", 1)
    assert "runs: 4 finished" in capsys.readouterr().out


def test_status_is_that_of_the_present_study_file(file, tmp_path, capsys, monkeypatch):
    """The outline in the store is used as long as the file has the same bytes."""
    from omnidrive.study import study_folder

    parsed, load = [], study_folder.load_study
    monkeypatch.setattr(
        study_folder, "load_study", lambda *args, **keys: parsed.append(1) or load(*args, **keys)
    )
    folder = tmp_path / "out"
    study(file, "--out", folder, "--jobs", 1)
    capsys.readouterr()
    definition = folder / "study.yaml"
    text = definition.read_text(encoding="utf-8")
    for changed, fact in (
        (text, "study short: 4 runs planned"),
        (text.replace("repetitions: 2", "repetitions: 3"), "study short: 6 runs planned"),
        (text.replace("name: short", "name: other"), "study other: 4 runs planned"),
    ):
        definition.write_text(changed, encoding="utf-8")
        study("status", folder)
        assert capsys.readouterr().out.splitlines()[0] == fact
        assert bool(parsed) == (changed != text)


def test_plan_is_shown_and_nothing_computed(file, tmp_path, capsys):
    study(file, "--dry-run", "--set", "sample_time=0.2", "--set", "controllers=[pid, feedforward]")
    shown = capsys.readouterr().out.splitlines()
    assert shown[0] == "study short: 4 runs"
    assert "controllers: pid, feedforward" in shown
    assert "repetitions: 2, each with 2 runs" in shown
    assert [path.name for path in tmp_path.iterdir()] == ["short.yaml"]


def test_studies_of_the_package_are_listed(capsys):
    study("list")
    assert "paper: 22 runs. How do the controllers" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("args", "error", "fact"),
    [
        (("fricton",), InvalidStudy, "there is no study 'fricton'"),
        (("FILE", "--set", "plnt=planar"), InvalidStudy, "did you mean 'plant'"),
        (("FILE", "--set", "plant"), InvalidInput, "write PATH=VALUE, such as plant=planar"),
        (("FILE", "--set", "plant=[&a x, *a]"), InvalidInput, "is not a YAML value"),
        (("FILE", "--until", "me"), InvalidInput, "write QUANTITY:HALF_WIDTH"),
        (("status", "nowhere"), InvalidStore, "there is no study in nowhere: no file study.yaml"),
        (("resume", "nowhere"), InvalidStore, "there is no study in nowhere"),
    ],
)
def test_wrong_input_is_reported(file, tmp_path, monkeypatch, args, error, fact):
    monkeypatch.chdir(tmp_path)
    given = [str(file) if each == "FILE" else each for each in args]
    with pytest.raises(error, match=fact.replace("[", r"\[")):
        study(*given, *(["--out", "new"] if "FILE" in args else []))
    assert not (tmp_path / "new").exists()


def test_progress_has_share_time_and_best_controller():
    best = ("fuzzy_t2", 0.0413)
    assert runs_text(RunProgress(50, 200, 3, 4321.0, best)) == (
        "50 of 200 runs (25 %), 3 ended early, 72 min left, best so far: fuzzy_t2, mean ME 41.3 mm"
    )
    assert runs_text(RunProgress(0, 1_000_000, 0, math.inf, None)) == "0 of 1,000,000 runs (0 %)"
    assert "3 h 20 min left" in runs_text(RunProgress(1, 2, 0, 12_000.0, None))
    assert count_text({"controller_failed": 2, "finished": 7}) == "7 finished, 2 controller failed"
