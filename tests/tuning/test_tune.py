"""Tuning from scenario to report, on the kinematic plant; interrupted and resumed."""

import re
import signal
import subprocess
import sys
import time
from dataclasses import replace
from importlib import import_module
from pathlib import Path

import pytest

from omnidrive.errors import CannotWrite, InvalidInput
from omnidrive.scenario import Scenario, paper_scenario, plan_at, save_scenario
from omnidrive.scenario.controller_file import load_controller
from omnidrive.study import RunPlan, StudyDefinition, load_definition
from omnidrive.study.storage.store import Store
from omnidrive.tuning import (
    Tuning,
    TuningSettings,
    default_sets,
    equal_budget,
    load_tuning,
    parse_objective,
    stored_runs,
    tune,
    write_tuning,
)
from omnidrive.tuning.balanced import objective_of
from omnidrive.tuning.run_sets import RunSets, check_apart, validation_set
from omnidrive.tuning.tune import _shows_gain, _shows_loss
from tests.command import omnidrive
from tests.tuning.synthetic import record


def scenario(**changes):
    return Scenario(
        **{
            "name": "small",
            "robot": {"name": "paper"},
            "plant": "kinematic",
            "reference": {"type": "circle", "radius": 0.4},
            "controllers": {"slow": {"type": "pid", "position": {"kp": 2.0}}, "pid": "pid"},
            "sample_time": 0.2,
            "tasks": {"track": {"durations": [4.0]}},
            **changes,
        }
    )


def small(trials=10, objectives=("me",), **changes):
    settings = TuningSettings(
        controller="slow", trials=trials, objectives=objectives,
        parameters=("position.kp", "heading.kp"), **changes,
    )  # fmt: skip
    found = Tuning.of(scenario(), settings)
    held_out = found.sets.held_out.scenario.with_values(
        reference={"type": "eight", "length": 1.5}, tasks={"track": {"durations": [12.0]}}
    )
    quick = type(found.sets.held_out).from_scenario(held_out)
    return Tuning(settings, RunSets(found.sets.training, quick))


def refuse(runs):
    raise AssertionError("a stored run was computed again")


def without_times(result):
    return (
        result.search,
        result.chosen,
        [each for each in result.held_out.gains if "time" not in each.label],
    )


@pytest.fixture(scope="module")
def finished(tmp_path_factory):
    """A finished tuning and its progress."""
    progress = []
    folder = tmp_path_factory.mktemp("tuning")
    return tune(small(), folder, report=lambda *each: progress.append(each)), progress


def test_search_improves_held_out_runs_and_resumes(finished, monkeypatch):
    result, progress = finished
    tmp_path = result.folder
    assert result.chosen.score.objectives[0] < 0.9 * result.search.trials[0].score.objectives[0]
    gain = result.held_out.gains[0]
    assert gain.label == "ME in mm"
    assert gain.after < gain.before
    assert progress[-1][:3] == ("held-out runs", 2, 2)
    assert progress[0][:3] == ("trials", 1, 10)
    assert all(done <= total for stage, done, total, _ in progress if stage == "trials")

    files = {path.name for path in write_tuning(result)}
    assert files == {"parameters.yaml", "trials.csv", "trials.svg", "report.html"}
    found = scenario(controllers={"tuned": str(tmp_path / "parameters.yaml")})
    assert found.controllers["tuned"] == result.after
    report = (tmp_path / "report.html").read_text()
    for text in (gain.text.split(",")[0], "omnidrive tune ", "Changed parameters", "position.kp"):
        assert text in report
    rows = (tmp_path / "trials.csv").read_text().splitlines()
    assert rows[0] == "trial,me,violation,failed_runs,position.kp,heading.kp"
    assert len(rows) == 1 + len(result.search.trials)

    work = stored_runs._work(timed=False)
    refused = type(work)(compute=refuse, lost=work.lost, name=work.name)
    monkeypatch.setattr(stored_runs, "_work", lambda *, timed: refused)
    again = tune(load_tuning(tmp_path), tmp_path)
    assert without_times(again) == without_times(result)
    held_out = load_definition(tmp_path / "held-out" / "study.yaml")
    with Store(tmp_path / "held-out", read_only=True) as store:
        assert store.status().runs == len(RunPlan(held_out)) == 2


def test_interrupted_search_continues(finished, tmp_path):
    def interrupt(part, done, total, best):
        if done > 5:
            raise KeyboardInterrupt

    expected, _ = finished
    with pytest.raises(KeyboardInterrupt):
        tune(small(), tmp_path / "part", report=interrupt)
    with Store(tmp_path / "part" / "training", read_only=True) as store:
        done = store.status().runs
    assert 0 < done < len(expected.search.trials)
    found = tune(load_tuning(tmp_path / "part"), tmp_path / "part")
    assert without_times(found) == without_times(expected)


def test_several_objectives_write_their_front(tmp_path):
    result = tune(small(trials=5, objectives=("me", "effort")), tmp_path)
    files = [path for path in write_tuning(result) if path.parent.name == "front"]
    assert files
    assert load_controller(files[0])["type"] == "pid"
    assert (tmp_path / "figures" / "front.svg").is_file()
    assert "Front" in (tmp_path / "report.html").read_text()


def test_folder_of_another_tuning_is_refused(tmp_path):
    tune(small(trials=2), tmp_path)
    with pytest.raises(CannotWrite, match="holds another tuning"):
        tune(small(trials=2, objectives=("mae",)), tmp_path)
    longer = load_tuning(tmp_path, trials=5)
    assert len(tune(longer, tmp_path).search.trials) >= 5
    other = tmp_path / "other"
    other.mkdir()
    (other / "notes.txt").write_text("mine")
    with pytest.raises(CannotWrite, match="is not empty"):
        tune(small(trials=2), other)


def test_gain_that_validation_does_not_show_is_not_taken():
    objective = parse_objective("me")

    def runs(values, repetitions):
        return [record(k, repetition=k % repetitions, me=me) for k, me in enumerate(values)]

    assert _shows_gain(runs([0.03, 0.03], 1), runs([0.02, 0.029], 1), objective)
    assert not _shows_gain(runs([0.03, 0.03], 1), runs([0.01, 0.031], 1), objective)
    assert _shows_gain(runs([0.030, 0.031], 2), runs([0.020, 0.0211], 2), objective)
    assert not _shows_gain(runs([0.03, 0.03], 2), runs([0.01, 0.031], 2), objective)


def test_loss_on_one_motion_is_not_outweighed():
    objective = parse_objective("me")

    def runs(circle, square):
        values = {"circle": circle, "square": square}
        return [
            replace(record(k, repetition=k % 3, me=me), factors={"motion": name})
            for k, (name, me) in enumerate((n, me) for n, each in values.items() for me in each)
        ]

    before = runs([0.030, 0.031, 0.032], [0.010, 0.011, 0.012])
    after = runs([0.010, 0.0111, 0.0122], [0.014, 0.0151, 0.0159])
    assert _shows_gain(before, after, objective)
    assert _shows_loss(before, after, objective, ["motion"])
    assert not _shows_loss(before, after, objective, [])
    unclear = runs([0.010, 0.0111, 0.0122], [0.009, 0.0150, 0.0121])
    assert not _shows_loss(before, unclear, objective, ["motion"])


def test_trial_that_loses_on_one_motion_of_validation_is_not_chosen(tmp_path, monkeypatch):
    seen = []

    def shows_loss(before, after, objective, axes):
        seen.append({each.factors["motion"] for each in after})
        return True

    monkeypatch.setattr(import_module("omnidrive.tuning.tune"), "_shows_loss", shows_loss)
    assert tune(small(), tmp_path).chosen.number == 0
    assert seen == [{"slow", "quick", "slalom", "raised-cosine"}] * len(seen)
    assert seen


def test_equal_budget_tunes_every_controller(tmp_path):
    definition = StudyDefinition.from_scenario(scenario())
    found = equal_budget(definition, 5, tmp_path)
    before, after = (each.scenario.controllers for each in (definition, found))
    assert list(after) == list(before)
    assert after["slow"] != before["slow"]
    assert found.scenario.seed == definition.scenario.seed
    assert (tmp_path / "pid" / "training" / "runs.sqlite").is_file()
    assert not (tmp_path / "slow" / "held-out").exists()


def test_computing_times_can_be_objectives(tmp_path):
    result = tune(small(trials=2, objectives=("me", "computing_time")), tmp_path)
    assert all(each.score.objectives[1] < 1e9 for each in result.search.trials)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("a: 1", "is no tuning of this version"),
        ("format: omnidrive-tuning-2", "is no tuning of this version"),
        ("format: omnidrive-tuning-1\ncontroller: slow\ntrials: 0", "trials is 0, need 2 to"),
        ("format: omnidrive-tuning-1\ncontroler: slow", "did you mean 'controller'"),
    ],
)
def test_bad_settings_are_refused(tmp_path, content, message):
    (tmp_path / "tuning.yaml").write_text(content)
    with pytest.raises(InvalidInput, match=re.escape(message)):
        load_tuning(tmp_path)


def test_many_bad_ranges_are_named_in_part(tmp_path):
    ranges = ", ".join(f"{k}: x" for k in range(500))
    (tmp_path / "tuning.yaml").write_text(
        f"format: omnidrive-tuning-1\ncontroller: slow\nranges: {{{ranges}}}"
    )
    with pytest.raises(InvalidInput, match=r"ranges.*; and \d+ more") as caught:
        load_tuning(tmp_path)
    assert len(str(caught.value)) < 2000


STEP = {"step": {"displacement": [0.1, 0.0, 0.0], "duration": 2.0}}


@pytest.mark.parametrize("plant", ["kinematic", "planar"])
@pytest.mark.parametrize("tasks", [{}, STEP])
@pytest.mark.parametrize("objective", ["balanced", "me"])
def test_sets_share_neither_seeds_nor_motions_nor_robots(plant, tasks, objective):
    tasks = {"track": {"durations": [4.0]}, **tasks}
    sets = default_sets(scenario(plant=plant, tasks=tasks), "pid", [objective_of(objective)])
    check_apart(sets)
    training, held_out = sets
    assert training.scenario.seed != held_out.scenario.seed
    motions = [{motion(run) for run in RunPlan(each)} for each in (*sets, validation_set(training))]
    kinds = [{each[0] for each in found} for found in motions]
    seen = {"circle", "square", "step"} if objective == "balanced" else {"circle"}
    assert kinds[0] == seen
    assert kinds[1] == {"eight", "random-smooth", "step"} | {"square"} - seen
    assert not motions[0] & motions[1]
    assert not motions[2] & motions[1]
    references = {each for each in motions[1] if each[0] != "step"}
    assert len(references) >= 7  # an interval over references needs six
    robots = [
        {run.factors.get("plant_robot.mass times", 1.0) for run in RunPlan(each)} for each in sets
    ]
    if plant == "planar":
        assert max(robots[0]) < min(robots[1])
    with pytest.raises(InvalidInput, match="of the held-out runs are training runs"):
        check_apart(RunSets(training, training))


def motion(run):
    """Return kind and parameters of the motion of a run."""
    if run.settings.task == "step":
        return "step", str(run.scenario.tasks.step)
    return run.scenario.reference.type, str(run.scenario.reference), run.settings.duration


def test_planned_path_is_not_driven_in_the_same_time_where_it_is_held_out():
    training, held_out = default_sets(paper_scenario(), "holonomic-nmpc")
    assert training.axes[0].labels == ("path", "square", "step", "small step")
    assert {"slower", "back", "circle", "eight", "random 3"} <= {*held_out.axes[0].labels}
    seconds = [
        {run.settings.duration for run in RunPlan(each) if run.scenario.reference == "path"}
        for each in (training, held_out)
    ]
    assert not seconds[0] & seconds[1]


def test_validation_has_robots_beyond_those_that_are_held_out():
    training, held_out = default_sets(scenario(plant="planar"), "pid")
    frictions = [
        [run.factors["plant_robot.friction times"] for run in RunPlan(each)]
        for each in (validation_set(training), held_out, training)
    ]
    assert max(frictions[0]) < min(frictions[1]) <= max(frictions[1]) < min(frictions[2])
    (quick,) = {run.settings.duration for run in RunPlan(validation_set(training))
                if run.factors["motion"] == "quick"}  # fmt: skip
    assert quick == pytest.approx(plan_at(training.scenario).shortest, abs=0.2)
    own = replace(training, random=held_out.random)
    assert validation_set(own).random == own.random


def test_validation_of_step_responses_alone():
    settling = [objective_of("settling_time")]
    training, _ = default_sets(scenario(tasks=STEP), "pid", settling)
    assert {run.settings.task for run in RunPlan(training)} == {"step"}
    assert {run.settings.task for run in RunPlan(validation_set(training))} == {"step"}


def test_faults_that_begin_after_a_motion_ends_are_left_out():
    faults = [{"kind": "pose-jump", "at": 30.0}]
    tasks = {"track": {"durations": [40.0]}}
    training, held_out = default_sets(scenario(tasks=tasks, faults=faults), "pid")
    found = {run.factors["motion"]: len(run.scenario.faults) for run in RunPlan(training)}
    assert found == {"circle": 1, "square": 0, "step": 0, "small step": 0}
    assert not any(run.refused for run in RunPlan(held_out))


@pytest.mark.parametrize(
    ("tasks", "objectives", "limits", "message"),
    [
        (STEP, ["me"], [], "the objective me has no value in the training runs of the task step;"),
        ({"track": {"durations": [4.0]}}, ["overshoot_x"], [], "overshoot_x has no value in"),
        (STEP, ["me+settling_time"], [], "has no value in the training runs of the task step;"),
        (STEP, ["balanced"], ["worst_error<=1m"], "the limit worst_error<=1m has no value in"),
    ],
)
def test_objectives_that_no_run_has_are_refused(tasks, objectives, limits, message):
    settings = TuningSettings(controller="pid", objectives=objectives, limits=limits)
    with pytest.raises(InvalidInput, match=re.escape(message)) as caught:
        Tuning.of(scenario(tasks=tasks), settings)
    assert str(caught.value).count(". ") == 0


def test_every_training_task_serves_an_objective_or_a_limit():
    both = StudyDefinition.from_scenario(scenario(tasks={"track": {"durations": [4.0]}, **STEP}))
    for objectives, limits in ((["me", "settling_time"], []), (["me"], ["overshoot_x<=5%"])):
        settings = TuningSettings(controller="pid", objectives=objectives, limits=limits)
        assert Tuning.of(scenario(), settings, training=both).limits or not limits
    settings = TuningSettings(controller="pid", objectives=["me"])
    with pytest.raises(InvalidInput, match="in the training runs of the task step"):
        Tuning.of(scenario(), settings, training=both)


def test_command(tmp_path):
    save_scenario(scenario(), tmp_path / "s.yaml")
    words = ["tune", "s.yaml", "--controller", "slow", "--trials", 3, "--jobs", 1]
    done = omnidrive(*words, "--objective", "me", "--out", "out", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert "on runs that the search has not seen: ME in mm" in done.stdout.replace("\n", " ")
    for text in ("Every held-out motion", "random 3", "settling time heading, s", "\u2717 worse"):
        assert text in done.stdout
        assert text in (tmp_path / "out" / "report.html").read_text()
    again = omnidrive("tune", "out", "--jobs", 1, cwd=tmp_path)
    assert again.returncode == 0, again.stderr
    assert "results: out" in again.stdout


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ([], "--controller is needed: the scenario has slow, pid"),
        (["--controller", "xy"], "there is no controller 'xy'"),
        (["--controller", "slow", "--objective", "mee"], "did you mean 'me'"),
        (["--controller", "slow", "--objective", "overshoot_x"], "overshoot_x has no value in"),
        (["--controller", "slow", "--limit", "me<=1"], "needs a unit"),
        (["--controller", "slow", "--parameters", "position.kq"], "did you mean 'position.kp'"),
        (["--controller", "slow", "--range", "position.kp=3"], "--range must be NAME=LOW:HIGH"),
        (["--controller", "slow", "--range", "position.kp=3:1"], "need an increasing one"),
        (["--controller", "slow", "--minutes", "-1"], "minutes is -1 min, need 0.01 to"),
        (["--controller", "slow", "--training", "no.yaml"], "no.yaml"),
    ],
)
def test_bad_options_are_refused(tmp_path, words, message):
    save_scenario(scenario(), tmp_path / "s.yaml")
    done = omnidrive("tune", "s.yaml", *words, cwd=tmp_path)
    assert done.returncode == 2
    assert message in " ".join(done.stderr.split())
    assert "Traceback" not in done.stderr
    assert [path.name for path in tmp_path.iterdir()] == ["s.yaml"]


@pytest.mark.long
@pytest.mark.parametrize("processes", [1, 2])
def test_killed_search_continues(tmp_path, processes):
    expected = tune(small(60), tmp_path / "whole", processes=processes)
    part = tmp_path / "part"
    code = (
        "from tests.tuning.test_tune import *\n"
        f"tune(small(60), {str(part)!r}, processes={processes})"
    )
    for seconds in (4.0, 6.0, 8.0):
        process = subprocess.Popen([sys.executable, "-c", code], cwd=Path(__file__).parents[2])
        time.sleep(seconds)
        process.send_signal(signal.SIGKILL)
        process.wait()
    found = tune(small(60), part, processes=processes)
    assert without_times(found) == without_times(expected)
