"""Processes that are killed while a robot drives: it stops, says why, and goes on when armed."""

import subprocess
import sys
import time
from contextlib import contextmanager
from math import hypot

import pytest

from omnidrive.control import FeedforwardController
from omnidrive.deploy.drive_state import DriveState
from omnidrive.deploy.links.ros2 import Ros2Link
from omnidrive.deploy.ros2 import Node
from omnidrive.deploy.ros2.drive_reports import ReportedPipeline
from omnidrive.deploy.ros2.path_follower import DriveRequests, PathFollower
from omnidrive.reference import Circle, ShapeReference
from tests.deploy.ros2.peer_process import new_domain
from tests.deploy.ros2.robot_process import ROBOT, running_robot

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


def test_a_killed_driver_leaves_a_robot_that_stops_by_itself():
    domain = new_domain()
    words = ("drive", "--reference", "circle,radius=0.5", "--controller", "feedforward")
    with running_robot(domain, rate=25.0) as robot, process(*words, domain=domain) as driver:
        end = time.monotonic() + 60.0
        while hypot(*robot.state.twist[:2]) < 0.1:
            assert time.monotonic() < end
            time.sleep(0.01)
        driver.kill()
        killed = time.monotonic()
        while hypot(*robot._command[:2]) > 0.0:
            assert time.monotonic() - killed < 0.5 + 0.3
            time.sleep(0.01)
        time.sleep(1.0)
        assert hypot(*robot.state.twist[:2]) < 0.02


def test_a_killed_robot_is_held_until_it_is_back_and_armed():
    domain = new_domain()
    options = {"domain": domain, "peers": ["localhost"], "distribution": "jazzy"}
    words = ("simulate", "--plant", "kinematic", "--rate", "25")
    robots = []
    with Node("drive", **options) as node, process(*words, domain=domain) as first:
        pipeline = ReportedPipeline(FeedforwardController(0.04))
        follower = PathFollower(Ros2Link(node, ROBOT), pipeline, 25.0, DriveRequests(node))
        began = time.monotonic()

        def watch(controls):
            since = time.monotonic() - began
            if not robots and hypot(*follower.link.sent[:2]) > 0.05:
                first.kill()
                robots.append(time.monotonic())
            elif len(robots) == 1 and time.monotonic() - robots[0] > 2.0:
                context = process(*words, domain=domain)
                context.__enter__()
                robots.append(context)
            elif len(robots) == 2 and time.monotonic() - robots[0] > 12.0:
                robots.append(True)
                controls.arm()
            elif since > 40.0:
                controls.stop("end of the test")

        try:
            result = follower.drive(ShapeReference(Circle(radius=0.5), 60.0), watch=watch)
        finally:
            if len(robots) > 1:
                robots[1].__exit__(None, None, None)
    held = [each for each in result.changes if each.state is DriveState.HOLDING]
    assert "more than 0.5 s" in held[0].reason
    runs = [each for each in result.changes if each.state is DriveState.RUNNING]
    assert len(runs) > 1, result.changes
    again = runs[1]
    assert again.t - held[0].t > 5.0
    assert result.ending == "end of the test"
