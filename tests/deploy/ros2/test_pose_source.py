"""The robot's pose from transforms, odometry and localisation; poses that are refused."""

import time
from math import inf, nan, pi

import numpy as np
import pytest

from omnidrive.deploy.ros2.pose_source import PoseSource
from omnidrive.geometry import Pose
from omnidrive.ros2 import Node
from omnidrive.ros2.transform_tree import Frames, Transform, TransformTree
from tests.deploy.ros2.robot_process import ROBOT, Odometer
from tests.ros2.peer_process import new_domain


class Bench:
    def __init__(self, node, source, odometer):
        self.node, self.source, self.odometer = node, source, odometer

    def read(self, timeout=2.0):
        found = []

        def arrives():
            fix = self.source.read()
            if fix is not None:
                found.append(fix)
            return found

        self.node.wait_for(arrives, timeout)
        return found[-1] if found else None

    def refused(self, count=1):
        """The reason of the refusals, once there are some."""
        assert self.node.wait_for(
            lambda: self.source.read() is None and len(self.source.refused) >= count, 2.0
        )
        return list(self.source.refused)[-1]


@pytest.fixture
def bench():
    options = {"domain": new_domain(), "peers": ["localhost"], "distribution": "jazzy"}
    with Node("driver", **options) as node, Node("robot", **options) as robot:
        source = PoseSource(node, ROBOT, Frames(), time.time)
        odometer = Odometer(robot)
        publishers = (odometer.odometry, odometer.transforms, odometer.localisation)
        assert node.wait_for(lambda: all(each.matched for each in publishers), 5.0)
        yield Bench(node, source, odometer)


def test_transforms_are_chained_by_name(bench):
    bench.odometer.tf("map", "odom", 1.0, 2.0, pi / 2)
    bench.odometer.tf("odom", "base_link", 0.5, 0.0, 0.1)
    fix = bench.read()
    assert np.allclose(fix.pose, (1.0, 2.5, pi / 2 + 0.1))
    assert abs(fix.stamp - time.time()) < 2.0
    assert np.isnan(fix.position_sigma)


def test_localisation_corrects_odometry(bench):
    """A localisation moves the odometry frame; odometry goes on from there."""
    bench.odometer.odom(1.0, 0.0, 0.0)
    assert bench.node.wait_for(lambda: bench.source.read() is None and bench.source._odometry, 2.0)
    bench.odometer.amcl(5.0, 5.0, pi / 2, sigma=0.05)
    assert bench.node.wait_for(
        lambda: bench.source.read() is None and bench.source.tree.get("odom"), 2.0
    ) or bench.source.tree.get("odom")
    bench.odometer.odom(1.01, 0.0, 0.0)
    fix = bench.read()
    assert np.allclose(fix.pose, (5.0, 5.01, pi / 2))
    assert fix.position_sigma == pytest.approx(0.05)
    assert fix.yaw_sigma == pytest.approx(0.05)


def test_poses_in_unconnected_frames_are_refused_by_name(bench):
    bench.odometer.odom(parent="wheel_odom")
    assert bench.refused() == ("frame map is not connected: known is base_link in wheel_odom")


def test_an_unknown_frame_of_the_robot_is_named(bench):
    bench.odometer.odom(child="base_footprint")
    assert bench.refused() == ("frame base_link is not known; there are base_footprint, odom")


@pytest.mark.parametrize(("age", "reason"), [(5.0, "s old"), (-5.0, "s in the future")])
def test_old_and_future_stamps_are_refused(bench, age, reason):
    bench.odometer.tf("map", "odom")
    bench.odometer.odom(age=age)
    assert reason in bench.refused()


@pytest.mark.parametrize("value", [nan, inf, 1e9])
def test_poses_that_are_not_finite_are_refused(bench, value):
    bench.odometer.tf("map", "odom")
    bench.odometer.odom(x=value)
    assert bench.refused() == "a pose of the robot is not finite"


def test_jumps_pause_the_poses(bench):
    bench.odometer.tf("map", "odom")
    bench.odometer.odom(0.0)
    assert bench.read() is not None
    bench.odometer.odom(3.0)
    assert bench.refused().startswith("odometry jumps by 3 m")
    bench.odometer.odom(3.0)
    assert bench.read(0.3) is None
    time.sleep(0.8)
    bench.odometer.odom(3.0)
    assert bench.read().pose.x == 3.0


def test_a_localisation_that_falls_silent_is_named(bench):
    """Odometry alone would drift without a limit."""
    bench.odometer.tf("map", "odom", age=2.2)
    bench.odometer.odom()
    assert bench.refused().startswith("odom in map is 2.")


def test_a_localisation_that_leaves_is_named():
    options = {"domain": new_domain(), "peers": ["localhost"], "distribution": "jazzy"}
    with Node("driver", **options) as node:
        source = PoseSource(node, ROBOT, Frames(), time.time)
        fixes = []

        def is_read():
            fixes.append(source.read())
            return fixes[-1]

        with Node("robot", **options) as robot:
            odometer = Odometer(robot)
            assert node.wait_for(lambda: odometer.localisation.matched, 5.0)
            odometer.odom()
            assert node.wait_for(lambda: is_read() or source._odometry, 5.0)
            odometer.amcl(1.0, 0.0, 0.0)
            assert node.wait_for(is_read, 5.0)
            assert fixes[-1].pose.x == pytest.approx(1.0)
            odometer.odom(0.01)
            assert node.wait_for(is_read, 5.0)
        with Node("base", **options) as robot:
            publisher = robot.publisher("/odom", "nav_msgs/msg/Odometry")
            assert node.wait_for(lambda: publisher.matched and not source._is_published(), 5.0)
            odometer = Odometer.__new__(Odometer)
            odometer.odometry = publisher
            odometer.odom(0.02)
            assert node.wait_for(lambda: is_read() or source.fault, 5.0)
    assert source.fault == "nothing publishes /amcl_pose any more"


def test_stamps_that_go_back_are_refused(bench):
    bench.odometer.tf("map", "odom")
    bench.odometer.odom(0.0)
    assert bench.read() is not None
    bench.odometer.tf("odom", "base_link", age=0.2)
    assert bench.read(0.2) is None
    assert bench.source.refused == {}
    bench.odometer.odom(0.0, age=0.3)
    assert bench.refused().startswith("stamps on /odom go back by")


def test_circles_and_many_frames_are_bounded():
    tree = TransformTree()
    step = Pose(1.0, 0.0, 0.0)
    tree.set("a", Transform("b", step, 0.0))
    tree.set("b", Transform("a", step, 0.0))
    assert tree.pose("a", "map") is None
    assert tree.chain("a") == ["a", "b"]
    for i in range(2000):
        tree.set(f"f{i}", Transform("map", step, 0.0))
    assert len(tree.names()) <= 1001
    assert tree.pose("f5", "map") == step
    assert tree.pose("f1999", "map") is None
