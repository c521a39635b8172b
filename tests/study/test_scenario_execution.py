"""Execution of runs in worker processes: results, lost runs, messages."""

import json
import os
import signal
import subprocess
import sys
from multiprocessing import current_process, get_context
from time import sleep

import pytest

from omnidrive.compiled.compilation import reported
from omnidrive.components import configure
from omnidrive.scenario.tasks import DurationsTask, FaultsTask, NoiseTask, StepTask, Tasks
from omnidrive.simulation import Outcome
from omnidrive.study import StudyDefinition, run_study
from omnidrive.study.computation import block_runner
from omnidrive.study.computation.block_runner import run_block
from omnidrive.study.computation.numbered_runs import is_sequential
from omnidrive.study.computation.run_recording import lost_record
from omnidrive.study.design.run_plan import RunPlan
from omnidrive.study.progress import NullProgress
from tests.study.processes import workers
from tests.study.small import small_scenario

TASKS = small_scenario().tasks.model_copy(update={"noise": NoiseTask(durations=(20.0,), repeats=4)})
SIX = small_scenario(controllers=("feedforward",), tasks=TASKS)
"""Six short runs of a controller without kernels."""


class Acting(NullProgress):
    """Progress that does something at the end of the first run."""

    def __init__(self, act):
        self.act, self.finished = act, []

    def runs(self, progress):
        is_first = progress.latest and not self.finished
        self.finished += [each.name for each in progress.latest]
        if is_first:
            self.act()


@pytest.fixture
def other_child():
    """A child process that is not a worker."""
    process = get_context("spawn").Process(target=sleep, args=(600,))
    process.start()
    yield process
    process.kill()
    process.join()


@pytest.mark.long
def test_interrupted_execution_kills_workers_and_no_other_child(other_child):
    found = []

    def interrupt():
        found.extend(workers())
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        run_study(SIX, processes=2, progress=Acting(interrupt))
    assert found
    assert not workers()
    assert other_child.is_alive()


@pytest.mark.long
def test_killed_worker_delays_the_study_only(caplog):
    def kill():
        workers()[0].kill()

    progress = Acting(kill)
    study = run_study(SIX, processes=2, progress=progress)
    assert len(study.records) == len(study.logs.select("track", "noise", "step")) + 3 == 6
    assert {each.name for each in study.records} <= set(progress.finished)
    assert all(each.finished for each in study.records)
    assert sum("was killed" in text for text in caplog.messages) <= 1
    assert not workers()


def test_daemon_processes_execute_runs_themselves(monkeypatch):
    assert not is_sequential(SIX)
    monkeypatch.setitem(current_process()._config, "daemon", True)
    assert is_sequential(SIX)


def test_interrupt_that_a_component_raises_ends_its_run(monkeypatch):
    """In a worker, which ignores the signals of the terminal."""

    def interrupted(*_):
        raise KeyboardInterrupt

    run = RunPlan(StudyDefinition.from_scenario(SIX))[0]

    def save(*_):
        raise AssertionError

    monkeypatch.setattr(block_runner, "simulate_run", interrupted)
    with pytest.raises(KeyboardInterrupt):
        run_block([run], save)
    monkeypatch.setattr(block_runner, "is_worker", lambda: True)
    (record,) = run_block([run], save)
    assert record.outcome == "killed"
    assert "by KeyboardInterrupt of a component" in record.detail


LAWS = """
import os, signal
import omnidrive as od

class Law:
    SIGNAL = None

    def reset(self, state):
        pass

    def step(self, t, state, reference):
        if self.SIGNAL:
            os.kill(os.getpid(), self.SIGNAL)
        return od.Command(od.BodyTwist(0.0, 0.0, 0.0))

class Killed(Law):
    SIGNAL = signal.SIGKILL

class Stopped(Law):
    SIGNAL = signal.SIGSTOP
"""


def steps_of_laws(folder, *names, **options):
    """Return the study of step responses of the laws with these names."""
    (folder / "laws.py").write_text(LAWS, encoding="utf-8")
    laws = {
        name: configure("controllers", f"{folder}/laws.py:{name}", allow_code=True)
        for name in names
    }
    step = StepTask(displacement=(0.3, 0.1, 0.2), duration=1.0)
    scenario = small_scenario(controllers=laws, tasks=Tasks(step=step))
    return run_study(scenario, folder / "a", processes=2, figures=(), **options)


@pytest.mark.long
@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs Unix")
def test_killed_runs_have_an_outcome_and_the_others_finish(tmp_path):
    study = steps_of_laws(tmp_path, "Killed", "Law")
    assert [each.outcome for each in study.records] == ["killed", "finished"]
    assert "--jobs 1" in dict(study.failures)[0]
    assert [each.controller for each in study.logs.runs] == ["Law"]
    data = json.loads((tmp_path / "a" / "results.json").read_text())
    series = {row["controller"]: row["series"] for row in data["step_response"]}
    assert series == {"Killed": None, "Law": "series/step-Law.parquet"}


@pytest.mark.long
@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs Unix")
def test_stopped_runs_have_an_outcome_and_the_others_finish(tmp_path):
    study = steps_of_laws(tmp_path, "Stopped", "Law", run_timeout=60.0)
    assert [each.outcome for each in study.records] == ["timed_out", "finished"]
    assert dict(study.failures)[0] == "the run exceeded its time limit: 60 s"
    assert [each.controller for each in study.logs.runs] == ["Law"]


@pytest.mark.parametrize("task", ["track", "step", "faults"])
def test_record_of_a_lost_run_is_that_of_its_task(task):
    tasks = small_scenario().tasks.model_copy(update={"faults": FaultsTask(duration=20.0)})
    plan = RunPlan(StudyDefinition.from_scenario(small_scenario(tasks=tasks)))
    run = [each for each in plan if each.settings.task == task][-1]
    record = lost_record(run, Outcome.KILLED, "twice")
    assert record.detail == "the process of the run was killed: twice"
    assert record.name == run.name
    assert (record.finished, record.metrics) == (False, {})


class CompilingProgress(NullProgress):
    """A listener during whose calls a kernel is compiled."""

    def runs(self, progress):
        with reported("kernel"):
            pass


def test_a_study_of_one_run_on_the_kinematic_plant_announces_compilations(caplog):
    tasks = Tasks(track=DurationsTask(durations=(20.0,)))
    scenario = small_scenario(controllers=("feedforward",), tasks=tasks)
    run_study(scenario, progress=CompilingProgress())
    messages = [record.message for record in caplog.records]
    assert sum(each.startswith("compiling kernels before") for each in messages) == 1, messages


UNGUARDED = """
from omnidrive.study import run_study
from tests.study.processes import workers
from tests.study.small import small_scenario
study = run_study(small_scenario(controllers=("feedforward",)), processes=2)
print(len(study.records))
"""


@pytest.mark.long
def test_script_needs_no_main_guard(tmp_path):
    """Worker processes do not import the script."""
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED, encoding="utf-8")
    process = subprocess.run(
        [sys.executable, script], env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert process.returncode == 0, process.stderr
    assert process.stdout.split() == ["3"]
