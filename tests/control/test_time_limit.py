"""Time limit of calls in the main thread, and what the pipeline makes of a stalled controller."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from omnidrive.control import FeedforwardController, Pipeline, Status, pipeline
from omnidrive.control.time_limit import SharedTimer, TimedOut, TimeLimit
from omnidrive.estimation import SensorReadings
from omnidrive.geometry import Pose
from omnidrive.testing.laws import Circle

DT = 0.1


def wait():
    time.sleep(60.0)


def compute():
    while True:
        pass


def suppress():
    """Suppress the exception once."""
    with pytest.raises(TimedOut):
        wait()
    wait()


def suppress_always():
    """Suppress the exception in nearly all the time."""
    while True:
        try:
            time.sleep(60.0)
        except BaseException:
            time.sleep(0.002)


@pytest.mark.parametrize("call", [wait, compute, suppress, suppress_always])
def test_call_is_interrupted(call):
    begin = time.monotonic()
    with pytest.raises(TimedOut), TimeLimit(0.2) as limit:
        call()
    assert limit.armed
    assert time.monotonic() - begin > 0.19
    assert signal.getitimer(signal.ITIMER_REAL) == (0.0, 0.0)


def test_interrupted_call_has_time_to_clean_up():
    released = []

    def hold():
        try:
            wait()
        finally:
            time.sleep(0.005)
            released.append(True)

    with pytest.raises(TimedOut), TimeLimit(0.2):
        hold()
    assert released == [True]


def test_suppressed_exception_is_raised_again_soon():
    """The shared timer's own period is too long to hit the code that handles the exception."""
    begin = time.monotonic()
    with SharedTimer(0.1):
        with pytest.raises(TimedOut), TimeLimit(0.2):
            suppress_always()
        assert time.monotonic() - begin < 5.0
        with TimeLimit(0.3):
            time.sleep(0.15)  # the timer has its own period again
        assert signal.getitimer(signal.ITIMER_REAL)[1] == pytest.approx(0.1)


def test_signal_that_the_program_uses_is_left_alone():
    before = signal.signal(signal.SIGALRM, signal.SIG_IGN)
    try:
        with TimeLimit(0.05) as limit:
            time.sleep(0.1)
        assert not limit.armed
        assert signal.getsignal(signal.SIGALRM) is signal.SIG_IGN
    finally:
        signal.signal(signal.SIGALRM, before)


STOPPED = """
import time
from omnidrive.control.time_limit import TimeLimit
with TimeLimit(5.0):
    print("begins", flush=True)
    begin = time.process_time()
    while time.process_time() - begin < 0.3:
        pass
print("ends")
"""


@pytest.mark.long
def test_stopped_process_is_not_stalled():
    """Stopped (SIGSTOP) for longer than the limit."""
    child = subprocess.Popen([sys.executable, "-c", STOPPED], stdout=subprocess.PIPE, text=True)
    assert child.stdout.readline() == "begins\n"
    os.kill(child.pid, signal.SIGSTOP)
    time.sleep(6.0)
    os.kill(child.pid, signal.SIGCONT)
    assert child.communicate(timeout=60.0)[0] == "ends\n"


class Slow(FeedforwardController):
    """A controller whose step at 0.2 s takes 0.3 s."""

    def step(self, t, state, reference):
        if 0.15 < t < 0.25:
            time.sleep(0.3)
        return super().step(t, state, reference)


def statuses(controller):
    """Return commands and statuses of a pipeline whose robot stays at the start."""
    line = Pipeline(controller)
    line.reset(Circle().at(0.0).pose)
    return [line.step(k * DT, SensorReadings(k * DT), Circle(), DT) for k in range(13)]


def test_slow_step_of_another_thread_is_judged_when_it_returns(monkeypatch):
    monkeypatch.setattr(pipeline, "STEP_TIMEOUT", 0.1)
    found = []
    thread = threading.Thread(target=lambda: found.extend(statuses(Slow(DT))))
    thread.start()
    thread.join()
    assert [step.command.status for step in found[:3]] == [Status.OK, Status.OK, Status.FALLBACK]
    held, last = [step.command.twist for step in found[2:7]], found[1].command.twist
    assert held == [last] * 5
    assert found[7].command.twist.vx == pytest.approx(0.8 * last.vx)
    assert found[11].failed == "controller"
    assert found[11].command.message == "its step at 0.2 s took longer than 0.1 s"


def test_slow_step_within_the_limit_changes_nothing():
    line = [step.command for step in statuses(FeedforwardController(DT))]
    assert [step.command for step in statuses(Slow(DT))] == line


def test_reset_forgets_a_stall(monkeypatch):
    monkeypatch.setattr(pipeline, "STEP_TIMEOUT", 0.1)
    line = Pipeline(Slow(DT))
    for _ in range(2):
        line.reset(Pose(0.0, 0.0, 0.0))
        for t in (0.0, 0.1):
            assert line.step(t, SensorReadings(t), Circle(), DT).command.status is Status.OK
        assert line.step(0.2, SensorReadings(0.2), Circle(), DT).command.status is Status.FALLBACK
