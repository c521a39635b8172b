"""Studies on the workers of a Dask scheduler."""

import os
import signal
import socket
import warnings
from contextlib import contextmanager, suppress
from importlib import import_module
from threading import Thread
from time import monotonic, sleep

import pytest

from omnidrive.errors import InvalidInput, MissingExtra
from omnidrive.execution import cluster
from omnidrive.execution.cluster import ClusterPool, _execute, _versions
from omnidrive.study.computation.experiment import Experiment
from omnidrive.study.storage.store import Store
from tests.study.synthetic import Compute, SyntheticPlan, table_bytes

pytest.importorskip("distributed")


@contextmanager
def local_cluster(workers):
    """Start a scheduler and workers in processes of their own; yield the cluster."""
    import distributed

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        local = distributed.LocalCluster(
            n_workers=workers, threads_per_worker=1, processes=True, dashboard_address=None
        )
        with local:
            yield local


def stored(folder):
    with Store(folder, read_only=True) as store:
        return table_bytes(store.records())


def execute_on_cluster(tmp_path, count, seconds, kill):
    """Execute a study on a cluster and in this process; check that the tables are equal."""
    plan = SyntheticPlan(count)
    Experiment(plan, Compute(plan), tmp_path / "here", "definition").execute()
    compute = Compute(plan, seconds=seconds)
    folder = tmp_path / "cluster"
    with local_cluster(2) as local:
        killer = Thread(target=kill, args=(local, folder))
        killer.start()
        experiment = Experiment(plan, compute, folder, "definition")
        experiment.execute(scheduler=local.scheduler_address)
        killer.join()
    assert stored(folder) == stored(tmp_path / "here")


@pytest.mark.filterwarnings("ignore")
@pytest.mark.long
def test_killed_worker_of_a_cluster_changes_no_result(tmp_path):
    killed = []

    def kill(local, folder):
        until = monotonic() + 60.0
        while monotonic() < until:
            with Store(folder, read_only=True) as store:
                if store.status().runs > 20:
                    break
            sleep(0.05)
        killed.append(next(iter(local.workers.values())).process.pid)
        os.kill(killed[0], signal.SIGKILL)

    (tmp_path / "cluster").mkdir()
    with Store(tmp_path / "cluster"):
        execute_on_cluster(tmp_path, 400, 0.02, kill)
    assert killed


@pytest.mark.filterwarnings("ignore")
def test_scheduler_that_does_not_answer_is_reported(monkeypatch):
    monkeypatch.setattr(cluster, "_ANSWER_TIME", 0.2)
    with pytest.raises(InvalidInput, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:9 "):
        ClusterPool("tcp://127.0.0.1:9", int)
    with pytest.raises(InvalidInput, match=r"no Dask scheduler answers at nonsense"):
        ClusterPool("nonsense://", int)


@pytest.mark.parametrize(
    ("answer", "reason"),
    [
        (b"", "it accepts connections, but does not answer"),
        (b"HTTP/1.1 400 Bad Request\r\n\r\n", "what answers is no scheduler"),
    ],
)
def test_program_that_is_no_scheduler_is_reported(monkeypatch, answer, reason):
    """A client of Dask waits for ever for the first, and allocates 3 EiB for the second."""
    if not answer:
        monkeypatch.setattr(cluster, "_ANSWER_TIME", 1.0)
    with socket.create_server(("127.0.0.1", 0)) as server:

        def serve():
            with suppress(OSError):  # the end of the test
                while True:
                    connection, _ = server.accept()
                    present.append(connection)
                    connection.sendall(answer)

        present = []
        Thread(target=serve, daemon=True).start()
        with pytest.raises(InvalidInput, match=reason):
            ClusterPool(f"tcp://127.0.0.1:{server.getsockname()[1]}", int)
    for each in present:
        each.close()


def test_missing_extra_is_reported(monkeypatch):
    def missing(name):
        raise ModuleNotFoundError(name)

    monkeypatch.setattr(cluster, "import_module", missing)
    with pytest.raises(MissingExtra, match=r"pip install dask distributed"):
        ClusterPool("tcp://127.0.0.1:9", int)


def test_worker_with_other_versions_is_refused():
    with pytest.raises(InvalidInput, match=r"other versions: numpy .*; install the same ones"):
        _execute(b"", b"", _versions() | {"numpy": "0.1"})


def test_distributed_has_what_the_pool_uses():
    distributed = import_module("distributed")
    assert issubclass(distributed.scheduler.KilledWorker, Exception)
    assert issubclass(distributed.client.FuturesCancelledError, Exception)
