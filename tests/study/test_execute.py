"""Execution of runs in worker processes: ends of workers, signals and incomplete results."""

import logging
import os
import signal
import struct
import subprocess
import sys
import warnings
from multiprocessing import active_children, get_context
from time import sleep

import pytest

from omnidrive.compiled import announce_compiling
from omnidrive.compiled.compilation import Compilation, compile_listeners
from omnidrive.errors import WorkerLost
from omnidrive.study.execute import execute
from omnidrive.study.jobs import Job, jobs_of
from omnidrive.study.planned_scenario import plan_and_check
from tests.study.small import small_scenario


@pytest.fixture(scope="module")
def planned():
    return plan_and_check(small_scenario())


@pytest.fixture
def other_child():
    """A child process that is not a worker."""
    process = get_context("spawn").Process(target=sleep, args=(600,))
    process.start()
    yield process
    process.kill()
    process.join()


def test_abandoned_execution_kills_workers_and_no_other_child(planned, other_child):
    jobs = jobs_of(planned.scenario)
    results = execute(planned, jobs, 2)
    next(results)
    assert len(active_children()) == 3
    results.close()
    assert active_children() == [other_child]


def test_killed_worker_raises_worker_lost(planned):
    jobs = jobs_of(planned.scenario)
    results = execute(planned, jobs, 2)
    next(results)
    for worker in active_children():
        worker.kill()
    with pytest.raises(WorkerLost, match="processes=1"):
        list(results)
    assert not active_children()


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs signal masks")
def test_signals_are_blocked_only_during_worker_start(planned):
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    results = execute(planned, jobs_of(planned.scenario), 2)
    next(results)
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == before
    results.close()


class KilledWhileSending(Job):
    """Job whose worker is killed while it sends the result."""

    def __reduce__(self):
        return send_first_bytes, (True,)


class BlockedWhileSending(Job):
    """Job whose worker sends only the first bytes of the result, and then blocks."""

    def __reduce__(self):
        return send_first_bytes, (False,)


def send_first_bytes(kill):
    """Send the first bytes of a result; called by the worker when it unpickles the job."""
    frame = sys._getframe()
    while "result_queue" not in frame.f_locals:
        frame = frame.f_back
    os.write(frame.f_locals["result_queue"]._writer.fileno(), struct.pack("!i", 1000) + b"half")
    if kill:
        os.kill(os.getpid(), signal.SIGKILL)
    sleep(600)


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="needs Unix")
def test_worker_killed_while_sending_a_result_raises_worker_lost(planned):
    job = jobs_of(planned.scenario)[0]
    with pytest.raises(WorkerLost):
        list(execute(planned, [KilledWhileSending(*job), BlockedWhileSending(*job)], 2))
    assert not active_children()


@pytest.mark.skipif(not hasattr(signal, "setitimer"), reason="needs Unix")
def test_interruption_while_a_worker_sends_a_result_ends_the_execution(planned):
    def interrupt(*_):
        raise KeyboardInterrupt

    job = jobs_of(planned.scenario)[0]
    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 5.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            list(execute(planned, [BlockedWhileSending(*job), BlockedWhileSending(*job)], 2))
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert not active_children()


class LoggingJob(Job):
    """Job whose worker logs, warns and reports a compilation when it unpickles the job."""

    def __reduce__(self):
        return log_and_compile, tuple(self)


def log_and_compile(*values):
    logging.getLogger("mine").warning("the step %d is infeasible", 3)
    logging.getLogger("mine").info("not shown")
    warnings.warn("division by zero", RuntimeWarning, stacklevel=1)
    for listener in compile_listeners:
        listener(Compilation("kernel"))
    return Job(*values)


def test_messages_of_workers_are_logged_here_and_the_compilation_once(planned, caplog, capfd):
    job = jobs_of(planned.scenario)[0]
    with announce_compiling():
        done = list(execute(planned, [LoggingJob(*job), LoggingJob(*job)], 2))
    assert len(done) == 2
    messages = [record.message for record in caplog.records]
    assert messages.count("the step 3 is infeasible") == 2
    assert any("division by zero" in message for message in messages)
    assert sum("compiling" in message for message in messages) == 1
    assert "not shown" not in messages
    assert capfd.readouterr() == ("", "")


UNGUARDED = """
from omnidrive.study import run_study
from tests.study.small import small_scenario
run_study(small_scenario(), processes=2)
"""


def test_script_without_main_guard_ends_with_advice(tmp_path):
    """Each worker imports the script, which starts workers again: Python forbids it."""
    script = tmp_path / "script.py"
    script.write_text(UNGUARDED, encoding="utf-8")
    process = subprocess.run(
        [sys.executable, script], env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        capture_output=True, text=True, timeout=120, check=False,
    )  # fmt: skip
    assert process.returncode != 0
    assert "WorkerLost" in process.stderr
    assert "__main__" in process.stderr.splitlines()[-1]
