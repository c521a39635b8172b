"""Drives in real time with a simulated robot in a process of its own; nothing is timed."""

import os
import signal
import threading
import time
from multiprocessing import Pipe

import numpy as np
import pytest

from omnidrive import FeedforwardController, KinematicPlant, PerfectSensors, Pose, named_robot
from omnidrive.control import Pipeline
from omnidrive.deploy.clock import MonotonicClock
from omnidrive.deploy.controls import DriveControls
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


def driven(link, duration, controls=None):
    goal = Pose(0.1, 0.0, 0.0)
    return drive(
        link,
        Pipeline(FeedforwardController(DT)),
        Hold(goal, duration),
        rate=1.0 / DT,
        start=START,
        controls=controls,
    )


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


def test_robot_that_dies_ends_the_drive():
    link, controls = process(), DriveControls(arm=True)

    def kill():
        while not link.pid:
            time.sleep(0.01)
        time.sleep(2.0)  # the process has started
        os.kill(link.pid, signal.SIGKILL)

    thread = threading.Thread(target=kill)
    thread.start()
    result = driven(link, 30.0, controls)
    thread.join()
    assert not result.finished
    assert "the link is lost" in result.ending


def test_signal_stops_the_robot():
    def end():
        time.sleep(2.0)
        os.kill(os.getpid(), signal.SIGTERM)

    thread = threading.Thread(target=end)
    before = signal.getsignal(signal.SIGTERM)
    thread.start()
    result = driven(process(), 30.0)
    thread.join()
    assert result.ending == "signal SIGTERM"
    assert signal.getsignal(signal.SIGTERM) is before


def test_robot_stops_by_itself_without_commands():
    """The driver sends one command and is then silent, as a process that is stopped or hangs."""
    here, there = Pipe()
    settings = simulated._Settings(START, DT, 0.0, 0.0, 0)
    thread = threading.Thread(target=simulated._simulate, args=(there, make, settings), daemon=True)
    thread.start()
    assert here.recv().watchdog == WATCHDOG
    here.send(BodyTwist(0.2, 0.0, 0.0))
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
