"""Processes that are killed while a robot drives: it stops, says why, and goes on when armed."""

import os
import signal
import subprocess
import sys
import time
from contextlib import ExitStack, contextmanager
from math import hypot

import pytest

from omnidrive.control import FeedforwardController
from omnidrive.control.controller import STOP
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.ros2.drive_reports import ReportedPipeline
from omnidrive.deploy.ros2.path_follower import DriveRequests, PathFollower
from omnidrive.deploy.ros2.ros2_link import Ros2Link, Ros2LinkSettings
from omnidrive.reference import Circle, ShapeReference
from omnidrive.ros2 import Node
from tests.deploy.ros2.robot_process import ROBOT, running_robot
from tests.ros2.peer_process import new_domain

pytestmark = pytest.mark.long


@contextmanager
def process(*words, domain):
    command = [sys.executable, "-m", "omnidrive", "ros2", *words]
    command += ["--robot", "mecanum", "--peer", "localhost", "--distribution", "jazzy"]
    with subprocess.Popen([*command, "--domain", str(domain)]) as running:
        try:
            yield running
        finally:
            running.kill()


@pytest.mark.parametrize("command_type", ["Twist", "TwistStamped"])
def test_a_killed_driver_leaves_a_robot_that_stops_by_itself(command_type):
    domain, settings = new_domain(), {"rate": 25.0, "command_type": command_type}
    words = ("drive", "--reference", "circle,radius=0.5", "--controller", "feedforward")
    with running_robot(domain, **settings) as robot, process(*words, domain=domain) as driver:
        end = time.monotonic() + 60.0
        while hypot(*robot.state.twist[:2]) < 0.1:
            assert time.monotonic() < end
            time.sleep(0.01)
        driver.kill()
        killed = time.monotonic()
        while hypot(*robot._command[:2]) > 0.0:
            assert time.monotonic() - killed < 0.5 + 0.3
            time.sleep(0.01)
        print(f"{command_type}: {time.monotonic() - killed:.3f} s after kill -9 of the driver")
        time.sleep(1.0)
        assert hypot(*robot.state.twist[:2]) < 0.02


LIMIT = 150.0  # s


class Losses:
    """Stops a robot's process while it is driven, brings it back, and arms the drive.

    Args:
        lose: Called when the robot moves.
        restore: Called two seconds after that.
    """

    def __init__(self, follower, lose, restore):
        self.follower, self.lose, self.restore = follower, lose, restore
        self.began, self.lost, self.restored, self.armed = time.monotonic(), 0.0, 0.0, 0.0
        self.seen = -1.0
        self.sent = set()  # commands while it is held

    def watch(self, controls):
        now, link = time.monotonic(), self.follower.link
        if not self.lost:
            if hypot(*link.sent[:2]) > 0.03:
                self.lose()
                self.lost = now
        elif not self.restored:
            if now - self.lost > 2.0:
                self.restore()
                self.restored = now
        elif not self.armed:
            self.sent.add(link.sent)
            arrives = time.time() - link.poses._last < 0.2
            self.seen = (now if self.seen < 0.0 else self.seen) if arrives else -1.0
            if 0.0 < self.seen < now - 1.5:  # poses arrive for a while: the jump is over
                controls.arm()
                self.armed = now
        elif now - self.armed > 3.0:
            controls.stop("end of the test")
        if now - self.began > LIMIT:
            controls.stop("too late")


def check(result, losses):
    """Held within 0.5 s, at rest until it was armed, then driven again."""
    held = next(each for each in result.changes if each.state is DriveState.HOLDING)
    print(held)
    assert "more than 0.5 s" in held.reason
    assert losses.sent == {STOP}
    runs = [each for each in result.changes if each.state is DriveState.RUNNING]
    assert len(runs) == 2, result.changes
    assert runs[1].t - held.t > losses.armed - losses.lost - 1.0
    assert result.ending == "end of the test"


@contextmanager
def following(domain):
    with Node("drive", domain=domain, peers=["localhost"], distribution="jazzy") as node:
        pipeline = ReportedPipeline(FeedforwardController(0.04))
        settings = Ros2LinkSettings(timeout=60.0)
        yield PathFollower(Ros2Link(node, ROBOT, settings), pipeline, 25.0, DriveRequests(node))


WORDS = ("simulate", "--plant", "kinematic", "--rate", "25")


def test_a_killed_robot_is_held_until_it_is_back_and_armed():
    domain = new_domain()
    with (
        following(domain) as follower,
        process(*WORDS, domain=domain) as first,
        ExitStack() as held,
    ):
        losses = Losses(
            follower,
            first.kill,
            lambda: held.enter_context(process(*WORDS, domain=domain)),
        )
        reference = ShapeReference(Circle(radius=0.5), 60.0)
        check(follower.drive(reference, watch=losses.watch), losses)


@pytest.mark.parametrize("command_type", ["Twist", "TwistStamped"])
def test_an_unplugged_robot_is_held_until_it_is_back_and_armed(command_type):
    """No packet of it arrives, and it reads none, as its process is stopped."""
    domain = new_domain()
    words = (*WORDS, "--cmd-vel", command_type)
    with following(domain) as follower, process(*words, domain=domain) as robot:
        losses = Losses(
            follower,
            lambda: os.kill(robot.pid, signal.SIGSTOP),
            lambda: os.kill(robot.pid, signal.SIGCONT),
        )
        reference = ShapeReference(Circle(radius=0.5), 60.0)
        check(follower.drive(reference, watch=losses.watch), losses)
