"""Execution of runs in worker processes: results, lost runs, messages."""

import os
import signal
import subprocess
import sys
from multiprocessing import current_process, get_context
from time import sleep

import pytest

from omnidrive.compiled.compilation import reported
from omnidrive.scenario.planned_scenario import plan_and_check
from omnidrive.scenario.run_settings import RunSettings, run_name, settings_of_runs
from omnidrive.scenario.run_simulation import unfinished
from omnidrive.scenario.tasks import DurationsTask, FaultsTask, NoiseTask, Tasks
from omnidrive.simulation import Outcome
from omnidrive.study import job_execution
from omnidrive.study.job_execution import execute_jobs, is_sequential
from omnidrive.study.study import NullProgress, run_study
from tests.study.processes import workers
from tests.study.small import small_scenario


@pytest.fixture(scope="module")
def planned():
    """Six short runs of a controller without kernels."""
    tasks = small_scenario().tasks.model_copy(
        update={"noise": NoiseTask(durations=(20.0,), repeats=4)}
    )
    return plan_and_check(small_scenario(controllers=("feedforward",), tasks=tasks))


@pytest.fixture
def other_child():
    """A child process that is not a worker."""
    process = get_context("spawn").Process(target=sleep, args=(600,))
    process.start()
    yield process
    process.kill()
    process.join()


def test_abandoned_execution_kills_workers_and_no_other_child(planned, other_child):
    jobs = settings_of_runs(planned.scenario)
    results = execute_jobs(planned, jobs, 2)
    next(results)
    assert workers()
    results.close()
    assert not workers()
    assert other_child.is_alive()


def test_killed_worker_delays_the_study_only(planned, caplog):
    jobs = settings_of_runs(planned.scenario)
    results = execute_jobs(planned, jobs, 2)
    finished = [next(results)]
    workers()[0].kill()
    finished += list(results)
    assert {job for job, _ in finished} == set(jobs)
    assert all(result.run.outcome is Outcome.FINISHED for _, result in finished)
    assert sum("was killed; starting it again" in text for text in caplog.messages) <= 1
    assert not workers()


def test_daemon_processes_execute_runs_themselves(planned, monkeypatch):
    assert not is_sequential(planned.scenario)
    monkeypatch.setitem(current_process()._config, "daemon", True)
    assert is_sequential(planned.scenario)


def test_interrupt_that_a_component_raises_ends_its_run(planned, monkeypatch):
    """In a worker, which ignores the signals of the terminal."""

    def interrupted(*_):
        raise KeyboardInterrupt

    job = settings_of_runs(planned.scenario)[0]
    monkeypatch.setattr(job_execution, "simulate_run", interrupted)
    ((_, result),) = job_execution._Alone(planned)([job])
    assert result.run.outcome is Outcome.KILLED
    assert "by KeyboardInterrupt of a component" in result.run.ending


class KillingJob(RunSettings):
    """RunSettings whose worker is killed when it unpickles the job."""

    number = "SIGKILL"

    def __reduce__(self):
        return os.kill, (Pid(), getattr(signal, self.number))


class StoppingJob(KillingJob):
    """RunSettings whose worker is stopped when it unpickles the job."""

    number = "SIGSTOP"


class Pid:
    """The number of the process that unpickles it."""

    def __reduce__(self):
        return os.getpid, ()


@pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs Unix")
def test_lost_runs_have_an_outcome_and_the_others_finish(planned):
    jobs = {job.task: job for job in settings_of_runs(planned.scenario)}
    bad = [KillingJob(*jobs["step"]), StoppingJob(*jobs["noise"])]
    found = dict(execute_jobs(planned, [*bad, jobs["track"]], 2, run_timeout=6.0))
    killed, stopped, good = (found[job].run for job in (*bad, jobs["track"]))
    assert (killed.outcome, stopped.outcome) == (Outcome.KILLED, Outcome.TIMED_OUT)
    assert "--jobs 1" in killed.ending
    assert stopped.ending == "the run exceeded its time limit: 6 s"
    assert len(killed.t) == len(stopped.t) == 1
    assert good.outcome is Outcome.FINISHED
    names = {run_name(planned.scenario, job): result.name for job, result in found.items()}
    assert list(names) == list(names.values())


@pytest.mark.parametrize("task", ["track", "step", "faults"])
def test_result_of_a_lost_run_is_that_of_its_task(task):
    tasks = small_scenario().tasks.model_copy(update={"faults": FaultsTask(duration=20.0)})
    planned = plan_and_check(small_scenario(tasks=tasks))
    job = [job for job in settings_of_runs(planned.scenario) if job.task == task][-1]
    result = unfinished(planned, job, Outcome.KILLED, "twice")
    assert result.run.ending == "the process of the run was killed: twice"
    assert result.name == run_name(planned.scenario, job)
    assert result.run.pose[0].tolist() == list(planned.start)


class CompilingProgress(NullProgress):
    """A listener during whose calls a kernel is compiled."""

    def done(self, what):
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
print(len(study.results.runs))
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
    assert process.stdout.split()
