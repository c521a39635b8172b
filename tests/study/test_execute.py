"""Runs on several processes: what ends them, and what they leave alone."""

import signal
from multiprocessing import active_children, get_context
from time import sleep

import pytest

from omnidrive.errors import WorkerLost
from omnidrive.study.execute import execute
from omnidrive.study.jobs import jobs_of
from omnidrive.study.prepared import prepare
from tests.study.small import small_scenario


@pytest.fixture(scope="module")
def prepared():
    return prepare(small_scenario())


@pytest.fixture
def bystander():
    """A process of the caller's own."""
    process = get_context("spawn").Process(target=sleep, args=(600,))
    process.start()
    yield process
    process.kill()
    process.join()


def test_runs_given_up_leave_no_worker_and_nobody_else_is_killed(prepared, bystander):
    jobs = jobs_of(prepared.scenario)
    results = execute(prepared, jobs, 2)
    next(results)
    assert len(active_children()) == 3
    results.close()
    assert active_children() == [bystander]


def test_a_killed_worker_is_an_error_of_ours(prepared):
    jobs = jobs_of(prepared.scenario)
    results = execute(prepared, jobs, 2)
    next(results)
    for worker in active_children():
        worker.kill()
    with pytest.raises(WorkerLost, match="processes=1"):
        list(results)
    assert not active_children()


@pytest.mark.skipif(not hasattr(signal, "pthread_sigmask"), reason="needs signal masks")
def test_signals_are_held_back_only_while_workers_are_started(prepared):
    before = signal.pthread_sigmask(signal.SIG_BLOCK, [])
    results = execute(prepared, jobs_of(prepared.scenario), 2)
    next(results)
    assert signal.pthread_sigmask(signal.SIG_BLOCK, []) == before
    results.close()
