"""Runs on several processes: what ends them, and what they leave alone."""

import os
import signal
import struct
import subprocess
import sys
from multiprocessing import active_children, get_context
from time import sleep

import pytest

from omnidrive.errors import WorkerLost
from omnidrive.study.execute import execute
from omnidrive.study.jobs import Job, jobs_of
from omnidrive.study.planned_scenario import plan_and_check
from tests.study.small import small_scenario


@pytest.fixture(scope="module")
def planned():
    return plan_and_check(small_scenario())


@pytest.fixture
def bystander():
    """A process of the caller's own."""
    process = get_context("spawn").Process(target=sleep, args=(600,))
    process.start()
    yield process
    process.kill()
    process.join()


def test_runs_given_up_leave_no_worker_and_nobody_else_is_killed(planned, bystander):
    jobs = jobs_of(planned.scenario)
    results = execute(planned, jobs, 2)
    next(results)
    assert len(active_children()) == 3
    results.close()
    assert active_children() == [bystander]


def test_a_killed_worker_is_an_error_of_ours(planned):
    jobs = jobs_of(planned.scenario)
    results = execute(planned, jobs, 2)
    next(results)
    for worker in active_children():
        worker.kill()
    with pytest.raises(WorkerLost, match="processes=1"):
        list(results)
    assert not active_children()


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs signal masks")
def test_signals_are_held_back_only_while_workers_are_started(planned):
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    results = execute(planned, jobs_of(planned.scenario), 2)
    next(results)
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == before
    results.close()


class Dying(Job):
    """A job that kills its worker in the middle of the answer."""

    def __reduce__(self):
        return begin_an_answer, (True,)


class Stuck(Job):
    """A job of which the answer is begun, and never finished."""

    def __reduce__(self):
        return begin_an_answer, (False,)


def begin_an_answer(die):
    """Called by the worker as it takes the job from its queue."""
    frame = sys._getframe()
    while "result_queue" not in frame.f_locals:
        frame = frame.f_back
    os.write(frame.f_locals["result_queue"]._writer.fileno(), struct.pack("!i", 1000) + b"half")
    if die:
        os.kill(os.getpid(), signal.SIGKILL)
    sleep(600)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs Unix")
def test_a_worker_killed_in_the_middle_of_its_answer_is_noticed(planned):
    job = jobs_of(planned.scenario)[0]
    with pytest.raises(WorkerLost):
        list(execute(planned, [Dying(*job), Stuck(*job)], 2))
    assert not active_children()


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs Unix")
def test_runs_are_given_up_even_in_the_middle_of_an_answer(planned):
    def interrupt(*_):
        raise KeyboardInterrupt

    job = jobs_of(planned.scenario)[0]
    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 5.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            list(execute(planned, [Stuck(*job), Stuck(*job)], 2))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert not active_children()


UNGUARDED = """
from omnidrive.study import run_study
from tests.study.small import small_scenario
run_study(small_scenario(), processes=2)
"""


def test_a_script_that_forgets_its_guard_ends_with_advice(tmp_path):
    """Each worker runs it anew, and may not start workers of its own: none of them ever starts."""
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED, encoding="utf-8")
    ended = subprocess.run(
        [sys.executable, script], env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert ended.returncode != 0
    assert "WorkerLost" in ended.stderr
    assert "__main__" in ended.stderr.splitlines()[-1]
