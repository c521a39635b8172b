"""Worker processes that are killed, stopped, or send half a result: the other calls go on."""

import logging
import os
import re
import signal
import struct
import sys
from functools import partial
from multiprocessing import active_children, resource_tracker, util
from multiprocessing.process import BaseProcess
from time import sleep

import pytest

from omnidrive.errors import WorkerLost
from omnidrive.study.heartbeat import Heartbeat
from omnidrive.study.workers import Call, Lost, Workers

pytestmark = pytest.mark.skipif(not hasattr(signal, "SIGSTOP"), reason="needs Unix")


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


def send_half(*, killed):
    """Send the first bytes of a result; then block, or be killed."""
    frame = sys._getframe()
    while "connection" not in frame.f_locals:
        frame = frame.f_back
    os.write(frame.f_locals["connection"].fileno(), struct.pack("!i", 1000) + b"half")
    send_signal(signal.SIGKILL if killed else signal.SIGSTOP)


def outcomes(calls, count=2, setup=nothing, **options):
    """Return the outcome of each function."""
    named = [Call(f"call {k}", call) for k, call in enumerate(calls)]
    return dict(Workers(count, setup, **options).outcomes(named))


def test_loss_of_processes_costs_their_calls_only(tmp_path, caplog):
    found = outcomes(
        [
            partial(answer, 0),
            partial(killed_once, tmp_path / "marker"),
            partial(send_signal, signal.SIGKILL),
            partial(send_half, killed=True),
            partial(send_half, killed=False),
            partial(send_signal, signal.SIGSTOP),
            partial(answer, 6),
        ],
        count=3,
        time_limit=1.5,
    )
    assert found == {
        0: 0, 1: "second attempt", 2: Lost.KILLED, 3: Lost.KILLED, 4: Lost.TIMED_OUT,
        5: Lost.TIMED_OUT, 6: 6,
    }  # fmt: skip
    assert sum("was killed; starting it again" in text for text in caplog.messages) == 3
    assert not active_children()


def unpicklable():
    return lambda: None


def exiting():
    sys.exit(3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (unpicklable, "(?i)can.*t.* pickle"),
        (exiting, "SystemExit: 3"),
        (partial(struct.pack, "!i", 0.5), "required argument is not an integer"),
    ],
)
def test_exception_of_a_call_is_raised_here(call, message):
    with pytest.raises(Exception, match=message):
        outcomes([call, partial(sleep, 600)])
    assert not active_children()


def test_processes_that_do_not_start_end_the_calls():
    with pytest.raises(WorkerLost, match="__main__"):
        outcomes([partial(answer, 1)], setup=partial(send_signal, signal.SIGKILL))


def test_process_that_stops_at_its_start_is_ended_by_the_time_limit():
    with pytest.raises(WorkerLost):
        outcomes([partial(answer, 1)], setup=partial(sleep, 600), time_limit=0.2, start_limit=0.2)


def blocked():
    """Return the signals that this thread blocks."""
    return signal.pthread_sigmask(signal.SIG_BLOCK, [])


def test_processes_start_with_blocked_signals_and_unblock_them(monkeypatch):
    """That of a call, and the resource tracker of Python, which unblocks those of its parent."""
    tracker, inherited, spawn = resource_tracker._resource_tracker, [], util.spawnv_passfds

    def spawn_and_note(*arguments):
        """Note the signals that the new process inherits as blocked."""
        inherited.append(blocked())
        return spawn(*arguments)

    monkeypatch.setattr(util, "spawnv_passfds", spawn_and_note)
    for name in ("_fd", "_pid"):
        monkeypatch.setattr(tracker, name, None)  # as in a process that has started none
    assert outcomes([blocked], count=1) == {0: blocked()}
    os.close(tracker._fd)
    os.waitpid(tracker._pid, 0)
    ending = {signal.SIGINT, signal.SIGTERM, signal.SIGHUP}
    assert [ending & each for each in inherited] == 2 * [ending]


def test_interruption_ends_all_processes():
    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 3.0)
    try:
        with pytest.raises(KeyboardInterrupt):
            outcomes([partial(send_half, killed=False), partial(sleep, 600)])
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)
    assert not active_children()


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


def test_signal_at_the_start_of_a_process_leaves_none_behind(monkeypatch):
    start = BaseProcess.start

    def interrupted(process):
        signal.raise_signal(signal.SIGINT)
        start(process)

    before = signal.getsignal(signal.SIGINT)
    monkeypatch.setattr(BaseProcess, "start", interrupted)
    with pytest.raises(KeyboardInterrupt):
        outcomes([partial(answer, 0)])
    assert not active_children()
    assert signal.getsignal(signal.SIGINT) is before
