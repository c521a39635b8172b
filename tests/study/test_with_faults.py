"""Faults in scenarios and studies, and on the command line."""

import json
from dataclasses import replace

import numpy as np
import pytest

from omnidrive.cli.main import load_verb
from omnidrive.errors import InvalidInput, InvalidScenario
from omnidrive.evaluation import recovery
from omnidrive.scenario import (
    faults_of,
    load_scenario,
    paper_scenario,
    plan_and_check,
    save_scenario,
)
from omnidrive.scenario.run_settings import settings_of_runs
from omnidrive.scenario.scenario_file import parse_scenario, scenario_data
from omnidrive.scenario.sections import WatchdogSection
from omnidrive.scenario.tasks import FaultsTask, Tasks
from omnidrive.simulation import FAULTS, Outcome, default_faults, parse_fault
from omnidrive.study import run_study
from omnidrive.study.results_data import results_data
from tests.study.small import small_scenario


def faulty(*texts, plant="kinematic", duration=20.0, **changes):
    faults = tuple(map(parse_fault, texts))
    tasks = Tasks(faults=FaultsTask(duration=duration, faults=faults))
    return small_scenario(
        **{"plant": plant, "tasks": tasks, "controllers": ("feedforward",), **changes}
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("faults") / "run"
    run_study(faulty(controllers=("feedforward", "fuzzy_t1")), path)
    return path


def test_every_kind_runs_with_every_controller(folder):
    data = json.loads((folder / "results.json").read_text())
    kinds = ["encoder-dead", "pose-jump", "sensor-silent", "period-jitter", "solver-overrun"]
    found = [(r["fault"]["kind"], r["controller"]) for r in data["faults"]]
    assert found == [(kind, name) for kind in kinds for name in ("feedforward", "fuzzy_t1")]
    for record in data["faults"]:
        assert record["recovered"] is True
        assert record["finished"] is True
        assert record["time_to_recover"] >= 0.0
        assert {"t": 5.0, "what": f"{record['fault']['kind']} begins"} in record["events"]
        assert (folder / record["series"]).exists()
    jump = next(r for r in data["faults"] if r["fault"]["kind"] == "pose-jump")
    assert jump["worst_error"] == pytest.approx(0.5, abs=0.1)
    assert 0.3 < jump["time_to_recover"] < 2.0


def test_report_contains_the_fault_table(folder):
    page = (folder / "report.html").read_text()
    for text in ("Disturbances and faults", "pose-jump at 5 s", "time to recover"):
        assert text in page


def test_scenario_of_the_folder_reproduces_the_results(folder):
    scenario = load_scenario(folder / "scenario.yaml")
    assert scenario.tasks.faults == FaultsTask(duration=20.0)
    study = run_study(scenario)
    old = json.loads((folder / "results.json").read_text())["faults"]
    assert json.loads(json.dumps(results_data(study)["faults"])) == old
    assert len(study.logs.select("faults")) == 12


def test_stopped_run_has_not_recovered():
    tasks = faulty("sensor-silent:at=4,duration=10", "encoder-dead:at=4").tasks
    study = run_study(small_scenario(tasks=tasks, controllers=("feedforward",)))
    _, silent, encoder = study.records
    assert (silent.metrics["recovered"], silent.outcome) == (0.0, "stopped")
    assert np.isnan(silent.metrics["time_to_recover"])
    assert (encoder.metrics["recovered"], encoder.outcome) == (1.0, "finished")
    assert encoder.metrics["time_to_recover"] == 0.0
    table = next(t for t in study.tables if t.title == "Disturbances and faults")
    assert table.rows[0][2].startswith("stopped at 6")
    assert table.rows[0][-1].startswith("5.80 s: the watchdog stops the robot: its pose is lost")
    study.raise_if_failed()  # a stop in this task is not a failure


def test_recovery_is_permanent_and_relative_to_the_run_without_the_fault():
    run = run_study(faulty("encoder-dead:at=4")).logs.runs[0].log

    def displaced(extra):
        pose = run.pose.copy()
        pose[:, 0] = run.target[:, 0] + extra
        pose[:, 1] = run.target[:, 1]
        return replace(run, pose=pose)

    t = run.t
    usual = displaced(np.full(len(t), 0.2))
    back = displaced(np.where((t > 5.95) & (t < 8.05), 0.3, 0.24))
    found = recovery(back, usual, 6.0)
    assert found == (True, pytest.approx(2.1), pytest.approx(0.3), False)
    assert recovery(displaced(np.where(t > 19.95, 0.3, 0.2)), usual, 6.0).recovered is False
    assert recovery(usual, usual, 6.0) == (True, 0.0, pytest.approx(0.2), False)


def test_faults_act_in_every_run_of_a_scenario():
    scenario = small_scenario(
        faults=(parse_fault("pose-jump:at=2"),), controllers=("feedforward",),
        tasks=small_scenario().tasks.model_copy(update={"horizon": None, "noise": None}),
    )  # fmt: skip
    study = run_study(scenario)
    assert len(study.logs.runs) == 2
    for each in study.logs.runs:
        assert [event.what for event in each.log.events] == ["pose-jump begins"]


def test_paper_scenario_has_no_faults():
    assert not any(job.task == "faults" for job in settings_of_runs(paper_scenario()))
    assert paper_scenario().watchdog == WatchdogSection()


def test_a_watchdog_can_be_set_and_taken_away():
    tasks = faulty("sensor-silent:at=4,duration=10").tasks
    for section, outcome in (
        (WatchdogSection(enabled=False), Outcome.FINISHED),
        (WatchdogSection(age=100.0, error=0.3), Outcome.STOPPED),
    ):
        scenario = small_scenario(tasks=tasks, controllers=("feedforward",), watchdog=section)
        assert run_study(scenario).logs.runs[1].log.outcome is outcome


def test_default_faults_are_those_that_the_plant_supports():
    assert [f.kind for f in faults_of(faulty(plant="mujoco-balls"))] == list(FAULTS)
    assert {f.at for f in faults_of(faulty(plant="mujoco-balls", duration=40.0))} == {10.0}
    assert len(faults_of(faulty())) == 5


def test_scenario_with_faults_round_trips(tmp_path):
    path = tmp_path / "scenario.yaml"
    tasks = Tasks(faults=FaultsTask(duration=20.0, faults=default_faults(3.0)))
    scenario = small_scenario(
        plant="mujoco-balls", tasks=tasks, faults=default_faults(1.0),
        watchdog=WatchdogSection(error=2.0),
        wheel_monitor=False,
    )  # fmt: skip
    save_scenario(scenario, path)
    assert load_scenario(path) == scenario


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        ({"kind": "push", "at": 30.0}, "fault push begins at 30 s, but a run ends at 20 s"),
        ({"kind": "puhs"}, "unknown kind of fault; there are push, slope"),
        ({"at": 3.0}, "unknown kind of fault; there are push, slope"),
        ({"kind": "push", "speed": "fast"}, "faults.0.push.speed must be a plain number"),
        ({"kind": "push", "speed": 11}, "speed is 11 m/s, need 0 to 10 m/s"),
        ({"kind": "wheel-dead", "whel": 1}, "unknown key 'tasks.faults.faults.0.wheel-dead.whel'; "
         "did you mean 'wheel'?"),
        ("push", "faults.0"),
    ],
)  # fmt: skip
def test_invalid_faults_are_rejected_with_a_message(fault, message):
    data = scenario_data(faulty(plant="mujoco-balls"))
    data["tasks"]["faults"]["faults"] = [fault]
    with pytest.raises(InvalidScenario) as caught:
        parse_scenario(data, "x.yaml")
    assert message in str(caught.value)


def test_too_many_faults_are_rejected():
    data = scenario_data(faulty(plant="mujoco-balls"))
    data["tasks"]["faults"]["faults"] = [{"kind": "push", "at": 1.0}] * 101
    with pytest.raises(InvalidScenario, match="100"):
        parse_scenario(data, "x.yaml")


def test_forces_require_a_plant_with_forces():
    with pytest.raises(InvalidScenario, match="slope needs forces, which the plant kinematic"):
        parse_scenario(scenario_data(faulty()) | {"faults": [{"kind": "slope"}]}, "x.yaml")


def test_unknown_wheels_are_rejected_before_the_first_run():
    with pytest.raises(InvalidInput, match="no wheel 6"):
        plan_and_check(faulty("encoder-dead:wheel=6"))


def verb(name, *words):
    load_verb(name)(list(map(str, words)), standalone_mode=False)


def test_help_lists_all_kinds(capsys):
    verb("run", "--help")
    shown = capsys.readouterr().out
    assert all(kind in shown for kind in FAULTS)


def test_run_prints_and_stores_the_events(tmp_path, capsys):
    words = ("--plant", "kinematic", "--controller", "feedforward", "--out", tmp_path / "out")
    verb("run", *words, "--fault", "pose-jump:at=5", "--fault", "sensor-silent:at=8")
    shown = capsys.readouterr().out
    for text in ("5.00 s  pose-jump begins", "8.00 s  sensor-silent begins", "sensor-silent ends"):
        assert text in shown
    record = json.loads((tmp_path / "out" / "results.json").read_text())["runs"][0]
    assert record["events"][0]["what"] == "pose-jump begins"


def test_compare_enables_the_task_with_the_given_faults(tmp_path, capsys):
    words = ("--plant", "kinematic", "--controllers", "feedforward", "--out", tmp_path / "out",
             "--jobs", 1, "--figures", "none")  # fmt: skip
    verb("compare", "--tasks", "faults", *words, "--fault", "pose-jump:distance=0.2,at=3")
    assert "pose-jump at 3 s" in capsys.readouterr().out
    data = json.loads((tmp_path / "out" / "results.json").read_text())
    assert len(data["faults"]) == 1
    assert data["runs"] == []
