"""Scheduling of the process for a loop, and of what it starts."""

import gc
import os
import subprocess
import sys
import threading

import numpy as np
import pytest

from omnidrive.deploy.loop_timing import LoopTiming
from omnidrive.deploy.realtime import Measure, realtime

_SHOW = "import os; print(os.sched_getscheduler(0))"


def test_process_is_as_before_at_the_end():
    def settings():
        return (
            gc.isenabled(),
            sys.getswitchinterval(),
            os.sched_getscheduler(0),
            os.sched_getaffinity(0),
        )

    before = settings()
    cpu = min(os.sched_getaffinity(0))
    with realtime(cpu=cpu) as measures:
        assert not gc.isenabled()
        assert sys.getswitchinterval() < 0.001
        assert os.sched_getaffinity(0) == {cpu}
        names = [measure.name for measure in measures]
    assert settings() == before
    assert names[-2:] == ["SCHED_FIFO", f"processor {cpu}"]


def test_what_the_loop_starts_does_not_inherit_its_priority():
    """A process of the same priority on the same processor delays the loop."""
    policies: list[int] = []
    with realtime() as measures:
        if any(m.name == "SCHED_FIFO" and m.refusal for m in measures):
            pytest.skip("SCHED_FIFO is not allowed")
        assert os.sched_getscheduler(0) & os.SCHED_FIFO
        thread = threading.Thread(target=lambda: policies.append(os.sched_getscheduler(0)))
        thread.start()
        thread.join()
        child = subprocess.run([sys.executable, "-c", _SHOW], capture_output=True, check=True)
    assert policies == [os.SCHED_OTHER]
    assert int(child.stdout) == os.SCHED_OTHER


def test_refused_measure_says_why():
    with realtime(cpu=10_000) as measures:
        assert "no (" in str(measures[-1])
    assert str(Measure("memory locked")) == "memory locked: yes"


def test_lateness_is_in_order_when_the_oldest_are_dropped():
    timing = LoopTiming(4)
    assert timing.lateness.size == 0
    for late in (1.0, 2.0, 3.0):
        timing.add(late, 0.0)
    np.testing.assert_array_equal(timing.lateness, [1.0, 2.0, 3.0])
    for late in (4.0, 5.0, 6.0):
        timing.add(late, 0.0)
    np.testing.assert_array_equal(timing.lateness, [3.0, 4.0, 5.0, 6.0])
    assert timing.summary().samples == 6
