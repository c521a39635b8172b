"""Drives in real time with a simulated robot in a process of its own; nothing is timed."""

import gc
import os
import signal
import threading
import time
from dataclasses import dataclass
from multiprocessing import Pipe

import numpy as np
import pytest

from omnidrive import FeedforwardController, KinematicPlant, PerfectSensors, Pose, named_robot
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import MonotonicClock
from omnidrive.deploy.drive import drive
from omnidrive.deploy.links import simulated
from omnidrive.deploy.links.simulated import WATCHDOG, SimulatedProcess, SimulatedRobot
from omnidrive.errors import InvalidInput
from omnidrive.geometry import BodyTwist
from omnidrive.reference import Hold

ROBOT = named_robot("small")
START = Pose(0.0, 0.0, 0.0)
DT = 0.02


def make():
    return SimulatedRobot(ROBOT, KinematicPlant(ROBOT), PerfectSensors())


def process(**settings):
    return SimulatedProcess(ROBOT, make, START, DT, **settings)


class FrozenCount(PerfectSensors):
    """The angle of each wheel is the number of objects that the garbage collector leaves out."""

    def read(self, t, state):
        return super().read(t, state)._replace(wheel_angles=(float(gc.get_freeze_count()),) * 4)


def make_counting():
    return SimulatedRobot(ROBOT, KinematicPlant(ROBOT), FrozenCount())


@pytest.mark.long
def test_collecting_garbage_does_not_interrupt_the_robot():
    """A full collection of all loaded modules takes 0.1 s."""
    link = SimulatedProcess(ROBOT, make_counting, START, DT)
    link.open(MonotonicClock())
    try:
        while (readings := link.read()) is None:
            time.sleep(DT)
    finally:
        link.close()
    assert readings.wheel_angles[0] > 10_000


def driven(link, duration):
    goal = Pose(0.1, 0.0, 0.0)
    return drive(
        link,
        Pipeline(FeedforwardController(DT)),
        Hold(goal, duration),
        rate=1.0 / DT,
        start=START,
    )


@pytest.mark.long
def test_robot_reaches_its_goal_in_real_time():
    link = process(latency=0.01, jitter=0.005)
    began = time.monotonic()
    result = driven(link, 1.5)
    assert time.monotonic() - began >= 1.5
    assert result.finished, result.ending
    assert result.run.pose[-1] == pytest.approx((0.1, 0.0, 0.0), abs=0.02)
    summary = result.timing.summary()
    assert summary.samples + summary.skipped >= 1.5 / DT
    assert result.timing.histogram().count("\n") >= 8
    assert {measure.name for measure in result.measures} >= {"memory locked", "SCHED_FIFO"}
    assert link._process is not None
    assert not link._process.is_alive()


@dataclass(slots=True)
class Interrupted(SimulatedProcess):
    """A link that sends a signal in the 30th sample."""

    number: int = signal.SIGTERM
    to_robot: bool = False
    samples: int = 0

    def send(self, value):
        self.samples += 1
        if self.samples == 30:
            pid = self.pid if self.to_robot else os.getpid()
            assert pid is not None
            os.kill(pid, self.number)
        SimulatedProcess.send(self, value)


@pytest.mark.long
def test_robot_that_dies_ends_the_drive():
    link = Interrupted(ROBOT, make, START, DT, number=signal.SIGKILL, to_robot=True)
    result = driven(link, 30.0)
    assert not result.finished
    assert "the link is lost" in result.ending


def test_signal_stops_the_robot():
    before = signal.getsignal(signal.SIGTERM)
    result = driven(Interrupted(ROBOT, make, START, DT), 30.0)
    assert result.ending == "signal SIGTERM"
    assert signal.getsignal(signal.SIGTERM) is before


@pytest.mark.long
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_signal_to_the_group_of_processes_is_the_reason(number):
    """Ctrl-C in a terminal reaches the simulated robot, too."""

    def to_both(link, value):
        link.samples += 1
        if link.samples == 30:
            os.kill(link.pid, number)
            os.kill(os.getpid(), number)
        SimulatedProcess.send(link, value)

    made = type("ToBoth", (Interrupted,), {"send": to_both})(ROBOT, make, START, DT)
    assert driven(made, 30.0).ending == f"signal {number.name}"


@pytest.mark.long
def test_robot_stops_by_itself_without_commands():
    """The driver sends one command and is then silent, as a process that is stopped or hangs."""
    here, there = Pipe()
    settings = simulated._Settings(START, DT, 0.0, 0.0, 0)
    thread = threading.Thread(target=simulated._simulate, args=(there, make, settings), daemon=True)
    thread.start()
    assert here.recv().watchdog == WATCHDOG
    here.send((time.monotonic(), BodyTwist(0.2, 0.0, 0.0)))
    sent = time.monotonic()
    poses = []
    while time.monotonic() - sent < WATCHDOG + 0.5:
        if here.poll(0.1):
            readings = here.recv()
            poses.append((readings.stamp, readings.fixes[0].pose.x))
    here.close()
    thread.join(timeout=2.0)
    times, x = np.array(poses).T
    moving = times[1:][np.diff(x) > 0.0]
    assert moving[-1] - sent == pytest.approx(WATCHDOG, abs=0.1)
    assert x[-1] == pytest.approx(0.2 * WATCHDOG, abs=0.03)


def test_bad_settings():
    with pytest.raises(InvalidInput, match="latency"):
        process(latency=-1.0)
    link = process()
    link.stop()
    link.close()
    made = simulated.SimulatedLink(make(), START)
    with pytest.raises(InvalidInput, match="SimulatedProcess"):
        made.open(MonotonicClock())


@pytest.mark.long
def test_a_robot_whose_process_was_stopped_moves_as_it_was_commanded():
    link = process()
    link.open(MonotonicClock())
    try:
        began = time.monotonic()
        link.send(BodyTwist(0.2, 0.0, 0.0))
        assert link._process is not None
        os.kill(link._process.pid, signal.SIGSTOP)
        time.sleep(0.1)
        ended = time.monotonic()
        link.send(BodyTwist(0.0, 0.1, 0.0))
        time.sleep(0.2)
        os.kill(link._process.pid, signal.SIGCONT)
        resumed = time.monotonic()
        fixes = []
        while not fixes or fixes[-1].stamp < resumed:
            readings = link.read()
            fixes += readings.fixes if readings else ()
            assert time.monotonic() < resumed + 30.0
    finally:
        link.close()
    # the two commands follow each other within the time that sending takes
    assert fixes[-1].pose.x == pytest.approx(0.2 * (ended - began), abs=0.002)
    assert fixes[-1].pose.y == pytest.approx(0.1 * (fixes[-1].stamp - ended), abs=0.002)
    late = [fix for fix in fixes if ended < fix.stamp < resumed]
    assert all(f.pose.y == pytest.approx(0.1 * (f.stamp - ended), abs=0.002) for f in late)
