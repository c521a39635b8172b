"""Experiments that are killed, interrupted and shared: every run is stored once, and the same."""

import os
import random
import signal
import subprocess
import sys
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from contextlib import suppress
from math import inf
from time import monotonic, sleep

import psutil
import pytest

from omnidrive.study.computation.experiment import Experiment, _Pace
from omnidrive.study.storage.store import FILE, Store
from tests.study.processes import workers
from tests.study.synthetic import Compute, SyntheticPlan, record, table_bytes

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs Unix")


def experiment(folder, plan, **options):
    return Experiment(plan, Compute(plan, **options), folder, "definition")


def stored(folder):
    """Return the table of a store as bytes."""
    with Store(folder, read_only=True) as store:
        return table_bytes(store.records())


def expected(plan, folder):
    """Return the table of an uninterrupted execution as bytes."""
    folder.mkdir()
    with Store(folder) as store:
        store.begin("definition")
        store.add([record(plan[number]) for number in range(len(plan))])
    return stored(folder)


def test_runs_are_stored_in_this_process_and_in_workers(tmp_path):
    plan = SyntheticPlan(200)
    wanted = expected(plan, tmp_path / "wanted")
    for processes in (1, 2):
        folder, seen = tmp_path / str(processes), []
        experiment(folder, plan).execute(processes, report=seen.append)
        assert stored(folder) == wanted
        last = seen[-1]
        assert (last.done, last.total, last.remaining) == (200, 200, 0.0)
        assert [each.done for each in seen] == sorted(each.done for each in seen)
        assert last.unfinished == sum(not record(plan[n]).finished for n in range(200))
        assert last.best[0] in {"pid", "fuzzy_t1", "fuzzy_t2"}


def test_best_controller_has_the_least_mean_error(tmp_path):
    plan, seen = SyntheticPlan(60), []
    experiment(tmp_path, plan).execute(report=seen.append)
    records = [record(plan[n]) for n in range(60)]
    means = {}
    for name in ("pid", "fuzzy_t1", "fuzzy_t2"):
        errors = [r.metrics["me"] for r in records if r.controller == name and r.finished]
        means[name] = sum(errors) / len(errors)
    best = min(means, key=means.get)
    assert seen[-1].best == (best, pytest.approx(means[best]))


def test_equal_runs_are_computed_once(tmp_path):
    plan = SyntheticPlan(100, period=30)
    experiment(tmp_path / "a", plan, noted=tmp_path / "noted").execute()
    computed = (tmp_path / "noted").read_text().split()
    assert len(computed) == 30
    assert stored(tmp_path / "a") == expected(plan, tmp_path / "wanted")
    other = SyntheticPlan(110, period=30)
    Experiment(other, Compute(other, tmp_path / "noted"), tmp_path / "a", "other").execute()
    assert len((tmp_path / "noted").read_text().split()) == 30
    assert stored(tmp_path / "a") == expected(other, tmp_path / "wanted2")


def test_stored_runs_are_not_computed_again(tmp_path):
    plan = SyntheticPlan(50)
    noted = tmp_path / "noted"
    with pytest.raises(KeyboardInterrupt):
        experiment(tmp_path / "a", plan, noted=noted).execute(report=interrupt_after(20))
    with Store(tmp_path / "a") as store:
        assert 20 <= store.status().runs < 50
        assert not store._connection.execute("SELECT * FROM leases").fetchall()
    experiment(tmp_path / "a", plan, noted=noted).execute()
    counts = Counter(noted.read_text().split())
    assert set(counts.values()) == {1}
    assert stored(tmp_path / "a") == expected(plan, tmp_path / "wanted")


def interrupt_after(count):
    """Return a receiver of progress that raises KeyboardInterrupt at ``count`` runs."""

    def report(progress):
        if progress.done >= count:
            raise KeyboardInterrupt

    return report


@pytest.mark.long
def test_a_run_that_kills_its_process_three_times_has_a_record(tmp_path):
    plan = SyntheticPlan(20)
    noted = tmp_path / "noted"
    experiment(tmp_path / "a", plan, noted=noted, killing=(7,)).execute(2)
    with Store(tmp_path / "a", read_only=True) as store:
        rows = store.records().to_pylist()
        assert store.status().failures[0][1].startswith("its process was killed three times")
    assert [row["number"] for row in rows] == list(range(20))
    assert [row["number"] for row in rows if row["outcome"] == "killed"] == [7]
    row = rows[7]
    assert (row["finished"], row["me"], row["controller"]) == (False, None, "fuzzy_t1")
    assert Counter(noted.read_text().split())["7"] in range(3, 7)


def test_plan_is_extended_until_it_is_enough(tmp_path):
    plan = SyntheticPlan(90)
    asked = []

    def extend(store):
        asked.append(store.status().runs)
        return asked[-1] + 30 if asked[-1] < 60 else None

    first = Experiment(plan, Compute(plan), tmp_path, "definition", first=30)
    first.execute(extend=extend)
    assert asked == [30, 60]
    with Store(tmp_path, read_only=True) as store:
        assert store.records()["number"].to_pylist() == list(range(60))


COMMAND = """
import sys
from pathlib import Path
from tests.study.processes import workers
from tests.study.synthetic import Compute, SyntheticPlan
from omnidrive.study.computation.experiment import Experiment

folder, count, period, seconds, processes = sys.argv[1:]
plan = SyntheticPlan(int(count), int(period))
compute = Compute(plan, Path(folder + "-noted"), float(seconds))
Experiment(plan, compute, folder, "definition").execute(int(processes))
"""


def start(folder, plan, seconds=0.005, processes=2):
    """Start a process that executes an experiment."""
    return subprocess.Popen(
        [sys.executable, "-c", COMMAND, str(folder), str(plan.count), str(plan.period),
         str(seconds), str(processes)],
        env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)}, stderr=subprocess.DEVNULL,
    )  # fmt: skip


def runs_in(folder):
    """Return the number of stored runs."""
    try:
        with Store(folder, read_only=True) as store:
            return store.status().runs
    except Exception:
        return 0


def kill_and_resume(tmp_path, plan, kills, seed):
    """Kill parents and workers of experiments at random moments; check the results of each.

    The moments are spread over the time of an experiment that is not killed, from its start.

    Returns:
        The number of experiments that were completed.
    """
    source = random.Random(seed)
    wanted = expected(plan, tmp_path / "wanted")
    began = monotonic()
    with start(tmp_path / "whole", plan) as parent:
        parent.wait(120)
    longest = 1.3 * (monotonic() - began)
    assert stored(tmp_path / "whole") == wanted
    completed = 0
    folder = tmp_path / "study-0"
    while kills > 0:
        before = runs_in(folder)
        with start(folder, plan) as parent:
            while kills > 0 and parent.poll() is None:
                sleep(source.uniform(0.0, longest))
                if parent.poll() is not None:
                    break
                with suppress(psutil.NoSuchProcess):
                    family = [psutil.Process(parent.pid), *workers(parent.pid)]
                    source.choice(family).kill()
                    kills -= 1
        assert runs_in(folder) >= before, f"seed {seed}: runs were lost"
        if runs_in(folder) == len(plan):
            assert stored(folder) == wanted, f"seed {seed}: other results"
            completed += 1
            folder = tmp_path / f"study-{completed}"
    with start(folder, plan) as parent:
        parent.wait(120)
    assert stored(folder) == wanted, f"seed {seed}: other results"
    return completed + 1


def test_killed_experiment_resumes(tmp_path):
    """At random moments, and killed workers: the following test."""
    plan, folder = SyntheticPlan(100), tmp_path / "study"
    with start(folder, plan, seconds=0.5, processes=1) as parent:
        while runs_in(folder) == 0 and parent.poll() is None:
            sleep(0.02)
        parent.kill()
    before = runs_in(folder)
    assert 0 < before < 100
    experiment(folder, plan, noted=tmp_path / "noted").execute()
    assert len((tmp_path / "noted").read_text().split()) == 100 - before
    assert stored(folder) == expected(plan, tmp_path / "wanted")


@pytest.mark.long
def test_experiments_survive_a_thousand_kills(tmp_path):
    completed = kill_and_resume(tmp_path, SyntheticPlan(400), 1000, 2)
    print(f"completed {completed}")
    assert completed > 50


def check_shared(tmp_path, execute_two):
    """Check the results of two executions at the same time."""
    plan = SyntheticPlan(300, period=250)
    folder, noted = tmp_path / "study", tmp_path / "study-noted"
    execute_two(folder, plan, noted)
    assert stored(folder) == expected(plan, tmp_path / "wanted")
    counts = Counter(noted.read_text().split())
    assert len(counts) == 250
    assert set(counts.values()) == {1}


def test_two_executions_share_the_runs(tmp_path):
    def execute_two(folder, plan, noted):
        both = [experiment(folder, plan, noted=noted, seconds=0.002) for _ in range(2)]
        with ThreadPoolExecutor(2) as threads:
            list(threads.map(Experiment.execute, both))

    check_shared(tmp_path, execute_two)


@pytest.mark.long
def test_two_processes_share_the_runs(tmp_path):
    def execute_two(folder, plan, _):
        with start(folder, plan, 0.01, 1) as first, start(folder, plan, 0.01, 1) as second:
            assert first.wait(120) == second.wait(120) == 0

    check_shared(tmp_path, execute_two)


@pytest.mark.long
def test_interrupted_experiment_ends_its_workers_and_resumes(tmp_path):
    plan = SyntheticPlan(2000)
    folder = tmp_path / "study"
    with start(folder, plan, 0.01) as parent:
        until = monotonic() + 60.0
        while runs_in(folder) < 20 and monotonic() < until:
            sleep(0.05)
        present = workers(parent.pid)
        parent.send_signal(signal.SIGINT)
        assert parent.wait(20) != 0
    assert present
    assert not psutil.wait_procs(present, timeout=5)[1]
    with Store(folder) as store:
        assert not store._connection.execute("SELECT * FROM leases").fetchall()
        assert 20 <= store.status().runs < 2000
    assert (folder / FILE).exists()


def test_time_left_does_not_count_the_first_block_of_each_process():
    """It compiles kernels: 60 s here, then each run takes 1 s."""
    pace = _Pace(2)
    assert pace.update(60.0, 1) == inf
    assert pace.update(61.0, 2) == inf
    assert pace.update(62.0, 3) == 1.0
    assert pace.update(64.0, 4) == 1.5  # of the latest half
    for k in range(5, 21):
        seconds = pace.update(60.0 + k, k)
    assert seconds == 1.0
