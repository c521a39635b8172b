"""Processes that are killed or stopped while a robot drives: real processes, in real time.

The measured times are printed (pytest -m long -s tests/deploy/test_kills.py).
"""

import os
import signal
import subprocess
import sys
import time
from contextlib import contextmanager
from pathlib import Path

import pytest

from omnidrive import FeedforwardController, KinematicPlant, PerfectSensors, Pose, named_robot
from omnidrive.control import Pipeline
from omnidrive.deploy.controls import DriveControls
from omnidrive.deploy.drive import drive
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.links.simulated import WATCHDOG, SimulatedProcess, SimulatedRobot
from omnidrive.deploy.links.wheels import WheelsLink
from omnidrive.estimation import EstimatorSettings, PoseEstimator, SensorSettings
from omnidrive.reference import Circle, ShapeReference
from tests.deploy.board import SerialBoard, UdpBoard

pytestmark = pytest.mark.long
ROBOT = named_robot("small")
WHEELS = len(ROBOT.mounts)
DT, START = 0.02, Pose(0.0, 0.0, 0.0)
DELAY = 0.3  # s; by which a process of a busy computer may see an event later
CIRCLE = ShapeReference(Circle(radius=0.3), 20.0)
ROOT = Path(__file__).parents[2]


def awaited(holds, timeout=60.0):
    """The time that passes until a condition holds, s."""
    began = time.monotonic()
    while not holds():
        assert time.monotonic() - began < timeout
        time.sleep(0.002)
    return time.monotonic() - began


@pytest.mark.parametrize("kind", [UdpBoard, SerialBoard])
def test_a_killed_driver_leaves_a_board_that_stops_by_itself(kind, tmp_path):
    with kind(WHEELS, counts=100_000) as board:
        words = ["drive", "--link", f"wheels,address={board.address}", "--estimator", "--arm"]
        words += ["--controller", "feedforward", "--reference", "circle,radius=0.5"]
        words += ["--robot", "small", "--plant", "kinematic"]
        command = [sys.executable, "-m", "omnidrive", *words]
        with subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.PIPE) as driver:
            awaited(lambda: any(board.speeds) or driver.poll() is not None, 120.0)
            assert driver.poll() is None
            time.sleep(1.0)
            driver.kill()
            stopped = awaited(lambda: not any(board.speeds), 5.0)
    print(f"{kind.__name__}: stops {stopped:.3f} s after kill -9 of the driver")
    assert stopped < board.hello.watchdog + DELAY


@contextmanager
def board_process(kind, port=0):
    command = [sys.executable, "-m", "tests.deploy.board", kind, str(WHEELS), str(port)]
    with subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        try:
            yield process, process.stdout.readline().strip()
        finally:
            process.kill()


def driven(link, events, estimator=None):
    """Drive; ``events``: pairs of time since the first motion and a function of the controls."""
    controls, waiting, began = DriveControls(arm=True), list(events), []

    def poll():
        began.append(time.monotonic())
        while waiting and time.monotonic() - began[0] >= waiting[0][0]:
            waiting.pop(0)[1](controls)

    controls.poll = poll
    pipeline = Pipeline(FeedforwardController(DT), *([estimator] if estimator else []))
    return drive(link, pipeline, CIRCLE, rate=1.0 / DT, start=START, controls=controls)


def board_estimator():
    return PoseEstimator(ROBOT, SensorSettings(), EstimatorSettings(), slips=False)


def held(result):
    return next(each for each in result.changes if each.state is DriveState.HOLDING)


def test_a_killed_board_is_held_and_goes_on_with_its_successor_when_armed():
    with board_process("udp") as (first, address), board_process("udp") as (_, _other):
        made = []

        def replace(_controls):
            made.append(board_process("udp", address.rpartition(":")[2]))
            made[0].__enter__()

        events = [
            (2.0, lambda _: first.kill()),
            (4.0, replace),
            (7.0, lambda controls: controls.arm()),
            (15.0, lambda controls: controls.stop("end of the test")),
        ]
        try:
            result = driven(WheelsLink(ROBOT, address), events, board_estimator())
        finally:
            made[0].__exit__(None, None, None)
    print(f"udp board: {held(result).t:.2f} s: {held(result).reason}")
    assert held(result).reason.startswith("no readings for 0.5")
    assert 2.4 < held(result).t < 2.5 + DELAY
    again = [change.t for change in result.changes if change.state is DriveState.RUNNING]
    assert len(again) == 2
    assert again[1] > 6.9


def test_a_killed_board_on_a_serial_line_ends_the_drive():
    with board_process("pty") as (board, address):
        events = [(2.0, lambda _: board.kill()), (9.0, lambda controls: controls.stop("late"))]
        result = driven(WheelsLink(ROBOT, address), events, board_estimator())
    print(f"serial board: {result.changes[-1].t:.2f} s: {result.ending}")
    assert result.ending.startswith("the link is lost: /dev/")
    assert 1.9 < result.changes[-1].t < 2.0 + DELAY


@pytest.mark.parametrize("kind", ["udp", "pty"])
def test_a_board_that_hangs_is_held_and_does_not_block_the_loop(kind):
    """It takes no bytes and sends none for eight seconds, as if it were unplugged."""
    with board_process(kind) as (board, address):
        events = [
            (2.0, lambda _: os.kill(board.pid, signal.SIGSTOP)),
            (10.0, lambda _: os.kill(board.pid, signal.SIGCONT)),
            (11.5, lambda controls: controls.arm()),
            (13.0, lambda controls: controls.stop("end of the test")),
        ]
        result = driven(WheelsLink(ROBOT, address), events, board_estimator())
    assert held(result).reason.startswith("no readings for 0.5")
    assert 2.4 < held(result).t < 2.5 + DELAY
    runs = [each.t for each in result.changes if each.state is DriveState.RUNNING]
    assert len(runs) == 2
    assert runs[1] > 11.4
    assert result.ending == "end of the test"
    assert result.timing.summary().jitter_max < 1.0


def make():
    return SimulatedRobot(ROBOT, KinematicPlant(ROBOT), PerfectSensors())


def test_a_simulated_robot_that_is_stopped_is_held_until_it_is_armed_again():
    link = SimulatedProcess(ROBOT, make, START, DT)
    events = [
        (2.0, lambda _: os.kill(link.pid, signal.SIGSTOP)),
        (6.0, lambda _: os.kill(link.pid, signal.SIGCONT)),
        (7.5, lambda controls: controls.arm()),
        (9.0, lambda controls: controls.stop("end of the test")),
    ]
    result = driven(link, events)
    print(f"simulated: {held(result).t:.2f} s: {held(result).reason}")
    assert held(result).reason.startswith("no readings for 0.5")
    assert 2.4 < held(result).t < 2.5 + DELAY
    runs = [each.t for each in result.changes if each.state is DriveState.RUNNING]
    assert len(runs) == 2
    assert runs[1] > 7.4
    assert result.ending == "end of the test"


def test_a_killed_driver_ends_its_simulated_robot(tmp_path):
    words = ["drive", "--controller", "feedforward", "--reference", "circle,radius=0.5"]
    words += ["--robot", "small", "--plant", "kinematic", "--arm"]
    command = [sys.executable, "-m", "omnidrive", *words]
    with subprocess.Popen(command, cwd=tmp_path, stdin=subprocess.PIPE) as driver:
        children = Path(f"/proc/{driver.pid}/task/{driver.pid}/children")
        awaited(lambda: children.read_text().split(), 60.0)
        time.sleep(5.0)
        robots = [int(pid) for pid in children.read_text().split()]
        driver.kill()
        ended = awaited(lambda: not any(map(is_running, robots)), 5.0)
    print(f"simulated: ends {ended:.3f} s after kill -9 of the driver")
    assert ended < WATCHDOG + DELAY


def is_running(pid):
    try:
        return "State:\tZ" not in Path(f"/proc/{pid}/status").read_text()
    except OSError:
        return False
