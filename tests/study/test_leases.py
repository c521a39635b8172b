"""Leases of runs by several processes."""

import os
import subprocess
import sys

import pytest

from omnidrive.study.storage import leases as leases_module
from omnidrive.study.storage.leases import Leases, _start_of
from omnidrive.study.storage.store import Store
from tests.study.synthetic import SyntheticPlan, record

PLAN = SyntheticPlan(30)


@pytest.fixture
def store(tmp_path):
    with Store(tmp_path) as store:
        store.begin("definition")
        yield store


@pytest.fixture
def other(store, tmp_path):
    """Return the leases of another process."""
    with Store(tmp_path) as second, Leases(second, PLAN) as leases:
        yield leases


@pytest.fixture
def own(store):
    with Leases(store, PLAN) as leases:
        yield leases


def enter(store, **values):
    """Write what another process has stored, and its lease of the first ten runs."""
    row = {"id": "x", "host": leases_module.HOST, "pid": 1, "started": "?", "beat": 3} | values
    with store.transaction() as connection:
        connection.execute("INSERT OR REPLACE INTO processes VALUES (?,?,?,?,?)", (*row.values(),))
        rows = [(n, key, "x") for n, key in enumerate(PLAN.keys(0, 10))]
        connection.executemany("INSERT OR REPLACE INTO leases VALUES (?,?,?)", rows)


def test_two_processes_take_all_runs_once(store, own, other):
    taken = []
    for count in (3, 7, 4, 20):
        taken += own.take(count)
        taken += other.take(count)
    assert sorted(taken) == list(range(30))
    assert own.take(5) == []  # not None: the others may be free again
    store.add([record(PLAN[n]) for n in range(30)])
    assert own.take(5) is None
    assert other.take(5) is None


def test_run_with_a_key_that_another_process_computes_is_left_to_it(store, tmp_path):
    plan = SyntheticPlan(6, period=4)
    with Store(tmp_path) as second, Leases(store, plan) as own, Leases(second, plan) as other:
        assert own.take(2) == [0, 1]
        assert other.take(9) == [2, 3]
        assert own.take(9) == [4, 5]  # the keys of 0 and 1


def test_leases_are_released_at_the_end(store, own, tmp_path):
    with Store(tmp_path) as second, Leases(second, PLAN) as other:
        assert other.take(30) == list(range(30))
        assert own.take(30) == []
    assert own.take(30) == list(range(30))


def test_leases_of_a_process_that_ended_are_free_at_once(store, own):
    with subprocess.Popen([sys.executable, "-S", "-c", ""]) as ended:
        started = _start_of(ended.pid)
        ended.wait()
    enter(store, pid=ended.pid, started=started)
    assert own.take(3) == [0, 1, 2]


@pytest.mark.skipif(not os.path.isdir("/proc/self"), reason="needs the start of processes")
def test_number_of_a_process_that_is_used_again_frees_the_leases(store, own):
    enter(store, pid=os.getpid(), started="other")
    assert own.take(1) == [0]


def test_leases_of_a_process_that_runs_are_kept(store, own):
    enter(store, pid=os.getpid(), started=_start_of(os.getpid()))
    assert own.take(3) == [10, 11, 12]


def test_leases_of_another_computer_are_free_when_its_heartbeat_stands_still(
    store, own, monkeypatch
):
    """By the clock of the observer: no time of another computer is read."""
    now = 1000.0
    monkeypatch.setattr(leases_module, "monotonic", lambda: now)
    enter(store, host="elsewhere")
    assert own.take(1) == [10]
    now += 29.0
    assert own.take(1) == [11]
    enter(store, host="elsewhere", beat=4)
    now += 29.0
    assert own.take(1) == [12]
    now += 29.0
    assert own.take(1) == [13]
    now += 2.0
    assert own.take(30) == list(range(14, 30))
    assert own.take(30) == list(range(10))


def test_heartbeat_returns_after_another_process_took_this_one_for_ended(store, tmp_path):
    with Leases(store, PLAN, interval=0.01):
        with store.transaction() as connection:
            connection.execute("DELETE FROM processes")
        for _ in range(500):
            ((count,),) = store._connection.execute("SELECT COUNT(*) FROM processes").fetchall()
            if count:
                break
            leases_module.Event().wait(0.01)
        assert count == 1
    ((count,),) = store._connection.execute("SELECT COUNT(*) FROM processes").fetchall()
    assert count == 0


def test_search_begins_behind_stored_runs(store, own, monkeypatch):
    monkeypatch.setattr(leases_module, "_RANGE", 4)
    store.add([record(PLAN[n]) for n in (*range(10), 15)])
    assert own.take(4) == [10, 11, 12, 13]
    assert own.take(4) == [14, 16, 17, 18]
    assert own._first == 8


def test_runs_of_a_small_plan_are_leased_in_a_given_order(store):
    order = [*range(29, -1, -2), *range(0, 30, 2)]
    with Leases(store, PLAN, order=order) as leases:
        found = [leases.take(1)[0] for _ in range(30)]
        assert leases.take(1) == []
    assert found == order
