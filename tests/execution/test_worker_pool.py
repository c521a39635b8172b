"""Worker processes that are killed or stopped, and long messages: the other calls go on."""

import logging
import os
import re
import signal
import subprocess
import sys
from functools import partial
from multiprocessing import resource_tracker, util
from time import monotonic, sleep

import psutil
import pytest
from loky import process_executor
from loky.backend import popen_loky_posix

from omnidrive.errors import WorkerLost
from omnidrive.execution.heartbeat import Heartbeat
from omnidrive.execution.worker_pool import Call, Lost, WorkerPool
from tests.study.processes import workers

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs Unix")

LONG = 3_000_000  # bytes; more than a pipe holds


def nothing():
    """Do nothing at the start of a process."""


def answer(value):
    return value


def killed_once(marker):
    if not marker.exists():
        marker.touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return "second attempt"


def send_signal(number):
    os.kill(os.getpid(), number)
    sleep(600)


def killed_with(data):
    os.kill(os.getpid(), signal.SIGKILL)


def outcomes(calls, size=2, setup=nothing, **options):
    """Return the outcome of each function."""
    named = [Call(f"call {k}", call) for k, call in enumerate(calls)]
    with WorkerPool(size, setup, **options) as pool:
        return dict(pool.outcomes(named))


def test_loss_of_processes_costs_their_calls_only(tmp_path, caplog):
    found = outcomes(
        [
            partial(answer, 0),
            partial(killed_once, tmp_path / "marker"),
            partial(send_signal, signal.SIGKILL),
            partial(send_signal, signal.SIGSTOP),
            partial(answer, 4),
        ],
        size=3,
        time_limit=1.5,
    )
    assert found == {
        0: 0, 1: "second attempt", 2: Lost.KILLED, 3: Lost.TIMED_OUT, 4: 4,
    }  # fmt: skip
    assert sum("was killed; starting it again" in text for text in caplog.messages) == 3
    assert not workers()


def test_long_messages_arrive_also_after_a_loss(tmp_path):
    """A process that is killed before it reads a long message, or within one, blocks nobody."""
    long = bytes(LONG)
    found = outcomes([partial(answer, long), partial(killed_with, long), partial(len, long)])
    assert (found[0], found[1], found[2]) == (long, Lost.KILLED, LONG)


def unpicklable():
    return lambda: None, sys._getframe()


def exiting():
    sys.exit(3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (unpicklable, "(?i)can.*t.* pickle"),
        pytest.param(exiting, "SystemExit: 3", marks=pytest.mark.long),
        pytest.param(partial(int, "x"), "invalid literal", marks=pytest.mark.long),
    ],
)
def test_exception_of_a_call_is_raised_here(call, message):
    with pytest.raises(Exception, match=message):
        outcomes([call, partial(sleep, 600)])
    assert not workers()


def test_processes_that_do_not_start_end_the_calls():
    with pytest.raises(WorkerLost, match=r"3 worker processes in succession are killed while they"):
        outcomes([partial(answer, 1)], setup=partial(send_signal, signal.SIGKILL))


def killed_times(folder, times):
    """Kill this process unless that has been done a number of times."""
    number = len(list(folder.iterdir()))
    if number < times:
        (folder / f"{number}").touch()
        os.kill(os.getpid(), signal.SIGKILL)


@pytest.mark.long
def test_two_processes_that_are_killed_while_they_start_are_replaced(tmp_path):
    calls = [partial(answer, k) for k in range(4)]
    assert outcomes(calls, size=1, setup=partial(killed_times, tmp_path, 2)) == {
        k: k for k in range(4)
    }
    assert len(list(tmp_path.iterdir())) == 2


def test_exception_at_the_start_is_raised_here():
    with pytest.raises(ValueError, match="invalid literal"):
        outcomes([partial(answer, 1)], setup=partial(int, "x"))


@pytest.mark.long
def test_process_that_stops_at_its_start_is_ended_by_the_time_limit():
    with pytest.raises(WorkerLost, match="exceed the time limit while they start"):
        outcomes([partial(answer, 1)], setup=partial(sleep, 600), time_limit=0.2, start_limit=0.2)


def blocked():
    """Return the signals that this thread blocks."""
    return signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_processes_start_with_blocked_signals_and_unblock_them(monkeypatch):
    """That of a call, and the resource tracker of Python, which unblocks those of its parent."""
    inherited = []
    launch = popen_loky_posix.Popen._launch

    def launch_and_note(*arguments):
        """Note the signals that the new process inherits as blocked."""
        inherited.append(blocked())
        return launch(*arguments)

    tracker, spawn = resource_tracker._resource_tracker, util.spawnv_passfds

    def spawn_and_note(*arguments):
        inherited.append(blocked())
        return spawn(*arguments)

    monkeypatch.setattr(popen_loky_posix.Popen, "_launch", launch_and_note)
    monkeypatch.setattr(util, "spawnv_passfds", spawn_and_note)
    for name in ("_fd", "_pid"):
        monkeypatch.setattr(tracker, name, None)  # as in a process that has started none
    assert outcomes([blocked], size=1) == {0: blocked()}
    os.close(tracker._fd)
    os.waitpid(tracker._pid, 0)
    ending = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
    assert [ending & each for each in inherited] == 2 * [ending]


@pytest.mark.long
def test_interruption_ends_all_processes():
    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 2.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            outcomes([partial(send_signal, signal.SIGSTOP), partial(sleep, 600)])
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert not workers()


def test_signal_at_the_start_of_a_process_leaves_none_behind(monkeypatch):
    launch = popen_loky_posix.Popen._launch

    def interrupted(*arguments):
        signal.raise_signal(signal.SIGINT)
        launch(*arguments)

    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(popen_loky_posix.Popen, "_launch", interrupted)
    with pytest.raises(KeyboardInterrupt):
        outcomes([partial(answer, 0)])
    assert not workers()
    assert signal.getsignal(signal.SIGINT) is before


def limits():
    return os.environ["OPENBLAS_NUM_THREADS"], process_executor._MAX_MEMORY_LEAK_SIZE


def test_processes_compute_with_one_thread_and_are_not_replaced_when_they_grow():
    assert process_executor._MAX_MEMORY_LEAK_SIZE < 1e12  # of loky; here it does not apply
    assert outcomes([limits], size=1) == {0: ("1", float("inf"))}


ORPHANING = """
import os, sys
from functools import partial
from time import sleep
from omnidrive.execution.worker_pool import Call, WorkerPool

def call():  # of a script without a guard of its main part
    print(os.getpid(), flush=True)
    sleep(600)

with WorkerPool(1, int) as pool:
    print(pool._folder, flush=True)
    pool.submit(Call("call", call))
    pool.wait()
"""


def test_processes_end_with_a_killed_parent(tmp_path):
    script = tmp_path / "script.py"
    script.write_text(ORPHANING, encoding="utf-8")
    with subprocess.Popen(
        [sys.executable, script], env=os.environ | {"PYTHONPATH": os.pathsep.join(sys.path)},
        stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
    ) as parent:  # fmt: skip
        folder, worker = (parent.stdout.readline().strip() for _ in range(2))
        assert os.path.isdir(folder)
        parent.kill()
    until = monotonic() + 20.0
    while (psutil.pid_exists(int(worker)) or os.path.isdir(folder)) and monotonic() < until:
        sleep(0.02)
    assert not psutil.pid_exists(int(worker))
    assert not os.path.isdir(folder)


def test_message_names_the_runs_while_nothing_finishes(caplog):
    caplog.set_level(logging.WARNING, "omnidrive")
    with Heartbeat(first=0.2) as heartbeat:
        heartbeat.begin("track-pid-20s")
        heartbeat.begin("step-pid")
        heartbeat.end("step-pid")
        sleep(1.0)
    assert 1 <= len(caplog.messages) <= 3  # after 0.2, 0.4 and 0.8 s
    for text in caplog.messages:
        assert re.fullmatch(r"nothing has finished for \d s; running: track-pid-20s \(\d s\)", text)
